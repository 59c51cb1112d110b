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
            value = getattr(self, name)
            if value is not None:
                setattr(self, name, require_positive(value, f"{name} of {self.kind}"))
        self._require_narrowing()
        self.of_image = self.feature_px is not None
        of_pose = self.translation_m is not None or self.rotation_rad is not None
        if self.of_image == of_pose:
            raise ConfigurationError(
                f"{self.kind} bounds the error in the image or of the camera's pose: give "
                "feature_px, or translation_m, rotation_rad or both"
            )
        if not self.goals:
            raise ConfigurationError(
                f"{self.kind} bounds the error to a goal, and the scenario has no goal"
            )
        lacks_pose = any(goal.camera is None for goal in self.goals)
        if not self.of_image and lacks_pose:
            raise ConfigurationError(
                f"{self.kind} of the camera's pose needs goals with one; give feature_px"
            )
        if self.markers is not None and not self.of_image:
            raise ConfigurationError(f"markers of {self.kind} need feature_px")
        if self.markers is not None:
            self.markers = require_numbers(self.markers, f"markers of {self.kind}")
        widths = self._start_widths()
        entries = list(widths)
        start = list(widths.values())
        #: Entries of the error that have rows: of (u₁, v₁, u₂, …) or of (t, θu).
        self._entries = entries
        # each has an upper row; the lower rows follow in the same order
        self._entry_of_row = entries + entries
        self.start: Array = np.array(start + start, dtype=np.float64)
        side = np.repeat([1.0, -1.0], len(entries))
        self._error_factor = side / self.start
        self._goal_starts = [goal.from_time for goal in self.goals]

    def _require_narrowing(self) -> None:
        """Raise ConfigurationError if the funnel widens, or narrows faster than rows approach."""
        if self.final > 1.0 or self.K * self.decay >= 1.0:
            raise ConfigurationError(
                f"{self.kind} must not widen, nor narrow faster than rows approach their "
                f"boundary: final is at most 1 and decay below 1/K = {1.0 / self.K:g} 1/s, not "
                f"{self.final:g} and {self.decay:g} 1/s"
            )

    def _start_widths(self) -> dict[int, float]:
        """Return ρ₀ [px, m or rad] by the entry of the error that it bounds."""
        widths: dict[int, float] = {}
        if self.feature_px is not None:
            marker_count = len(self.goals[0].pixels)
            for number in self.markers or range(1, marker_count + 1):
                u = 2 * (number - 1)
                widths[u] = self.feature_px
                widths[u + 1] = self.feature_px
        if self.translation_m is not None:
            widths |= dict.fromkeys(range(3), self.translation_m)
        if self.rotation_rad is not None:
            widths |= dict.fromkeys(range(3, 6), self.rotation_rad)
        return widths

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
        if self.of_image:
            last = max(self._entries) // 2 + 1
            if last > len(scene.markers):
                raise ConfigurationError(
                    f"{self.kind}: there is no marker {last}; the scene has {len(scene.markers)}"
                )
        names = [self._entry_name(entry) for entry in self._entries]
        upper = [f"{self.kind}[{name}].upper" for name in names]
        lower = [f"{self.kind}[{name}].lower" for name in names]
        return (*upper, *lower)

    def _entry_name(self, entry: int) -> str:
        """Return the name of an entry of the error, such as ``x`` or ``marker 1 u``."""
        if not self.of_image:
            return POSE[entry]
        marker, coordinate = divmod(entry, 2)
        return f"marker {marker + 1} {'uv'[coordinate]}"

    def units(self, scene: Scene) -> tuple[str, ...]:
        """Return the units of the rows: pixels, metres or radians."""
        if self.of_image:
            return ("px",) * len(self._entry_of_row)
        return tuple("m" if entry < 3 else "rad" for entry in self._entry_of_row)

    def compiled_form(self, scene: Scene, points: slice) -> CompiledRowSpec | None:
        """Return the form of the rows, which are computed from markers or the camera's pose."""
        if type(self).rows is not Constraint.rows:
            return None
        from ..compiled.constraint_rows import image_funnel_rows, pose_funnel_rows

        wanted: list[float] = []  # of each goal: pixels, or R and t of the camera
        for goal in self.goals:
            if self.of_image or goal.camera is None:
                wanted += goal.pixels.ravel().tolist()
            else:
                wanted += goal.camera.R.ravel().tolist()
                wanted += goal.camera.t.tolist()
        goal_count = float(len(self.goals))
        return CompiledRowSpec(
            image_funnel_rows if self.of_image else pose_funnel_rows,
            parameters=(self.final, self.decay, goal_count, *self._goal_starts, *wanted),
            which=self._entry_of_row,
            offsets=self._error_factor,
        )

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Return the clearance ρ ∓ eᵢ [px, m or rad]."""
        goal_numbers = [goal_at(self._goal_starts, t) for t in trace.t]
        goals = np.array(goal_numbers, dtype=np.int64)
        if self.of_image:
            wanted = np.array([goal.pixels for goal in self.goals])
            offsets = trace.pixels - wanted[goals]
            error = offsets.reshape(len(goals), -1)
        else:
            error = self._pose_errors(trace, goals)
        starts = np.array(self._goal_starts)
        elapsed = trace.t - starts[goals]
        width, _, _ = funnel(elapsed, self.final, self.decay)
        relative_error = self._error_factor * error[:, self._entry_of_row]
        clearance: Array = self.start * (width[:, None] - relative_error)
        return clearance

    def _pose_errors(self, trace: Trace, goals: IntArray) -> Array:
        """Return the errors (t, θu) (T, 6) of the camera's pose, for the goal of each sample."""
        if trace.scene is None:
            raise ConfigurationError(
                f"clearances of {self.kind} of the camera's pose need the trace's scene"
            )
        errors = np.zeros((len(goals), 6))
        near = np.zeros(3)
        for k, goal in enumerate(goals):
            camera = trace.scene.camera_pose(trace.q[k], float(trace.t[k]))
            wanted = self.goals[goal].camera
            assert wanted is not None
            _, t, w = pose_error(wanted.R, wanted.t, camera.R, camera.t, near, False)
            errors[k] = (*t, *w)
        return errors

    def characteristic_length(self, scene: Scene) -> Array:
        """Return ρ₀ of each row."""
        return self.start

    def refusal(self, sigma: Array, labels: tuple[str, ...]) -> str:
        """Return a reason if an error starts outside: a funnel only holds those inside."""
        outside = []
        for i in np.flatnonzero(sigma >= 0.0):
            error = (sigma[i] + 1.0) * self.start[i]
            outside.append(
                f"{labels[i]} with an error of {error:.3g}, where ρ₀ is {self.start[i]:g}"
            )
        if not outside:
            return ""
        return f"the start is outside its funnel: {'; '.join(outside)}"
