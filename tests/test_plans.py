"""Loops over a plan of accelerations against NumPy's products of whole matrices, as they are and compiled."""

from __future__ import annotations

import numpy as np
import pytest

from vsconstraints import compiled as kernels
from vsconstraints.formulas import plans as as_they_are

FORMS = ["as they are", "compiled"]
N, m, n, H = 5, 4, 3, 2


@pytest.fixture(params=FORMS)
def loops(request: pytest.FixtureRequest):
    if request.param == "as they are":
        return as_they_are
    if not kernels.available():
        pytest.skip("there is no compiler")
    from vsconstraints.compiled import plans

    return plans


@pytest.fixture
def drawn():
    rng = np.random.default_rng(3)
    return {
        # rows on φ itself, and two gains of which one is 1
        "K": np.array([0.0, 1.0, 4.0, 0.0]),
        "phi": rng.normal(size=(N, m)), "sigma": rng.normal(size=(N, m)), "Lg": rng.normal(size=(N, m, n)),
        "now": rng.normal(size=m), "Q": rng.normal(size=(N, H)), "V": rng.normal(size=(N, H)),
        "plan": rng.normal(size=(H, n)), "falls": rng.uniform(0.5, 1.0, N - 1), "left": rng.normal(size=(N - 1, m)),
    }  # fmt: skip


def linearised(loops, drawn):
    value, gradient = np.empty((N, m)), np.empty((N, m, n))
    loops.linearise(*(drawn[name] for name in ("phi", "sigma", "Lg", "K", "now")), value, gradient)
    return value, gradient


def exceeded(loops, drawn, plan):
    over = np.empty((N - 1, m))
    value, gradient = linearised(loops, drawn)
    loops.exceed(value, gradient, drawn["K"], drawn["Q"] @ plan, drawn["V"] @ plan, drawn["falls"], drawn["left"], over)
    return over


def test_rows_are_those_of_now_and_differ_as_predicted(loops, drawn):
    value, gradient = linearised(loops, drawn)
    np.testing.assert_allclose(value[0], drawn["now"], rtol=1e-12)
    for i, K in enumerate(drawn["K"]):
        seen = drawn["phi" if K == 0.0 else "sigma"][:, i]
        np.testing.assert_allclose(np.diff(value[:, i]), np.diff(seen), rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(gradient[:, i] * (K or 1.0), drawn["Lg"][:, i], rtol=1e-12)


def test_what_rows_exceed_is_what_whole_matrices_say(loops, drawn):
    value, gradient = linearised(loops, drawn)
    direct = drawn["K"] == 0.0
    by_plan = np.where(direct[:, None], drawn["V"][:, None], drawn["Q"][:, None])
    after = value + np.einsum("tmh,tmn,hn->tm", by_plan, gradient, drawn["plan"])
    np.testing.assert_allclose(
        exceeded(loops, drawn, drawn["plan"]),
        after[1:] - drawn["falls"][:, None] * after[:-1] - drawn["left"],
        rtol=1e-10,
    )


def test_gradients_are_the_differences_that_a_plan_makes(loops, drawn):
    which = np.array([0, 1, 2, 7, 13, (N - 1) * m - 1])
    G, largest = np.empty((which.size, H * n)), np.full(which.size, np.nan)
    gradient = linearised(loops, drawn)[1]
    loops.differentiate(which, gradient, *(drawn[name] for name in ("K", "Q", "V", "falls")), G, largest)
    zero = exceeded(loops, drawn, np.zeros((H, n)))
    for column, unit in enumerate(np.eye(H * n)):
        # exact, as all is linear in the plan
        made = (exceeded(loops, drawn, unit.reshape(H, n)) - zero).ravel()[which]
        np.testing.assert_allclose(G[:, column], made, rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(largest, np.abs(G).max(axis=1))


def test_a_gradient_that_is_not_a_number_is_the_largest(loops, drawn):
    gradient = linearised(loops, drawn)[1]
    gradient[1, 2, 0] = np.nan
    largest = np.empty(1)
    loops.differentiate(
        np.array([2]), gradient, *(drawn[name] for name in ("K", "Q", "V", "falls")), np.empty((1, H * n)), largest
    )
    assert np.isnan(largest[0])


def test_the_normal_equations_are_those_of_the_stacked_residual(loops, drawn):
    rng = np.random.default_rng(4)
    B, k = 3, 2
    C, J, b, own = rng.normal(size=(B, H)), rng.normal(size=(B, k, n)), rng.normal(size=(B, k)), rng.normal(size=(B, n))
    C[1, 0] = 0.0
    P, q = np.zeros((H * n, H * n)), np.zeros(H * n)
    loops.normal_equations(C, J, b, own, np.empty((n, n)), P, q)
    M = np.concatenate([np.kron(C[a], J[a]) for a in range(B)])
    d = np.concatenate([b[a] + J[a] @ own[a] for a in range(B)])
    np.testing.assert_allclose(np.triu(P), np.triu(M.T @ M), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(q, M.T @ d, rtol=1e-10)
