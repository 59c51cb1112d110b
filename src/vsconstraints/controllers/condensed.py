"""The quadratic program of a predictive law in the plan alone: states are linear in it, and are eliminated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from ..model import Prediction
from ..qp.lexicographic import ZERO_GRADIENT
from ..rows import Array, BoolArray, IntArray, Rows, Task
from .horizon import Horizon, Instants


class Lookahead(NamedTuple):
    """Rows and task along a plan (H, n) that is known, at N instants.

    Attributes
    ----------
    plan
        (H, n), along which all is linearised.
    at
        The instants.
    value
        (N, m) σ of rows, or φ of those on φ itself, if what the model says otherwise of now stays so.
    gradient
        (N, m, Hn) of them, by the plan.
    J, b, error
        (N, k, n), and (N, k) of the task, likewise.
    """

    plan: Array
    at: Instants
    value: Array
    gradient: Array
    J: Array
    b: Array
    error: Array


def look_ahead(rows: Rows, task: Task, seen: Prediction, at: Instants, plan: Array, K: Array) -> Lookahead:
    """Linearise a prediction along a plan; rows and task are those of now, K (m,) is 0 for rows on φ itself."""
    value = along(rows, seen, K)
    direct, N = K == 0.0, len(seen)
    by_state = seen.Lg / np.where(direct, 1.0, K)[:, None]
    by_plan = np.where(direct[:, None], at.V[:N, None, :], at.Q[:N, None, :])
    gradient = (by_plan[..., None] * by_state[:, :, None, :]).reshape(*value.shape, plan.size)
    J = seen.J.copy()
    J[0] = task.J
    return Lookahead(plan, at.first(N), value, gradient, J, seen.b + (task.b - seen.b[0]), seen.error)


def along(rows: Rows, seen: Prediction, K: Array) -> Array:
    """(N, m) σ, or φ of rows on φ itself, if what the model says otherwise of now stays so."""
    sigma = seen.sigma + ((rows.sigma - seen.sigma[0]) if len(rows.sigma) else (rows.phi - seen.phi[0]))
    value: Array = np.where(K == 0.0, seen.phi + (rows.phi - seen.phi[0]), sigma)
    return value


def cost(ahead: Lookahead, horizon: Horizon, gains: Array, damping: float) -> tuple[Array, Array]:
    """Σ‖J(uₖ − q̈ₖ)‖² + λ‖u‖² as ‖T⁻¹(u − center)‖²: center (Hn,) and T (Hn, Hn).

    Parameters
    ----------
    gains
        (B, 2) K_p and K_v at the beginnings of the B blocks that can be predicted.
    damping
        λ relative to the mean of ‖J‖².
    """
    H, n = ahead.plan.shape
    begins = horizon.begins[: len(gains)]
    J, b = ahead.J[begins], ahead.b[begins]
    # b falls with the errors that a plan makes: K_p J δq + K_v J δq̇
    feedback = gains[:, :1] * horizon.Q[begins] + gains[:, 1:] * horizon.V[begins]
    C = np.eye(H)[: len(begins)] + feedback
    M = (C[:, None, :, None] * J[:, :, None, :]).reshape(-1, H * n)
    d = (b + np.einsum("bkn,bn->bk", J, feedback @ ahead.plan)).ravel()
    size = float(np.einsum("bkn,bkn->", J, J)) / len(begins)
    P = M.T @ M
    P[np.diag_indices(H * n)] += damping * (size if size > 0.0 else 1.0)
    L, refused = lapack.dpotrf(P, lower=1, clean=1)
    inverse, singular = lapack.dtrtri(L, lower=1)
    if refused or singular:
        raise np.linalg.LinAlgError("the cost of the plan is beyond the range of floating point")
    T: Array = inverse.T
    return T @ (T.T @ (M.T @ d)), T


class Limits(NamedTuple):
    """Rows G u ≤ h of the plan (Hn,): which row of now each is of, −1 for bounds of accelerations."""

    G: Array
    h: Array
    of: IntArray

    def where(self, which: BoolArray) -> Limits:
        """Those of them."""
        if which.all():
            return self
        return Limits(self.G[which], self.h[which], self.of[which])


def limits(ahead: Lookahead, approach: float, K: Array) -> Limits:
    """Rows that hold along a plan: σ(τ + Δτ) ≤ e^(−Δτ/κ) σ(τ), with φ where K (m,) is 0, and σ ≤ 0 while braking.

    ``approach`` is κ [s].
    """
    at, m = ahead.at, ahead.value.shape[1]
    N, ends = at.braking, len(at.times)
    free = ahead.value - ahead.gradient @ ahead.plan.ravel()
    falls = np.exp(-np.diff(at.times[:N]) / approach)[:, None]
    of_sigma = np.flatnonzero(K > 0.0)
    # what is outside now may come back as slowly while braking
    left = np.maximum(ahead.value[0], 0.0) * np.exp(-at.times[N:, None] / approach)
    parts = (
        Limits(
            (ahead.gradient[1:N] - falls[:, :, None] * ahead.gradient[: N - 1]).reshape(-1, ahead.plan.size),
            (falls * free[: N - 1] - free[1:N]).ravel(),
            np.tile(np.arange(m), N - 1),
        ),
        Limits(
            ahead.gradient[N:, of_sigma].reshape(-1, ahead.plan.size),
            (left - free[N:])[:, of_sigma].ravel(),
            np.tile(of_sigma, ends - N),
        ),
    )
    return Limits(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def bounded(rows: Limits, low: Array, high: Array) -> Limits:
    """The rows that the box (H, n) leaves anything to say, and its bounds."""
    reach = np.maximum(-low, high).ravel()
    if np.isfinite(reach).all():
        rows = rows.where(np.abs(rows.G) @ reach > rows.h)
    sides = np.concatenate((high.ravel(), -low.ravel()))
    stated = np.isfinite(sides)
    if not stated.any():
        return rows
    each = np.eye(low.size)
    box = np.vstack((each, -each))[stated]
    return Limits(
        np.concatenate((rows.G, box)),
        np.concatenate((rows.h, sides[stated])),
        np.concatenate((rows.of, np.full(len(box), -1))),
    )


def influenced(rows: Limits, scale: Array) -> BoolArray:
    """Which rows a plan has any influence on; ``scale`` (m,) is that of the rows."""
    least = np.append(scale, 0.0)[rows.of] * ZERO_GRADIENT
    found: BoolArray = np.abs(rows.G).max(axis=1, initial=0.0) > least
    return found
