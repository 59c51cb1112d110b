"""Rows, task, laws and the closed loop at compiled speed, as functions that numba compiles.

Formulas are those of :mod:`vsconstraints.formulas`; here is the rest. :func:`load` imports a module
when it is first needed, so that nobody waits for a compiler without using it.

- ``workspace`` has the arrays that compiled functions share; ``parts`` reaches them, and functions,
  by address.
- ``step`` evaluates rows and task; ``*_rows`` are the rows of the kinds of constraints.
- ``laws`` applies a law, demand and resolver; ``task_priority`` and ``hierarchical_qp`` are the
  resolvers.
- ``closed_loop`` runs step, law and robot together; ``samples`` scores and keeps each sample.
- ``sensing`` is what the control sees; ``arm`` and ``drives`` are an arm with mass.
- ``compiler`` and ``numba_internals`` compile all that, or leave it to Python for debugging.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

#: Environment variable; 0 turns compilation off, and with ``alone`` no second process helps with
#: the first one.
VARIABLE = "VSCONSTRAINTS_COMPILE"

MODULES = (
    "laws",
    "step",
    "task_priority",
    "closed_loop",
    "constraint_rows",
    "polylines",
    "hierarchical_qp",
)
"""Modules whose functions are called from Python, of which any simulation may need each.

A process that compiles them begins with the first ones, and one that helps it with the last, which
takes longest.
"""

#: How the warning begins that says why nothing is compiled; processes that another one starts do
#: not repeat it.
COMPLAINT = "vsconstraints runs without its compiler"
#: Modules by their names: like ``sys.modules``, for as long as the process lives.
loaded: dict[str, Any] = {}


def load(name: str) -> Any:
    """Module ``vsconstraints.compiled.<name>``, compiled or read from the cache.

    Where numba is missing, broken or does not fit NumPy, or its cache cannot be written, the same
    functions run in Python, some 200 times slower, and a RuntimeWarning says why; it is not
    repeated by processes that this one starts. With ``VSCONSTRAINTS_COMPILE=0`` in the environment
    they do so without a warning.
    """
    try:
        return loaded[name]
    except KeyError:
        return loaded.setdefault(name, import_module(f"{__name__}.{name}"))


@cache
def entry(function: Any) -> Any:
    """The compiled function without the search for the one that fits its arguments: for arrays that
    are known to.
    """
    return (
        function.overloads[function.signatures[0]].entry_point
        if hasattr(function, "overloads")
        else function
    )


def prepare(*others: str) -> None:
    """Compile, or read from the cache, all that a simulation may need: once, before several
    processes do it.

    Where that had to be compiled, another process compiles ``others``, and goes on when this one
    returns.
    """
    load("compiler").compile_ahead([name for name in others if name not in MODULES])
    for name in MODULES:
        load(name)


def available() -> bool:
    """Whether all that a simulation may need runs compiled here; imports or compiles it to find
    out.
    """
    prepare()
    return bool(load("compiler").compiles())
