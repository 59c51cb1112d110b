"""Section 9, simulation of the case study: claims 5a to 5i."""

from __future__ import annotations

import numpy as np

from ...comparisons.run import Run
from ...rows.readable import amount
from ..case_study import (
    BORDERS,
    EVENTS,
    RANGE,
    SPEED,
    SPHERE,
    active_of,
    active_spans,
    at_once,
    phases,
    switch_sample,
)
from ..scenes import CASE, CASE_HALVED
from ..verdicts import Finding, claim, finding, shown_intervals, shown_samples
from .boundary import (
    FULFILLED,
    SMOOTHLY,
    VANISHED,
    clear,
    ends_of,
    fully_used,
    greatest_phi,
    phi_never_positive,
    rounds_to,
    smoothly,
)

Q6_RANGE = 1.2
QD2_LIMIT = 0.4
#: Limits printed in 9.1: joint 6, its middle and its range [rad]; joint 2, its speed [rad/s].
Q6_LIMIT = -0.5 + 0.5 * Q6_RANGE


def acting_borders(run: Run, phase: int) -> list[str]:
    """Return the image borders that are active in the first (0) or the second phase."""
    return [label for label in BORDERS if phases(run, label)[phase]]


@claim(
    "5a",
    CASE,
    where="9.2, Fig. 10",
    sentence="the position and orientation error is made zero for both phases",
    rule="at the end of each phase less than 1 % of what it began with, in position and "
    "orientation; partly if in one",
)
def _errors_vanish_in_both_phases(case: Run) -> Finding:
    k = switch_sample(case)
    error = case.trajectory.camera_error
    values = {}
    texts = []
    for phase, first, last in ((1, error[0], error[k - 1]), (2, error[k], error[-1])):
        values[f"position_left_{phase}"] = last[0] / first[0]
        values[f"orientation_left_{phase}"] = last[1] / first[1]
        texts.append(
            f"phase {phase}: {1e3 * first[0]:.0f} → {1e3 * last[0]:.1f} mm, "
            f"{first[1]:.2f} → {last[1]:.4f} rad"
        )
    return finding(
        "; ".join(texts),
        holds=max(values.values()) < VANISHED,
        partly=min(values.values()) < VANISHED,
        **values,
    )


@claim(
    "5b",
    CASE,
    where="9.2, Fig. 10",
    sentence="the second and third features remain in the FOV fully utilizing the allowed space",
    rule="clearance never negative and unused margin of at most 1 % of half the allowed image, for "
    "both",
)
def _space_is_used(case: Run) -> Finding:
    return fully_used(case, BORDERS[1], BORDERS[2])


@claim(
    "5c",
    CASE,
    where="9.2, Fig. 10",
    sentence="reaching smoothly the boundary of the hyperellipse constraint",
    rule=SMOOTHLY,
)
def _boundary_is_reached_smoothly(case: Run) -> Finding:
    return smoothly(case, BORDERS[1], BORDERS[2])


@claim(
    "5d",
    CASE,
    CASE_HALVED,
    where="9.2, Fig. 11",
    sentence="all the constraints are fulfilled, i.e., max(φ_i) ≤ 0",
    rule=f"over all rows, {FULFILLED}",
)
def _all_constraints_are_fulfilled(case: Run, case_halved: Run) -> Finding:
    kept = phi_never_positive(case, case.trajectory.labels)
    speed_excess = greatest_phi(case, case.labels("speed"))
    halved = phi_never_positive(case_halved, case_halved.trajectory.labels)
    longest_halved = halved.values["longest"]
    gains = "keep (12)"
    if case.needed_share().max() >= 1:
        gains = "break (12): this is not sampling"
    text = (
        f"{kept.text}; the printed gains {gains}: "
        f"with half the period φ ≥ 0 for {shown_samples(longest_halved)} in a row; "
        f"the speed of joint 2 is at most {100 * speed_excess:.2f} % above its limit"
    )
    further = {"speed_excess": speed_excess, "longest_halved": longest_halved}
    return Finding(kept.verdict, text, {**kept.values, **further})


