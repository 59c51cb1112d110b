"""Setup of a simulation: scene, constraints, task and stopping criteria."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from ..constraints import ConstraintSet, Trace
from ..control import ControlStep
from ..controllers import Controller
from ..controllers.delay import split_delay
from ..controllers.velocity_controller import commands_velocity
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
from ..plugins.registry import load
from ..robots.geometry import require_sign
from ..robots.limits import NO_LIMITS, ActuatorLimits, per_joint
from ..rows import Array, BoolArray
from ..rows.factors import AS_THEY_ARE, RowFactors
from ..rows.readable import amount, counted, in_one_line
from ..vision.features import CameraPose
from ..vision.scene import Scene
from ..vision.tracking import VisualTask
from .disturbances import Disturbances
from .follower import ACCELERATIONS, ArmInput, FollowingPlant, LowLevelLoop
from .plant import Actuation, Plant, pending_commands
from .sensing import GradientError, Sensor
from .settings import PlantSettings, SensorSettings
from .start import forbidden_goals, hidden_at_start, separated_markers, undetermined_goals
from .units import unit_warnings

#: Lower bound [s], so that the number of samples per second fits an integer.
MIN_SAMPLING_TIME = 1e-9
MAX_MEMORY = 2e9  #: Memory limit of a run, whose samples are all stored [bytes].
#: Shortest time over which rest is judged, in seconds and in sampling periods, however short
#: ``Tolerances.rest_s`` is. Over a shorter time, a motion that is slow, reverses or is sampled
#: rarely cannot be distinguished from rest.
REST = 1.0, 10


@dataclass(frozen=True)
class Tolerances:
    """Criteria by which a motion counts as settled or at rest."""

    #: Error of the camera's pose below which a goal counts as reached, if the goal is a pose.
    translation_m: float = 0.005
    rotation_rad: float = 0.005
    #: Largest error of a marker in the image, if the goal or the task is an image.
    feature_px: float = 2.0
    #: Speed of the fastest joint below which the arm is at rest, as required at a goal [rad/s or
    #: m/s]. Not required if the target moves, because the joints must follow it.
    joint_speed: float = 0.1
    dwell_s: float = 0.2  #: Time for which the goal must be held until the end of the run [s].
    #: Time over which the camera must move by less than ``translation_m`` and ``rotation_rad`` to
    #: count as at rest [s]. At least 1 s and ten sampling periods are used.
    rest_s: float = 2.0

    def __post_init__(self) -> None:
        require_sign(self, "tolerance ", positive=vars(self))


@dataclass(frozen=True)
class Setup:
    """Complete description of a simulation, except for the controller."""

    scene: Scene
    constraints: ConstraintSet
    task: VisualTask
    q0: Array  #: (n,) initial joint coordinates [rad or m].
    qd0: Array  #: (n,) initial joint speeds [rad/s or m/s].
    sampling_time: float  #: T_s [s].
    #: Duration of every run without a time limit [s]; scores per second refer to it.
    duration: float
    #: Reaction to a loss of row rank (section 5.2).
    on_rank_loss: Literal["abort", "continue"] = "abort"
    tolerances: Tolerances = field(default_factory=Tolerances)
    disturbances: Disturbances = field(default_factory=Disturbances)
    actuation: Actuation = "acceleration"  #: Input of the robot's low-level controller.
    #: Reaction to markers that the robot's links hide at the start.
    on_hidden_markers: Literal["refuse", "continue"] = "refuse"
    limits: ActuatorLimits = NO_LIMITS
    #: Masses, joint controller and friction of the robot; eq. (6) is used if None.
    dynamics: PlantSettings | None = None
    #: Settings of rendered images; if None, the controller knows where the markers are.
    images: SensorSettings | None = None
    #: Time until which a run that is not at rest at the end of its duration continues [s], see
    #: :func:`.until_settled`. None: runs end with their duration.
    time_limit: float | None = None
    #: What the arm takes, and how its low-level loop follows it.
    arm: ArmInput = ACCELERATIONS

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
        """Sampling time T_s, in the notation of the formulas [s]."""
        return self.sampling_time

    def plant(self) -> Plant:
        """Return the robot in its initial state.

        Raises ConfigurationError if ``arm`` contradicts ``actuation``, or if ``dynamics`` is
        combined with actuation or disturbances that describe an arm without mass (eq. 6).
        """
        if self.arm.streams and self.actuation != "acceleration":
            raise ConfigurationError(
                f'actuation = "{self.actuation}" and arm.command = "{self.arm.command}" both set '
                "the kind of command: leave out one"
            )
        # the limits of an arm that takes velocities or positions are those of its motion
        limited = self.limits.any and not self.arm.streams
        limits = self.limits.arrays(self.scene.robot.ranges, self.Ts) if limited else None
        actuators = self.limits.acceleration
        if self.dynamics is None and self.arm.streams:
            return FollowingPlant(
                self.arm, self.q0, self.qd0, self.Ts, self.disturbances, actuators
            )
        if self.dynamics is None:
            return Plant(self.q0, self.qd0, self.Ts, self.actuation, self.disturbances, limits)
        if self.actuation != "acceleration":
            raise ConfigurationError(
                f'actuation = "{self.actuation}" applies to an arm without mass: with plant, use '
                "plant.controller"
            )
        for name in ("acceleration", "acceleration_noise", "time_constant", "command_delay"):
            if np.any(getattr(self.disturbances, name)):
                raise ConfigurationError(
                    f"disturbances.{name} applies to an arm without mass: with plant, set "
                    "controller, friction and gears instead (plant.dead_time delays torques)"
                )
        # a DynamicPlant, whose module the core does not import
        make: Callable[..., Plant] = load(self.dynamics.made_by)
        loop = None
        if self.arm.streams:
            loop = LowLevelLoop(self.arm, self.q0, self.qd0, self.Ts, actuators)
        return make(self.scene.robot, self.dynamics, self.q0, self.qd0, self.Ts, limits, loop)

    @property
    def known_limits(self) -> ActuatorLimits:
        """Limits that the controller knows; none if it knows no actuator limits.

        Of each joint, |q̈| is at most the smaller limit of the actuators and of the arm's loop.
        """
        if not self.limits.known:
            return NO_LIMITS
        if self.arm.acceleration is None:
            return self.limits
        n = self.scene.robot.n
        actuators = self.limits.of_joint("acceleration", n)
        loop = per_joint("arm.acceleration", self.arm.acceleration, n)
        smaller = np.minimum(actuators, loop)
        return replace(self.limits, acceleration=tuple(smaller.tolist()))

    def control(self, factors: RowFactors = AS_THEY_ARE) -> ControlStep:
        """Return the control step that precedes the law, with the law's factors on the rows."""
        return ControlStep(
            self.scene,
            self.constraints.scaled(factors),
            self.task,
            limits=self.known_limits,
            period=self.Ts,
            streams=self.arm.streams,
        )

    def world(self) -> ControlStep:
        """Return the step of the true rows and task, with the motion of all objects known."""
        return ControlStep(self.scene, self.constraints, self.task, known=True)

    def sensor(self) -> Sensor:
        """Return the sensor that turns true states into measurements for the controller."""
        if self.images is not None:
            make: Callable[..., Sensor] = load(self.images.made_by)
            return make(self.scene, self.disturbances, self.images, self.photographer(), self.Ts)
        return Sensor(
            self.scene, self.disturbances, self.Ts, self.constraints.has_unknown_motion(self.scene)
        )

    def photographer(self) -> Any:
        """Return the renderer of the images that the controller receives.

        Raises ConfigurationError if the setup has no image sensor.
        """
        if self.images is None:
            raise ConfigurationError('there are no images without sensor = "images"')
        return load(self.images.rendered_by)(
            self.scene, self.images, self.constraints.constraints, self.q0, self.disturbances.seed
        )

    def gradient_error(self, factors: RowFactors = AS_THEY_ARE) -> GradientError:
        """Return the gradient errors of the rows."""
        return GradientError(
            self.constraints.scaled(factors), self.disturbances, self.scene.robot.n
        )

    @cached_property
    def forbidden(self) -> list[str]:
        """Remarks on goals that violate a constraint.

        See :func:`vsconstraints.simulation.start.forbidden_goals`.
        """
        with np.errstate(divide="ignore", invalid="ignore"):  # custom σ may be undefined in places
            return forbidden_goals(self.scene, self.constraints, self.task)

    @cached_property
    def separated(self) -> list[str]:
        """Remarks on markers that constraints separate from a goal.

        See :func:`vsconstraints.simulation.start.separated_markers`.
        """
        start = self.scene.glance(self.q0)[0]
        with np.errstate(divide="ignore", invalid="ignore"):  # custom σ may be undefined in places
            return separated_markers(self.scene, self.constraints, self.task, start)

    @cached_property
    def doubts(self) -> list[str]:
        """Warnings about implausible numbers and undetermined goals, one sentence each.

        They concern numbers that suggest another unit, and goals that the image does not determine.
        See :func:`vsconstraints.simulation.units.unit_warnings` and
        :func:`vsconstraints.simulation.start.undetermined_goals`.
        """
        estimated = self.images is not None or self.sensor().estimates
        # overflows are reported where the numbers are used
        with np.errstate(all="ignore"):
            undetermined = undetermined_goals(self.scene, self.task, self.q0, estimated)
            numbers = unit_warnings(
                self.scene, self.constraints, self.task, self.limits, self.q0, self.Ts
            )
        return numbers + undetermined

    @property
    def samples(self) -> int:
        """Number of samples from t = 0 to the end of the last whole period within the duration."""
        return self._samples_of(self.duration)

    @property
    def samples_at_most(self) -> int:
        """Number of samples of the longest run: up to the time limit, as far as memory allows."""
        longest = min(self.time_limit or 0.0, MAX_MEMORY / self.sample_memory * self.Ts)
        return self._samples_of(max(longest, self.duration))

    def _samples_of(self, seconds: float) -> int:
        return int(np.floor(seconds / self.Ts + 1e-6)) + 1

    @property
    def rest_time(self) -> float:
        """Time over which the camera must hardly move to count as at rest [s]."""
        return max(self.tolerances.rest_s, REST[0], REST[1] * self.Ts)

    @property
    def sample_memory(self) -> int:
        """Memory per sample of a run, while it is simulated and scored [bytes]."""
        n = self.scene.robot.n
        m = len(self.constraints.labels)
        markers = len(self.scene.markers)
        # floats stored by the loop: states and command, error, camera, markers, points, φ and σ,
        # times
        waiting = pending_commands(
            split_delay("disturbance command_delay", self.disturbances.command_delay, self.Ts)
        )
        rows = 6 + waiting if not self.arm.streams else 14 + 2 * waiting
        kept = (
            rows * n
            + max(6, 2 * markers)
            + 12
            + 2 * markers
            + 3 * len(self.scene.points)
            + 2 * m
            + 12
        )
        # computed from them at the end: states, clearances and how far they may dip, errors
        scored = 3 * n + 7 * m + 2 * markers + 8
        return 8 * (kept + scored) + 2 * m

    @property
    def goal_tolerances(self) -> Array:
        """Tolerances (g, 4) within which each goal is reached.

        Columns: distance [m], angle [rad], pixels [px] and joint speed [rad/s or m/s].
        """
        tolerances = self.tolerances
        at_rest = tolerances.joint_speed if self.scene.motion is None else np.inf
        factors = np.array([goal.tolerance_factor for goal in self.task.goals])
        return np.outer(
            factors,
            [tolerances.translation_m, tolerances.rotation_rad, tolerances.feature_px, at_rest],
        )

    @property
    def goal_begins(self) -> Array:
        """(g,) time at which each goal begins [s]."""
        return np.array([float(goal.from_time) for goal in self.task.goals])

    def reached(self, t: Array, camera_error: Array, feature_error: Array, qd: Array) -> BoolArray:
        """Return (N,) flags: the current goal is reached, with the joints at rest.

        The camera's pose decides if it is the task's feature; otherwise the markers or the feature
        decide, see :attr:`.Feature.reached_by`. The arguments are times (N,) [s], distances [m] and
        angles [rad] of the camera from the goal (N, 2), errors of the image (N,) [px], see
        :class:`.Trajectory`, and joint speeds (N, n).
        """
        tolerance = self.goal_tolerances[goals_at(self.goal_begins, t)].T
        speed = np.abs(qd).max(axis=1)
        by_pose = isinstance(self.task.feature, CameraPose)
        is_reached: BoolArray = reached(
            camera_error[:, 0], camera_error[:, 1], feature_error, speed, tolerance, by_pose
        )
        return is_reached

    def clearance(self, t: Array, q: Array, qd: Array, pixels: Array, points: Array) -> Array:
        """Return the clearance (N, m) of each row at N samples.

        See :class:`vsconstraints.constraints.Trace` for the arguments.
        """
        return self.constraints.clearance(
            Trace(t, q, qd, pixels, points, self.scene.camera.size, self.scene)
        )

    def check_start(self, world: ControlStep | None = None) -> list[str]:
        """Check the start, and return remarks for a reader of the results, one sentence each.

        Raises ConfigurationError if a joint is outside its range; if a marker is behind the camera
        or outside the image; if the robot's own links hide a marker, as far as it has collision
        geometry and unless ``on_hidden_markers`` permits it; if an error is outside its funnel; or
        if the rows cannot be evaluated. Any other constraint may be violated at the start, because
        every controller is built to return. A goal that places markers where a constraint forbids
        them is no error either, although no controller can reach it. ``world`` is the result of
        :meth:`world`, if it already exists.
        """
        robot = self.scene.robot
        outside = robot.outside_ranges(self.q0)
        # implausible numbers are often the reason why a start fails
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
        # custom constraints may raise anything, and floating-point numbers may overflow
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
        remarks = [*self.doubts, *self.task.feature.remarks]
        remarks += hidden_at_start(self.scene, self.q0, self.on_hidden_markers == "refuse")
        rows = start.rows
        sigma = start.sigma
        first = 0
        numbers = np.column_stack((sigma, rows.phi, rows.Lf, rows.Lg))
        beyond = ~np.isfinite(numbers).all(axis=1)
        if beyond.any():
            labels = [rows.labels[i] for i in np.flatnonzero(beyond)]
            raise FloatingPointError(
                f"numbers beyond the range of floating point in {', '.join(listed(labels, 'rows'))}"
            )
        for constraint, count, _ in self.constraints.blocks():
            block = slice(first, first := first + count)
            refusal = constraint.refusal(sigma[block], rows.labels[block])
            if refusal:
                raise ConfigurationError(refusal)
        violated = np.flatnonzero(sigma > 0.0)
        outside = [
            f"{rows.labels[i]} is violated at the start: σ = {sigma[i]:.3g}" for i in violated
        ]
        remarks += listed(outside, "rows that are violated at the start")
        return remarks + self.forbidden + self.separated


def require_followed(setup: Setup, controller: Controller) -> None:
    """Raise ConfigurationError if a law commands speeds, and the arm any acceleration at once.

    An arm that takes accelerations without a limit would jump to the commanded speeds.
    """
    if setup.arm.streams or not commands_velocity(controller):
        return
    acceleration = setup.limits.of_joint("acceleration", setup.scene.robot.n)
    if not np.isfinite(acceleration).all():
        raise ConfigurationError(
            f"{controller.name} commands joint speeds, and the arm of this scene takes "
            f'accelerations without a limit: give arm = {{ command = "velocity", lag = 0.02, '
            f"acceleration = 8.0 }} with the arm's own numbers, or limits.acceleration. Of drawn "
            f'and frozen scenes, those of the condition "limited" have such limits'
        )
