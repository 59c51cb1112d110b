"""Arrays of compiled functions, declared once: every field with its type and shape.

A field ``Annotated[Array, F8, "m", "n"]`` is an array of that type and shape; letters are counts of
:class:`Size`. Records are arrays whose fields compiled code takes as attributes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple, get_type_hints
from weakref import WeakValueDictionary

import numpy as np

from ..errors import InvalidInput, format_value
from ..formulas.limits import JointLimits
from ..rows import Array, BoolArray, IntArray

#: Codes of compiled functions: solved; the NumPy version has to answer; no answer passes the check;
#: rows contradict each other; active rows have lost full row rank. Codes of the hierarchy: bounds
#: are violated; levels 2 and 3 may be improved; both.
SOLVED, NEEDS_PYTHON, FAILED, INCOMPATIBLE, RANK_LOSS, RELAXED_ROWS, SHORT, RELAXED_SHORT = range(8)
CAMERA_POSE, IMAGE_POINTS, OWN = range(3)  #: Features of the task.
#: Objectives below the rows: the task, then the least acceleration; the distance to the
#: unconstrained command, in joint space, or in task space with a small part in joint space; the
#: distance to a share of that command.
STRICT, NEAREST, WEIGHED, SCALED = range(4)
#: Options of a resolver: rank tolerance; of a hierarchy also greatest |q̈|, damping and objective;
#: of a saturation also 1 if it scales the task.
TOLERANCE, LIMIT, DAMPING, OBJECTIVE, SCALES = range(5)
STAGE = 1  #: Option of a law that looks ahead, whose only other option is the rank tolerance.
#: Gains of a predicted task: K_p(0), its slope and K_v/√K_p; d and (d/2)² of q̈₀.
KP0, KP_SLOPE, KV_FACTOR, REST_DAMPING, REST_STIFFNESS = range(5)
#: Entries of the innovation of a step: those of ``INNOVATIONS`` in
#: :mod:`vsconstraints.vision.measurement`, then the greatest ratio of one of them to its bound.
IMAGE, SHAPE, POSITION, ORIENTATION, AGE, SPEED, DEPTH, WORST = range(8)

Records = Any


def record(*fields: tuple[str, Any] | str) -> np.dtype[Any]:
    """Return a type of records of floats.

    A field is a name or (name, shape). ``#name`` is an integer, (name, type) another record.
    """
    columns: list[Any] = []
    for field in fields:
        name, shape = (field, ()) if isinstance(field, str) else field
        nested = isinstance(shape, np.dtype)
        columns.append(
            (name, shape) if nested else (name[1:], "i8") if name[0] == "#" else (name, "f8", shape)
        )
    return np.dtype(columns)


F8 = np.dtype("f8")
I8 = np.dtype("i8")
BOOL = np.dtype("?")
V3 = (3,)
M3 = (3, 3)
POSE = ("R", M3), ("t", V3)

#: d(t) of :class:`vsconstraints.vision.motion.Motion`; the third coordinate of a motion in the
#: image is zero.
MOTION = record(("velocity", V3), ("amplitude", V3), "rate", "phase")
#: Placement on the previous body, axis there, and 1 if the joint moves along it. ``continuous``: 1
#: if the joint turns without limits, so that its angles count modulo 2π.
JOINT = record(*POSE, ("axis", V3), "#prismatic", "#continuous")
#: Pose in the last body, or in the base frame if ``fixed``; pose of the tip in the last body; focal
#: lengths and offset of pixels; factor of believed depths.
CAMERA = record(
    *POSE, ("tip_R", M3), ("tip_t", V3), ("focal", (2,)), ("offset", (2,)), "depth_factor", "#fixed"
)
#: See :class:`vsconstraints.vision.motion.TargetMotion`.
TARGET = record("#moves", "#known", ("motion", MOTION), ("angular_velocity", V3), ("centre", V3))
#: Robot point: its body (0 is the base) and its place in the frame of that body.
POINT = record("#body", ("offset", V3))
#: See :class:`vsconstraints.vision.tracking.VisualTask`; ``share`` is the share of the goal's L: 0,
#: 1 or a half.
TASK = record(
    "#feature",
    "share",
    "#drift_by_differences",
    "#velocity_by_differences",
    "#reference_by_differences",
    "Kp0",
    "slope",
    "damping",
    "rest_damping",
    "rest_stiffness",
)
#: Start time of a goal, duration in which s_ref gets there (0: at once), and the camera's pose
#: there.
GOAL = record("from_time", "reach_in", *POSE)
#: Constraint: function of its rows; first row and number of rows; K; margin; frame of its formula
#: (in the image R[:2, :2] and t[:2]); motion of the forbidden region.
PART = record(
    "#address", "#first", "#count", "K", "margin", *POSE, "#moves", "#known", ("motion", MOTION)
)
#: Body in the base frame, for q̈ = 0: orientation, origin, axis of its joint, ω, v of the origin,
#: ω̇, v̇.
BODY = record(
    ("R", M3),
    ("origin", V3),
    ("axis", V3),
    ("angular_velocity", V3),
    ("velocity", V3),
    ("angular_acceleration", V3),
    ("acceleration", V3),
)
#: Marker in the image: normalised coordinates, their first and, for q̈ = 0, second derivative, and
#: Z.
MARKER = record(("xy", (2,)), ("velocity", (2,)), ("drift", (2,)), "depth")
#: Robot point in the base frame, its velocity and, for q̈ = 0, its acceleration.
PLACE = record(("position", V3), ("velocity", V3), ("drift", V3))
#: Camera: orientation and origin in the base frame; v, ω, v̇ and ω̇ (for q̈ = 0) relative to the
#: target, in the camera's axes.
EYE = record(
    ("R", M3),
    ("origin", V3),
    ("velocity", V3),
    ("angular_velocity", V3),
    ("acceleration", V3),
    ("angular_acceleration", V3),
)
#: 1 if pixels are measured, 1 if the camera's pose is measured, and the time of the measurement.
MEASUREMENT = record("#given", "#pose_given", "time")
#: Camera's pose in the target's frame at some time, as far as the motion is known.
VIEW = record("time", ("R", M3), ("t", V3))
#: Function that applies an error to gradients, or 0; 1 if it applies to φ and L_fφ too.
GRADIENT_ERROR = record("#address", "#in_phi")
#: Previous sample; goal −1 if there is none; time of its goal's first sample; number of views so
#: far.
SAMPLE = record("time", "#goal", "began", "#views")
#: Addresses that a closed loop uses, 0 where Python does the work: function that evaluates a step;
#: step of the controller and of the simulated world; law, and law of the unconstrained baseline;
#: function that writes measurements to the controller's step, and its workspace; function that
#: moves a plant without a transition matrix, and its workspace.
LOOP_PARTS = record(
    "#evaluate",
    "#believed",
    "#true",
    "#law",
    "#baseline",
    "#observe",
    "#sensing",
    "#move",
    "#plant",
)
VIEWS = 256  #: Number of samples whose camera pose is stored.


class RowArrays(NamedTuple):
    """Arrays of :class:`vsconstraints.rows.Rows`."""

    phi: Annotated[Array, F8, "m"]
    Lg: Annotated[Array, F8, "m", "n"]
    Lf: Annotated[Array, F8, "m"]
    sigma: Annotated[Array, F8, "m"]
    sigma_dot: Annotated[Array, F8, "m"]
    K: Annotated[Array, F8, "m"]
    switching_gain: Annotated[Array, F8, "m"]
    scale: Annotated[Array, F8, "m"]
    qdd_min: Annotated[Array, F8, "limits"]
    qdd_max: Annotated[Array, F8, "limits"]


class TaskArrays(NamedTuple):
    """Arrays of :class:`vsconstraints.rows.Task`."""

    J: Annotated[Array, F8, "k", "n"]
    b: Annotated[Array, F8, "k"]
    error: Annotated[Array, F8, "k"]
    error_rate: Annotated[Array, F8, "k"]
    rest: Annotated[Array, F8, "rest"]
    qd: Annotated[Array, F8, "n"]


class Answer(NamedTuple):
    """Output of compiled laws: q̈, active rows, slack, iterations, and unconstrained q̈.

    Laws that measure no slack take (0,) for it. Laws that compute the unconstrained q̈ on the way
    write it to ``alone``, unless that is (0,).
    """

    qdd: Annotated[Array, F8, "n"]
    acted: Annotated[BoolArray, BOOL, "m"]
    slack: Annotated[Array, F8, "m"]
    iterations: Annotated[IntArray, I8, 1]
    alone: Annotated[Array, F8, "n"]


class Scratch(NamedTuple):
    """Numbers for temporary arrays, and the number of them that are taken.

    The creator has to hold the array as long as any part of it is in use.
    """

    numbers: Annotated[Array, F8, 1]
    taken: Annotated[IntArray, I8, 1]


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
    options: Annotated[Array, F8, 1]
    parameters: Annotated[Array, F8, 1]
    #: (m,) weights of the rows' violations, or (0,) if all are 1.
    weights: Annotated[Array, F8, "m"]
    memory: Annotated[Array, F8, "m", 1]  #: (m, f) memory of the demand for each row, or (0, 0).
    #: (m,) L_gφ q̈ of the previous answer, or (0,) if the demand does not use it.
    last_rates: Annotated[Array, F8, "m"]
    #: (n,) last commanded q̇ of a law that commands joint speeds, NaN before the first; (0,) of
    #: others, whose q̈ is clipped to the box of the rows.
    speeds: Annotated[Array, F8, "n"]
    #: Scratch: (m,) ‖L_gφ‖² of each row, (m,) bounds, the next memory, and (m,) L_gφ q̈ and (1,)
    #: ‖q̈‖ of the unconstrained command.
    squared: Annotated[Array, F8, "m"]
    asked: Annotated[Array, F8, "m"]
    after: Annotated[Array, F8, "m", 1]
    tracked: Annotated[Array, F8, "m"]
    effort: Annotated[Array, F8, 1]
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
    camera: Annotated[Records, CAMERA, 1]
    markers: Annotated[Array, F8, "M", 3]  # in the target's frame
    robot_points: Annotated[Records, POINT, "P"]
    target: Annotated[Records, TARGET, 1]
    # task: normalised markers and L of each goal; the joints' posture
    options: Annotated[Records, TASK, 1]
    goals: Annotated[Records, GOAL, "goals"]
    goal_points: Annotated[Array, F8, "goals", "2M"]
    goal_interaction: Annotated[Array, F8, "goals", "2M", 6]
    posture: Annotated[Array, F8, "n"]
    # constraints: parameters of their formulas; marker or robot point of each row; gradient and
    # constant of linear rows; middle of the range of rows on a continuous joint, NaN elsewhere
    parts: Annotated[Records, PART, "parts"]
    parameters: Annotated[Array, F8, "parts", "parameters"]
    which: Annotated[IntArray, I8, "m"]
    gradients: Annotated[Array, F8, "m", "n"]
    offsets: Annotated[Array, F8, "m"]
    middles: Annotated[Array, F8, "m"]
    # error of gradients, with c_e s of eq. (49)
    gradient_error: Annotated[Records, GRADIENT_ERROR, 1]
    gradient_share: Annotated[Array, F8, "m", "n"]
    # current time and state, limits of q̈, and the previous command
    time: Annotated[Array, F8, 1]
    q: Annotated[Array, F8, "n"]
    qd: Annotated[Array, F8, "n"]
    limits: JointLimits
    last_command: Annotated[Array, F8, "n"]
    # memory of the task: previous sample, its s minus the value at the goal, ∂s/∂t and J_s; s at
    # the goal's first sample and s_ref, both minus the value at the goal, and ṡ_ref
    last: Annotated[Records, SAMPLE, 1]
    last_error: Annotated[Array, F8, "k or 6"]
    last_partial: Annotated[Array, F8, "k"]
    last_J: Annotated[Array, F8, "k", "n"]
    last_reference: Annotated[Array, F8, 3, "k"]
    # bodies and camera; the target's pose in the base frame; ∂(v, ω)/∂q̇ of the camera's twist
    # relative to it
    bodies: Annotated[Records, BODY, "n + 1"]
    eye: Annotated[Records, EYE, 1]
    target_R: Annotated[Array, F8, 3, 3]
    target_t: Annotated[Array, F8, 3]
    camera_J: Annotated[Array, F8, 6, "n"]
    seen: Annotated[Records, MARKER, "M"]
    places: Annotated[Records, PLACE, "P"]
    # camera in the last samples according to the model, a ring buffer, and at the time of the
    # image; measured pixels and Z, NaN if missing; last measured offset of a marker from the model,
    # in normalised coordinates
    views: Annotated[Records, VIEW, VIEWS]
    then: Annotated[Records, VIEW, 1]
    measurement: Annotated[Records, MEASUREMENT, 1]
    measured: Annotated[Array, F8, "M", 3]
    correction: Annotated[Array, F8, "M", 2]
    # ratio of a marker's measured Z to that of the model; NaN if none is measured
    depth_ratio: Annotated[Array, F8, "M"]
    # innovation: formulas.innovation.slip; bounds of vision.measurement.INNOVATIONS; the values,
    # and their greatest ratio to the bounds
    slip: Annotated[Array, F8, "n"]
    bounds: Annotated[Array, F8, 7]
    innovation: Annotated[Array, F8, 8]
    # scratch: the Jacobian of a point; ∂s/∂t; s̈ for q̈ = 0
    J_point: Annotated[Array, F8, 3, "n"]
    partial: Annotated[Array, F8, "k"]
    drift: Annotated[Array, F8, "k"]
    # output, with robot points in the base frame and the camera's pose in the target's frame
    rows: RowArrays
    task: TaskArrays
    pixels: Annotated[Array, F8, "M", 2]
    points: Annotated[Array, F8, "P", 3]
    camera_R: Annotated[Array, F8, 3, 3]
    camera_t: Annotated[Array, F8, 3]


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


@cache
def fields(kind: Any) -> dict[str, Any]:
    """Return the declared types of a structure's fields, by name."""
    return get_type_hints(kind, include_extras=True)


