"""Performance funnel: errors stay in a funnel that narrows with time (prescribed performance)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace

import numpy as np

from ..errors import ConfigurationError
from ..formulas.features import pose_error
from ..formulas.tracking import funnel, goal_at
from ..rows import Array, IntArray
from ..vision.features import Goal
from ..vision.scene import Scene
from .base import Constraint, Trace, require_numbers, require_positive
from .by_formula import CompiledRowSpec

#: Components of a camera pose's error, in the frame of the goal's camera.
POSE = ("x", "y", "z", "rotation x", "rotation y", "rotation z")


@dataclass(eq=False, repr=False)
class PerformanceFunnel(Constraint):
    """Constraint that keeps every component of the error to the goal in a narrowing funnel.

    ±eᵢ/ρ₀ − ρ(t)/ρ₀ ≤ 0 with ρ(t) = (ρ₀ − ρ∞) exp(−l t) + ρ∞ (Bechlioulis, Heshmati-alamdari,
    Karras and Kyriakopoulos, T-RO 2019), as rows for any law.

    e is the feature minus its value at the goal, independently of a reference trajectory. t is
    counted from the beginning of the goal: the funnel opens again when the goal changes. Angles are
    within π. Raises ConfigurationError if a goal does not define the feature of the funnel, or if
    the numbers are inconsistent.
    """

    kind = "funnel"
    unit = "px"

    goals: Sequence[Goal]  #: Goals of the task.
    _: KW_ONLY
    K: float  #: Approach time constant [s].
    switching_gain: float  #: u⁺ [1/s].
    decay: float  #: l [1/s]; K l must be below 1, otherwise φ would be positive without any error.
    final: float  #: ρ∞/ρ₀, above 0 and at most 1.
    translation_m: float | None = None  #: ρ₀ of t of eq. (44) [m]; no rows if None.
    rotation_rad: float | None = None  #: ρ₀ of θu [rad]; no rows if None.
    #: ρ₀ of the markers' image coordinates, instead of the pose [px].
    feature_px: float | None = None
    #: Numbers of the markers concerned, counted from 1; all if None.
    markers: Sequence[int] | None = None

    def __post_init__(self) -> None:
        super().__init__(K=self.K, switching_gain=self.switching_gain)
        for name in ("decay", "final", "translation_m", "rotation_rad", "feature_px"):
            if getattr(self, name) is not None:
                setattr(self, name, require_positive(getattr(self, name), f"{name} of {self.kind}"))
        if self.final > 1.0 or self.K * self.decay >= 1.0:
            raise ConfigurationError(
                f"{self.kind} must not widen, nor narrow faster than rows approach their "
                f"boundary: final is at most 1 "
                f"and decay below 1/K = {1.0 / self.K:g} 1/s, not {self.final:g} and "
                f"{self.decay:g} 1/s"
            )
        self.of_image = self.feature_px is not None
        if self.of_image == (self.translation_m is not None or self.rotation_rad is not None):
            raise ConfigurationError(
                f"{self.kind} bounds the error in the image or of the camera's pose: give "
                "feature_px, or translation_m, rotation_rad or both"
            )
        if not self.goals:
            raise ConfigurationError(
                f"{self.kind} bounds the error to a goal, and the scenario has no goal"
            )
        if not self.of_image and any(goal.camera is None for goal in self.goals):
            raise ConfigurationError(
                f"{self.kind} of the camera's pose needs goals with one; give feature_px"
            )
        if self.markers is not None and not self.of_image:
            raise ConfigurationError(f"markers of {self.kind} need feature_px")
        if self.markers is not None:
            self.markers = require_numbers(self.markers, f"markers of {self.kind}")
        width: list[float | None] = [self.translation_m] * 3 + [self.rotation_rad] * 3
        at = [i for i, size in enumerate(width) if size is not None]
        if self.of_image:
            numbers = self.markers or range(1, len(self.goals[0].pixels) + 1)
            at = [2 * (i - 1) + c for i in numbers for c in (0, 1)]
            width = [self.feature_px] * (max(at) + 1)
        self._at = at
        self._both = at + at
        self._begins = [goal.from_time for goal in self.goals]
        self.start: Array = np.array([width[i] for i in self._both], dtype=np.float64)
        self._side = np.repeat([1.0, -1.0], len(at)) / self.start

    def scaled(self, K: float, switching_gain: float) -> PerformanceFunnel:
        """Return a copy with these factors, see :class:`.Constraint`.

        Raises ConfigurationError if the funnel would narrow faster than its rows approach their
        boundary.
        """
        return replace(self, K=self.K * K, switching_gain=self.switching_gain * switching_gain)

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """Return the labels of all upper rows, then of all lower ones.

        Examples are ``funnel[x].upper`` and ``funnel[marker 1 u].lower``.
        """
        if self.of_image and max(self._at) >= 2 * len(scene.markers):
            raise ConfigurationError(
                f"{self.kind}: there is no marker {max(self._at) // 2 + 1}; the scene has "
                f"{len(scene.markers)}"
            )
        names = [
            f"marker {i // 2 + 1} {'uv'[i % 2]}" if self.of_image else POSE[i] for i in self._at
        ]
        return tuple(f"{self.kind}[{name}].{side}" for side in ("upper", "lower") for name in names)

    def units(self, scene: Scene) -> tuple[str, ...]:
        """Return the units of the rows: pixels, metres or radians."""
        return tuple("px" if self.of_image else "m" if i < 3 else "rad" for i in self._both)

    def compiled_form(self, scene: Scene, points: slice) -> CompiledRowSpec | None:
        """Return the form of the rows, which are computed from markers or the camera's pose."""
        if type(self).rows is not Constraint.rows:
            return None
        wanted: list[Array] = [
            goal.pixels.ravel()
            if self.of_image or goal.camera is None
            else np.append(goal.camera.R, goal.camera.t)
            for goal in self.goals
        ]
        numbers = (
            self.final,
            self.decay,
            float(len(wanted)),
            *self._begins,
            *np.concatenate(wanted).tolist(),
        )
        rows = "image_funnel_rows" if self.of_image else "pose_funnel_rows"
        return CompiledRowSpec(rows, parameters=numbers, which=self._both, offsets=self._side)

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Return the clearance ρ ∓ eᵢ [px, m or rad]."""
        goals = np.array([goal_at(self._begins, t) for t in trace.t], dtype=np.int64)
        if self.of_image:
            wanted = np.array([goal.pixels for goal in self.goals])
            error = (trace.pixels - wanted[goals]).reshape(len(goals), -1)
        else:
            error = self._pose_errors(trace, goals)
        elapsed = trace.t - np.array(self._begins)[goals]
        width, _, _ = funnel(elapsed, self.final, self.decay)
        clearance: Array = self.start * (width[:, None] - self._side * error[:, self._both])
        return clearance

    def _pose_errors(self, trace: Trace, goals: IntArray) -> Array:
        """Return the errors (t, θu) (T, 6) of the camera's pose, for the goal of each sample."""
        if trace.scene is None:
            raise ConfigurationError(
                f"clearances of {self.kind} of the camera's pose need the trace's scene"
            )
        errors = np.zeros((len(goals), 6))
        for k, goal in enumerate(goals):
            camera = trace.scene.camera_pose(trace.q[k], float(trace.t[k]))
            wanted = self.goals[goal].camera
            assert wanted is not None
            _, t, w = pose_error(wanted.R, wanted.t, camera.R, camera.t, np.zeros(3), False)
            errors[k] = (*t, *w)
        return errors

    def characteristic_length(self, scene: Scene) -> Array:
        """Return ρ₀ of each row."""
        return self.start

    def refusal(self, sigma: Array, labels: tuple[str, ...]) -> str:
        """Return a reason if an error starts outside: a funnel only holds those inside."""
        outside = [
            f"{labels[i]} with an error of {(sigma[i] + 1.0) * self.start[i]:.3g}, where ρ₀ is "
            f"{self.start[i]:g}"
            for i in np.flatnonzero(sigma >= 0.0)
        ]
        return f"the start is outside its funnel: {'; '.join(outside)}" if outside else ""
