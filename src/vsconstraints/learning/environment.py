"""Scenes as an environment of Gymnasium."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from ..compiled.samples import ALONE, LAW, STEP
from ..controllers import Controller, Tracking, make_controller
from ..errors import ConfigurationError
from ..rows import Array
from ..scenarios import Scenario
from ..scenarios.families import Family, families
from ..simulation import Prepared
from ..simulation.loop import Run
from .observation import ACCELERATION, Observer

SLACK = 1e-9  #: Rounding of times, as a share of a period.


class ServoEnv(gymnasium.Env[Array, Array]):  # type: ignore[misc]
    """The closed loop of a simulation, in which an action is what a law would command: compiled, one call a step.

    The observation is that of :class:`~vsconstraints.learning.observation.Observer`, of what the control believes. The
    action (n,) in [-1, 1] is q̈/a, or with ``law`` what is added to that law's q̈, by a. The reward of a step is

        (‖e_k‖ − ‖e_{k+1}‖)/‖e_0‖ − w T_s Σ_{σ_i > 0} (1 + min(σ_i/s_i, 1)) + 1 at success − 1 at failure,

    e being the task's error, and σ and s those of the rows as they are at k + 1; a new goal's error counts like any
    other. ``terminated`` at success, which is the last goal reached for as long as the scenario's tolerances say; and
    at failure, which is a state that cannot be evaluated, such as a marker behind the camera: the observation is then
    the last one. ``truncated`` at the end of the scene's duration. ``info`` has the ``scene``'s number, the time ``t``
    [s], ``violation``, the greatest σ/s of any row so far, and whether there is ``success``.

    ``reset(seed=…)`` draws one of the scenes, the same for the same seed; ``options={"scene": 3}`` names one. Each has
    its own noise, the same in every episode.

    Parameters
    ----------
    scenes
        A scenario, or a family of scenes, or the name of either.
    half, condition, count
        Of a family: of which half scenes are drawn, in what condition, and how many, from number 0.
    law
        The law that actions are added to, or its name; None for none.
    acceleration
        a where the scene states no limit of q̈ [rad/s² or m/s²].
    violation_weight
        w [1/s].

    Raises
    ------
    ConfigurationError
        if a scene is not compiled as a whole, or is of other sizes than the first one.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self,
        scenes: str | Path | Family | Scenario = "planar-arm",
        *,
        half: str = "training",
        condition: str = "nominal",
        count: int = 100,
        law: str | Controller | None = None,
        acceleration: float = ACCELERATION,
        violation_weight: float = 1.0,
    ) -> None:
        if isinstance(scenes, str | Path):
            scenes = Family.load(scenes) if str(scenes) in families() else Scenario.load(str(scenes))
        self.scenes, self.half, self.condition = scenes, half, condition
        self.count = count if isinstance(scenes, Family) else 1
        self.law, self._adds = (make_controller(law) if isinstance(law, str) else law) or Tracking(), law is not None
        self.acceleration, self.violation_weight = acceleration, violation_weight
        self._prepared: dict[int, Prepared] = {}
        self._begin(0)
        size, n = self._observe().shape, self._run.setup.scene.robot.n
        self.observation_space = gymnasium.spaces.Box(-1.0, 1.0, size, np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (n,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; see the class."""
        super().reset(seed=seed)
        number = (options or {}).get("scene")
        self._begin(int(self.np_random.integers(self.count)) if number is None else number)
        observation = self._observe()
        if observation.shape != self.observation_space.shape:
            expected = self.observation_space.shape
            raise ConfigurationError(
                f"scene {self.number} has observations of the shape {observation.shape}, scene 0 of {expected}"
            )
        return observation, self._info(False)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """One sampling period; see the class."""
        loop, setup, k = self._loop, self._run.setup, self._k
        qdd = self._observer.action * np.minimum(np.maximum(action, -1.0), 1.0)
        if self._adds:
            qdd += self.law.command(self._rows, self._task).qdd
        loop.answer.qdd[:] = qdd
        self._k, stage = self._run.run(k, k + 2, ALONE)
        if stage != LAW:
            return self._last, -1.0, True, False, self._info(False)
        sigma, before = self._sigma, self._error
        self._error = float(loop.task.error @ loop.task.error) ** 0.5
        reward = (before - self._error) / self._unit
        share = float(sigma.max()) if sigma.size else -np.inf
        if share > 0.0:
            shares = sigma[sigma > 0.0] / self._scale[sigma > 0.0]
            self._violation = max(self._violation, float(shares.max()))
            reward -= self.violation_weight * setup.Ts * float((1.0 + np.minimum(shares, 1.0)).sum())
        # the sample before is the last one that is judged
        success = k - max(int(loop.scores.unreached[-1]) + 1, self._last_goal) >= self._dwell
        return self._observe(), reward + success, success, self._k + 1 >= setup.samples, self._info(success)

    def _begin(self, number: int) -> None:
        """Go to the first sample of a scene."""
        self.number = number
        if number not in self._prepared:
            setup = (
                self.scenes.scene(number, self.half).setup(self.condition)
                if isinstance(self.scenes, Family)
                else self.scenes.setup()
            )
            setup.check_start()
            self._prepared[number] = Prepared(setup, self.law.factors)
        prepared = self._prepared[number]
        self._run = run = Run(prepared, self.law, whole=False, by_public_call=True)
        setup, self._loop = run.setup, run.loop
        self._k, stage = run.run(0, 1, STEP)
        if stage != LAW or prepared.bound is None or run.at_once == 1:
            raise ConfigurationError(
                f"{self.scenes.name}: an environment takes scenes whose step is compiled, without images, MuJoCo, and "
                "own parts in NumPy"
            )
        loop, robot, now = run.loop, setup.scene.robot, prepared.bound.now
        self._rows, self._task, self._sigma, self._scale = now.rows, now.task, loop.true.sigma, loop.true.scale
        self._observer = Observer(self._rows.scale, prepared.control.acceleration, robot.ranges, self.acceleration)
        self._error = float(np.linalg.norm(loop.task.error))
        self._unit, self._violation = self._error or 1.0, max(0.0, float((self._sigma / self._scale).max(initial=0.0)))
        self._last_goal = int(np.ceil(setup.goal_begins[-1] / setup.Ts - SLACK))
        self._dwell = setup.tolerances.dwell_s / setup.Ts - SLACK

    def _observe(self) -> Array:
        x = self._loop.plant.x
        self._last: Array = self._observer(self._rows, self._task, x[0], x[1]).astype(np.float32)
        return self._last

    def _info(self, success: bool) -> dict[str, Any]:
        t = self._k * self._run.setup.Ts
        return {"scene": self.number, "t": t, "violation": self._violation, "success": success}


gymnasium.register("vsconstraints/Servo-v0", entry_point=f"{__name__}:ServoEnv")
