"""Errors stay in a funnel that narrows with time: prescribed performance, as rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..formulas.features import pose_error
from ..formulas.tracking import funnel, goal_at
from ..rows import Array, IntArray
from ..vision.features import CameraPose, Goal
from ..vision.scene import Scene, State
from .base import Constraint, RowBlock, Trace, demand_numbers, demand_positive
from .by_formula import Form

POSE = ("x", "y", "z", "rotation x", "rotation y", "rotation z")
"""Components of a camera pose's error, in the frame of the goal's camera."""


class PerformanceFunnel(Constraint):
    """Every component of the error to the goal stays in a funnel that narrows with time.

    ±eᵢ/ρ₀ − ρ(t)/ρ₀ ≤ 0 with ρ(t) = (ρ₀ − ρ∞) exp(−l t) + ρ∞ (Bechlioulis, Heshmati-alamdari, Karras and
    Kyriakopoulos, T-RO 2019), as rows that any law can hold.

    e is the feature less its value at the goal, whatever reference trajectory leads there. t counts from when the goal
    begins to hold: at a change of the goal the funnel opens again. Angles are those within π.

    Parameters
    ----------
    goals
        The task's.
    K, switching_gain
        Approach time constant [s] and u⁺ [1/s].
    final
        ρ∞/ρ₀, above 0 and at most 1.
    decay
        l [1/s]; K l must be below 1, or φ would be positive with no error at all.
    translation_m, rotation_rad
        ρ₀ of the components of (t, θu) of eq. (44) [m], [rad]; no rows of those that are None.
    feature_px
        ρ₀ of the markers' coordinates in the image instead [px].
    markers
        Numbers of the markers concerned, counted from 1; all if None.

    Raises
    ------
    ConfigurationError
        if a goal is not given as what the funnel is about, or the numbers do not go together.
    """

    kind = "funnel"
    unit = "px"

    def __init__(
        self,
        goals: Sequence[Goal],
        *,
        K: float,
        switching_gain: float,
        decay: float,
        final: float,
        translation_m: float | None = None,
        rotation_rad: float | None = None,
        feature_px: float | None = None,
        markers: Sequence[int] | None = None,
    ) -> None:
        super().__init__(K=K, switching_gain=switching_gain)
        sizes = {"translation_m": translation_m, "rotation_rad": rotation_rad, "feature_px": feature_px}
        for name, value in (("decay", decay), ("final", final), *sizes.items()):
            if value is not None:
                demand_positive(value, f"{name} of {self.kind}")
        if final > 1.0 or K * decay >= 1.0:
            raise ConfigurationError(
                f"{self.kind} must not widen, nor narrow faster than rows approach their boundary: final is at most 1 "
                f"and decay below 1/K = {1.0 / K:g} 1/s, not {final:g} and {decay:g} 1/s"
            )
        self.of_image = feature_px is not None
        if self.of_image == (translation_m is not None or rotation_rad is not None):
            raise ConfigurationError(
                f"{self.kind} is about the image or about the camera's pose: give feature_px, or translation_m, "
                "rotation_rad or both"
            )
        if not goals:
            raise ConfigurationError(f"{self.kind} is about the error to a goal, and there is none")
        if not self.of_image and any(goal.camera is None for goal in goals):
            raise ConfigurationError(f"{self.kind} of the camera's pose needs goals with one; give feature_px")
        if markers is not None and not self.of_image:
            raise ConfigurationError(f"markers of {self.kind} go with feature_px")
        self.goals, self.decay, self.final = tuple(goals), float(decay), float(final)
        self.markers = None if markers is None else demand_numbers(markers, f"markers of {self.kind}")
        if feature_px is not None:
            numbers = self.markers or range(1, len(goals[0].pixels) + 1)
            self._at = [2 * (i - 1) + c for i in numbers for c in (0, 1)]
            half = [feature_px] * len(self._at)
        else:
            width = [translation_m] * 3 + [rotation_rad] * 3
            self._at = [i for i, one in enumerate(width) if one is not None]
            half = [one for one in width if one is not None]
        self.start: Array = np.array(half + half, dtype=np.float64)
        self._side = np.repeat([1.0, -1.0], len(half)) / self.start
        self._both = self._at + self._at

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """All upper rows, then all lower ones: ``funnel[x].upper``, ``funnel[marker 1 u].lower``."""
        if self.of_image and max(self._at) >= 2 * len(scene.markers):
            raise ConfigurationError(
                f"{self.kind}: there is no marker {max(self._at) // 2 + 1}; the scene has {len(scene.markers)}"
            )
        names = [f"marker {i // 2 + 1} {'uv'[i % 2]}" if self.of_image else POSE[i] for i in self._at]
        return tuple(f"{self.kind}[{name}].{side}" for side in ("upper", "lower") for name in names)

    def units(self, scene: Scene) -> tuple[str, ...]:
        """Pixels, metres or radians."""
        return tuple("px" if self.of_image else "m" if i < 3 else "rad" for i in self._both)

    def rows(self, state: State, points: slice) -> RowBlock:
        """From the error and its derivatives, and those of the funnel."""
        goal, seen = self.goals[self._goal(state.t)], state.pixels
        error: Array
        J: Array
        velocity: Array
        drift: Array
        if self.of_image:
            error, J = (seen.position - goal.pixels).ravel(), seen.J.reshape(-1, seen.J.shape[2])
            velocity, drift = seen.velocity.ravel(), seen.drift.ravel()
        else:
            pose = CameraPose().evaluate(state, goal, None)
            error, J, velocity, drift = pose.error, pose.J, pose.velocity, pose.drift
        at, side = self._both, self._side
        width, rate, bend = funnel(state.t - goal.from_time, self.final, self.decay)
        return self.block(
            side * error[at] - width, side * velocity[at] - rate, side[:, None] * J[at], side * drift[at] - bend
        )

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """The rows that compiled code makes of markers or of the camera's pose."""
        if type(self) is not PerformanceFunnel:
            return None
        wanted: list[Array] = [
            goal.pixels.ravel() if self.of_image or goal.camera is None else np.append(goal.camera.R, goal.camera.t)
            for goal in self.goals
        ]
        begins = [goal.from_time for goal in self.goals]
        numbers = (self.final, self.decay, float(len(begins)), *begins, *np.concatenate(wanted).tolist())
        rows = "image_funnel_rows" if self.of_image else "pose_funnel_rows"
        return Form(rows, parameters=numbers, which=self._both, offsets=self._side)

    def clearance(self, trace: Trace, points: slice) -> Array:
        """ρ ∓ eᵢ [px, m or rad]."""
        which = np.array([self._goal(t) for t in trace.t], dtype=np.int64)
        if self.of_image:
            error = (trace.pixels - np.array([goal.pixels for goal in self.goals])[which]).reshape(len(which), -1)
        else:
            error = self._pose_errors(trace, which)
        began = np.array([goal.from_time for goal in self.goals])[which]
        width, _, _ = funnel(trace.t - began, self.final, self.decay)
        clearance: Array = self.start * (width[:, None] - self._side * error[:, self._both])
        return clearance

    def characteristic_length(self, scene: Scene) -> Array:
        """ρ₀."""
        return self.start

    def refusal(self, sigma: Array, labels: tuple[str, ...]) -> str:
        """A funnel holds only what starts inside."""
        outside = [
            f"{labels[i]} with an error of {(sigma[i] + 1.0) * self.start[i]:.3g}, where ρ₀ is {self.start[i]:g}"
            for i in np.flatnonzero(sigma >= 0.0)
        ]
        return f"the start is outside its funnel: {'; '.join(outside)}" if outside else ""

    def _goal(self, t: float) -> int:
        return goal_at([goal.from_time for goal in self.goals], t)

    def _pose_errors(self, trace: Trace, which: IntArray) -> Array:
        """(T, 6) errors of the camera's pose."""
        if trace.scene is None:
            raise ConfigurationError(f"clearances of {self.kind} of the camera's pose need the trace's scene")
        errors = np.zeros((len(which), 6))
        for k, i in enumerate(which):
            camera, wanted = trace.scene.camera_pose(trace.q[k], float(trace.t[k])), self.goals[i].camera
            assert wanted is not None
            _, t, w = pose_error(wanted.R, wanted.t, camera.R, camera.t, np.zeros(3), False)
            errors[k] = (*t, *w)
        return errors
