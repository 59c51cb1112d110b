"""Laws that command joint speeds, compiled: see :mod:`vsconstraints.velocity`.

They are called like any law. The joint speeds q̇ are written to ``speeds`` of :class:`.LawArrays`,
and q̈, the change from the speeds commanded before, to the answer. A closed loop replaces this q̈
by the change from the speeds of the robot (``go_to_speeds`` in ``compiled/samples.py``).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from ...compiled.codes import NEEDS_PYTHON, SOLVED, TOLERANCE
from ...compiled.compiler import compiled, in_place, inner
from ...compiled.laws import (
    RESOLVER,
    answer_without_baseline,
    apply_law,
    bounds,
    is_answer,
    load_law,
)
from ...compiled.linear import finite, largest_magnitude
from ...compiled.memory import zeros
from ...compiled.parts import call_int_pointer, set_fields, struct_loader
from ...compiled.resolving import checkable, valid
from ...compiled.scratch import emptied, matrix, vector
from ...compiled.workspace import Answer, LawArrays, RowArrays, Scratch, TaskArrays
from ...formulas.projection import CLOSED, OPENED, opening
from ...formulas.velocity import adaptive_gain, damped_bound, rate_factor
from ...rows import Array, BoolArray


class SpeedArrays(NamedTuple):
    """Options of a law that commands joint speeds, and its quadratic program.

    ``program`` is the address of the law that solves the program, with speeds in place of
    accelerations; 0 if there is none. ``rows``, ``task`` and ``answer`` are those of the program.
    """

    program: int
    period: float  #: T_s [s].
    #: λ_∞, λ₀ and −λ'₀ of :func:`.adaptive_gain`; the first two are the same for a constant gain.
    gain: float
    gain_at_zero: float
    slope_at_zero: float
    task_weights: Annotated[Array, "k"]  #: Diagonal of W; (0,) for 1.
    damping: float  #: μ; 0 for a program without.
    #: Greatest |q̈| between two commands, NaN for those of the rows; least and greatest q̇ that it
    #: allows, (0,) each without a limit.
    acceleration: float
    least: Annotated[Array, "n"]
    greatest: Annotated[Array, "n"]
    #: ξ, d_i and d_s of velocity dampers; 0 of other laws.
    speed: float
    influence: float
    security: float
    #: Options of the avoidance, 0 of other laws; and the (m,) rows that are avoided, or (0,).
    zone: float
    full: float
    tune: float
    avoided: Annotated[BoolArray, "m"]
    scratch: Scratch
    rows: RowArrays
    task: TaskArrays
    answer: Answer


load_speeds = struct_loader(zeros(SpeedArrays))


@in_place
def complete(
    own: SpeedArrays, law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer
) -> bool:
    """True if rows and task are :func:`.valid` and contain everything that the law uses."""
    k, n = task.J.shape
    m = rows.phi.size
    if task.qd.size != n or law.speeds.size != n:
        return False
    if task.error.size != k or task.error_rate.size != k:
        return False
    has_weights = own.task_weights.size > 0
    if has_weights and own.task_weights.size != k:
        return False
    uses_sigma = own.speed > 0.0 or own.zone > 0.0
    if uses_sigma and (rows.sigma.size != m or rows.K.size != m):
        return False
    return valid(law, rows, task, answer)


@in_place
def speed_before(law: LawArrays, task: TaskArrays, j: int) -> float:
    """Return the last commanded q̇ of joint j, or the present one if there was no command."""
    last: float = law.speeds[j]
    return task.qd[j] if math.isnan(last) else last


@in_place
def write_task(own: SpeedArrays, task: TaskArrays, v: Array) -> None:
    """Write v = −λ e − ∂s/∂t (k,) of the task J q̇ = v, with ∂s/∂t = ė − J q̇."""
    error = task.error
    gain = adaptive_gain(largest_magnitude(error), own.gain_at_zero, own.gain, own.slope_at_zero)
    for i in range(error.size):
        total = -task.error_rate[i] - gain * error[i]
        for j in range(task.qd.size):
            total += task.J[i, j] * task.qd[j]
        v[i] = total


@inner
def command_speeds(
    own: SpeedArrays, law: LawArrays, rows: RowArrays, task: TaskArrays, answer: Answer
) -> bool:
    """Store the q̇ that stands in ``answer.qdd``, and replace it there by q̈.

    q̈ is the change from the speeds before, per second. Return False, with no speeds stored, if a
    number is not finite or the answer is not :func:`.checkable`.
    """
    qdd = answer.qdd
    n = qdd.size
    speeds = vector(own.scratch, n)
    for j in range(n):
        speeds[j] = qdd[j]
        qdd[j] = (qdd[j] - speed_before(law, task, j)) / own.period
    if not (finite(speeds) and checkable(law, rows, qdd)):
        return False
    for j in range(n):
        law.speeds[j] = speeds[j]
    return True


@in_place
def resolve_rate(law: LawArrays, task: TaskArrays, v: Array, qd: Array) -> None:
    """Write J†v (n,), with the law's rank tolerance."""
    tolerance = law.options[TOLERANCE]
    no_rest = task.rest[:0]
    call_int_pointer(law.track, (law.scratch, task.J, v, tolerance, no_rest, qd))


