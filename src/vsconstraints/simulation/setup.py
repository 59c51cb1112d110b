"""What is simulated: a scene, its constraints, a task, and when to stop."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from ..constraints import ConstraintSet, Trace
from ..control import ControlStep
from ..controllers.delay import split_delay
from ..errors import (
    ConfigurationError,
    InvalidInput,
    SceneError,
    VsconstraintsError,
    described,
    listed,
)
from ..formulas.motion import reached
from ..formulas.tracking import goals_at
from ..robots.geometry import demand_sign
from ..robots.limits import NO_LIMITS, ActuatorLimits
from ..rows import Array, BoolArray
from ..rows.factors import AS_THEY_ARE, RowFactors
from ..rows.readable import amount, counted, in_one_line
from ..vision.features import CameraPose
from ..vision.images.settings import ImageSettings
from ..vision.scene import Scene
from ..vision.tracking import VisualTask
from .disturbances import Disturbances
from .dynamics import ArmDynamics, DynamicPlant
from .image_sensor import ImageSensor, SceneRenderer
from .plant import Actuation, Plant, pending_commands
from .sensing import GradientError, Sensor
from .start import forbidden_goals, hidden_at_start, separated_markers, undetermined_goals
from .units import implausible

MIN_SAMPLING_TIME = 1e-9  #: Of a simulation [s]: numbers of samples in a second fit an integer.
MAX_MEMORY = 2e9  #: Memory that a run may take, which is kept whole [bytes].
#: Seconds, and sampling periods, for which a camera must at least have hardly moved to be at rest,
#: however short ``Tolerances.rest_s`` is: in less, a motion that is slow, turns back or is sampled
#: rarely looks the same.
REST = 1.0, 10


@dataclass(frozen=True)
class Tolerances:
    """When a motion counts as settled or at rest."""

    #: Error of the camera's pose below which a goal counts as reached, if it is a pose.
    translation_m: float = 0.005
    rotation_rad: float = 0.005
    #: Greatest error of a marker in the image likewise; if the goal, or the task, is an image.
    feature_px: float = 2.0
    #: Speed of the fastest joint below which the arm is at rest, as it must be at a goal [rad/s or
    #: m/s]; it may be any where the target moves, which joints have to follow.
    joint_speed: float = 0.1
    dwell_s: float = 0.2  #: How long it must stay there until the end.
    #: How long the camera must have moved by less than ``translation_m`` and ``rotation_rad`` to
    #: count as at rest; less than 1 s, or ten sampling periods, counts as that.
    rest_s: float = 2.0

    def __post_init__(self) -> None:
        demand_sign(self, "tolerance ", positive=vars(self))


@dataclass(frozen=True)
class Setup:
    """A complete simulation, except for the controller."""

    scene: Scene
    constraints: ConstraintSet
    task: VisualTask
    q0: Array  #: (n,) where the robot starts.
    qd0: Array  #: (n,) how fast.
    sampling_time: float  #: T_s [s].
    duration: float  #: [s]. Every run lasts as long, and scores per second are of this time.
    #: What follows a loss of row rank (section 5.2).
    on_rank_loss: Literal["abort", "continue"] = "abort"
    tolerances: Tolerances = field(default_factory=Tolerances)
    disturbances: Disturbances = field(default_factory=Disturbances)
    actuation: Actuation = "acceleration"  #: What the robot's own controller takes.
    #: At a start with markers hidden by the robot's links.
    on_hidden_markers: Literal["refuse", "continue"] = "refuse"
    limits: ActuatorLimits = NO_LIMITS
    #: Masses, joint controller and friction of the robot; without them, eq. (6).
    dynamics: ArmDynamics | None = None
    #: Of rendered images; without them, the control knows where markers are.
    images: ImageSettings | None = None
    #: Until when a run that has not come to rest by then goes on [s], see :func:`.until_settled`;
    #: not at all if None.
    time_limit: float | None = None

    def __post_init__(self) -> None:
        for name in ("sampling_time", "duration"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InvalidInput(
                    f"{name} must be a positive number of seconds, not {getattr(self, name)}"
                )
        if self.sampling_time < MIN_SAMPLING_TIME:
            least = f"sampling_time must be {MIN_SAMPLING_TIME:g} s or more"
            raise InvalidInput(f"{least}, not {self.sampling_time:g} s: is it in seconds?")
        for name in ("q0", "qd0"):
            self.scene.robot.configuration(getattr(self, name), name)
        self.task.rest_of(self.scene.robot.n, 6)
        samples = self.duration / self.Ts
        most = MAX_MEMORY / self.sample_memory
        if samples > most:
            raise ConfigurationError(
                f"{self.duration} s in steps of {self.Ts} s are {samples:.3g} samples, which take "
                f"{samples * self.sample_memory / 1e9:.3g} GB of memory; a run may have "
                f"{most:.3g} samples, "
                f"{MAX_MEMORY / 1e9:g} GB"
            )
        if self.duration < self.Ts:
            rate = ": is the sampling time a rate in Hz, or in ms, not s?" if self.Ts >= 1.0 else ""
            raise ConfigurationError(
                f"the duration {self.duration} s is shorter than one sample, {self.Ts} s{rate}"
            )
        for part in (self.plant, self.sensor, self.gradient_error):
            part()

    @in_one_line
    def __repr__(self) -> str:
        time = f"{amount(self.duration)} s in steps of {amount(1e3 * self.Ts)} ms"
        what = f"{self.task.feature.name}, {counted(len(self.constraints.labels), 'row')}"
        return f"<Setup: {self.scene.robot.name}, {what}, {time}>"

    @property
    def Ts(self) -> float:  # noqa: N802 - a symbol of the formulas
        """T_s, as formulas call the sampling time [s]."""
        return self.sampling_time

    def plant(self) -> Plant:
        """The robot, at its start; raises ConfigurationError if an arm with mass is also described
        by eq. (6).
        """
        limits = self.limits.arrays(self.scene.robot.ranges, self.Ts) if self.limits.any else None
        if self.dynamics is None:
            return Plant(self.q0, self.qd0, self.Ts, self.actuation, self.disturbances, limits)
        if self.actuation != "acceleration":
            raise ConfigurationError(
                f'actuation = "{self.actuation}" is of an arm without mass: with plant, '
                f"plant.controller says what "
                "drives the joints"
            )
        for name in ("acceleration", "acceleration_noise", "time_constant", "command_delay"):
            if np.any(getattr(self.disturbances, name)):
                raise ConfigurationError(
                    f"disturbances.{name} is of an arm without mass: with plant, it follows from "
                    f"controller, friction "
                    "and gears (plant.dead_time delays torques)"
                )
        return DynamicPlant(self.scene.robot, self.dynamics, self.q0, self.qd0, self.Ts, limits)

    def control(self, factors: RowFactors = AS_THEY_ARE) -> ControlStep:
        """The control step, as far as its controller's command, with the law's factors on the
        rows.
        """
        limits = self.limits if self.limits.known else NO_LIMITS
        return ControlStep(
            self.scene, self.constraints.scaled(factors), self.task, limits=limits, period=self.Ts
        )

    def world(self) -> ControlStep:
        """Rows and task as they are: with the motion of everything known."""
        return ControlStep(self.scene, self.constraints, self.task, known=True)

    def sensor(self) -> Sensor:
        """What turns true states into what a controller believes."""
        if self.images is not None:
            return ImageSensor(
                self.scene, self.disturbances, self.images, self.photographer(), self.Ts
            )
        return Sensor(
            self.scene, self.disturbances, self.Ts, self.constraints.has_unknown_motion(self.scene)
        )

    def photographer(self) -> SceneRenderer:
        """What takes the images that the control sees; raises ConfigurationError where it sees
        none.
        """
        if self.images is None:
            raise ConfigurationError('there are no images without sensor = "images"')
        return SceneRenderer(
            self.scene, self.images, self.constraints.constraints, self.q0, self.disturbances.seed
        )

    def gradient_error(self, factors: RowFactors = AS_THEY_ARE) -> GradientError:
        """Errors of the rows' gradients."""
        return GradientError(
            self.constraints.scaled(factors), self.disturbances, self.scene.robot.n
        )

    @cached_property
    def forbidden(self) -> list[str]:
        """See :func:`vsconstraints.simulation.start.forbidden_goals`."""
        return forbidden_goals(self.scene, self.constraints, self.task)

    @cached_property
    def separated(self) -> list[str]:
        """See :func:`vsconstraints.simulation.start.separated_markers`."""
        start = self.scene.glance(self.q0)[0]
        return separated_markers(self.scene, self.constraints, self.task, start)

    @cached_property
    def doubts(self) -> list[str]:
        """Numbers that suggest another unit, and goals that the image does not determine; one
        sentence each.

        See :func:`vsconstraints.simulation.units.implausible` and
        :func:`vsconstraints.simulation.start.undetermined_goals`.
        """
        estimated = self.images is not None or self.sensor().estimates
        # numbers beyond the range of floating point are refused where they are computed with
        with np.errstate(all="ignore"):
            undetermined = undetermined_goals(self.scene, self.task, self.q0, estimated)
            numbers = implausible(
                self.scene, self.constraints, self.task, self.limits, self.q0, self.Ts
            )
        return numbers + undetermined

    @property
    def samples(self) -> int:
        """Number of samples from t = 0 to the end, which is the last whole period within the
        duration.
        """
        return self._samples_of(self.duration)

    @property
    def samples_at_most(self) -> int:
        """The same of the longest run: to the time limit, as far as memory goes."""
        longest = min(self.time_limit or 0.0, MAX_MEMORY / self.sample_memory * self.Ts)
        return self._samples_of(max(longest, self.duration))

    def _samples_of(self, seconds: float) -> int:
        return int(np.floor(seconds / self.Ts + 1e-6)) + 1

    @property
    def rest_time(self) -> float:
        """For how long the camera must have hardly moved to be at rest [s]."""
        return max(self.tolerances.rest_s, REST[0], REST[1] * self.Ts)

    @property
    def sample_memory(self) -> int:
        """Memory that one sample of a run takes while it is simulated and scored [bytes]."""
        n = self.scene.robot.n
        m = len(self.constraints.labels)
        markers = len(self.scene.markers)
        # floats that a log keeps: states and command, error, camera, markers, points, φ and σ,
        # times
        waiting = pending_commands(
            split_delay("disturbance command_delay", self.disturbances.command_delay, self.Ts)
        )
        kept = (
            (6 + waiting) * n
            + max(6, 2 * markers)
            + 12
            + 2 * markers
            + 3 * len(self.scene.points)
            + 2 * m
            + 12
        )
        # computed from them at the end: states, clearances, errors
        scored = 3 * n + 3 * m + 2 * markers + 8
        return 8 * (kept + scored) + 2 * m

    @property
    def goal_tolerances(self) -> Array:
        """(g, 4) distance [m], angle [rad], pixels and joints' speed [rad/s or m/s] with which each
        goal is reached.
        """
        own = self.tolerances
        at_rest = own.joint_speed if self.scene.motion is None else np.inf
        factors = np.array([goal.tolerance_factor for goal in self.task.goals])
        return np.outer(factors, [own.translation_m, own.rotation_rad, own.feature_px, at_rest])

    @property
    def goal_begins(self) -> Array:
        """(g,) when each goal begins [s]."""
        return np.array([float(goal.from_time) for goal in self.task.goals])

    def reached(self, t: Array, camera_error: Array, feature_error: Array, qd: Array) -> BoolArray:
        """(N,) whether the goal of the time is reached, by the camera's pose or the markers, with
        the joints at rest.

        For times (N,) [s], distances [m] and angles [rad] of the camera from the goal (N, 2),
        greatest distances of a marker from it (N,) [px], and joint speeds (N, n).
        """
        tolerance = self.goal_tolerances[goals_at(self.goal_begins, t)].T
        speed = np.abs(qd).max(axis=1)
        by_pose = isinstance(self.task.feature, CameraPose)
        there: BoolArray = reached(
            camera_error[:, 0], camera_error[:, 1], feature_error, speed, tolerance, by_pose
        )
        return there

    def clearance(self, t: Array, q: Array, qd: Array, pixels: Array, points: Array) -> Array:
        """(N, m) of each row at N samples: see :class:`vsconstraints.constraints.Trace` for the
        arguments.
        """
        return self.constraints.clearance(
            Trace(t, q, qd, pixels, points, self.scene.camera.size, self.scene)
        )

    def check_start(self, world: ControlStep | None = None) -> list[str]:
        """What a reader of the results should know, one sentence each; raises ConfigurationError if
        there is no start.

        That is: a joint is outside its range, a marker behind the camera, outside the image, or
        hidden by the robot's own links as far as it has collision geometry, an error outside its
        funnel, or the rows cannot be evaluated. Any other constraint violated at the start is no
        error: every controller is built to come back. Nor is a goal that puts markers where a
        constraint forbids them, which no controller can reach. ``world`` is that of the setup, if
        it is there already.
        """
        robot = self.scene.robot
        outside = robot.outside_ranges(self.q0)
        # what is wrong with numbers is often why there is no start
        doubts = "".join(f"; {doubt}" for doubt in self.doubts)
        if outside:
            raise ConfigurationError(
                f"{robot.name} starts outside its ranges: {'; '.join(outside)}{doubts}"
            )
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                return self._remarks_at_start(world or self.world())
        except SceneError as error:
            raise ConfigurationError(f"at the start, {error}{doubts}") from error
        except VsconstraintsError:
            raise
        # own constraints may raise anything, and numbers may leave the range of floats
        except Exception as error:
            raise ConfigurationError(
                f"the start cannot be evaluated: {described(error)}"
            ) from error

    def _remarks_at_start(self, world: ControlStep) -> list[str]:
        camera = self.scene.camera
        start = world.evaluate(0.0, self.q0, self.qd0)
        pixels = enumerate(start.pixels, start=1)
        unseen = [
            f"marker {i} at ({uv[0]:.0f}, {uv[1]:.0f}) px"
            for i, uv in pixels
            if not camera.sees(uv)
        ]
        if unseen:
            raise ConfigurationError(
                f"at the start, outside the image of {camera.size[0]:g} × {camera.size[1]:g} px: "
                f"{', '.join(listed(unseen, 'markers'))} "
                f"from its centre{''.join(f'; {doubt}' for doubt in self.doubts)}"
            )
        remarks = list(self.doubts)
        remarks += hidden_at_start(self.scene, self.q0, self.on_hidden_markers == "refuse")
        rows = start.rows
        sigma = start.sigma
        first = 0
        beyond = ~np.isfinite(np.column_stack((sigma, rows.phi, rows.Lf, rows.Lg))).all(axis=1)
        if beyond.any():
            labels = ", ".join(listed([rows.labels[i] for i in np.flatnonzero(beyond)], "rows"))
            raise FloatingPointError(f"numbers beyond the range of floating point in {labels}")
        for constraint, count, _ in self.constraints.blocks():
            own = slice(first, first := first + count)
            refusal = constraint.refusal(sigma[own], rows.labels[own])
            if refusal:
                raise ConfigurationError(refusal)
        violated = np.flatnonzero(sigma > 0.0)
        outside = [
            f"{rows.labels[i]} is violated at the start: σ = {sigma[i]:.3g}" for i in violated
        ]
        remarks += listed(outside, "rows that are violated at the start")
        return remarks + self.forbidden + self.separated
