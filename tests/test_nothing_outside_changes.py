"""Loading the package changes nothing outside it: no result of functions of others, no setting of
the process.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import vsconstraints

SCRIPT = """
import decimal, gc, importlib, json, locale, logging, os, pkgutil, random, signal, sys, threading, warnings

import numpy as np

# what others change when they are imported is theirs
for name in ("numba", "pinocchio", "matplotlib", "matplotlib.pyplot", "pandas", "pyarrow.parquet", "cv2", "dask",
             "distributed", "optuna", "gymnasium", "rich.console", "rich.progress", "typer", "jinja2", "IPython",
             "scipy.optimize", "scipy.sparse.linalg", "scipy.special", "scipy.stats"):
    try:
        importlib.import_module(name)
    except ImportError:
        pass
import numba


def functions():
    "What a user's own compiled functions return, compiled anew: the type, and the value as text."
    x, y = np.linspace(-1.0, 2.0, 5), np.arange(5.0)
    numbers, arrays = (True, 1.0, 2.0), (x > 0.0, x, y)
    calls = {
        "where": (lambda c, a, b: np.where(c, a, b), numbers, arrays, (True, 1, 2.5), (1, x, 0.0)),
        "where of an index": (lambda a: np.where(a), (x,)),
        "clip": (lambda a, b, c: np.clip(a, b, c), (0.5, 0.0, 0.2), (x, 0.0, 1.0)),
        "maximum": (lambda a, b: np.maximum(a, b), (1.0, 2.0), (x, y), (1, 2)),
        "abs": (lambda a: np.abs(a), (-1.0,), (x,)),
        "sum": (lambda a: np.sum(a), (x,)),
        "dot": (lambda a, b: np.dot(a, b), (x, y)),
        "sign": (lambda a: np.sign(a), (-1.0,), (x,)),
        "isnan": (lambda a: np.isnan(a), (np.nan,), (x,)),
        "divide": (lambda a, b: np.divide(a, b), (1.0, 2.0), (x, y + 1.0)),
        "interp": (lambda a, b, c: np.interp(a, b, c), (x, y, y), (0.5, y, y)),
        "floor": (lambda a: np.floor(a), (0.5,), (x,)),
    }
    answers = {}
    for name, (function, *examples) in calls.items():
        compiled = numba.njit(function)
        for example in examples:
            of = " ".join(type(each).__name__ for each in example)
            try:
                answer = compiled(*example)
            except numba.TypingError:
                answers[f"{name} of {of}"] = "refused"
                continue
            kind = answer.dtype.str + str(answer.shape) if isinstance(answer, np.ndarray) else type(answer).__name__
            answers[f"{name} of {of}"] = f"{kind} {numba.typeof(answer)} {answer!r}"
    try:
        numba.njit(lambda a: 1 // a)(0)
    except ZeroDivisionError:
        answers["a division by zero"] = "raises"
    return answers


def settings():
    import matplotlib

    names = [name for name in dir(numba.config) if name.isupper()]
    return {
        "errstate": repr(np.geterr()),
        "how numbers are printed": repr(np.get_printoptions()),
        "random numbers": repr([np.random.get_state()[1].tolist(), random.getstate()]),
        "warnings": repr(warnings.filters),
        "how warnings are shown": repr(warnings.showwarning),
        "rcParams": repr(sorted(matplotlib.rcParams.items())),
        "backend": str(matplotlib.get_backend(auto_select=False)),
        "signals": repr([(number, signal.getsignal(number)) for number in sorted(signal.valid_signals())]),
        "timers": repr(signal.getitimer(signal.ITIMER_REAL)),
        "locale": locale.setlocale(locale.LC_ALL),
        "environment": repr(sorted(os.environ.items())),
        "path": repr(sys.path),
        # without the finder of this package's earlier names, which answers for no other name, and that of
        # setuptools' distutils, which goes when another package imports setuptools
        "where modules are looked for": repr([
            *(type(finder) for finder in sys.meta_path
              if "distutils" not in repr(finder) and getattr(finder, "__name__", "") != "EarlierNames"),
            *map(repr, sys.path_hooks),
        ]),
        "folder": os.getcwd(),
        "recursion": repr(sys.getrecursionlimit()),
        "hooks": repr([sys.excepthook, sys.displayhook, threading.excepthook, sys.gettrace(), sys.getprofile()]),
        "garbage": repr([gc.isenabled(), gc.get_threshold(), gc.callbacks]),
        "loggers": repr([logging.root.level, logging.root.handlers, logging.root.manager.disable]),
        "decimals": repr(decimal.getcontext()),
        "numba": repr([(name, getattr(numba.config, name)) for name in names]),
        "threads": repr(numba.get_num_threads()),
        "builtins": repr(sorted(vars(__import__("builtins")))),
    }


before = functions(), settings()
import vsconstraints
import vsconstraints.compiled

# optional parts that are not installed here, and the command itself, which is no part to import
skipped = []
for found in pkgutil.walk_packages(vsconstraints.__path__, "vsconstraints."):
    if found.name.endswith("__main__"):
        continue
    try:
        importlib.import_module(found.name)
    except Exception as error:
        skipped.append(f"{found.name}: {type(error).__name__}: {error}")
for found in pkgutil.iter_modules(vsconstraints.compiled.__path__):
    vsconstraints.compiled.load(found.name)
print(json.dumps({
    "before": before, "after": [functions(), settings()], "skipped": skipped,
    "compiled": vsconstraints.compiled.available(),
}))
"""


def told() -> Any:
    """What the script says of a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(Path(vsconstraints.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env=environment,
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def answers() -> Any:
    return told()


@pytest.mark.parametrize("which", [0, 1], ids=["functions of others", "settings of the process"])
def test_loading_the_package_changes_nothing_outside_it(answers: Any, which: int) -> None:
    before = answers["before"][which]
    after = answers["after"][which]
    assert before, "nothing was compared"
    changed = {
        name: (text[:300], after[name][:300])
        for name, text in before.items()
        if after[name] != text
    }
    assert not changed


def test_all_that_is_compiled_was_loaded(answers: Any) -> None:
    assert answers["compiled"]
    assert not [text for text in answers["skipped"] if ".compiled." in text]
