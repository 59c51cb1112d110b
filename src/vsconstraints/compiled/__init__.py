"""The control step at compiled speed, as functions that numba compiles.

Formulas are those of :mod:`vsconstraints.formulas`, as in NumPy; what stands here is what goes around them, on arrays
that stay where they are. :func:`load` imports a module of this package when it is first needed, so that nobody pays for
a compiler who does not use it.

- ``step`` evaluates a scene, its constraints and its task on the arrays of ``structures``, which ``packing`` fills.
- ``parts`` compiles what varies, rows of constraints and laws, into functions of their own that are called by address;
  ``*_rows`` are the rows of the kinds of constraints.
- ``laws.follow`` carries out a law, demand and resolver; ``task_priority`` and ``hierarchical_qp`` are the resolvers.
- ``closed_loop`` runs step, law and robot together; ``samples`` says what is kept and scored of each sample.
- ``sensing`` and ``gradient_error`` are what the control believes wrongly, ``images`` how images come.

Two things have another form than in NumPy: the kinematics of a chain, which Pinocchio computes there, and least
squares, that of a camera's pose among them, by reflections here and by singular values there. Tests hold these
together.
"""

from __future__ import annotations

import os
import warnings
from importlib import import_module
from typing import Any

VARIABLE = "VSCONSTRAINTS_COMPILE"
"""Environment variable; 0 turns compilation off, and with ``alone`` no second process helps with the first one."""

MODULES = ("laws", "step", "task_priority", "closed_loop", "packing", "polylines", "hierarchical_qp")
"""Modules whose functions are called from Python, of which any simulation may need each.

A process that compiles them begins with the first ones, and one that helps it with the last, which takes longest.

Rows of constraints are compiled where a scene has such constraints; of several processes that need the same, the first
compiles them and the others wait for it.
"""

COMPLAINT = "vsconstraints runs in its NumPy form"
"""How the warning begins that says why nothing is compiled; processes that another one starts do not repeat it."""

_told = False
"""Whether this process has said that it has no compiler: once is enough, whoever asks."""

loaded: dict[str, Any] = {}
"""Modules by their names, None for those that cannot be had: like ``sys.modules``, for as long as the process lives."""


def load(name: str) -> Any:
    """Module ``vsconstraints.compiled.<name>``, compiled or read from the cache; None where there is no compiler.

    The reason is told once, as a RuntimeWarning, and not again by processes that this one starts: numba is missing,
    broken or does not fit NumPy, or its cache cannot be written. With ``VSCONSTRAINTS_COMPILE=0`` in the environment
    there is nothing to tell.
    """
    try:
        return loaded[name]
    except KeyError:
        return loaded.setdefault(name, _load(name))


def entry(function: Any) -> Any:
    """The compiled function without the search for the one that fits its arguments: for arrays that are known to."""
    return function.overloads[function.signatures[0]].entry_point


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
        global _told
        if _told:
            return None
        _told = True
        warnings.warn(
            f"{COMPLAINT}, which is slower: {type(error).__name__}: {error} (set {VARIABLE}=0 to say nothing)",
            RuntimeWarning,
            stacklevel=3,
        )
        return None