@compiled(RESOLVER, from_python=False)
def resolved_rate(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.ResolvedRate`."""
    law = load_law(address)
    own = load_speeds(law.demand)
    if not complete(own, law, rows, task, answer):
        return NEEDS_PYTHON
    emptied(law)
    own.scratch.taken[0] = 0
    v = vector(own.scratch, task.b.size)
    write_task(own, task, v)
    resolve_rate(law, task, v, answer.qdd)
    for i in range(rows.phi.size):
        answer.acted[i] = False
    return SOLVED if command_speeds(own, law, rows, task, answer) else NEEDS_PYTHON


@inner
def project(
    own: SpeedArrays, law: LawArrays, task: TaskArrays, norm_share: float, x: Array, out: Array
) -> None:
    """Write P x (n,) of :func:`vsconstraints.velocity.avoidance.large_projection`.

    ``norm_share`` is λ̄: 1 keeps the norm of the error alone, 0 each of its components.
    """
    J = task.J
    k, n = J.shape
    taken = own.scratch.taken[0]
    image = vector(own.scratch, k)  # J x
    pull = vector(own.scratch, n)  # Jᵀ e
    for i in range(k):
        total = 0.0
        for j in range(n):
            total += J[i, j] * x[j]
        image[i] = total
    along = 0.0
    size = 0.0
    for j in range(n):
        total = 0.0
        for i in range(k):
            total += J[i, j] * task.error[i]
        pull[j] = total
        size += total * total
        along += total * x[j]
    resolve_rate(law, task, image, out)
    for j in range(n):
        in_null_space = x[j] - out[j]
        out[j] = in_null_space
        if size > 0.0:
            keeps_norm = x[j] - pull[j] * along / size
            out[j] = norm_share * keeps_norm + (1.0 - norm_share) * in_null_space
    own.scratch.taken[0] = taken


@in_place
def is_avoided(own: SpeedArrays, law: LawArrays, rows: RowArrays, i: int) -> bool:
    """True if row i is one of those that are avoided, and the arm is in its outer zone."""
    limits_position = rows.K[i] > 0.0
    has_gradient = law.squared[i] > 0.0
    if not (own.avoided[i] and limits_position and has_gradient):
        return False
    return bool(rows.sigma[i] > -zone_width(own, rows, i))


@in_place
def zone_width(own: SpeedArrays, rows: RowArrays, i: int) -> float:
    """Return the distance from its boundary at which row i begins to be avoided."""
    width: float = 2.0 * own.zone * rows.scale[i]
    return width


@in_place
def norm_share_of(task: TaskArrays) -> float:
    """Return λ̄ of :func:`project` for the error of the task."""
    error = task.error
    squared = 0.0
    for i in range(error.size):
        squared += error[i] * error[i]
    share: float = opening(np.sqrt(squared), CLOSED, OPENED)
    return share


@in_place
def avoidance_factor(
    own: SpeedArrays, rows: RowArrays, i: int, speed: float, effect: float
) -> float:
    """Return the multiple of the avoiding motion that is subtracted for row i.

    ``speed`` is the rate of the row due to the task alone, and ``effect`` that due to the avoiding
    motion. The multiple grows with the depth in the zone, by :func:`.opening`, up to
    (1 + tune) |speed / effect|.
    """
    width = zone_width(own, rows, i)
    full_width = own.full * width
    depth = max((rows.sigma[i] + width) / full_width, 0.0)
    factor: float = opening(depth, 0.0, 1.0) * (1.0 + own.tune) * abs(speed / effect)
    return factor


@compiled(RESOLVER, from_python=False)
def resolved_rate_avoidance(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.ResolvedRateAvoidance`."""
    law = load_law(address)
    own = load_speeds(law.demand)
    if not complete(own, law, rows, task, answer):
        return NEEDS_PYTHON
    n = answer.qdd.size
    emptied(law)
    own.scratch.taken[0] = 0
    v = vector(own.scratch, task.b.size)
    primary = vector(own.scratch, n)
    gradient = vector(own.scratch, n)
    along = vector(own.scratch, n)
    write_task(own, task, v)
    resolve_rate(law, task, v, primary)
    norm_share = norm_share_of(task)
    for j in range(n):
        answer.qdd[j] = primary[j]
    for i in range(rows.phi.size):
        answer.acted[i] = False
        if not is_avoided(own, law, rows, i):
            continue
        length = np.sqrt(law.squared[i])
        for j in range(n):
            gradient[j] = rows.Lg[i, j] / length
        project(own, law, task, norm_share, gradient, along)
        speed = 0.0
        effect = 0.0
        for j in range(n):
            speed += gradient[j] * primary[j]
            effect += gradient[j] * along[j]
        if abs(speed) < abs(effect):
            factor = avoidance_factor(own, rows, i, speed, effect)
            for j in range(n):
                answer.qdd[j] -= factor * along[j]
            answer.acted[i] = True
    return SOLVED if command_speeds(own, law, rows, task, answer) else NEEDS_PYTHON


@in_place
def write_box(own: SpeedArrays, law: LawArrays, rows: RowArrays, task: TaskArrays) -> bool:
    """Write the least and greatest q̇ within the limit of accelerations, if the law has one.

    Return False if the limits are those of the rows, and these have none.
    """
    n = own.least.size  # 0 for a law without limit
    of_rows = math.isnan(own.acceleration)
    if of_rows and rows.qdd_max.size != n:
        return False
    for j in range(n):
        before = speed_before(law, task, j)
        least = -own.acceleration
        greatest = own.acceleration
        if of_rows:
            least = rows.qdd_min[j]
            greatest = rows.qdd_max[j]
        own.least[j] = before + own.period * least
        own.greatest[j] = before + own.period * greatest
    return bounds(own.least, own.greatest, n)


@in_place
def damping_row_count(own: SpeedArrays, n: int) -> int:
    """Return the number of rows √μ q̇ = 0 of the program's task."""
    return n if own.damping > 0.0 else 0


@inner
def has_room(own: SpeedArrays, rows: RowArrays, task: TaskArrays) -> bool:
    """True if the scratch holds the arrays of :func:`write_program`.

    They are passed on by address, so that they must not be allocated elsewhere.
    """
    k, n = task.J.shape
    m = rows.phi.size
    task_row_count = k + damping_row_count(own, n)
    rescaled_row_count = m if own.speed > 0.0 else 0
    of_task = task_row_count * (n + 1)
    of_rows = rescaled_row_count * n + 2 * m
    return bool(of_task + of_rows <= own.scratch.numbers.size)


@inner
def damper_gradients(own: SpeedArrays, rows: RowArrays) -> Array:
    """Return ∇σ (m, n) of the rows, whose L_gφ is K ∇σ; L_gφ itself of rows on speeds."""
    m, n = rows.Lg.shape
    G = matrix(own.scratch, m, n)
    for i in range(m):
        factor = rate_factor(rows.K[i])
        for j in range(n):
            G[i, j] = rows.Lg[i, j] / factor
    return G


@in_place
def write_damped_task(own: SpeedArrays, task: TaskArrays, v: Array, J: Array) -> None:
    """Write W J and W v of the task J q̇ = v and, if J has more rows, √μ q̇ = 0."""
    k, n = task.J.shape
    weights = own.task_weights
    write_task(own, task, v[:k])
    for i in range(k):
        weight = weights[i] if weights.size > 0 else 1.0
        v[i] *= weight
        for j in range(n):
            J[i, j] = weight * task.J[i, j]
    diagonal = np.sqrt(own.damping)
    for i in range(J.shape[0] - k):
        row = k + i
        v[row] = 0.0
        for j in range(n):
            J[row, j] = diagonal if i == j else 0.0


@in_place
def speed_bound(own: SpeedArrays, rows: RowArrays, task: TaskArrays, i: int) -> float:
    """Return h of row i, G q̇ ≤ h."""
    h = -rows.phi[i]
    for j in range(task.qd.size):
        h += rows.Lg[i, j] * task.qd[j]
    if own.speed > 0.0:
        damper = own.speed, own.influence, own.security
        h = damped_bound(h, rows.sigma[i], rows.K[i], rows.scale[i], *damper)
    bound: float = h
    return bound


@inner
def write_program(own: SpeedArrays, rows: RowArrays, task: TaskArrays) -> None:
    """Write rows and task of the quadratic program, with q̇ in place of q̈.

    G q̇ ≤ h becomes rows with φ = −h; see
    :meth:`vsconstraints.velocity.quadratic.QuadraticVelocity.solve`. Velocity dampers
    have their own G and h, which do not depend on K.
    """
    k, n = task.J.shape
    m = rows.phi.size
    none = rows.phi[:0]
    task_row_count = k + damping_row_count(own, n)
    v = vector(own.scratch, task_row_count)
    J = matrix(own.scratch, task_row_count, n)
    write_damped_task(own, task, v, J)
    phi = vector(own.scratch, m)
    drift = vector(own.scratch, m)
    for i in range(m):
        phi[i] = -speed_bound(own, rows, task, i)
        drift[i] = 0.0
    G = damper_gradients(own, rows) if own.speed > 0.0 else rows.Lg
    gains = rows.switching_gain, rows.scale
    box = own.least, own.greatest
    set_fields(own.rows, (phi, G, drift, none, none, none, *gains, *box))
    set_fields(own.task, (J, v, none, none, none, none))


@compiled(RESOLVER, from_python=False)
def quadratic(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.velocity.QuadraticVelocity`."""
    law = load_law(address)
    own = load_speeds(law.demand)
    if not complete(own, law, rows, task, answer):
        return NEEDS_PYTHON
    if not write_box(own, law, rows, task):
        return NEEDS_PYTHON
    if not has_room(own, rows, task):
        return NEEDS_PYTHON
    own.scratch.taken[0] = 0
    write_program(own, rows, task)
    answer_without_baseline(own.answer, answer)
    code = apply_law(own.program, own.rows, own.task, own.answer)
    if not is_answer(code):
        return code
    return code if command_speeds(own, law, rows, task, answer) else NEEDS_PYTHON
