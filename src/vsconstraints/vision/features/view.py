"""Features by their value: a function of what the camera sees."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import ConfigurationError, InvalidInput, SceneError
from ...formulas.rotation import whole_turns
from ...robots.geometry import Pose
from ...rows import Array
from ..scene import State, interaction_matrix
from .base import Feature, FeatureMotion, Goal, selected
from .camera_pose import require_pose

#: Steps h of difference quotients, as rotations in radians or as translations in shares of the
#: smallest depth, 1 m at most. Of values, also for second derivatives, where truncation h⁴ meets
#: rounding 1e-16/h²; and of interaction matrices, where h² meets 1e-16/h.
VALUE_STEP = 1e-3
MATRIX_STEP = 3e-6


class View(NamedTuple):
    """What the camera sees of m markers, now or at a goal."""

    xy: Array  #: (m, 2) normalised coordinates.
    depth: Array  #: (m,) Z [m]; NaN at a goal whose depths are unknown.
    #: Pose of the camera in the target's frame; None at a goal that is given by its image alone.
    camera: Pose | None

    @classmethod
    def of_state(cls, state: State) -> View:
        """Return the view of a state."""
        return cls(state.normalised.position, state.depth, state.camera)

    @classmethod
    def of_goal(cls, goal: Goal) -> View:
        """Return the view at a goal."""
        depth = np.full(len(goal.normalised), np.nan) if goal.depth is None else goal.depth
        return cls(goal.normalised, depth, goal.camera)

    @property
    def point_rows(self) -> Array:
        """(m, 3, 6) interaction matrices of x, y (eq. 24) and Z of each marker."""
        Z_row = np.zeros((len(self.depth), 1, 6))
        Z_row[:, 0, 2] = -1.0
        Z_row[:, 0, 3] = -self.xy[:, 1] * self.depth
        Z_row[:, 0, 4] = self.xy[:, 0] * self.depth
        return np.concatenate((interaction_matrix(self.xy, self.depth), Z_row), axis=1)

    def moved(self, twist: Array, time: float) -> View:
        """Return the view after the camera has moved with a constant twist (v, ω) [m/s, rad/s].

        The twist is that of the camera relative to the target, in the camera frame.
        """
        step = Pose.of(pin.exp6(time * twist))
        xy, depth, camera = self  # also in a value that declares less
        points = np.column_stack((xy, np.ones(len(xy)))) * depth[:, None]
        P = (points - step.t) @ step.R
        camera = None if camera is None else camera @ step
        return View(P[:, :2] / P[:, 2:], P[:, 2], camera)


class _DeclaredView(View):
    """View in which the value of a feature can read what the feature declares in ``needs``.

    Reading anything else raises ConfigurationError. Its place in the tuple has no number.
    """

    #: The feature; None for a copy that the value made, in which nothing else has a number either.
    feature: ViewFeature | None = None

    @classmethod
    def of(cls, view: View, feature: ViewFeature) -> _DeclaredView:
        """Return a view with what a feature declares."""
        depth = view.depth if "depth" in feature.needs else np.full(len(view.depth), np.nan)
        shown = cls(view.xy, depth, view.camera if "pose" in feature.needs else None)
        shown.feature = feature
        return shown

    @property
    def depth(self) -> Array:
        """(m,) Z [m]."""
        self._require("depth", "view.depth")
        return self[1]

    @property
    def camera(self) -> Pose | None:
        """Pose of the camera in the target's frame."""
        self._require("pose", "view.camera")
        return self[2]

    def _require(self, need: Literal["depth", "pose"], used: str) -> None:
        feature = self.feature
        if feature is not None and need not in feature.needs:
            needs = (*feature.needs, need)
            raise ConfigurationError(
                f"the value of the feature {feature.name} uses {used} without declaring it: add "
                f"{need!r} to needs of {type(feature).__name__}, needs = {needs!r}"
            )


