"""Arrays of compiled functions, declared once: every field with its type and shape.

A field ``Annotated[Array, "m n"]`` is an array of that type with the axes m and n, whose lengths
are those of :class:`Size`. :mod:`.memory` makes the arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, NamedTuple

import numpy as np

from ..formulas.limits import JointLimits
from ..rows import Array, BoolArray, IntArray
from .memory import fields, shape_of, zeros
from .records import (
    BODY,
    CAMERA,
    EYE,
    GOAL,
    GRADIENT_ERROR,
    JOINT,
    MARKER,
    MEASUREMENT,
    PART,
    PLACE,
    POINT,
    SAMPLE,
    TARGET,
    TASK,
    VIEW,
    VIEWS,
    Records,
)


class RowArrays(NamedTuple):
    """Arrays of :class:`vsconstraints.rows.Rows`."""

    phi: Annotated[Array, "m"]
    Lg: Annotated[Array, "m n"]
    Lf: Annotated[Array, "m"]
    sigma: Annotated[Array, "m"]
    sigma_dot: Annotated[Array, "m"]
    K: Annotated[Array, "m"]
    switching_gain: Annotated[Array, "m"]
    scale: Annotated[Array, "m"]
    qdd_min: Annotated[Array, "limits"]
    qdd_max: Annotated[Array, "limits"]


class TaskArrays(NamedTuple):
    """Arrays of :class:`vsconstraints.rows.Task`."""

    J: Annotated[Array, "k n"]
    b: Annotated[Array, "k"]
    error: Annotated[Array, "k"]
    error_rate: Annotated[Array, "k"]
    rest: Annotated[Array, "rest"]
    qd: Annotated[Array, "n"]


class Answer(NamedTuple):
    """Output of compiled laws: q̈, active rows, slack, iterations, and unconstrained q̈.

    Laws that measure no slack take (0,) for it. Laws that compute the unconstrained q̈ on the way
    write it to ``alone``, unless that is (0,).
    """

    qdd: Annotated[Array, "n"]
    acted: Annotated[BoolArray, "m"]
    slack: Annotated[Array, "m"]
    iterations: Annotated[IntArray, "1"]
    alone: Annotated[Array, "n"]


class Scratch(NamedTuple):
    """Numbers for temporary arrays, and the number of them that are taken.

    The creator has to hold the array as long as any part of it is in use.
    """

    numbers: Annotated[Array, "1"]
    taken: Annotated[IntArray, "1"]


class LawArrays(NamedTuple):
    """Compiled law: addresses of its demand and resolver, and their arrays.

    The ``resolver`` is called with the law, :class:`RowArrays`, :class:`TaskArrays` and
    :class:`Answer`; see :mod:`vsconstraints.compiled.laws`. It returns a code. With
    ``NEEDS_PYTHON`` nothing is stored, and the controller's ``command`` has to be called.
    """

    #: Addresses; the third is that of :func:`.track`, the last that of the resolver that answers if
    #: this one does not, or 0.
    resolver: int
    demand: int
    track: int
    otherwise: int
    tracks: int  #: 1 if the demand depends on the effect of the unconstrained command on the rows.
    period: float  #: T_s [s], or NaN.
    #: Options of the resolver, and parameters of the demand's formula.
    options: Annotated[Array, "1"]
    parameters: Annotated[Array, "1"]
    #: (m,) weights of the rows' violations, or (0,) if all are 1.
    weights: Annotated[Array, "m"]
    memory: Annotated[Array, "m 1"]  #: (m, f) memory of the demand for each row, or (0, 0).
    #: (m,) L_gφ q̈ of the previous answer, or (0,) if the demand does not use it.
    last_rates: Annotated[Array, "m"]
    #: (n,) last commanded q̇ of a law that commands joint speeds, NaN before the first; (0,) of
    #: others, whose q̈ is clipped to the box of the rows.
    speeds: Annotated[Array, "n"]
    #: Scratch: (m,) ‖L_gφ‖² of each row, (m,) bounds, the next memory, and (m,) L_gφ q̈ and (1,)
    #: ‖q̈‖ of the unconstrained command.
    squared: Annotated[Array, "m"]
    asked: Annotated[Array, "m"]
    after: Annotated[Array, "m 1"]
    tracked: Annotated[Array, "m"]
    effort: Annotated[Array, "1"]
    scratch: Scratch  #: Scratch for everything else; empty whenever a law begins.
    #: Input and output of the current call, if they are not those of a step or of a loop.
    rows: RowArrays
    task: TaskArrays
    answer: Answer


class Step(NamedTuple):
    """Input, memory, scratch and output of the compiled step.

    It has m rows, n joints, M markers, P points and k features.
    """

    # function that evaluates the step; scene
    evaluate: int
    joints: Annotated[Records, JOINT, "n"]
    camera: Annotated[Records, CAMERA, "1"]
    markers: Annotated[Array, "M 3"]  # in the target's frame
    robot_points: Annotated[Records, POINT, "P"]
    target: Annotated[Records, TARGET, "1"]
    # task: normalised markers and L of each goal; the joints' posture
    options: Annotated[Records, TASK, "1"]
    goals: Annotated[Records, GOAL, "goals"]
    goal_points: Annotated[Array, "goals 2M"]
    goal_interaction: Annotated[Array, "goals 2M 6"]
    posture: Annotated[Array, "n"]
    # constraints: parameters of their formulas; marker or robot point of each row; gradient and
    # constant of linear rows; middle of the range of rows on a continuous joint, NaN elsewhere
    parts: Annotated[Records, PART, "parts"]
    parameters: Annotated[Array, "parts parameters"]
    which: Annotated[IntArray, "m"]
    gradients: Annotated[Array, "m n"]
    offsets: Annotated[Array, "m"]
    middles: Annotated[Array, "m"]
    # error of gradients, with c_e s of eq. (49)
    gradient_error: Annotated[Records, GRADIENT_ERROR, "1"]
    gradient_share: Annotated[Array, "m n"]
    # current time and state, limits of q̈, and the previous command
    time: Annotated[Array, "1"]
    q: Annotated[Array, "n"]
    qd: Annotated[Array, "n"]
    limits: JointLimits
    last_command: Annotated[Array, "n"]
    # memory of the task: previous sample, its s minus the value at the goal, ∂s/∂t and J_s; s at
    # the goal's first sample and s_ref, both minus the value at the goal, and ṡ_ref
    last: Annotated[Records, SAMPLE, "1"]
    last_error: Annotated[Array, "k_or_6"]
    last_partial: Annotated[Array, "k"]
    last_J: Annotated[Array, "k n"]
    last_reference: Annotated[Array, "3 k"]
    # bodies and camera; the target's pose in the base frame; ∂(v, ω)/∂q̇ of the camera's twist
    # relative to it
    bodies: Annotated[Records, BODY, "n+1"]
    eye: Annotated[Records, EYE, "1"]
    target_R: Annotated[Array, "3 3"]
    target_t: Annotated[Array, "3"]
    camera_J: Annotated[Array, "6 n"]
    seen: Annotated[Records, MARKER, "M"]
    places: Annotated[Records, PLACE, "P"]
    # camera in the last samples according to the model, a ring buffer, and at the time of the
    # image; measured pixels and Z, NaN if missing; last measured offset of a marker from the model,
    # in normalised coordinates
    views: Annotated[Records, VIEW, VIEWS]
    then: Annotated[Records, VIEW, "1"]
    measurement: Annotated[Records, MEASUREMENT, "1"]
    measured: Annotated[Array, "M 3"]
    correction: Annotated[Array, "M 2"]
    # ratio of a marker's measured Z to that of the model; NaN if none is measured
    depth_ratio: Annotated[Array, "M"]
    # innovation: formulas.innovation.slip; bounds of vision.measurement.INNOVATIONS; the values,
    # and their greatest ratio to the bounds
    slip: Annotated[Array, "n"]
    bounds: Annotated[Array, "7"]
    innovation: Annotated[Array, "8"]
    # scratch: the Jacobian of a point; ∂s/∂t; s̈ for q̈ = 0
    J_point: Annotated[Array, "3 n"]
    partial: Annotated[Array, "k"]
    drift: Annotated[Array, "k"]
    # output, with robot points in the base frame and the camera's pose in the target's frame
    rows: RowArrays
    task: TaskArrays
    pixels: Annotated[Array, "M 2"]
    points: Annotated[Array, "P 3"]
    camera_R: Annotated[Array, "3 3"]
    camera_t: Annotated[Array, "3"]


#: Outputs of a step, in the order in which they stand in one array.
OUTPUTS = (
    "qdd_min",
    "qdd_max",
    "phi",
    "Lg",
    "Lf",
    "sigma",
    "sigma_dot",
    "J",
    "b",
    "error",
    "error_rate",
    "rest",
    "qd",
    "pixels",
    "points",
    "camera_R",
    "camera_t",
)


@dataclass(frozen=True)
class Size:
    """Numbers of joints n, markers M, robot points P, rows m, features k, goals and constraints.

    ``parts`` is the number of constraints, ``parameters`` that of their parameters. ``limited`` is
    True if q̈ has a box, ``rests`` if the task has a q̈₀.
    """

    n: int = 1
    M: int = 0
    P: int = 0
    m: int = 0
    k: int = 0
    goals: int = 1
    parts: int = 0
    parameters: int = 0
    limited: bool = False
    rests: bool = False

    @property
    def lengths(self) -> dict[str, int]:
        """Lengths of the axes in declarations."""
        n = self.n
        M = self.M
        k = self.k
        counts = {
            "n+1": n + 1,
            "2M": 2 * M,
            "k_or_6": max(k, 6),
            "limits": n * self.limited,
            "rest": n * self.rests,
        }
        return {**vars(self), **counts}

    @property
    def outputs(self) -> dict[str, tuple[slice, tuple[int, ...]]]:
        """Place in the array of outputs, and shape, of each output."""
        return _outputs(self)

    def step(self, limits: JointLimits | None = None) -> tuple[Step, Array]:
        """Return a step of this size, of zeros, and the array that contains all its outputs."""
        outputs = self.outputs
        last_place, _ = outputs[OUTPUTS[-1]]
        out = np.zeros(last_place.stop)
        known: dict[str, Any] = {}
        for name, (place, shape) in outputs.items():
            known[name] = out[place].reshape(shape)
        if limits is not None:
            known["limits"] = limits
        step: Step = zeros(Step, self.lengths, known)
        step.bodies["R"][0] = np.eye(3)
        step.bounds[:] = np.inf
        return step, out


@lru_cache(maxsize=256)
def _outputs(size: Size) -> dict[str, tuple[slice, tuple[int, ...]]]:
    """Return the place of each output in the vector of all outputs, and its shape."""
    declared = {**fields(Step), **fields(RowArrays), **fields(TaskArrays)}
    places = {}
    begin = 0
    for name in OUTPUTS:
        shape = shape_of(declared[name], size.lengths)
        end = begin + int(np.prod(shape))
        places[name] = slice(begin, end), shape
        begin = end
    return places
