"""Environment of Gymnasium based on scenes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeGuard

import gymnasium
import numpy as np

from ...compiled.samples import ALONE, LAW, STEP
from ...controllers import Controller, Tracking, make_controller
from ...controllers.ranges import positive_number
from ...errors import ConfigurationError, format_value
from ...robots.geometry import vector
from ...rows import Array
from ...scenarios import Scenario
from ...simulation import RunWorkspace
from ...simulation.loop import Run
from ..families import Family, families
from .policy import ACCELERATION, Observer


class ServoEnv(gymnasium.Env[Array, Array]):  # type: ignore[misc]
    """Compiled closed loop of a simulation, in which an action replaces the command of a law.

    The observation is that of :class:`.Observer`, for the rows and task that a law would receive.
    The action (n,) in [-1, 1] is q̈/a. With a ``law`` it is the acceleration added to the law's q̈,
    divided by a. The reward of the step to sample k is

        (‖e_{k−1}‖ − ‖e_k‖)/‖e_0‖ − w T_s Σ_{σ_i > 0} (1 + min(σ_i/s_i, 1)) + 1 at success,

    with the task's error e and the rows' σ and s, and −1 at failure.

    An episode is ``terminated`` at success and at failure. Success means that the last goal has
    been reached for as long as the tolerances require. Failure means that the state cannot be
    evaluated, for example with a marker behind the camera; the observation is then the previous
    one. An episode is ``truncated`` at the end of the duration. ``info`` contains the number of the
    ``scene``, the time ``t`` [s], ``violation``, the greatest σ/s so far, and ``success``.
    ``reset(seed=…)`` draws one of the scenes, ``options={"scene": 3}`` selects one; its noise is
    always the same. Raises ConfigurationError if a scene cannot be compiled as a whole, or differs
    in size from the first one.

    Parameters
    ----------
    scenes
        A scenario, or a family of scenes, or the name of either.
    half, condition, count
        For a family: half and condition of the scenes, and their number, starting at scene 0.
    law
        The law to whose command actions are added, or its name; None for no law.
    acceleration
        a for joints without a limit of q̈ in the scene [rad/s² or m/s²].
    violation_weight
        w [1/s].
    """

    def __init__(
        self,
        scenes: str | Family | Scenario = "planar-arm",
        *,
        half: str = "training",
        condition: str = "nominal",
        count: int = 100,
        law: str | Controller | None = None,
        acceleration: float = ACCELERATION,
        violation_weight: float = 1.0,
    ) -> None:
        if isinstance(scenes, str):
            kind = Family if scenes in families() else Scenario
            scenes = kind.load(scenes)
        _require_usable(scenes, count, law)
        acceleration = positive_number("acceleration", acceleration)
        if violation_weight != 0.0:
            violation_weight = positive_number("violation_weight", violation_weight)
        self.scenes = scenes
        self.half = half
        self.condition = condition
        self.count = int(count)
        if isinstance(law, str):
            law = make_controller(law)
        self.law = law or Tracking()
        self.adds = law is not None
        self.acceleration = acceleration
        self.violation_weight = violation_weight
        self._prepared: dict[int, RunWorkspace] = {}
        self._begin(0)
        self.observation_space = gymnasium.spaces.Box(
            -1.0, 1.0, self._observation.shape, np.float32
        )
        action_shape = self._observer.action.shape
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, action_shape, np.float32)

    def _begin(self, number: int) -> None:
        """Go to the first sample of a scene."""
        scenes = self.scenes
        if number not in self._prepared:
            if isinstance(scenes, Family):
                setup = scenes.scene(number, self.half).setup(self.condition)
            else:
                setup = scenes.setup()
            setup.check_start()
            self._prepared[number] = RunWorkspace(setup, self.law.factors)
        self._scene = number
        prepared = self._prepared[number]
        self.run = run = Run(prepared, self.law, whole=False, by_public_call=True)
        setup = run.setup
        loop = run.loop
        self._violation = 0.0
        self._k, stage = run.run(0, 1, STEP)
        if prepared.bound is None or run.at_once == 1 or stage != LAW:
            raise ConfigurationError(
                f"{scenes.name}: the environment does not support images, MuJoCo or custom parts "
                "in NumPy"
            )
        now = prepared.bound.now
        self.seen = now.rows, now.task
        limits = prepared.control.acceleration
        ranges = setup.scene.robot.ranges
        self._observer = Observer(loop.rows.scale, limits, ranges, self.acceleration)
        self._look()
        self._unit = self._error or 1.0
        self._last_goal = _samples(setup.goal_begins[-1], setup.Ts)
        self._dwell = _samples(setup.tolerances.dwell_s, setup.Ts)

    def _look(self) -> None:
        """Update the observation and the error of a sample."""
        loop = self.run.loop
        rows, task = self.seen
        q, qd = loop.plant.x[:2]
        observation = self._observer(rows, task, q, qd)
        self._observation: Array = observation.astype(np.float32)
        error = loop.task.error
        self._error = float(error @ error) ** 0.5

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; see the class."""
        super().reset(seed=seed)
        count = 1
        drawn = 0
        if isinstance(self.scenes, Family):
            count = self.count
            drawn = int(self.np_random.integers(count))
        self._begin(_scene_number(self.scenes.name, options, drawn, count))
        if self._observation.shape != self.observation_space.shape:
            raise ConfigurationError(
                f"{self.scenes.name}: scene {self._scene} has observations of another size than "
                "scene 0"
            )
        return self._observation, self._info(False)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Simulate one sampling period; see the class.

        Raises InvalidInput unless the action consists of n finite numbers.
        """
        action = vector(action, len(self._observer.action), "an action")
        loop = self.run.loop
        k = self._k
        before = self._error
        qdd = self._observer.action * np.clip(action, -1.0, 1.0)
        if self.adds:
            qdd += self.law.command(*self.seen).qdd
        loop.answer.qdd[:] = qdd
        self._k, stage = self.run.run(k, k + 2, ALONE)
        if stage != LAW:
            return self._observation, -1.0, True, False, self._info(False)
        self._look()
        reward = (before - self._error) / self._unit - self._penalty()
        # sample k is the last judged sample
        first_reached = int(loop.scores.unreached[-1]) + 1
        dwell = k - max(first_reached, self._last_goal)
        success = dwell >= self._dwell
        is_truncated = self._k + 1 >= self.run.setup.samples
        return self._observation, reward + success, success, is_truncated, self._info(success)

    def _penalty(self) -> float:
        """Return the penalty on rows that are violated, and note the deepest violation."""
        true = self.run.loop.true
        is_violated = true.sigma > 0.0
        depths = (true.sigma / true.scale)[is_violated]
        if not depths.size:
            return 0.0
        deepest = float(depths.max())
        self._violation = max(self._violation, deepest)
        penalties = 1.0 + np.minimum(depths, 1.0)
        weight = self.violation_weight * self.run.setup.Ts
        return weight * float(penalties.sum())

    def _info(self, success: bool) -> dict[str, Any]:
        t = self._k * self.run.setup.Ts
        return {"scene": self._scene, "t": t, "violation": self._violation, "success": success}


def _require_usable(scenes: object, count: object, law: object) -> None:
    """Raise ConfigurationError unless the arguments can define an environment."""
    if not isinstance(scenes, Family | Scenario):
        raise ConfigurationError(
            f"scenes must be a scenario, a family, or the name of either, not "
            f"{format_value(scenes)}"
        )
    if not _is_integer(count) or count < 1:
        raise ConfigurationError(f"count must be an integer, 1 or more, not {format_value(count)}")
    if not (law is None or isinstance(law, str | Controller)):
        raise ConfigurationError(
            f"law must be a controller or the name of one, not {format_value(law)}"
        )


def _scene_number(name: str, options: object, drawn: int, count: int) -> int:
    """Return the scene that the options of ``reset`` name, or else the drawn one.

    Raises ConfigurationError for invalid options.
    """
    if options is not None and not isinstance(options, Mapping):
        raise ConfigurationError(
            f'{name}: options must be a table such as {{"scene": 3}}, not {format_value(options)}'
        )
    number = options.get("scene", drawn) if options else drawn
    if not _is_integer(number) or not 0 <= number < count:
        raise ConfigurationError(
            f"{name}: scene must be an integer from 0 to {count - 1}, since the environment has so "
            f"many scenes (count), not {format_value(number)}"
        )
    return int(number)


def _samples(time: float, period: float) -> int:
    """Return the number of samples until a time [s], up to rounding."""
    return int(np.ceil(time / period - 1e-6))


def _is_integer(value: object) -> TypeGuard[int]:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


gymnasium.register("vsconstraints/Servo-v0", entry_point=f"{__name__}:ServoEnv")
