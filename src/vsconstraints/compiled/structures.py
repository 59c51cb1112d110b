"""What the compiled step and the laws work on, by name: arrays of what is known and what comes out, and codes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple
from weakref import WeakValueDictionary

import numpy as np

from ..errors import InvalidInput
from ..formulas.limits import JointLimits
from ..rows import Array, BoolArray, IntArray
from .records import (
    BODY,
    CAMERA,
    CAMERA_MOTION,
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
    Records,
)

SOLVED, NEEDS_PYTHON, FAILED, INCOMPATIBLE, RANK_LOSS, RELAXED_ROWS, SHORT, RELAXED_SHORT = range(8)
"""Codes of compiled functions: the outputs hold the answer; the definition has to be asked; no answer passes the check;
rows contradict each other; active rows have lost full row rank. And of answers of the hierarchy: demands are unmet;
levels 2 and 3 may be better met; both."""

CAMERA_POSE, IMAGE_POINTS, OWN = range(3)
"""Features of the task."""

STRICT, NEAREST, WEIGHED, SCALED = range(4)
"""What the descent does below the rows: the task, and within it the least acceleration; the way to the command that
tracks, in the joints, or in the task with a little of the joints; the way to a share of that command."""


class RowArrays(NamedTuple):
    """See :class:`vsconstraints.rows.Rows`: (m,) each, L_gφ (m, n), and the box (n,) or (0,)."""

    phi: Array
    Lg: Array
    Lf: Array
    sigma: Array
    sigma_dot: Array
    K: Array
    switching_gain: Array
    scale: Array
    qdd_min: Array
    qdd_max: Array


class TaskArrays(NamedTuple):
    """A task as compiled laws take it; see :class:`vsconstraints.rows.Task`. J (k, n), rest (n,) or (0,), else (k,)."""

    J: Array
    b: Array
    error: Array
    error_rate: Array
    rest: Array


class Answer(NamedTuple):
    """What compiled laws write: q̈ (n,), which rows acted (m,), what they leave unmet (m,), and iterations (1,).

    Laws that measure no slack take (0,) for it. Those that find q̈ of tracking alone on the way write it to
    ``alone`` (n,), or (0,).
    """

    qdd: Array
    acted: BoolArray
    slack: Array
    iterations: IntArray
    alone: Array


class Scratch(NamedTuple):
    """Numbers, and (1,) how many of them are taken: whoever made it holds it until nothing taken is used any more."""

    numbers: Array
    taken: IntArray


class LawArrays(NamedTuple):
    """A compiled law: a demand and a resolver, each where its function begins, and what they work with.

    The law at an address is carried out by its ``resolver`` with :class:`RowArrays`, :class:`TaskArrays` and
    :class:`Answer`; see :mod:`vsconstraints.compiled.laws`. It returns ``SOLVED`` or another code of an answer, or
    ``NEEDS_PYTHON``: then nothing is remembered, and the controller's ``command`` has to be asked.

    Attributes
    ----------
    resolver, demand, track, otherwise
        Addresses; the third of :func:`.track`, the last of the resolver that answers
        where this one does not, or 0.
    tracks
        Whether the demand depends on what tracking alone does to the rows.
    period
        T_s [s], or NaN.
    options, parameters
        Of the resolver, and of the demand's formula.
    weights
        (m,) of the rows' violations, or (0,) where all are 1.
    memory
        (m, f) what the demand remembers of each row, or (0, 0).
    last_rates
        (m,) L_gφ q̈ of the answer before, or (0,) where the demand does not use it.
    squared, asked, after, tracked, effort
        Scratch: (m,) ‖L_gφ‖² of each row, (m,) what rows ask for, what is to be remembered, and of tracking alone
        (m,) L_gφ q̈ and (1,) ‖q̈‖.
    scratch
        For all else; it is empty whenever a law begins.
    """

    resolver: int
    demand: int
    track: int
    otherwise: int
    tracks: int
    period: float
    options: Array
    parameters: Array
    weights: Array
    memory: Array
    last_rates: Array
    squared: Array
    asked: Array
    after: Array
    tracked: Array
    effort: Array
    scratch: Scratch


class Step(NamedTuple):
    """All that the compiled step knows and makes, for m rows, n joints, M markers, P robot points and k features.

    Attributes
    ----------
    joints, camera, markers, robot_points, target
        The scene: (n,) JOINT, (1,) CAMERA, (M, 3) in the target's frame, (P,) POINT, (1,) TARGET.
    options, goals, goal_points, goal_interaction, posture
        The task: (1,) TASK, (g,) GOAL, (g, 2M) normalised markers, (g, 2M, 6) L, (n,) the joints' posture.
    parts, parameters, which, gradients, offsets
        The constraints: (c,) PART, (c, p) parameters of their formulas; for each row (m,) the marker or robot point,
        and of linear rows (m, n) the gradient and (m,) the constant.
    gradient_error, gradient_share
        What spoils gradients, if anything: (1,) GRADIENT_ERROR, (m, n) c_e s of eq. (49).
    time, q, qd
        (1,), (n,) and (n,): now.
    limits, last_command
        What limits q̈, if anything, and (n,) the command before, at first zero.
    last, last_error, last_partial, last_J, last_reference
        What the task remembers: (1,) SAMPLE, and of the sample before (k,) s less its value at the goal, (k,) ∂s/∂t,
        (k, n) J_s, and (3, k) s at the goal's first sample, s_ref, both likewise, and ṡ_ref.
    bodies, eye, target_R, target_t, camera_J, seen, places
        (n + 1,) BODY, (1,) CAMERA_MOTION, the target's pose in the base frame, (6, n) ∂(v, ω)/∂q̇ of the camera's twist
        relative to it, (M,) MARKER, (P,) PLACE.
    measurement, measured, correction
        What a detector says, if anything: (1,) MEASUREMENT, (M, 3) pixels and Z, NaN where it says nothing; (M, 2) by
        how much a marker was last seen beside where the model has it, in normalised coordinates.
    slip, bounds, innovation
        How far what is measured is from the model: (n,) see :func:`vsconstraints.formulas.innovation.slip`; (6,) bounds
        of what :data:`.INNOVATIONS` names; (7,) that, and its greatest ratio to its bounds.
    J_point, partial, drift
        Scratch: (3, n) the Jacobian of a point; (k,) ∂s/∂t, and s̈ when q̈ = 0.
    rows, task, pixels, points, camera_R, camera_t
        What comes out, with (M, 2) pixels, (P, 3) robot points, and the camera's pose in the target's frame.
    """

    joints: Records
    camera: Records
    markers: Array
    robot_points: Records
    target: Records
    options: Records
    goals: Records
    goal_points: Array
    goal_interaction: Array
    posture: Array
    parts: Records
    parameters: Array
    which: IntArray
    gradients: Array
    offsets: Array
    gradient_error: Records
    gradient_share: Array
    time: Array
    q: Array
    qd: Array
    limits: JointLimits
    last_command: Array
    last: Records
    last_error: Array
    last_partial: Array
    last_J: Array
    last_reference: Array
    bodies: Records
    eye: Records
    target_R: Array
    target_t: Array
    camera_J: Array
    seen: Records
    places: Records
    measurement: Records
    measured: Array
    correction: Array
    slip: Array
    bounds: Array
    innovation: Array
    J_point: Array
    partial: Array
    drift: Array
    rows: RowArrays
    task: TaskArrays
    pixels: Array
    points: Array
    camera_R: Array
    camera_t: Array


@dataclass(frozen=True)
class Size:
    """How many joints n, markers M, robot points P, rows m, features k, goals, constraints; and whether q̈ has a box.

    ``rests`` says whether the task has a q̈₀.
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
    def outputs(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of what a step comes to, in the order in which they stand in one array."""
        n, m, k, limits = self.n, self.m, self.k, self.n if self.limited else 0
        return {
            "qdd_min": (limits,), "qdd_max": (limits,),
            "phi": (m,), "Lg": (m, n), "Lf": (m,), "sigma": (m,), "sigma_dot": (m,),
            "J": (k, n), "b": (k,), "error": (k,), "error_rate": (k,), "rest": (n if self.rests else 0,),
            "pixels": (self.M, 2), "points": (self.P, 3), "camera_R": (3, 3), "camera_t": (3,),
        }  # fmt: skip

    def where(self) -> dict[str, slice]:
        """Where each output stands in that array."""
        ends = np.cumsum([int(np.prod(shape)) for shape in self.outputs.values()]).tolist()
        return {name: slice(a, b) for name, a, b in zip(self.outputs, [0, *ends[:-1]], ends, strict=True)}

    def step(self) -> tuple[Step, Array]:
        """A step of this size, of zeros, and the array that all its outputs are parts of."""
        n, M, P, m, k, zeros = self.n, self.M, self.P, self.m, self.k, np.zeros
        limited = n if self.limited else 0
        where = self.where()
        out = zeros(where["camera_t"].stop)
        view = {name: out[where[name]].reshape(shape) for name, shape in self.outputs.items()}
        rows = RowArrays(
            phi=view["phi"],
            Lg=view["Lg"],
            Lf=view["Lf"],
            sigma=view["sigma"],
            sigma_dot=view["sigma_dot"],
            K=zeros(m),
            switching_gain=zeros(m),
            scale=zeros(m),
            qdd_min=view["qdd_min"],
            qdd_max=view["qdd_max"],
        )
        task = TaskArrays(*(view[name] for name in TaskArrays._fields))
        step = Step(
            joints=zeros(n, JOINT),
            camera=zeros(1, CAMERA),
            markers=zeros((M, 3)),
            robot_points=zeros(P, POINT),
            target=zeros(1, TARGET),
            options=zeros(1, TASK),
            goals=zeros(self.goals, GOAL),
            goal_points=zeros((self.goals, 2 * M)),
            goal_interaction=zeros((self.goals, 2 * M, 6)),
            posture=zeros(n),
            parts=zeros(self.parts, PART),
            parameters=zeros((self.parts, self.parameters)),
            which=zeros(m, np.int64),
            gradients=zeros((m, n)),
            offsets=zeros(m),
            gradient_error=zeros(1, GRADIENT_ERROR),
            gradient_share=zeros((m, n)),
            time=zeros(1),
            q=zeros(n),
            qd=zeros(n),
            limits=JointLimits(*(zeros(limited),) * 5, ranges=0, period=1.0),
            last_command=zeros(n),
            last=zeros(1, SAMPLE),
            last_error=zeros(max(k, 6)),
            last_partial=zeros(k),
            last_J=zeros((k, n)),
            last_reference=zeros((3, k)),
            bodies=zeros(n + 1, BODY),
            eye=zeros(1, CAMERA_MOTION),
            target_R=zeros((3, 3)),
            target_t=zeros(3),
            camera_J=zeros((6, n)),
            seen=zeros(M, MARKER),
            places=zeros(P, PLACE),
            measurement=zeros(1, MEASUREMENT),
            measured=zeros((M, 3)),
            correction=zeros((M, 2)),
            slip=zeros(n),
            bounds=np.full(6, np.inf),
            innovation=zeros(7),
            J_point=zeros((3, n)),
            partial=zeros(k),
            drift=zeros(k),
            rows=rows,
            task=task,
            pixels=view["pixels"],
            points=view["points"],
            camera_R=view["camera_R"],
            camera_t=view["camera_t"],
        )
        step.bodies["R"][0] = np.eye(3)
        return step, out


class StructWords(np.ndarray[Any, np.dtype[np.int64]]):
    """The words from which compiled code reads a structure: see :func:`pack_struct`."""

    structure: Any
    in_python: Any = None


_packed: WeakValueDictionary[int, StructWords] = WeakValueDictionary()
"""What is packed, by the address of its words."""


def pack_struct(structure: Any) -> StructWords:
    """What compiled code reads a structure of arrays and numbers from: by the address where it begins.

    Arrays are not copied, and live as long as what is returned, which must live as long as its address is used.
    """
    words = np.array(_words(structure), dtype=np.int64).view(StructWords)
    words.structure = structure
    _packed[words.ctypes.data] = words
    return words


def demand_packed(address: int, kind: type) -> None:
    """Raise InvalidInput unless a structure of that class was packed at an address, and still lives."""
    words = _packed.get(address)
    if words is None or type(words.structure) is not kind:
        raise InvalidInput(f"there is no {kind.__name__} at the address {address}")


def packed_at(address: int) -> Any:
    """The structure that was packed at an address, with fields of records as attributes."""
    words = _packed[int(address)]
    if words.in_python is None:
        words.in_python = _with_records(words.structure)
    return words.in_python


def _with_records(part: Any) -> Any:
    if isinstance(part, tuple):
        return type(part)(*(_with_records(field) for field in part))
    return part.view(np.recarray) if isinstance(part, np.ndarray) and part.dtype.names else part


def _words(part: Any) -> list[int]:
    if isinstance(part, tuple):
        return [word for field in part for word in _words(field)]
    if isinstance(part, np.ndarray):
        # as numba has it: no owner, no parent, numbers, bytes of each, where they begin, shape and strides
        return [0, 0, part.size, part.itemsize, part.ctypes.data, *part.shape, *part.strides]
    return [int(np.float64(part).view(np.int64)) if isinstance(part, float) else int(part)]
