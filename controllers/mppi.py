"""Model predictive path integral control: cost-weighted mean of random plans.

For formulas and results see ``docs/laws.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vsconstraints.controllers.ranges import Range, option, positive_number
from vsconstraints.controllers.resolver import row_weights
from vsconstraints.prediction import PredictiveControl
from vsconstraints.prediction.planner import Plan
from vsconstraints.prediction.predictive import whole_number
from vsconstraints.rows import Array, BoolArray, Command, Rows, Task

MOST = 100_000  #: Upper limit of samples and of seeds.
SEEN = ("phi", "sigma", "J", "b", "rest")  #: Fields of predictions that are used.


@dataclass(kw_only=True, eq=False, repr=False)
class PathIntegralControl(PredictiveControl):
    """Model predictive path integral control (MPPI): weighted mean of random plans.

    Williams et al., IEEE Transactions on Robotics 34(6), 2018, without a cost of inputs; S
    plans are sampled around the last one, the first without noise, and predicted
    without linearisation. Their cost is the objective of :class:`.PredictiveControl` plus a penalty
    of rows. Few samples leave noise in the command, and rows may be violated. Plans that the model
    cannot predict to their end are dropped. Every reset restarts from the seed, so that runs repeat
    bit by bit.
    """

    name = "mppi"
    ignores = (*PredictiveControl.ignores, "observer")
    kernels = ()

    samples: int = option(
        64, "S: number of sampled plans, from 1 to 100,000", Range(16, 512, integer=True)
    )
    horizon: int = option(
        3, "H: number of blocks in a plan, from 1 to 100", Range(2, 20, integer=True)
    )
    approach: float = option(
        5.0, "κ: time constant with which rows may approach their boundary, in blocks"
    )
    damping: float = option(1e-3, "λ: weight of the accelerations in the cost")
    temperature: float = option(
        1.0,
        "temperature of the weighted mean; a lower value favours the best plans more",
        (0.1, 10.0),
    )
    noise: float = option(
        0.2, "standard deviation of the sampled q̈ in every block [rad/s² or m/s²]", (0.02, 2.0)
    )
    penalty: float = option(1.0, "weight of violated rows in the cost", (0.01, 100.0))
    seed: int = option(1, "seed of the random numbers, from 1 to 100,000")

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("samples", "seed"):
            value = whole_number(name, value, MOST)
        elif name in ("temperature", "noise", "penalty"):
            value = positive_number(name, value)
        super().__setattr__(name, value)

    def planner(self, shape: tuple[int, int]) -> Any:
        """See :class:`.PredictiveControl`."""
        return Sampler(self, shape)


class Sampler:
    """Last plan of a law for a task of shape (k, n), and its random number generator."""

    compiled = False

    def __init__(self, law: PathIntegralControl, shape: tuple[int, int]) -> None:
        self.law = law
        self.shape = shape
        self.rng = np.random.default_rng(law.seed)
        self.mean = np.zeros((law.horizon, shape[1]))
        self.made = np.nan
        self.length = law.block * (law.period or np.nan)

    @property
    def plan(self) -> Plan | None:
        """Last plan, with its last block repeated; None if there is none."""
        if np.isnan(self.made):
            return None
        return Plan(self.mean.copy(), self.mean[-1].copy(), self.made)

    def carry_on(self, t: float) -> Array:
        """Return the last plan (H, n), shifted to the time t [s]; zero if there is none.

        The blocks are means of the last plan over the new blocks.
        """
        H = len(self.mean)
        elapsed = (t - self.made) / self.length
        if not 0.0 <= elapsed < H:
            return np.zeros_like(self.mean)
        share = elapsed % 1.0
        block = np.minimum(np.arange(H + 1) + int(elapsed), H - 1)
        moved: Array = (1.0 - share) * self.mean[block[:-1]] + share * self.mean[block[1:]]
        return moved

    def solve(self, rows: Rows, task: Task) -> Command:
        """Compute the command, see :class:`PathIntegralControl`."""
        law = self.law
        now = law.model.present
        low, high = self.bounds(rows)
        u = self.carry_on(now.t) + np.zeros((law.samples, 1, 1))
        u[1:] += law.noise * self.rng.standard_normal(u[1:].shape)
        np.clip(u, low, high, out=u)
        cost, exceeded = self.costs(u, rows, task)
        remark = law.remark(rows.labels)
        known = np.isfinite(cost)
        if not known.any():
            self.made = np.nan
            why = "braking: no plan is predicted, since a marker is then not in front of the camera"
            qdd = np.clip(-now.qd / self.length, low[0], high[0])
            return Command(qdd, "suboptimal", exceeded, rows.labels, reason=why, remark=remark)
        scale = 2.0 * law.temperature * law.noise**2
        weights = np.where(known, np.exp((cost[known].min() - cost) / scale), 0.0)
        mean = np.einsum("s,skj->kj", weights / weights.sum(), u)
        self.mean = np.clip(mean, low, high)
        self.made = now.t
        return Command(self.mean[0].copy(), "ok", exceeded, rows.labels, remark=remark)

    def bounds(self, rows: Rows) -> tuple[Array, Array]:
        """Return the least and greatest q̈ (H, n); those of the first block are within the box."""
        law = self.law
        most = law.model.acceleration
        if law.max_acceleration is not None:
            most = np.minimum(most, law.max_acceleration)
        high = most * np.ones_like(self.mean)
        low = -high
        if len(rows.qdd_max):
            low[0] = np.clip(low[0], rows.qdd_min, rows.qdd_max)
            high[0] = np.clip(high[0], rows.qdd_min, rows.qdd_max)
        return low, high

    def costs(self, u: Array, rows: Rows, task: Task) -> tuple[Array, BoolArray]:
        """Return the costs (S,) of plans (S, H, n), and the rows (m,) that any of them exceeds.

        The cost is infinite where the model cannot predict the plan.
        """
        law = self.law
        T = self.length
        model = law.model
        seen, whole = self.along_plans(u, rows, task)
        on_phi = np.asarray(model.K) == 0.0
        x = np.where(on_phi, seen["phi"], seen["sigma"]) + law.margin * rows.scale
        over = np.maximum(x[:, 1:] - np.exp(-1.0 / law.approach) * x[:, :-1], 0.0)
        unit = rows.scale * np.where(on_phi, T, T * T)
        over *= np.sqrt(row_weights(rows.labels, law.weights or {})) / unit
        residual = np.einsum("skij,skj->ski", seen["J"][:, :-1], u) - seen["b"][:, :-1]
        free = u
        if len(task.rest):
            free = u - seen["rest"][:, :-1]
        size = float((task.J**2).sum()) or 1.0
        cost = np.zeros(len(u))
        for weight, part in ((1.0 / size, residual), (law.damping, free), (law.penalty, over)):
            cost = cost + weight * (part**2).sum(axis=(1, 2))
        return np.where(whole, cost, np.inf), (over[whole] > 0.0).any(axis=(0, 1))

    def along_plans(self, u: Array, rows: Rows, task: Task) -> tuple[dict[str, Array], BoolArray]:
        """Return rows and task (S, H + 1, …) along plans (S, H, n), and which plans (S,) are whole.

        The first instant is now. The present difference between the model and rows or task is taken
        as constant. A plan is not whole if the model cannot predict one of its states.
        """
        model = self.law.model
        T = self.length
        t, q, qd = model.present
        S, H, n = u.shape
        speeds = qd + T * np.cumsum(u, axis=1)
        places = q + np.cumsum(T * speeds - 0.5 * T * T * u, axis=1)
        times = np.tile(t + T * np.arange(1, H + 1), S)
        states = times, places.reshape(-1, n), speeds.reshape(-1, n)
        now = model.along(np.array([t]), q[None], qd[None])
        whole = np.ones(S, dtype=np.bool_)
        seen = {name: np.zeros((S * H, *getattr(now, name).shape[1:])) for name in SEEN}
        first = 0
        while first < S * H:
            part = model.along(*(each[first:] for each in states))
            for name, array in seen.items():
                array[first : first + len(part)] = getattr(part, name)
            # the first state without a prediction ends its plan
            end = (first + len(part)) // H
            whole[end : end + 1] = False
            first = H * (end + 1)
        sigma = rows.sigma
        if not len(sigma):
            sigma = now.sigma[0] + rows.phi - now.phi[0]
        present = {"phi": rows.phi, "sigma": sigma, "J": task.J, "b": task.b}
        if len(task.rest):
            present["rest"] = task.rest
        along = {}
        for name, value in present.items():
            moved = (seen[name] + (value - getattr(now, name)[0])).reshape(S, H, *value.shape)
            first_instant = np.broadcast_to(value, (S, 1, *value.shape))
            along[name] = np.concatenate((first_instant, moved), axis=1)
        return along, whole
