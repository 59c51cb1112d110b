"""The quadratic program of a predictive law in the plan alone: states are linear in it, and are eliminated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from ..model import Prediction
from ..qp.penalised import Cost
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
        (N, m, n) of them: of σ by q, of φ by q̇.
    direct
        (m,) which rows are on φ itself.
    J, b, error
        (N, k, n), and (N, k) of the task, likewise.
    """

    plan: Array
    at: Instants
    value: Array
    gradient: Array
    direct: BoolArray
    J: Array
    b: Array
    error: Array

    def rows(self, plan: Array) -> Array:
        """(N, m) their values along another plan (H, n), to first order."""
        away = plan - self.plan
        moved: Array = (self.at.Q @ away)[:, None, :]
        if self.direct.any():
            moved = np.where(self.direct[:, None], (self.at.V @ away)[:, None, :], moved)
        values: Array = self.value + (self.gradient * moved).sum(axis=2)
        return values

    def by_plan(self, instant: IntArray, row: IntArray) -> Array:
        """(r, H, n) gradients by the plan of r rows, each at an instant."""
        time = np.where(self.direct[row, None], self.at.V[instant], self.at.Q[instant])
        gradients: Array = time[:, :, None] * self.gradient[instant, row][:, None, :]
        return gradients


def look_ahead(rows: Rows, task: Task, seen: Prediction, at: Instants, plan: Array, K: Array) -> Lookahead:
    """Linearise a prediction along a plan; rows and task are those of now, K (m,) is 0 for rows on φ itself."""
    direct = K == 0.0
    J = seen.J.copy()
    J[0] = task.J
    return Lookahead(
        plan,
        at.first(len(seen)),
        along(rows, seen, direct),
        seen.Lg / np.where(direct, 1.0, K)[:, None],
        direct,
        J,
        seen.b + (task.b - seen.b[0]),
        seen.error,
    )


def along(rows: Rows, seen: Prediction, direct: BoolArray) -> Array:
    """(N, m) σ, or φ of rows on φ itself, if what the model says otherwise of now stays so."""
    now = np.where(direct, rows.phi, rows.sigma if len(rows.sigma) else seen.sigma[0] + rows.phi - seen.phi[0])
    then = np.where(direct, seen.phi, seen.sigma)
    value: Array = then + (now - then[0])
    return value


def cost(ahead: Lookahead, horizon: Horizon, gains: Array, damping: float) -> Cost:
    """Σ‖J(uₖ − q̈ₖ)‖² + λ‖u‖² of a plan u (Hn,).

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
    d = b + (J @ (feedback @ ahead.plan)[:, :, None])[:, :, 0]
    # of Σ‖J (C u) − d‖² in blocks: P = Σ (C ᵀC) ⊗ (JᵀJ), each over the beginnings
    squares = J.transpose(0, 2, 1) @ J
    pairs = C[:, :, None] * C[:, None, :]
    P = (pairs.reshape(-1, H * H).T @ squares.reshape(-1, n * n)).reshape(H, H, n, n)
    P = P.transpose(0, 2, 1, 3).reshape(H * n, H * n)
    size = float(np.vdot(J, J)) / len(begins)
    P.ravel()[:: H * n + 1] += damping * (size if size > 0.0 else 1.0)
    q = C.T @ (d[:, None, :] @ J)[:, 0, :]
    L, center, refused = lapack.dposv(P.T, q.ravel(), lower=1, overwrite_a=1)
    if refused:
        raise np.linalg.LinAlgError("the cost of the plan is beyond the range of floating point")
    return Cost(center, L)


class Limits(NamedTuple):
    """Rows G u ≤ h of a plan u (Hn,): of every instant after now, and then of the box; see :class:`.penalised.Rows`.

    σ(τ + Δτ) ≤ e^(−Δτ/κ) σ(τ), with φ in place of σ of rows on φ itself, and σ ≤ 0 while braking.

    Attributes
    ----------
    ahead
        What is linearised.
    falls
        (N − 1,) e^(−Δτ/κ), 0 while braking.
    left
        (N − 1, m) by what a row may be exceeded, ∞ where there is none.
    low, high
        (Hn,) the box.
    least
        (m,) a row of G with no entry beyond it counts as zero.
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
        value = self.ahead.rows(u.reshape(self.ahead.plan.shape))
        rows = value[1:] - self.falls[:, None] * value[:-1] - self.left
        return np.concatenate((rows.ravel(), u - self.high, self.low - u))

    def stated(self, which: IntArray) -> tuple[IntArray, Array]:
        """Those of these rows, in ascending order, that a plan has any influence on, and their G."""
        size, r = self.low.size, int(np.searchsorted(which, self.left.size))
        before, row = np.divmod(which[:r], len(self.least))
        fall = self.falls[before, None, None]
        side, entry = np.divmod(which[r:] - self.left.size, size)
        G, least = np.zeros((len(which), size)), np.zeros(len(which))
        G[:r] = (self.ahead.by_plan(before + 1, row) - fall * self.ahead.by_plan(before, row)).reshape(r, size)
        G[np.arange(r, len(which)), entry] = 1.0 - 2.0 * side
        least[:r] = self.least[row]
        has = ~(np.abs(G).max(axis=1) <= least)
        return which[has], G[has]

    def open(self, G: Array, h: Array) -> BoolArray:
        """Which of some rows the box leaves anything to say."""
        reach = np.maximum(-self.low, self.high)
        if not np.isfinite(reach).all():
            return np.ones(len(h), dtype=np.bool_)
        said: BoolArray = ~(np.abs(G) @ reach <= h)
        return said


def limits(ahead: Lookahead, approach: float, box: tuple[Array, Array], least: Array) -> Limits:
    """Rows that hold along a plan; ``approach`` is κ [s], the box (H, n) twice, ``least`` as of :class:`Limits`."""
    times, N = ahead.at.times, ahead.at.braking
    falls, left = np.zeros(len(times) - 1), np.zeros((len(times) - 1, len(least)))
    falls[: N - 1] = np.exp(-np.diff(times[:N]) / approach)
    if len(times) > N:
        # what is outside now may come back as slowly while braking
        left[N - 1 :] = np.maximum(ahead.value[0], 0.0) * np.exp(-times[N:, None] / approach)
        left[N - 1 :, ahead.direct] = np.inf
    return Limits(ahead, falls, left, box[0].ravel(), box[1].ravel(), least)
