"""Low-level loop of an arm that takes velocities or positions: motion within a period, exactly.

Each joint follows a wanted speed u, q̈ = a + d with the disturbance d and a → (u − q̇)/τ, within
|a| ≤ A and |ȧ| ≤ j. The motion is composed of parts with closed forms: exponential, saturated with
constant a, and ramps with constant ȧ. It changes from one to the next at instants
that are roots of polynomials of degree one or two, or of one exponential.

A position command moves a reference linearly to it within a period; the loop then wants u = ṙ + w
(r − q), as cascaded drives do: see :func:`approach`.

``push`` is d, ``most`` is A, ``left`` is the remaining duration of a motion, and ``until`` the time
until its next change, both in seconds; ``x`` (s, n) is the state, whose rows are named below.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from ..rows import Array, IntArray
from .compiler import IN_PLACE, compiled, in_place
from .linear import clip
from .memory import zeros
from .parts import address, call_int_pointer, checked, struct_loader
from .signatures import FLOAT, INT, MATRIX, VOID, signature

#: Rows of the state of a joint: q, q̇ and the loop's acceleration a; wanted speed u; position
#: reference r and ṙ; periods since a command was taken, from 0 to ``periods`` − 1. Two rows follow
#: for every command that may still be taken, the newest first: its position and its speed. The
#: last two rows are q̈_c and d_c of the period.
Q, QD, ACCELERATION, WANTED, REFERENCE, RATE, AGE, COMMANDS = range(8)
COMMAND = -2
PUSH = -1
#: Most parts of the motion between two instants at which the arm takes commands. Some ten are
#: usual; a loop that swings ever faster about its wanted speed has more.
MOST_PARTS = 10_000
#: What ends a ramp of the acceleration a: it is at its limit, or what the loop asks for.
AT_LIMIT, AS_ASKED = range(2)
SAME = 1e-12  #: Relative difference below which two accelerations are the same.
ROUNDING = 4.0 * np.finfo(np.float64).eps  #: Relative error of a difference of two speeds.
#: Share of the distance between the loop and the reference of an arm with mass that is removed in
#: each period. With 1, the speed of the reference would jump by twice as much.
REMOVED = 0.5


class Follower(NamedTuple):
    """Low-level loop of an arm, and how it takes commands.

    ``Ts`` [s] is the period of the controller. The arm takes commands at instants that are ``tick``
    [s] apart: ``ticks`` of them in a period, or one every ``periods`` periods; one of both is 1.
    ``ages`` tells for each instant of a period how many periods old the newest command is that has
    arrived, and ``fresh`` is 1 where it is not that of the instant before. ``positions`` is 1 if
    the arm takes positions. ``implicit`` (1,) is 1 if q_c advances with the new q̇_c alone, as for
    laws that command speeds. ``unfollowed`` (1,) is 1 once a motion has had more than
    ``MOST_PARTS`` parts, from where on it is wrong. ``lag`` is τ [s], ``feedback`` is κ [1/s].
    ``reference`` is the state of the loop. Where an arm with mass follows it as its reference,
    ``q_c`` and ``qd_c`` are the reference of its joint controllers, and ``move`` and ``moved`` the
    addresses of the function that moves that arm, and of its workspace.
    """

    Ts: float
    tick: float
    ticks: int
    periods: int
    ages: Annotated[IntArray, "ticks"]
    fresh: Annotated[IntArray, "ticks"]
    positions: int
    implicit: Annotated[IntArray, "1"]
    unfollowed: Annotated[IntArray, "1"]
    lag: float
    feedback: float
    acceleration: Annotated[Array, "n"]
    jerk: Annotated[Array, "n"]
    reference: Annotated[Array, "s n"]
    q_c: Annotated[Array, "n"]
    qd_c: Annotated[Array, "n"]
    move: int
    moved: int


@in_place
def first_root(a: float, b: float, c: float) -> float:
    """Return the least t > 0 with a t² + b t + c = 0, or infinity."""
    if a == 0.0:
        t = math.inf
        if b != 0.0:
            t = -c / b
        return t if t > 0.0 else math.inf
    discriminant = b * b - 4.0 * a * c
    if discriminant < 0.0:
        return math.inf
    # the form without cancellation
    half = -0.5 * (b + np.copysign(np.sqrt(discriminant), b))
    one = half / a
    other = one
    if half != 0.0:
        other = c / half
    least = math.inf
    if one > 0.0:
        least = one
    if 0.0 < other < least:
        least = other
    return least


@in_place
def glide(x: Array, j: int, t: float, jerk: float, push: float) -> None:
    """Move joint j for t [s] with constant ȧ = ``jerk``, and q̈ = a + ``push``."""
    # q ← q + q̇ t + q̈ t²/2 + ȧ t³/6 and q̇ ← q̇ + q̈ t + ȧ t²/2
    a = x[ACCELERATION, j]
    qdd = a + push
    mean_speed_rate = 0.5 * qdd + t * jerk / 6.0
    mean_speed = x[QD, j] + t * mean_speed_rate
    mean_acceleration = qdd + 0.5 * t * jerk
    x[Q, j] += t * mean_speed
    x[QD, j] += t * mean_acceleration
    x[ACCELERATION, j] = a + t * jerk


@in_place
def lag_behind(x: Array, j: int, t: float, lag: float, push: float) -> None:
    """Move joint j for t [s] with a = (u − q̇)/τ: q̇ approaches u + τ d."""
    qdd = x[ACCELERATION, j] + push
    # q̈ decays as exp(−t/τ), which has the integral τ (1 − exp(−t/τ))
    integral = -lag * np.expm1(-t / lag)
    by_acceleration = lag * qdd * (t - integral)
    x[Q, j] += t * x[QD, j] + by_acceleration
    x[QD, j] += qdd * integral
    x[ACCELERATION, j] = qdd * (1.0 - integral / lag) - push


@in_place
def follow_at_once(x: Array, j: int, t: float, most: float, push: float) -> None:
    """Move joint j for t [s] by a loop without lag: with ±A until q̇ = u, then at u."""
    if most == math.inf:
        x[QD, j] = x[WANTED, j]
        x[ACCELERATION, j] = 0.0
        x[Q, j] += t * x[QD, j]
        return
    missing = x[WANTED, j] - x[QD, j]
    until = 0.0
    if missing != 0.0:
        a = np.copysign(most, missing)
        x[ACCELERATION, j] = a
        qdd = a + push
        approaches = missing * qdd > 0.0
        until = missing / qdd if approaches else math.inf
        glide(x, j, min(t, until), 0.0, push)
    if until < t:
        x[QD, j] = x[WANTED, j]
        # beyond its limit the push carries the joint away
        x[ACCELERATION, j] = clip(-push, -most, most)
        glide(x, j, t - until, 0.0, push)


@in_place
def asked_acceleration(f: Follower, x: Array, j: int) -> float:
    """Return the demand of the loop for acceleration, (u − q̇)/τ."""
    asked: float = (x[WANTED, j] - x[QD, j]) / f.lag
    return asked


@in_place
def follow_at_limit(f: Follower, x: Array, j: int, left: float, asked: float) -> float:
    """Move joint j with a at its limit, up to the time at which the loop demands less.

    Return the remaining duration.
    """
    push = x[PUSH, j]
    # speed by which the wanted one exceeds that at which the loop asks for the limit, and its rate
    excess = (abs(asked) - f.acceleration[j]) * f.lag
    rate = np.copysign(1.0, asked) * (x[ACCELERATION, j] + push)
    until = math.inf
    if rate > 0.0:
        until = excess / rate
    glide(x, j, min(left, until), 0.0, push)
    if until < left:
        x[QD, j] = x[WANTED, j] - f.lag * x[ACCELERATION, j]
    return left - until


@in_place
def exceeding(a: float, most: float, push: float, lag: float) -> float:
    """Return the time until |a| of a lagging joint exceeds A, infinity if |d| ≤ A."""
    if abs(push) <= most:
        return math.inf
    # q̈ = a + d fades as exp(−t/τ), until a is at the end opposite to d
    qdd_at_end = np.copysign(most, -push) + push
    faded_to = qdd_at_end / (a + push)
    if not 0.0 < faded_to < 1.0:
        return math.inf
    until: float = -lag * np.log(faded_to)
    return until


@in_place
def next_event(f: Follower, x: Array, j: int, jerk: float, met: bool) -> tuple[int, float]:
    """Return what ends a ramp of joint j with ȧ = ``jerk``, and the time until then.

    The time is infinite if nothing ends the ramp. For ``met`` see :func:`ramp`.
    """
    a = x[ACCELERATION, j]
    # a is what the loop asks for at a root of a − (u − q̇)/τ; if ``met``, that is so now
    distance = 0.0
    if not met:
        distance = a - asked_acceleration(f, x, j)
    qdd = a + x[PUSH, j]
    slope = jerk + qdd / f.lag
    half_curvature = 0.5 * jerk / f.lag
    until_met = first_root(half_curvature, slope, distance)
    if f.acceleration[j] < math.inf:
        end = np.copysign(f.acceleration[j], jerk)
        until_end = (end - a) / jerk
        if 0.0 < until_end <= until_met:
            return AT_LIMIT, until_end
    return AS_ASKED, until_met


@in_place
def ramp(f: Follower, x: Array, j: int, left: float, jerk: float, met: bool) -> tuple[float, bool]:
    """Move joint j with ȧ = ``jerk``, until a is at its limit or as the loop demands.

    Return the remaining duration, and True if a is then what the loop asks for. ``met`` is True if
    it is so at the beginning, and what the loop asks for changes faster than a.
    """
    event, until = next_event(f, x, j, jerk, met)
    glide(x, j, min(left, until), jerk, x[PUSH, j])
    if until > left:
        return 0.0, False
    asked = asked_acceleration(f, x, j)
    if event == AS_ASKED:
        x[ACCELERATION, j] = asked
        return left - until, True
    end = np.copysign(f.acceleration[j], jerk)
    x[ACCELERATION, j] = end
    # the loop may ask for the limit, or for more
    return left - until, asked / end >= 1.0


@in_place
def follow_limited(f: Follower, x: Array, j: int, left: float) -> bool:
    """Move joint j for ``left`` [s] by a loop with lag and limits of a and ȧ.

    Return False if the motion has more than ``MOST_PARTS`` parts, of which only these are made.
    """
    most = f.acceleration[j]
    jerk = f.jerk[j]
    push = x[PUSH, j]
    lag = f.lag
    met = False  # True if a is what the loop asks for
    for _ in range(MOST_PARTS):
        if left <= 0.0:
            return True
        asked = asked_acceleration(f, x, j)
        aim = clip(asked, -most, most)
        a = aim
        if jerk < math.inf:
            # rounding may have left a just beyond its limit, from where a ramp would lead away
            a = clip(x[ACCELERATION, j], -most, most)
        x[ACCELERATION, j] = a
        met = met or a == aim
        qdd = a + push
        # what the loop asks for is at the limit, or beyond, and does not return at once
        grows = asked * qdd < 0.0
        # q̇ is rounded, which the short lag magnifies
        size_of_speeds = abs(x[WANTED, j]) + abs(x[QD, j])
        rounding = ROUNDING * size_of_speeds / lag
        is_beyond = abs(asked) > most * (1.0 + SAME) + rounding
        is_at_limit = abs(asked) >= most * (1.0 - SAME) - rounding
        # under lag alone, ȧ = −q̈/τ
        is_slow_enough = abs(qdd) <= jerk * lag * (1.0 + SAME)
        if not met:
            toward_aim = np.copysign(jerk, aim - a)
            left, met = ramp(f, x, j, left, toward_aim, False)
        elif is_beyond or (is_at_limit and grows):
            left = follow_at_limit(f, x, j, left, asked)
        elif is_slow_enough:
            until = exceeding(a, most, push, lag)
            lag_behind(x, j, min(left, until), lag, push)
            left -= until
        else:
            # the lag would change a faster than the jerk allows
            against_motion = np.copysign(jerk, -qdd)
            left, met = ramp(f, x, j, left, against_motion, True)
    return left <= 0.0


@in_place
def approach(error: float, feedback: float, most: float) -> float:
    """Return the speed w(e) at which a position loop reduces an error e = r − q.

    w obeys |w|/κ + w²/(2A) = |e|: κ e near zero, and elsewhere no faster than a joint can stop at A
    within the error. κ e alone would swing for ever where A does not suffice to follow it.
    """
    # root of w²/(2A) + |w|/κ − |e| in the form without cancellation
    slowness = 1.0 / feedback
    discriminant = slowness * slowness + 2.0 * abs(error) / most
    divisor = slowness + math.sqrt(discriminant)
    return 2.0 * error / divisor


@in_place
def take_command(f: Follower, x: Array, instant: int, duration: float) -> None:
    """Let all joints take the command of an instant, which they follow for ``duration`` [s]."""
    # rows of the newest command that has arrived
    position = COMMANDS + 2 * f.ages[instant]
    speed = position + 1
    for j in range(x.shape[1]):
        if f.positions == 0:
            x[WANTED, j] = x[speed, j]
            continue
        reference = x[REFERENCE, j]
        rate = x[RATE, j]
        if f.fresh[instant]:
            rate = (x[position, j] - reference) / max(f.Ts, duration)
            x[RATE, j] = rate
        error = reference - x[Q, j]
        correction = approach(error, f.feedback, f.acceleration[j])
        x[WANTED, j] = rate + correction
        x[REFERENCE, j] = reference + duration * rate


@in_place
def advance(f: Follower, x: Array, span: float) -> None:
    """Move the joints for the first ``span`` [s] of a period, whose command is integrated.

    Motions with too many parts set ``f.unfollowed``.
    """
    done = 0.0
    for instant in range(f.ticks):
        t = min(f.Ts / f.ticks, span - done)
        if t <= 0.0:
            return
        if f.periods == 1 or x[AGE, 0] == 0.0:
            take_command(f, x, instant, f.tick)
        for j in range(x.shape[1]):
            if f.lag == 0.0:
                follow_at_once(x, j, t, f.acceleration[j], x[PUSH, j])
            elif not follow_limited(f, x, j, t):
                f.unfollowed[0] = 1
        done += t


@in_place
def integrate_command(f: Follower, x: Array) -> None:
    """Append the command of a period: q̈_c, integrated to a speed and a position."""
    newest_position = COMMANDS
    newest_speed = COMMANDS + 1
    # commands become older by one: the oldest, before q̈_c and d_c, is overwritten
    oldest = len(x) - 4
    for i in range(oldest - 1, COMMANDS - 1, -1):
        for j in range(x.shape[1]):
            x[i + 2, j] = x[i, j]
    weight_of_change = 1.0 if f.implicit[0] else 0.5
    for j in range(x.shape[1]):
        qdd = x[COMMAND, j]
        qd = x[newest_speed, j]
        mean_speed = qd + weight_of_change * f.Ts * qdd
        x[newest_position, j] += f.Ts * mean_speed
        x[newest_speed, j] = qd + f.Ts * qdd


@in_place
def age_command(f: Follower, x: Array) -> None:
    """Count a period since a command was taken, up to the one in which the next is taken."""
    for j in range(x.shape[1]):
        x[AGE, j] = (x[AGE, j] + 1.0) % f.periods


load_follower = struct_loader(zeros(Follower))


@compiled(signature(INT, INT, MATRIX), IN_PLACE, from_python=False)
def follow_period_at(follower_address: int, x: Array) -> int:
    """Move the joints through a period with the command x[-2].

    Return 0, or 1 if the loop could not be followed.
    """
    f = load_follower(follower_address)
    integrate_command(f, x)
    advance(f, x, f.Ts)
    age_command(f, x)
    unfollowed: int = f.unfollowed[0]
    return unfollowed


@checked(Follower)
@compiled(signature(VOID, INT, MATRIX, FLOAT), IN_PLACE)
def follow_part(follower_address: int, x: Array, span: float) -> None:
    """Move the joints through the first ``span`` [s] of a period with the command x[-2]."""
    f = load_follower(follower_address)
    integrate_command(f, x)
    advance(f, x, span)


@in_place
def write_reference(f: Follower, x: Array) -> None:
    """Move the loop through a period, and replace the command x[-2] by that of its reference.

    The reference moves from q_r and q̇_r with a constant acceleration,

        q̈_r = (q̇ − q̇_r)/T_s − ρ d/T_s²,   d = q_r + ½ T_s (q̇_r + q̇) − q,

    where the loop ends the period at q and q̇. The first term alone leads to the loop's speed, but
    ends at the distance d from the loop, and these distances would add up. The second term removes
    the share ρ = :data:`REMOVED` of d: half of it in this period, since it changes the end by
    −½ ρ d, and the other half in the next one, by the speed that this period leaves.
    """
    loop = f.reference
    Ts = f.Ts
    for j in range(x.shape[1]):
        loop[COMMAND, j] = x[COMMAND, j]
    integrate_command(f, loop)
    advance(f, loop, Ts)
    age_command(f, loop)
    for j in range(x.shape[1]):
        q_r = f.q_c[j]
        qd_r = f.qd_c[j]
        qd = loop[QD, j]
        end = q_r + 0.5 * Ts * (qd_r + qd)
        distance = end - loop[Q, j]
        to_loop_speed = (qd - qd_r) / Ts
        correction = REMOVED * distance / (Ts * Ts)
        x[COMMAND, j] = to_loop_speed - correction


@compiled(signature(INT, INT, MATRIX), IN_PLACE, from_python=False)
def follow_with_mass(follower_address: int, x: Array) -> int:
    """Move an arm whose joint controllers follow the loop's motion as their reference.

    Its command x[-2] becomes that of the reference. Return what the arm's function returns, or 1
    if the loop could not be followed.
    """
    f = load_follower(follower_address)
    write_reference(f, x)
    if f.unfollowed[0] != 0:
        return 1
    return call_int_pointer(f.move, (f.moved, x))


@checked(Follower)
@compiled(signature(VOID, INT, MATRIX), IN_PLACE)
def refer(follower_address: int, x: Array) -> None:
    """Call :func:`write_reference` for an arm that another program moves."""
    write_reference(load_follower(follower_address), x)


MOVE = address(follow_period_at)  #: Address of the function that moves an arm without mass.
MOVE_WITH_MASS = address(follow_with_mass)


@checked(Follower, calls=MOVE)
@compiled(signature(INT, INT, INT, MATRIX), IN_PLACE)
def follow_period(function: int, follower_address: int, x: Array) -> int:
    """Call :func:`follow_period_at` from Python."""
    code: int = call_int_pointer(function, (follower_address, x))
    return code
