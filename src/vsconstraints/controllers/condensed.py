"""The quadratic program of a predictive law in the plan alone: states are linear in it, and are eliminated."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..compiled import load
from ..qp.decomposition import lapack
from ..qp.penalised import Cost
from ..rows import UNKNOWN, Array, IntArray, Rows, Task
from .horizon import Horizon, Instants


class Lookahead(NamedTuple):
    """Rows and task along a ``plan`` (H, n) that is known, at N instants, along which all is linearised.

    ``value`` (N, m) is σ of rows, or φ of those on φ itself, whose K (m,) is 0, if what the model says otherwise of now
    stays so; ``gradient`` (N, m, n) of them: of σ by q, of φ by q̇. J, b, error and rest (N, n), or (0,), likewise.
    """

    plan: Array
    at: Instants
    value: Array
    gradient: Array
    K: Array
    J: Array
    b: Array
    error: Array
    rest: Array = UNKNOWN


def look_ahead(rows: Rows, task: Task, seen: Any, at: Instants, plan: Array, K: Array) -> Lookahead:
    """Linearise a prediction along a plan; rows and task are those of now, K (m,) is 0 for rows on φ itself."""
    # what the model says otherwise of now than φ does is otherwise of σ too, where that is not given
    sigma = rows.sigma if len(rows.sigma) else seen.sigma[0] + rows.phi - seen.phi[0]
    value, gradient = np.empty(seen.phi.shape), np.empty(seen.Lg.shape)
    load("plans").linearise(seen.phi, seen.sigma, seen.Lg, K, np.where(K == 0.0, rows.phi, sigma), value, gradient)
    J = seen.J.copy()
    J[0] = task.J
    b = seen.b + (task.b - seen.b[0])
    rest = UNKNOWN
    if len(task.rest):
        rest = seen.rest + (task.rest - seen.rest[0]) if seen.rest.size else np.tile(task.rest, (len(seen), 1))
    return Lookahead(plan, at.first(len(seen)), value, gradient, K, J, b, seen.error, rest)


def cost(ahead: Lookahead, horizon: Horizon, gains: Array, damping: float, rest: Any | None = None) -> Cost:
    """Σ‖J(uₖ − q̈ₖ)‖² + λ‖u − q̈₀‖² of a plan u (Hn,).

    ``gains`` (B, 2) are K_p and K_v at the beginnings of the B blocks that can be predicted, ``damping`` is λ relative
    to the mean of ‖J‖². ``rest`` is how q̈₀ depends on the state; None if it is zero, as it is in blocks that cannot be
    predicted.
    """
    H, n = ahead.plan.shape
    begins = horizon.begins[: len(gains)]
    J, b, Q, V = ahead.J[begins], ahead.b[begins], horizon.Q[begins], horizon.V[begins]
    # b falls with the errors that a plan makes: K_p J δq + K_v J δq̇
    feedback = gains[:, :1] * Q + gains[:, 1:] * V
    C = np.eye(H)[: len(begins)] + feedback
    P, q = np.zeros((H * n, H * n)), np.zeros(H * n)
    load("plans").normal_equations(C, J, b, feedback @ ahead.plan, np.empty((n, n)), P, q)
    size = float(np.vdot(J, J)) / len(begins)
    weight = damping * (size if size > 0.0 else 1.0)
    if rest is not None:
        # likewise, with the unit matrix for J
        feedback = rest.damping * V
        if rest.stiffness > 0.0:
            feedback += rest.stiffness * Q
        C = np.eye(H)
        C[: len(begins)] += feedback
        within = np.einsum("gihi->ghi", P.reshape(H, n, H, n))
        within += weight * (C.T @ C)[:, :, None]
        q += weight * (C[: len(begins)].T @ (ahead.rest[begins] + feedback @ ahead.plan)).ravel()
    else:
        P.ravel()[:: H * n + 1] += weight
    L, center, refused = lapack().dposv(P.T, q, lower=1, overwrite_a=1)
    if refused:
        raise np.linalg.LinAlgError(f"the plan has no one optimum: rounding exceeds the damping {damping:g}")
    return Cost(center, L)


class Limits(NamedTuple):
    """Rows G u ≤ h of a plan u (Hn,): of every instant after now, and then of the box; see :class:`.ManyRows`.

    σ(τ + Δτ) ≤ e^(−Δτ/κ) σ(τ), with φ in place of σ of rows on φ itself, and σ ≤ 0 while braking: ``falls`` (N − 1,)
    are e^(−Δτ/κ), 0 while braking; ``left`` (N − 1, m) is by what a row may be exceeded, ∞ where there is none. ``low``
    and ``high`` (Hn,) are the box. A row of G with no entry beyond ``least`` (m,) counts as zero.
    """

    ahead: Lookahead
    falls: Array
    left: Array
    low: Array
    high: Array
    least: Array

    def of(self, which: IntArray) -> IntArray:
        """Which row of now each of these is of, −1 for bounds of accelerations."""
        found: IntArray = np.where(which < self.left.size, which % max(len(self.least), 1), -1)
        return found

    def excess(self, u: Array) -> Array:
        """G u − h of all of them."""
        ahead, (r, size) = self.ahead, (self.left.size, u.size)
        away = u.reshape(ahead.plan.shape) - ahead.plan
        over = np.empty(r + 2 * size)
        rows, moved = over[:r].reshape(self.left.shape), (ahead.at.Q @ away, ahead.at.V @ away)
        load("plans").exceed(ahead.value, ahead.gradient, ahead.K, *moved, self.falls, self.left, rows)
        over[r : r + size], over[r + size :] = u - self.high, self.low - u
        return over

    def stated(self, which: IntArray) -> tuple[IntArray, Array]:
        """Those of these rows, in ascending order, that a plan has any influence on, and their G."""
        size, r = self.low.size, int(np.searchsorted(which, self.left.size))
        ahead, at = self.ahead, self.ahead.at
        G, largest = np.zeros((len(which), size)), np.ones(len(which))
        load("plans").differentiate(which[:r], ahead.gradient, ahead.K, at.Q, at.V, self.falls, G[:r], largest[:r])
        side, entry = np.divmod(which[r:] - self.left.size, size)
        G[np.arange(r, len(which)), entry] = 1.0 - 2.0 * side
        zero = largest[:r] <= self.least[which[:r] % max(len(self.least), 1)]
        if not zero.any():
            return which, G
        has = np.append(~zero, np.ones(len(which) - r, dtype=np.bool_))
        return which[has], G[has]


def limits(ahead: Lookahead, approach: float, box: tuple[Array, Array], least: Array) -> Limits:
    """Rows that hold along a plan; ``approach`` is κ [s], the box (H, n) twice, ``least`` as of :class:`Limits`."""
    times, N = ahead.at.times, ahead.at.braking
    falls, left = np.zeros(len(times) - 1), np.zeros((len(times) - 1, len(least)))
    falls[: N - 1] = np.exp(-np.diff(times[:N]) / approach)
    if len(times) > N:
        # what is outside now may come back as slowly while braking
        left[N - 1 :] = np.maximum(ahead.value[0], 0.0) * np.exp(-times[N:, None] / approach)
        left[N - 1 :, ahead.K == 0.0] = np.inf
    return Limits(ahead, falls, left, box[0].ravel(), box[1].ravel(), least)
