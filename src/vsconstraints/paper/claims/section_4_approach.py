"""Section 4, proposed approach: claims 3e and 5j."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from ...comparisons.run import Run
from ...rows import Array
from ...rows.readable import amount
from ..case_study import switch_sample
from ..scenes import BOWL, BOWL_ROW, OTHER_ROW, TRACKING
from ..verdicts import Finding, claim, finding, shown_samples
from .boundary import FULFILLED, VANISHED, clear, excess, phi_never_positive


@claim(
    "3e",
    BOWL,
    where="4.3.3, 8.2",
    sentence="a constraint can be used to guarantee that all image features do not enter the area",
    rule=f"of both features, {FULFILLED}",
    figure="fig-06.png",
)
def _no_feature_enters_the_area(bowl: Run) -> Finding:
    both = phi_never_positive(bowl, [BOWL_ROW, OTHER_ROW])
    texts = [
        f"{label}: max φ = {bowl.phi(label).max():.3g} ({excess(bowl, label):.3g} T_s u⁺), "
        f"φ ≥ 0 for {shown_samples(bowl.positive_samples(label))} in a row, "
        f"least clearance {amount(clear(bowl, label))} px"
        for label in (BOWL_ROW, OTHER_ROW)
    ]
    needed = bowl.drift[:, bowl.index(OTHER_ROW)].max()
    text = f"{'; '.join(texts)}; (12) asks the second's row for u⁺ > {needed:.3g}"
    return Finding(both.verdict, text, both.values)


@claim(
    "5j",
    TRACKING,
    where="4.4",
    sentence="the dynamics (i.e., the poles) of this kinematic controller is given by the roots of "
    "the polynomial with coefficients [1 K_T,v K_T,p]",
    rule="with tracking alone, started in motion, the error of the first phase stays within 1 % of "
    "its norm at the start of the solution of ë = −K_T,p e − K_T,v ė, integrated apart from the "
    "simulation",
)
def _error_follows_the_polynomial(tracking: Run) -> Finding:
    k = switch_sample(tracking)
    error = tracking.trajectory.error[:k]
    # to second order in T_s, and from nothing but the error itself
    rate = (4 * error[1] - 3 * error[0] - error[2]) / (2 * tracking.sampling_time)
    wanted = ideal_error(error[0], rate, tracking.t[:k])
    share = np.linalg.norm(error - wanted, axis=1).max() / np.linalg.norm(wanted[0])
    text = f"{100 * share:.2g} % of the error at the start, at most, in {k} samples"
    return finding(text, holds=share <= VANISHED, share=share)


def ideal_error(start: Array, start_rate: Array, t: Array) -> Array:
    """Error (N, k) at times (N,), integrated from e and ė (k,).

    The gains are K_T,p(0) = 20, slope 60 and K_T,v = 3 √K_T,p as in 9.1.
    """

    def rate(_: float, x: Array) -> Array:
        e, e_dot = x.reshape(2, -1)
        Kp = 20.0 * np.exp(-60.0 / 20.0 * np.linalg.norm(e))
        Kv = 3.0 * np.sqrt(Kp)
        e_ddot = -Kp * e - Kv * e_dot
        return np.concatenate((e_dot, e_ddot))

    ends = (float(t[0]), float(t[-1]))
    x0 = np.concatenate((start, start_rate))
    solution = solve_ivp(rate, ends, x0, t_eval=t, rtol=1e-9, atol=1e-12)
    errors = solution.y[: len(start)]
    return np.asarray(errors.T)
