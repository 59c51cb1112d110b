"""Unusual rows, tasks and options: random, extreme, degenerate, and malformed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vsconstraints.controllers import DEMANDS, RESOLVERS
from vsconstraints.qp import solver_names
from vsconstraints.rows import OPTIONAL, Array, Rows, Task
from vsconstraints.rows.checks import FARTHEST

ROWS = ("phi", "Lg", "Lf", "switching_gain", "scale", *OPTIONAL)
TASK = ("J", "b", "error", "error_rate", "qd")

MALFORMED = 0.2
"""Share of the inputs with a wrong type or shape, or with a number that is not finite."""

LAID_OUT = 0.2
"""Share of the inputs whose arrays have an unusual memory layout."""


@dataclass(frozen=True)
class Input:
    """Input of a law; ``sound`` if the law must answer, None if it may also refuse."""

    rows: Any
    task: Any
    sound: bool | None


def make_input(rng: np.random.Generator) -> Input:
    """Return one input; the same for the same state of the generator."""
    rows, task = problem(rng)
    kind = rng.random()
    if kind < MALFORMED:
        return malformed(rng, rows, task)
    if kind < MALFORMED + LAID_OUT:
        rows = replace(rows, **{name: laid_out(rng, getattr(rows, name)) for name in ROWS})
        task = replace(task, **{name: laid_out(rng, getattr(task, name)) for name in TASK})
    return Input(rows, task, sound=not (rows.phi / FARTHEST > rows.scale).any())


# --- finite numbers of matching shapes ---


def problem(rng: np.random.Generator) -> tuple[Rows, Task]:
    """Return finite rows and a task, from usual ones to the limits of floating point."""
    n = int(rng.choice((1, 2, 3, 6, 6, 6, 7, 7, 12, 30)))
    m = int(
        rng.choice(
            (0, 1, 2, 3, 4, 6, 8, 12, 40), p=(0.1, 0.1, 0.15, 0.15, 0.15, 0.15, 0.1, 0.08, 0.02)
        )
    )
    k = int(rng.choice((0, 1, 2, 3, 6, 6, 8, 24), p=(0.05, 0.1, 0.15, 0.15, 0.2, 0.2, 0.13, 0.02)))
    Lg = degenerate(rng, rng.normal(size=(m, n)))
    J = degenerate(rng, rng.normal(size=(k, n)))
    phi = rng.normal(size=m)
    gain = rng.uniform(0.1, 10.0, m)
    scale = rng.uniform(0.1, 2.0, m)
    if rng.random() < 0.2:
        phi = rng.choice((0.0, -0.0, 1.0, -1e-12, 1e-12), m)
    labels = tuple(f"row[{i}]" for i in range(m))
    K = rng.uniform(0.1, 2.0, m)
    sigma_dot = rng.normal(size=m)
    rows = Rows(phi, Lg, rng.normal(size=m), gain, labels, scale, phi - K * sigma_dot, sigma_dot, K)
    task = Task(J, *rng.normal(size=(3, k)), qd=rng.normal(size=n))
    if rng.random() < 0.5:
        rows, task = scaled(rng, rows, task)
    return rows, task


def degenerate(rng: np.random.Generator, A: Array) -> Array:
    """Make some rows zero, repeated, opposite, nearly so, or combinations of others."""
    if len(A) == 0 or rng.random() < 0.4:
        return A
    for i in range(len(A)):
        other = A[int(rng.integers(len(A)))]
        near = rng.normal(size=A.shape[1]) * 10.0 ** rng.uniform(-16.0, -1.0)
        A[i] = (
            A[i],
            A[i],
            A[i] * 0.0,
            other,
            -other,
            other + near,
            -other + near,
            near,
            np.round(A[i]),
        )[int(rng.integers(9))]
    if rng.random() < 0.1:
        A[-1] = rng.normal(size=len(A)) @ A
    return A


def scaled(rng: np.random.Generator, rows: Rows, task: Task) -> tuple[Rows, Task]:
    """Change units by a little, a lot, or to the limits of floating point.

    All numbers stay finite.
    """
    decades = float(rng.choice((3.0, 6.0, 12.0, 150.0, 308.0)))
    whole = rng.random() < 0.3

    def factor(size: int) -> Array:
        return 10.0 ** (
            np.full(size, rng.uniform(-decades, decades))
            if whole
            else rng.uniform(-decades, decades, size)
        )

    def finite(array: Array, least: float = -np.inf) -> Array:
        return np.clip(np.nan_to_num(array), max(least, -1.79e308), 1.79e308)

    chosen = rng.random(len(ROWS) + len(TASK)) < rng.choice((0.2, 0.5, 1.0))
    values = {name: getattr(rows, name) for name in ROWS} | {
        name: getattr(task, name) for name in TASK
    }
    with np.errstate(over="ignore"):
        for name, change in zip(values, chosen, strict=True):
            if change:
                by = factor(len(values[name]))
                least = 5e-324 if name in ("switching_gain", "scale") else -np.inf
                values[name] = finite(
                    values[name] * (by if values[name].ndim == 1 else by[:, None]), least
                )
    return replace(rows, **{name: values[name] for name in ROWS}), Task(
        **{name: values[name] for name in TASK}
    )


def laid_out(rng: np.random.Generator, array: Array) -> Array:
    """Return the same numbers in another memory layout."""
    kind = int(rng.integers(6))
    if kind == 0:
        frozen = array.copy()
        frozen.flags.writeable = False
        return frozen
    if kind == 1:
        return np.asfortranarray(array)
    if kind == 2:
        return np.repeat(array, 2, axis=0)[::2]
    if kind == 3:
        return array[::-1].copy()[::-1]
    if kind == 4:
        shifted = (
            np.empty(array.nbytes + 1, dtype=np.uint8)[1:].view(np.float64).reshape(array.shape)
        )
        shifted[...] = array
        return shifted
    return array


# --- malformed input ---


def malformed(rng: np.random.Generator, rows: Rows, task: Task) -> Input:
    """Return an input with one error, sometimes two."""
    sound: bool | None = False
    for _ in range(1 + (rng.random() < 0.2)):
        name = str(rng.choice((*ROWS, *TASK)))
        if name in TASK:
            # laws that do not use e, ė and q̇ need not check them
            changed, sound = wrong(rng, getattr(task, name), sound if name in "Jb" else None)
            task = replace(task, **{name: changed})
        elif name == "scale":
            changed = not_finite(rng, rows.scale)
            sound = None if not rows.scale.size else sound
            rows = replace(rows, scale=changed)
        else:
            # laws that do not use σ, σ̇ and K need not check them
            changed, sound = wrong(rng, getattr(rows, name), None if name in OPTIONAL else sound)
            rows = replace(rows, **{name: changed})
    kind = rng.random()
    if kind < 0.1:
        labels: Any = (
            rows.labels[:-1],
            (*rows.labels, "one more"),
            tuple(range(len(rows.labels))),
            ("",) * 3,
        )
        return Input(replace(rows, labels=labels[int(rng.integers(4))]), task, None)
    if kind < 0.15:
        pairs: Any = (
            (None, task),
            (rows, None),
            (task, rows),
            (rows.Lg, task.J),
            (rows, (task.J, task.b)),
        )
        rows, task = pairs[int(rng.integers(5))]
        return Input(rows, task, sound=False)
    if kind < 0.2:
        return Input(
            replace(rows, Lg=np.empty((len(rows.labels), 0))),
            Task(np.empty((3, 0)), np.zeros(3)),
            sound=False,
        )
    return Input(rows, task, sound)


WRONG: tuple[Callable[[Array], Any], ...] = (
    lambda array: None,
    lambda array: array.tolist(),
    lambda array: "words",
    lambda array: 1.0,
    lambda array: np.array(1.0),
    lambda array: array.astype(complex),
    lambda array: array.astype(object),
    lambda array: np.zeros(array.shape, dtype=int),
    lambda array: array > 0.0,
    lambda array: np.zeros(array.shape, dtype=np.float32),
    lambda array: array[None],
    lambda array: array[..., None],
    lambda array: np.concatenate((array, np.ones((1, *array.shape[1:])))),
    lambda array: np.ones((len(array) + 1, *array.shape)),
)
"""Types and shapes that no array of rows or task may have."""


def wrong(rng: np.random.Generator, array: Any, sound: bool | None) -> tuple[Any, bool | None]:
    """Replace an array; also return if a law must still answer."""
    if not (type(array) is np.ndarray and array.dtype == np.float64 and array.ndim):
        return array, sound
    kind = rng.random()
    if kind < 0.4 and array.size:
        return not_finite(rng, array), sound
    if kind < 0.5 and array.ndim == 2:
        # the transpose of a square matrix is another valid matrix
        return array.T, None
    if kind < 0.55:
        # numba may accept these as plain arrays, after a call with another unusual array
        return (
            array.view(np.matrix) if rng.random() < 0.5 and array.size else array.astype(">f8")
        ), None
    return WRONG[int(rng.integers(len(WRONG)))](array), sound


def not_finite(rng: np.random.Generator, array: Array) -> Array:
    """Make one number, or all of them, not finite."""
    changed = array.copy()
    if changed.size:
        value = float(rng.choice((np.nan, np.inf, -np.inf)))
        changed.flat[int(rng.integers(changed.size)) if rng.random() < 0.8 else slice(None)] = value
    return changed


# --- options ---

SOLVERS = tuple(
    name for name in ("daqp", "proxqp", "osqp", "quadprog", "clarabel") if name in solver_names()
)


def power(rng: np.random.Generator, usual: float, decades: float) -> float:
    """Return a number near a usual value, or some decades away."""
    far: float = rng.uniform(-decades, decades) if rng.random() < 0.2 else rng.uniform(-1.0, 1.0)
    return float(usual * 10.0**far)


def field(rng: np.random.Generator) -> dict[str, Any]:
    """Draw options of a potential field."""
    return {
        "blend": str(rng.choice(("additive", "priority"))),
        "region": power(rng, 0.2, 300.0),
        "exponent": float(rng.choice((0.5, 1.0, 2.0, power(rng, 1.0, 3.0)))),
        "strength": power(rng, 1.0, 300.0),
    }


def hierarchy(rng: np.random.Generator) -> dict[str, Any]:
    """Draw options of the hierarchical QP."""
    options: dict[str, Any] = {
        "rows": str(rng.choice(("barrier", "active"))),
        "alpha": power(rng, 20.0, 100.0),
        "solver": "auto" if rng.random() < 0.9 else str(rng.choice(SOLVERS)),
    }
    if rng.random() < 0.3:
        options["max_acceleration"] = power(rng, 10.0, 100.0)
    if rng.random() < 0.3:
        options["weights"] = {"row": power(rng, 1.0, 4.0), "row[1]": power(rng, 1.0, 10.0)}
    if rng.random() < 0.1:
        options["damping"] = power(rng, 1e-8, 6.0)
    return options


def pair(rng: np.random.Generator) -> dict[str, Any]:
    """Draw any demand with any resolver, and parameters of the demand."""
    demand = DEMANDS[int(rng.integers(len(DEMANDS)))]
    resolver = RESOLVERS[int(rng.integers(len(RESOLVERS)))]
    usual = {name: float(np.sqrt(low * high)) for name, (low, high) in demand.ranges.items()}
    parameters = {
        name: power(rng, value, 2.0) for name, value in usual.items() if rng.random() < 0.5
    }
    return {"demand": demand.name, "resolver": resolver.name, **parameters}


def avoidance(rng: np.random.Generator) -> dict[str, Any]:
    """Draw options of the avoidance of limits at the level of speeds."""
    return {
        "gain": power(rng, 2.0, 100.0),
        "avoids": str(rng.choice(("ranges", "all"))),
        "zone": min(power(rng, 0.1, 10.0), 0.5),
    }


def program(rng: np.random.Generator) -> dict[str, Any]:
    """Draw options of a quadratic program over joint speeds."""
    options: dict[str, Any] = {"gain": power(rng, 2.0, 100.0)}
    if rng.random() < 0.5:
        options["gain_at_zero"] = options["gain"] * power(rng, 4.0, 2.0)
    if rng.random() < 0.5:
        options["max_acceleration"] = "limits" if rng.random() < 0.3 else power(rng, 10.0, 100.0)
    if rng.random() < 0.3:
        options["damping"] = power(rng, 1e-6, 6.0)
    return options


OPTIONS: dict[str, Callable[[np.random.Generator], dict[str, Any]]] = {
    "resolved-rate-avoidance": avoidance,
    "velocity-qp": program,
    "velocity-hierarchical-qp": program,
    "velocity-damper": program,
    "potential-field": field,
    "hierarchical-qp": hierarchy,
    "law": pair,
}
"""Options by the name of the controller; others have their default options."""

WRONG_OPTIONS = (
    None,
    "fast",
    0.0,
    -1.0,
    np.nan,
    np.inf,
    True,
    10**400,
    1j,
    [1.0],
    np.float64(0.0),
    {"row": -1.0},
    {"row": 1e30},
    (),
)