def shape_of(declared: Any, lengths: Mapping[str, int]) -> tuple[int, ...]:
    """Return the shape of a declared array; a letter that ``lengths`` lacks stands for 1."""
    _, *shape = declared.__metadata__
    return tuple([length if type(length) is int else lengths.get(length, 1) for length in shape])


def zeros(
    kind: Any, lengths: Mapping[str, int] | None = None, known: Mapping[str, Any] | None = None
) -> Any:
    """Return a structure of zeros, with arrays of their declared types and shapes.

    ``known`` contains fields that exist already. ``lengths`` are those of the letters in the
    declarations; see :func:`shape_of`.
    """
    values = dict(known or {})
    lengths = lengths or {}
    for name, declared in fields(kind).items():
        if name in values:
            continue
        if hasattr(declared, "__metadata__"):
            values[name] = np.zeros(shape_of(declared, lengths), declared.__metadata__[0])
        elif declared in (int, float):
            values[name] = declared(0)
        elif declared is JointLimits:
            values[name] = JointLimits(
                *(np.zeros(lengths.get("limits", 1)),) * 5, ranges=0, period=1.0
            )
        else:
            values[name] = zeros(declared, lengths, known)
    return kind(**{name: values[name] for name in kind._fields})


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
        """Lengths of the letters in declarations."""
        n = self.n
        M = self.M
        k = self.k
        counts = {
            "n + 1": n + 1,
            "2M": 2 * M,
            "k or 6": max(k, 6),
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
        out = np.zeros(outputs[OUTPUTS[-1]][0].stop)
        views = {name: out[place].reshape(shape) for name, (place, shape) in outputs.items()}
        step: Step = zeros(
            Step, self.lengths, views if limits is None else {**views, "limits": limits}
        )
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


#: Memory of an array with d dimensions: where its numbers begin, and its shape.
ARRAYS = [np.dtype([("address", "i8"), ("shape", "i8", (d,))]) for d in range(5)]


def _is_float(structure: Any, name: str) -> bool:
    """True if a number of a structure is a float, even if an integer was given for it."""
    kind: Any = type(structure)
    return fields(kind).get(name) is float or isinstance(getattr(structure, name), float)


def memory_layout(structure: Any) -> np.dtype[Any]:
    """Return the record that holds a structure: its numbers, records and references to arrays."""
    columns: list[Any] = []
    for name in structure._fields:
        part = getattr(structure, name)
        if isinstance(part, tuple):
            columns.append((name, memory_layout(part)))
        elif isinstance(part, np.ndarray):
            columns.append((name, ARRAYS[part.ndim]))
        else:
            columns.append((name, "f8" if _is_float(structure, name) else "i8"))
    return np.dtype(columns)


def _memory(structure: Any) -> tuple[Any, ...]:
    """Return the values of the record that holds a structure."""
    values: list[Any] = []
    for part in structure:
        if isinstance(part, tuple):
            values.append(_memory(part))
        elif isinstance(part, np.ndarray):
            if not part.flags.c_contiguous:
                raise InvalidInput("compiled functions take contiguous arrays only")
            values.append((part.ctypes.data, part.shape))
        else:
            values.append(part)
    return tuple(values)


#: Workspaces by their addresses.
_workspaces: WeakValueDictionary[int, Workspace] = WeakValueDictionary()


class Workspace:
    """Structure (a named tuple) that compiled functions take by its address.

    Its arrays are not copied. Functions that take a workspace check its kind. It lives as long as a
    user holds it.
    """

    __slots__ = ("__weakref__", "_in_python", "_record", "address", "structure")

    def __init__(self, structure: Any) -> None:
        self._record = np.array([_memory(structure)], dtype=memory_layout(structure))
        self.structure = structure
        self.address = int(self._record.ctypes.data)
        self._in_python: Any = None
        _workspaces[self.address] = self

    def in_python(self) -> Any:
        """Return the structure as functions that run in Python take it."""
        if self._in_python is None:
            self._in_python = _in_python(self.structure)
        return self._in_python


def require_workspace(given: object, kind: type, function: str) -> int:
    """Return the address of a workspace of the given kind of structure.

    Raise InvalidInput, which names the function, for anything else.
    """
    if isinstance(given, Workspace) and type(given.structure) is kind:
        return given.address
    what = type(given.structure).__name__ if isinstance(given, Workspace) else format_value(given)
    raise InvalidInput(f"{function} takes a workspace of {kind.__name__}, not {what}")


def structure_at(address: int) -> Any:
    """Return the structure of the workspace at an address, for functions that run in Python."""
    return _workspaces[int(address)].in_python()


def _in_python(part: Any) -> Any:
    """Return a structure whose fields can be set, with fields of records as attributes."""
    if isinstance(part, tuple):
        fields = part._asdict()  # type: ignore[attr-defined]
        return SimpleNamespace(**{name: _in_python(field) for name, field in fields.items()})
    return part.view(np.recarray) if isinstance(part, np.ndarray) and part.dtype.names else part
