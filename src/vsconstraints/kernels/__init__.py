"""The control step at compiled speed: the same laws as in NumPy, as functions that numba compiles.

The NumPy form of a law is its definition, and runs wherever this one cannot; tests hold the two together.
:func:`load` imports a module of this package when it is first needed, so that nobody pays for a compiler who does not
use it. Called from elsewhere are:

- ``step`` (what it needs: ``packing``, ``layout``): from a state to rows and task; ``regions`` and ``manipulability``
  add rows that few scenes have.
- ``task_priority.follow``: tracking, the sliding mode and both potential fields; ``hierarchical_qp.descend``: the
  hierarchy.
- ``look``, ``hold``, ``polylines``: what a camera sees, the robot over one period, distances to curves.

The others are called by these. Both laws check their input. Their code :data:`~vsconstraints.kernels.linear.DONE` says
that the outputs hold the definition's answer, ``ASK`` that the definition has to be asked; ``descend`` has two more,
and returns the iterations too.
"""

from __future__ import annotations

import os
import warnings
from importlib import import_module
from typing import Any

VARIABLE = "VSCONSTRAINTS_COMPILE"
"""Environment variable; 0 turns compilation off, and with ``alone`` no second process helps with the first one."""

MODULES = ("task_priority", "hierarchical_qp", "packing", "step", "polylines", "hold")
"""Modules whose functions are called from Python, of which any simulation may need each.

Those for rows of some constraints only (``Packed.after``) are compiled where a scene has such constraints; of several
processes that need one, the first compiles it and the others wait for it.
"""

TOLD = "VSCONSTRAINTS_TOLD"
"""Environment variable that says that the reason why nothing is compiled was told, by this process or its parent."""

_loaded: dict[str, Any] = {}


def load(name: str) -> Any:
    """Module ``vsconstraints.kernels.<name>``, compiled or read from the cache; None where there is no compiler.

    The reason is told once, as a RuntimeWarning, and not again by processes that this one starts: numba is missing,
    broken or does not fit NumPy, or its cache cannot be written. With ``VSCONSTRAINTS_COMPILE=0`` in the environment
    there is nothing to tell.
    """
    try:
        return _loaded[name]
    except KeyError:
        return _loaded.setdefault(name, _load(name))


def available() -> bool:
    """Whether all that a simulation may need runs compiled here; imports or compiles it to find out."""
    return all(load(name) is not None for name in MODULES)


def prepare() -> None:
    """Compile, or read from the cache, all that a simulation may need: once, before several processes do it."""
    for name in MODULES:
        load(name)


def _load(name: str) -> Any:
    if os.environ.get(VARIABLE, "").strip() == "0":
        return None
    try:
        if import_module("numba").config.DISABLE_JIT:
            raise RuntimeError("NUMBA_DISABLE_JIT is set")
        return import_module(f"{__name__}.{name}")
    except Exception as error:  # whatever is wrong with the compiler, the definition runs
        if TOLD in os.environ:
            return None
        os.environ[TOLD] = "1"  # for processes that this one starts
        warnings.warn(
            f"vsconstraints runs in its NumPy form, which is slower: {type(error).__name__}: {error} "
            f"(set {VARIABLE}=0 to say nothing)",
            RuntimeWarning,
            stacklevel=3,
        )
        return None
