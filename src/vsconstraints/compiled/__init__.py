"""Rows, tasks, laws and the closed loop at compiled speed, as functions that numba compiles.

The formulas are in :mod:`vsconstraints.formulas`; this package contains the code around them.
:func:`load` imports a module on first use, so that programs that do not need it do not wait for the
compiler.

- ``workspace`` declares the arrays that compiled functions share, ``records`` the small structures
  in them, and ``codes`` the integers that they exchange with Python. ``memory`` makes these arrays.
  ``parts`` accesses them, and functions, by address.
- ``step`` evaluates rows and task. ``*_rows`` contain the rows of each kind of constraint.
- ``laws`` applies a law, i.e. a demand and a resolver. ``task_priority`` and ``hierarchical_qp``
  are resolvers.
- ``closed_loop`` runs step, law and robot together. ``samples`` scores and records each sample.
- ``sensing`` computes the measurements of the controller.
- Parts of the package have folders ``kernels``, with the compiled functions that they alone need.
- ``compiler`` compiles these functions, or leaves them to Python for debugging.
  ``numba_interface`` contains what it asks of numba, and ``accelerator`` private parts of numba
  that it can do without.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

#: Environment variable. ``0`` turns compilation off; with ``alone``, no second process helps to
#: compile.
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
"""Modules with functions that Python calls and that any simulation may need.

A process that compiles them begins with the first one. A second process that helps begins with the
last one, which takes longest.
"""

#: Beginning of the warning that gives the reason why nothing is compiled. Processes that another
#: one starts do not repeat it.
COMPLAINT = "vsconstraints runs without its compiler"
#: Loaded modules by name, like ``sys.modules``, for the lifetime of the process.
loaded: dict[str, Any] = {}


def load(name: str) -> Any:
    """Return a module of compiled functions, compiled or read from the cache.

    ``name`` is that of a module of this package, or the full name of a module of a part.

    If numba is missing, broken or incompatible with NumPy, if it fails for a function of the
    package, or if its cache cannot be written, the same functions run in Python, number by number,
    about 200 times slower. A RuntimeWarning then gives the reason; processes that this one starts
    do not repeat it. With ``VSCONSTRAINTS_COMPILE=0`` in the environment, the functions run in
    Python without a warning.

    A run is also called uncompiled if only its law is in NumPy, such as a custom one. Then Python
    calls rows, law and robot one by one, and the run takes some ten times as long.
    """
    try:
        return loaded[name]
    except KeyError:
        full_name = name if "." in name else f"{__name__}.{name}"
        return loaded.setdefault(name, import_module(full_name))


@cache
def entry(function: Any) -> Any:
    """Return the compiled entry point of a function, without dispatch on the argument types.

    The caller must pass arguments of the compiled types. A function that is not compiled is
    returned unchanged.
    """
    interface = load("compiler").interface
    if interface is None or not hasattr(function, "signatures"):
        return function
    return interface.accelerator.entry_point(function)


def prepare(*others: str) -> None:
    """Compile everything that a simulation may need, or read it from the cache.

    Call it once before several processes need it. If something had to be compiled, another process
    compiles ``others`` and continues when this function returns.
    """
    load("compiler").compile_ahead([name for name in others if name not in MODULES])
    for name in MODULES:
        load(name)


def available() -> bool:
    """True if everything that a simulation may need runs compiled here.

    Imports or compiles it to find out.
    """
    prepare()
    return bool(load("compiler").compiles())
