"""Checks of the input of a law, rows and task, and of its answer."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput, format_value
from . import ARRAYS, BOX, GIVEN, OPTIONAL, Array, Rows, Task

ROUNDING = 2.0**-53  #: Largest relative error of one operation in floating point.
#: Largest φ in multiples of its scale. Laws that push in proportion fail long before.
FARTHEST = 1e30


def beyond_rounding(rows: Rows, qdd: Array) -> str:
    """Report rows that cannot be verified at these accelerations; empty if all can.

    The rounding error of L_gφ q̈ alone, ε‖L_gφ‖‖q̈‖, then exceeds u⁺, the largest demand of the
    row. The message names the rows and their largest φ.
    """
    largest = float(np.abs(qdd).max(initial=0.0))
    size = 0.0
    if largest > 0.0:
        # squares of large numbers would overflow
        size = largest * float(np.linalg.norm(qdd / largest))
    with np.errstate(over="ignore", invalid="ignore"):
        rounding = ROUNDING * np.linalg.norm(rows.Lg, axis=1) * size
        lost = rounding > rows.switching_gain
    if not lost.any():
        return ""
    names = ", ".join(rows.labels[i] for i in np.flatnonzero(lost))
    return (
        f"the commanded accelerations (up to {size:.1e}) are too large for the rows to be "
        f"verified: rounding exceeds the gain of {names} (φ up to {rows.phi[lost].max():.1e}); "
        "is the goal reachable?"
    )


def check(rows: Rows, task: Task) -> None:
    """Raise InvalidInput unless shapes agree, all numbers are finite and φ is in range.

    The message names the invalid row or entry.
    """
    _check_types(rows, task)
    if task.J.ndim != 2 or task.b.shape != task.J.shape[:1]:
        raise InvalidInput(
            f"task.J must be (k, n) and task.b (k,): they have the shapes {task.J.shape} and "
            f"{task.b.shape}"
        )
    n = task.J.shape[1]
    if n == 0:
        raise InvalidInput("task.J has no column: there is no joint to command")
    _check_rows(rows, n)
    if len(rows.qdd_min) or len(rows.qdd_max):
        _check_box(rows, n)
    _check_task(task, n)
    _check_range(rows)


def _check_types(rows: Rows, task: Task) -> None:
    """Raise InvalidInput unless labels are names, and all other fields arrays of floats."""
    if not (isinstance(rows, Rows) and isinstance(task, Task)):
        raise InvalidInput(
            f"a law needs Rows and a Task, not {format_value(rows)} and {format_value(task)}"
        )
    labels = rows.labels
    if not (isinstance(labels, tuple) and all(isinstance(label, str) for label in labels)):
        raise InvalidInput(f"rows.labels must be a tuple of names, not {format_value(labels)}")
    for name in ("J", "b"):
        _check_array(f"task.{name}", getattr(task, name))
    for name in (*GIVEN, *OPTIONAL, *BOX):
        _check_array(f"rows.{name}", getattr(rows, name))
    for name in ("error", "error_rate", "rest", "qd"):
        _check_array(f"task.{name}", getattr(task, name))


def _check_array(name: str, array: Any) -> None:
    """Raise InvalidInput unless a field is an array of floats."""
    if not (type(array) in ARRAYS and array.dtype == np.float64):
        raise InvalidInput(f"{name} must be an array of floats, not {format_value(array)}")


def _check_rows(rows: Rows, n: int) -> None:
    """Raise InvalidInput unless the rows of n joints have one shape and finite numbers."""
    m = len(rows.labels)
    given = [name for name in OPTIONAL if getattr(rows, name).shape != (0,)]
    for name in (*GIVEN, *given):
        array = getattr(rows, name)
        shape = (m, n) if name == "Lg" else (m,)
        if array.shape != shape:
            raise InvalidInput(
                f"rows.{name} has the shape {array.shape}; with {m} labels and {n} joints it must "
                f"be {shape}"
            )
        if not np.isfinite(array).all():
            names = ", ".join(rows.labels[i] for i in _rows_not_finite(array))
            raise InvalidInput(f"rows.{name} is not finite for {names}")


def _rows_not_finite(array: Array) -> list[int]:
    """Return the indices of the rows, or entries, that contain a number that is not finite."""
    places = np.argwhere(~np.isfinite(array))
    rows: list[int] = np.unique(places[:, 0]).tolist()
    return rows


def _check_task(task: Task, n: int) -> None:
    """Raise InvalidInput unless the optional fields of a task fit, and its numbers are finite."""
    k = len(task.b)
    for name in ("error", "error_rate"):
        shape = getattr(task, name).shape
        if shape not in ((0,), (k,)):
            raise InvalidInput(
                f"task.{name} has the shape {shape}; with {k} features it must be {(k,)}"
            )
    for name in ("rest", "qd"):
        shape = getattr(task, name).shape
        if shape not in ((0,), (n,)):
            raise InvalidInput(
                f"task.{name} has the shape {shape}; with {n} joints it must be {(n,)}"
            )
    for name in ("J", "b", "error", "error_rate", "rest", "qd"):
        array = getattr(task, name)
        if not np.isfinite(array).all():
            wrong = ", ".join(map(str, _rows_not_finite(array)))
            raise InvalidInput(f"task.{name} is not finite in row {wrong}")


def _check_range(rows: Rows) -> None:
    """Raise InvalidInput unless gains and scales are positive, and φ is in range of its scale."""
    wrong = np.flatnonzero((rows.switching_gain <= 0.0) | (rows.scale <= 0.0))
    if len(wrong):
        names = ", ".join(rows.labels[i] for i in wrong)
        raise InvalidInput(f"switching gain and scale must be positive; they are not for {names}")
    too_far = np.flatnonzero(rows.phi / FARTHEST > rows.scale)
    if len(too_far):
        far = ", ".join(
            f"{rows.labels[i]} (φ = {rows.phi[i]:.1e}, scale {rows.scale[i]:.1e})" for i in too_far
        )
        raise InvalidInput(
            f"φ is more than {FARTHEST:g} times its scale, too large for any law: {far}. Give "
            "both in the same units, in which the scale is the size of the allowed range"
        )


def _check_box(rows: Rows, n: int) -> None:
    low = rows.qdd_min
    high = rows.qdd_max
    if low.shape != (n,) or high.shape != (n,):
        raise InvalidInput(
            f"rows.qdd_min and rows.qdd_max must both be {(n,)}, or neither be given: they have "
            f"the shapes {low.shape} and {high.shape}"
        )
    empty = np.flatnonzero(~((low <= high) & (low < np.inf) & (high > -np.inf)))
    if len(empty):
        boxes = "; ".join(f"joint {j + 1}: [{low[j]:g}, {high[j]:g}]" for j in empty)
        raise InvalidInput(f"rows.qdd_min and rows.qdd_max leave no acceleration: {boxes}")