@claim(
    "5e",
    CASE,
    where="9.2, Fig. 11",
    sentence="the joint limit constraint for the sixth joint and the speed constraint for the "
    "second joint become active during the first phase",
    rule="both act in the first phase, neither in the second; then q₆ comes within 1 % of the "
    "printed range of its limit without exceeding it, and the speed of joint 2 within 1 % of its "
    "limit; partly if only the former",
)
def _joint_limits_act_in_the_first_phase(case: Run) -> Finding:
    in_range = phases(case, RANGE)
    in_speed = phases(case, SPEED)
    q6 = case.trajectory.q.T[5].max()
    qd2 = np.abs(case.trajectory.qd.T[1]).max()
    in_first_only = all(bool(first) and not second for first, second in (in_range, in_speed))
    at_limits = 0 <= Q6_LIMIT - q6 <= 0.01 * Q6_RANGE and abs(qd2 - QD2_LIMIT) <= 0.01 * QD2_LIMIT
    return finding(
        f"{RANGE} at {shown_intervals(in_range[0] + in_range[1])}; "
        f"{SPEED} at {shown_intervals(in_speed[0] + in_speed[1])}; "
        f"q₆ up to {q6:.4f} rad of {Q6_LIMIT:g}, joint 2 up to {qd2:.4f} rad/s of {QD2_LIMIT:g}",
        holds=in_first_only and at_limits,
        partly=in_first_only,
        q6=q6,
        qd2=qd2,
    )


@claim(
    "5f",
    CASE,
    where="9.2, Fig. 11",
    sentence="the constraint for forbidden areas becomes active for the time interval 6-8 s during "
    "the second phase",
    rule="one interval, its ends within 0.5 s of those printed",
)
def _sphere_acts_in_the_second_phase(case: Run) -> Finding:
    first, second = phases(case, SPHERE)
    return finding(
        f"active at {shown_intervals(first + second)}",
        holds=not first and rounds_to(second, [(6, 8)]),
        partly=bool(second),
        **ends_of(second),
    )


@claim(
    "5g",
    CASE,
    where="9.2, Fig. 11",
    sentence="the FOV constraint becomes active for the second and third feature during the first "
    "phase and for the second feature during the second phase",
    rule="exactly these rows act in each phase",
)
def _borders_act_in_each_phase(case: Run) -> Finding:
    first = acting_borders(case, 0)
    second = acting_borders(case, 1)
    texts = [
        f"{border} at {shown_intervals(active_spans(case, border))}"
        for border in BORDERS
        if border in first + second
    ]
    wanted = {BORDERS[1], BORDERS[2]}
    return finding(
        "; ".join(texts) or "no border ever acts",
        holds=set(first) == wanted and second == [BORDERS[1]],
        partly=set(first) >= wanted and BORDERS[1] in second,
    )


@claim(
    "5h",
    CASE,
    where="9.2, Fig. 11",
    sentence="in some phases of the simulation there are up to three active constraints at a time",
    rule="three at most, as overlapping intervals, at some time",
)
def _three_at_a_time(case: Run) -> Finding:
    count = at_once(case)
    most = int(count.max())
    when = case.t[count == most]
    active = np.sum([active_of(case, event) for event in EVENTS], axis=0)
    same = int(active[count == most].max())
    return finding(
        f"up to {most} intervals overlap ({when[0]:.2f}–{when[-1]:.2f} s); "
        f"up to {same} rows have φ ≥ 0 in one sample",
        holds=most == 3,
        partly=most > 1,
        most=most,
        same_sample=same,
    )


@claim(
    "5i",
    CASE,
    where="9.2, Fig. 12",
    sentence="this constraint [the spherical forbidden area] is fulfilled",
    rule="the end-effector never inside the sphere, between samples too",
)
def _sphere_is_not_entered(case: Run) -> Finding:
    clearance = clear(case, SPHERE)
    phi = case.phi(SPHERE).max()
    return finding(
        f"the end-effector stays {1e3 * clearance:.3f} mm outside; max φ = {amount(phi)} m",
        holds=clearance >= 0,
        clearance_min=clearance,
        phi_max=phi,
    )