class ViewFeature(Feature):
    """Feature s that is a function of the markers' image and depths, or of the camera's pose.

    A derived class defines :meth:`size`, :meth:`value` and, if it is known in closed form,
    :meth:`interaction_matrix`. Otherwise the matrix is derived from the value by differences. J_s,
    ṡ and s̈ follow from them: ṡ = L V and s̈ = L V̇ + L̇ V, with V the camera's twist relative to
    the target and L̇ V by differences along V. Goals count as reached by the feature's own error.

    Parameters
    ----------
    markers
        Numbers of the markers that the feature sees, from 1; all by default.
    """

    #: What the value depends on beside the image; goals must state it, and it reads nothing else.
    needs: ClassVar[tuple[Literal["depth", "pose"], ...]] = ()
    #: Components that are angles [rad]: their differences are taken on the circle.
    angles: ClassVar[slice | Sequence[int]] = slice(0)
    reached_by = "feature"

    def __init__(self, markers: Sequence[int] | None = None) -> None:
        self.markers = markers

    @abstractmethod
    def value(self, view: View, goal: View) -> Array:
        """Return s (k,) of a view; view and goal hold the feature's own markers only.

        s may be stated relative to the goal, as in log(Z/Z*), if the goal only adds a constant.
        Raises SceneError, or returns NaN, where s is not defined.
        """

    def interaction_matrix(self, view: View, goal: View) -> Array:
        """Return L (k, 6) with ṡ = L (v, ω): the camera's twist in its own frame, static markers.

        This method derives it by differences of the value. Their steps are at most
        ``VALUE_STEP`` [m, rad], and shorter where a marker is nearer than 1 m.
        """
        nearest = view.depth.min(initial=1.0)
        columns = []
        for i, twist in enumerate(np.eye(6)):
            is_translation = i < 3
            step = VALUE_STEP * (nearest if is_translation else 1.0)
            change = self.along(view, goal, twist)
            columns.append(_slope(change, step))
        return np.stack(columns, axis=1)

    @property
    def derived(self) -> bool:
        """True if the interaction matrix is derived by differences."""
        return type(self).interaction_matrix is ViewFeature.interaction_matrix

    @property
    def remarks(self) -> list[str]:
        """Remark on a matrix that is derived by differences."""
        remark = f"the interaction matrix of the feature {self.name} is derived by differences"
        return [remark] if self.derived else []

    def count(self, markers: int) -> int:
        """Return the number of the feature's own markers, of so many in all."""
        return len(selected(self.markers, markers, self.name))

    def seen(self, view: View) -> View:
        """Return the feature's own markers of a view."""
        xy, depth, camera = view
        markers = selected(self.markers, len(xy), self.name)
        return View(xy[markers], depth[markers], camera)

    def check_goal(self, goal: Goal) -> None:
        """Raise ConfigurationError if the feature is not defined at a goal."""
        if "depth" in self.needs and goal.depth is None:
            raise ConfigurationError(
                f"the feature {self.name} needs the markers' depths at a goal: give a goal as a "
                "pose or a configuration, or depth_m with markers_px"
            )
        if "pose" in self.needs:
            require_pose(self, goal)
        wanted = self.seen(View.of_goal(goal))
        try:
            value = self.defined_value(wanted, wanted)
        except SceneError as error:
            raise ConfigurationError(f"at a goal, {error}") from error
        k = self.size(len(goal.normalised))
        if len(value) != k:
            raise ConfigurationError(
                f"the value of the feature {self.name} has {len(value)} components at a goal, but "
                f"its size is {k}: let {type(self).__name__}.size return the number of components"
            )

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """Return the reference relative to a new goal: see :meth:`Feature.carried`."""
        wanted = self.seen(View.of_goal(new))
        before = self.seen(View.of_goal(old))
        value = self._declared_value(before, wanted)
        value_at_goal = self._declared_value(wanted, wanted)
        return self._nearest(reference + value - value_at_goal, near)

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Evaluate the feature: see :meth:`Feature.evaluate`.

        Raises InvalidInput if value or interaction matrix have another shape.
        """
        view = self.seen(View.of_state(state))
        wanted = self.seen(View.of_goal(goal))
        here = self.defined_value(view, wanted)
        near = np.zeros(len(here)) if previous is None else previous
        L = self._checked_matrix(view, wanted, len(here))
        J = L @ state.camera_J
        twist = state.camera_twist
        velocity = L @ twist
        away = here - self.defined_value(wanted, wanted)
        bend = self._bend(view, wanted, twist, len(here))
        return FeatureMotion(
            error=self._nearest(away, near),
            J=J,
            velocity=velocity,
            drift=L @ state.camera_drift + bend,
            partial=velocity - J @ state.robot.qd,
        )

    def defined_value(self, view: View, goal: View) -> Array:
        """Return s (k,) of a view of the feature's own markers.

        Raises SceneError if a component is not a finite number.
        """
        with np.errstate(all="ignore"):  # what is not finite is named below
            value = np.asarray(self._declared_value(view, goal), dtype=np.float64)
        if value.ndim != 1:
            raise InvalidInput(
                f"the value of the feature {self.name} must have the shape (k,), not {value.shape}"
            )
        if not np.isfinite(value).all():
            which = int(np.flatnonzero(~np.isfinite(value))[0]) + 1
            declare = "" if "depth" in self.needs else ", or, if it uses depth, declare it in needs"
            raise SceneError(
                f"the feature {self.name} is not defined here: its component {which} is "
                f"{value[which - 1]}. Choose other markers, or another start or goal{declare}"
            )
        return value

    def _declared_value(self, view: View, goal: View) -> Array:
        """Return the value from what the feature declares in ``needs``.

        Raises ConfigurationError if it reads anything else.
        """
        shown = _DeclaredView.of(view, self)
        wanted = shown if view is goal else _DeclaredView.of(goal, self)
        return self.value(shown, wanted)

    def _checked_matrix(self, view: View, goal: View, k: int) -> Array:
        L = np.asarray(self.interaction_matrix(view, goal), dtype=np.float64)
        if L.shape != (k, 6):
            raise InvalidInput(
                f"the interaction matrix of the feature {self.name} must have the shape {(k, 6)}, "
                f"not {L.shape}"
            )
        if not np.isfinite(L).all():
            raise SceneError(f"the interaction matrix of the feature {self.name} is not finite")
        return L

    def _nearest(self, difference: Array, near: Array) -> Array:
        """Return a difference (k,) with its angles as close as possible to those of ``near``."""
        angles = self.angles
        result = difference.copy()
        result[angles] -= whole_turns(difference[angles] - near[angles])
        return result

    def along(self, view: View, goal: View, twist: Array) -> Callable[[float], Array]:
        """Return the change (k,) of s as a function of the time of a motion with constant twist.

        The views are those of the feature's own markers.
        """
        here = self._declared_value(view, goal)
        nowhere = np.zeros(len(here))

        def change(t: float) -> Array:
            there = self._declared_value(view.moved(twist, t), goal)
            return self._nearest(there - here, nowhere)

        return change

    def _bend(self, view: View, goal: View, twist: Array, k: int) -> Array:
        """Return L̇ V (k,), the second derivative of s along the constant twist V."""
        v, omega = twist.reshape(2, 3)
        nearest = view.depth.min(initial=1.0)
        speed = np.linalg.norm(omega) + np.linalg.norm(v) / nearest
        if speed == 0.0:
            return np.zeros(k)
        if self.derived:
            away = self.along(view, goal, twist)
            h = VALUE_STEP / speed
            near = away(h) + away(-h)
            far = away(2.0 * h) + away(-2.0 * h)
            bend: Array = (16.0 * near - far) / (12.0 * h * h)
        else:
            h = MATRIX_STEP / speed
            ahead = self.interaction_matrix(view.moved(twist, h), goal)
            behind = self.interaction_matrix(view.moved(twist, -h), goal)
            bend = (ahead - behind) @ twist / (2.0 * h)
        return bend


def _slope(function: Callable[[float], Array], h: float) -> Array:
    """Return the derivative at 0 of a function, from its values at ±h and ±2h."""
    near = function(h) - function(-h)
    far = function(2.0 * h) - function(-2.0 * h)
    return (8.0 * near - far) / (12.0 * h)
