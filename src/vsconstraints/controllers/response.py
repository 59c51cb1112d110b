"""How tracking answers to a reference that stands still: what is predicted to decide whether it may be moved there.

In NumPy a model is asked sample after sample; :mod:`vsconstraints.compiled.response` asks the compiled step, in one
loop. ``test_responses_alike_in_both_forms`` in ``tests/test_goal_governor.py`` compares the two.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..compiled import load
from ..errors import InvalidInput, SceneError
from ..formulas.tracking import held_gains, held_rest, retargeted
from ..rows import Array
from .compiled import SCRATCH
from .least_norm import RANK_TOLERANCE, least_norm

NEWTON = 2  #: Steps of Newton from where a response ends to where it comes to rest.


class Response(NamedTuple):
    """The least −σ (m,) of each row on the way and at rest; and at rest σ (m,), L_gφ (m, n) and J (k, n).

    σ counts by the row's scale.
    """

    least: Array
    sigma: Array
    Lg: Array
    J: Array


def response(model: Any, reference: Array, periods: Array, scale: Array) -> Response | None:
    """Follow the tracking law of eq. (42) from now on; None if it comes to where nothing can be evaluated.

    ``model`` is a :class:`vsconstraints.control.model.Model`; ``reference`` (k,) is s_ref less the feature's value at
    the goal of now, which is kept; ``periods`` (N,) says how long each acceleration lasts [s]: long ones too, since
    gains are those of the implicit midpoint rule; ``scale`` (m,) is of the rows.
    """
    bound, kernels = model.compiled(), load("response")
    if bound is None:
        return _in_numpy(model, reference, periods, scale)
    step, least, (t, q, qd) = bound.packed.step, np.full(len(scale), np.inf), model.present
    parts = np.array([kernels.EVALUATE, kernels.TRACK, bound.packed.workspace.address, 0])
    numbers = np.array([t, model.until, RANK_TOLERANCE, NEWTON])
    state, work = np.array([q, qd, np.zeros_like(q)]), np.empty(len(reference) + SCRATCH)
    if kernels.respond(parts, numbers, state, reference, work, periods, least):
        return None
    return Response(least, step.rows.sigma / scale, step.rows.Lg.copy(), step.task.J.copy())


def _in_numpy(model: Any, reference: Array, periods: Array, scale: Array) -> Response | None:
    (t, q, qd), gains = model.present, model.task.gains
    least, N = np.full(len(scale), np.inf), len(periods)
    for k in range(N + NEWTON + 1):
        try:
            found = model.at(t, q, qd)
        except (SceneError, InvalidInput):
            return None
        task, e = found.task, found.error
        if 0 < k <= N or k == N + NEWTON:
            least = np.minimum(least, -found.sigma / scale)
        if k < N:
            h = float(periods[k])
            Kp, Kv = gains.at(e - reference)
            then = held_gains(Kp, Kv, h)
            b, rest = retargeted(task.b, e, task.error_rate, reference, gains.at(e), then), task.rest
            if len(rest):
                own = model.task.rest_of(len(q), len(b))
                rest = held_rest(rest, qd, own.damping, own.stiffness, h)
            qdd = least_norm(task.J, b, RANK_TOLERANCE, rest).qdd
            t, q, qd = min(t + h, model.until), q + h * (qd + 0.5 * h * qdd), qd + h * qdd
        elif k < N + NEWTON:
            q, qd = q + least_norm(task.J, reference - e, RANK_TOLERANCE).qdd, np.zeros_like(qd)
    return Response(least, found.sigma / scale, found.rows.Lg, task.J)
