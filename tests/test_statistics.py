"""Statistics against published numbers, brute force, and other libraries."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scikit_posthocs
import scipy.integrate
import scipy.optimize
import scipy.special
import scipy.stats
import statsmodels.stats.contingency_tables as contingency
import statsmodels.stats.descriptivestats as descriptive
import statsmodels.stats.proportion as proportion
from hypothesis import given, settings
from hypothesis import strategies as st

from vsconstraints.bench.statistics import (
    Rate,
    across_families,
    detectable,
    difference_interval,
    distinguishable,
    left_out_ranks,
    mcnemar,
    median,
    paired,
    profile,
    ranks,
    rate,
    rate_of,
    rate_text,
    simultaneous,
    verdict,
    with_interval,
)
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.rows import Array

# Demšar 2006, Table 6: AUC of C4.5, C4.5+m, C4.5+cf, C4.5+m+cf on 14 data sets. In "voting" the
# paper ranks two equal printed values 2 and 3, from digits that it does not print.
AUC = np.array(
    [
        [0.763, 0.768, 0.771, 0.798],
        [0.599, 0.591, 0.590, 0.569],
        [0.954, 0.971, 0.968, 0.967],
        [0.628, 0.661, 0.654, 0.657],
        [0.882, 0.888, 0.886, 0.898],
        [0.936, 0.931, 0.916, 0.931],
        [0.661, 0.668, 0.609, 0.685],
        [0.583, 0.583, 0.563, 0.625],
        [0.775, 0.838, 0.866, 0.875],
        [1.000, 1.000, 1.000, 1.000],
        [0.940, 0.962, 0.965, 0.962],
        [0.619, 0.666, 0.614, 0.669],
        [0.972, 0.981, 0.9751, 0.975],
        [0.957, 0.978, 0.946, 0.970],
    ]
)


def test_none_of_ten_thousand_still_allows() -> None:
    """By hand: (1 − p)ⁿ = 0.025."""
    found = rate(np.zeros(10_000, dtype=bool))
    assert (found.count, found.of, found.low) == (0, 10_000, 0.0)
    assert found.high == pytest.approx(1.0 - 0.025 ** (1 / 10_000), rel=1e-12)
    assert found.high == pytest.approx(3.7e-4, rel=0.01)
    assert rate_text(found) == "0 of 10 000: at most 3.7e-4 (95 %)"


@pytest.mark.parametrize(
    ("count", "of"), [(0, 1), (1, 1), (1, 10), (10, 20), (81, 263), (999, 1000)]
)
@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
def test_rates_as_in_statsmodels(count: int, of: int, confidence: float) -> None:
    found = rate_of(count, of, confidence)
    known = proportion.proportion_confint(count, of, 1 - confidence, method="beta")
    assert (found.low, found.high) == pytest.approx(known, abs=1e-12)


def test_a_rate_in_a_textbook() -> None:
    """81 of 263: 0.2527 to 0.3676 (Newcombe, Statistics in Medicine 17, 1998, Table I, method
    5).
    """
    found = rate_of(81, 263)
    assert (round(found.low, 4), round(found.high, 4)) == (0.2527, 0.3676)


def test_a_paired_difference_as_published() -> None:
    """Tango 1998, section 6.1: none and one of 44 discordant; lower limit at 90 % −0.096. And R's
    PropCIs, 48 and 41 of 549, at 90 %: −1.57 to 4.14 %.
    """
    assert round(difference_interval(0, 1, 44, 0.9, correction=0.0)[0], 3) == -0.096
    assert [
        round(100 * end, 2) for end in difference_interval(48, 41, 549, 0.9, correction=0.0)
    ] == [-1.57, 4.14]


@given(
    st.integers(0, 40), st.integers(0, 40), st.integers(0, 40), st.sampled_from([0.8, 0.95, 0.99])
)
@settings(max_examples=80, deadline=None)
def test_ends_of_a_paired_difference_are_where_the_score_test_turns(
    a: int, b: int, rest: int, level: float
) -> None:
    """The most likely probability under δ is sought by brute force, and the score test with it."""
    n = a + b + rest
    low, high = difference_interval(a, b, n, level)
    assert -1.0 <= low <= high <= 1.0
    assert difference_interval(b, a, n, level) == (-high, -low)
    if n == 0:
        assert (low, high) == (-1.0, 1.0)
        return
    assert low <= (a - b) / n <= high
    z = scipy.stats.norm.ppf((1 + level) / 2)
    for end in (low, high):
        if abs(end) < 1.0 - 1e-9:
            least = max(0.0, -end)
            most = (1.0 - end) / 2.0
            q = np.linspace(least, most, 200_001)
            likely = scipy.special.xlogy(a, q + end) + scipy.special.xlogy(b, q)
            likely += scipy.special.xlogy(rest, np.maximum(1.0 - 2.0 * q - end, 0.0))
            at = q[np.nanargmax(likely)]
            spread = math.sqrt(n * (2.0 * at + end * (1.0 - end)))
            assert abs(a - b - n * end) - 1.0 == pytest.approx(z * spread, rel=2e-3, abs=2e-3)


def test_mcnemar_in_a_textbook() -> None:
    """Agresti, Categorical Data Analysis: approval 794, 150, 86, 570 of 1600; and statsmodels, with
    correction.
    """
    first = np.repeat([1, 1, 0, 0], [794, 150, 86, 570])
    second = np.repeat([1, 0, 1, 0], [794, 150, 86, 570])
    found = mcnemar(first, second)
    known = contingency.mcnemar([[794, 150], [86, 570]], exact=False, correction=True)
    assert (found.only_a, found.only_b, found.n) == (150, 86, 1600)
    assert found.p == pytest.approx(known.pvalue, rel=1e-9)
    assert found.difference == pytest.approx(0.04)
    # ± 1.96 standard errors and 1/1600
    assert (found.low, found.high) == pytest.approx((0.0206, 0.0594), abs=3e-4)


@given(
    st.integers(0, 30), st.integers(0, 30), st.integers(0, 30), st.sampled_from([0.9, 0.95, 0.998])
)
@settings(max_examples=200, deadline=None)
def test_an_interval_excludes_zero_where_its_test_rejects_and_only_there(
    a: int, b: int, rest: int, level: float
) -> None:
    """Of rates against statsmodels, of numbers against SciPy's binomial test of the signs."""
    rates = mcnemar([1] * a + [0] * (b + rest), [0] * a + [1] * b + [0] * rest, level)
    known = (
        contingency.mcnemar([[0, a], [b, rest]], exact=False, correction=True).pvalue
        if a + b
        else 1.0
    )
    assert rates.p == pytest.approx(1.0 if a == b else known, rel=1e-9)
    assert distinguishable(rates.low, rates.high) == (rates.p <= 1.0 - level)
    values = np.concatenate([-np.arange(1.0, a + 1), np.arange(1.0, b + 1) ** 2, np.zeros(rest)])
    found = paired(10.0 + values, np.full(len(values), 10.0), confidence=level)
    assert found.p == pytest.approx(scipy.stats.binomtest(a, a + b).pvalue if a + b else 1.0)
    assert distinguishable(found.low, found.high) == (found.p <= 1.0 - level + 1e-12)
    assert (found.wins, found.losses, found.n) == (a, b, a + b + rest)


def test_intervals_of_several_comparisons_hold_at_once() -> None:
    """By Bonferroni: each of ten errs once in 200."""
    assert simultaneous(0.95, 10) == pytest.approx(0.995)
    assert simultaneous(0.95, 1) == simultaneous(0.95, 0) == pytest.approx(0.95)


@pytest.mark.parametrize(
    ("n", "differing", "comparisons"), [(40, 0.3, 15), (80, 0.1, 15), (3500, 0.2, 45), (30, 0.9, 1)]
)
def test_what_is_detectable_is_found_in_four_of_five_simulations(
    n: int, differing: float, comparisons: int
) -> None:
    level = simultaneous(0.95, comparisons)
    delta = detectable(n, differing, level)
    share = max(differing, delta)
    rng = np.random.default_rng(n)
    wins, losses, _ = rng.multinomial(
        n, [(share + delta) / 2, (share - delta) / 2, 1.0 - share], 20_000
    ).T
    score = (wins - losses - 1.0) / np.sqrt(np.maximum(wins + losses, 1))
    found = scipy.stats.norm.sf(score) * 2.0 <= 1.0 - level
    assert np.mean(found) == pytest.approx(0.8, abs=0.015)
    low, _ = difference_interval(int(wins[0]), int(losses[0]), n, level)
    assert (low > 0.0) == found[0]


def test_nothing_is_detectable_on_too_few_scenes() -> None:
    """Eight scenes to one side: (8 − 1)/√8 = 2.47, which 15 comparisons (2.94) do not allow."""
    assert detectable(8, 0.5, simultaneous(0.95, 15)) == math.inf
    # alone, six to none are enough: (6 − 1)/√6 = 2.04
    assert scipy.stats.binom.sf(5, 8, detectable(8, 0.5)) == pytest.approx(0.8, abs=1e-4)
    assert detectable(0, 0.0) == math.inf


def test_an_interval_that_is_exactly_as_sure_as_asked() -> None:
    """Six values: 2/2⁶ that the median lies beyond them, so that they cover 31/32."""
    assert median([3, 1, 2, 6, 5, 4], 31 / 32)[1:3] == (1.0, 6.0)
    assert median([3, 1, 2, 6, 5, 4], 31.1 / 32)[1:3] == (-math.inf, math.inf)
    assert math.isnan(median([]).median)


@pytest.mark.parametrize(
    ("n", "confidence"), [(6, 0.95), (7, 0.95), (20, 0.95), (501, 0.95), (30, 0.99), (5, 0.9)]
)
def test_the_interval_of_a_median_is_scipys(n: int, confidence: float) -> None:
    x = np.random.default_rng(n).normal(size=n)
    known = scipy.stats.quantile_test(x, q=0.0, p=0.5).confidence_interval(confidence)
    assert median(x, confidence)[1:3] == (known.low, known.high)


def test_a_pair_by_hand_and_by_scipy() -> None:
    rng = np.random.default_rng(3)
    a = rng.lognormal(size=40)
    b = rng.lognormal(size=40)
    found = paired(a, b)
    assert found.median == np.median(a - b)
    assert found.p == pytest.approx(descriptive.sign_test(a - b)[1])
    assert (found.wins, found.losses, found.effect) == (
        int((a < b).sum()),
        int((a > b).sum()),
        np.mean(a < b),
    )
    assert paired(a, b, better="more").effect == np.mean(a > b)
    ratio = paired(a, b, "log-ratio")
    assert ratio.median == pytest.approx(np.median(np.log(a / b)))
    known = scipy.stats.quantile_test(np.log(a / b), q=0.0, p=0.5)
    assert (ratio.low, ratio.high) == pytest.approx(tuple(known.confidence_interval(0.95)))
    assert ratio.p == pytest.approx(known.pvalue)


def test_the_sign_test_in_a_textbook() -> None:
    """Siegel 1956, p. 70: eleven fathers rank higher and three lower of 17, three alike; one-sided
    p = .029.
    """
    a = np.repeat([2.0, 0.0, 1.0], [11, 3, 3])
    b = np.ones(17)
    assert round(paired(a, b).p / 2.0, 3) == 0.029


def test_slower_in_half_of_the_scenes_and_never_faster_is_slower() -> None:
    """Three times as long in 48 of 100 scenes: in the others the laws are alike, and say nothing of
    which is faster.
    """
    b = np.linspace(1.0, 2.0, 100)
    found = paired(np.where(np.arange(100) < 48, 3.0 * b, b), b, "log-ratio")
    assert np.exp([found.median, found.low, found.high]) == pytest.approx([3.0, 3.0, 3.0])
    assert (found.wins, found.losses, found.effect) == (0, 48, pytest.approx(0.26))
    assert verdict(found.low, found.high, n=found.n) == "worse"
    # too near to differ
    assert paired(np.r_[1.1, b], np.r_[1.0, b], least=0.2)[:3] == (0.0, -math.inf, math.inf)


def test_only_scenes_in_which_both_count() -> None:
    a = np.array([1.0, 2, 3, math.nan, 5, 6, 7, 8])
    b = np.array([2.0, 3, 4, 5, math.nan, 7, 8, 9])
    found = paired(a, b)
    assert (found.n, found.of, found.median, found.effect) == (6, 8, -1.0, 1.0)


@pytest.mark.parametrize("kind", ["difference", "log-ratio"])
@pytest.mark.parametrize("n", [0, 1, 5, 6, 60])
def test_nothing_differs(n: int, kind: str) -> None:
    x = np.linspace(0.0, 3.0, n)
    found = paired(x, x, kind)  # type: ignore[arg-type]
    assert (found.p, found.effect, found.n) == (1.0, 0.5, n)
    assert (found.low, found.high) == (-math.inf, math.inf)
    assert math.isnan(found.median) if n == 0 else found.median == 0.0
    told = verdict(found.low, found.high, n=found.n)
    assert told == ("not distinguishable" if n >= 6 else "too few")


@given(
    st.integers(6, 120),
    st.integers(0, 2**32 - 1),
    st.floats(0.0, 1.0),
    st.sampled_from(["difference", "log-ratio"]),
)
@settings(max_examples=80, deadline=None)
def test_no_pair_of_numbers_is_too_odd(n: int, seed: int, ties: float, kind: str) -> None:
    rng = np.random.default_rng(seed)
    a = rng.integers(0, 3, n).astype(float)
    b = rng.lognormal(sigma=9.0, size=n)
    b[rng.random(n) < ties] = 0.0
    found = paired(a, b, kind)  # type: ignore[arg-type]
    other = paired(b, a, kind)  # type: ignore[arg-type]
    assert not np.isnan(found).any()
    assert found.low <= found.median <= found.high
    assert 0.0 <= found.p <= 1.0
    assert found.effect == pytest.approx(1.0 - other.effect)
    assert found.p == pytest.approx(other.p)
    assert found.median == pytest.approx(-other.median)


def test_ratios_of_zero() -> None:
    found = paired([0.0] * 8, [1.0] * 8, "log-ratio")
    assert found.median == found.low == found.high == -math.inf
    assert found.p == 2 / 2**8
    assert verdict(found.low, found.high, n=8) == "better"


def test_a_profile_by_brute_force() -> None:
    """Dolan and Moré: ρ_s(τ) = #{p: r_ps ≤ τ}/n, r_ps = t_ps / min_s t_ps."""
    rng = np.random.default_rng(2)
    costs = rng.lognormal(size=(50, 4))
    costs[rng.random((50, 4)) < 0.3] = math.inf
    costs[7] = math.inf
    found = profile(costs)
    assert found.shift == 0.0
    for tau in (1.0, 1.3, 2.0, 5.0, 1e9):
        for law in range(4):
            within = [
                row for row in costs if math.isfinite(row[law]) and row[law] / min(row) <= tau
            ]
            assert found.share(tau)[law] == len(within) / 50
    assert found.solved == pytest.approx(np.isfinite(costs).mean(axis=0))
    assert found.share([1.0, 2.0]).shape == (2, 4)
    assert found.steps[0] == 1.0
    assert np.isfinite(found.steps).all()
    assert profile([[1.0, 2.0], [math.inf, 3.0]]).steps.tolist() == [1.0, 2.0]
    assert profile([[math.inf]]).steps.tolist() == [1.0]
    assert profile([[1.0, 2.0]]).share(1.0).tolist() == [1.0, 0.0]


def test_costs_of_zero_are_shifted_as_said() -> None:
    """Least −3, median −1: 5 is added, and the median becomes 4, twice the least."""
    found = profile([[-3.0, -1.0], [-1.0, math.inf], [4.0, -2.0]])
    assert found.shift == 5.0
    assert found.ratios == pytest.approx(np.array([[1.0, 2.0], [1.0, math.inf], [3.0, 1.0]]))
    assert profile([[0.0, 0.0, 0.0, 4.0]]).ratios[0] == pytest.approx([1, 1, 1, 5])
    assert profile([[0.0, 0.0]]).ratios[0] == pytest.approx([1, 1])
    assert profile([[0.0, 0.0]]).shift == 1.0
    with pytest.raises(InvalidInput, match="positive costs: the least is -3, and 1 is added"):
        profile([[-3.0, 1.0]], shift=1.0)
    with pytest.raises(InvalidInput, match="positive costs: the least is -3, and 3 is added"):
        profile([[-3.0, 1.0]], shift=3.0)


def test_ranks_as_demsar_2006() -> None:
    """Sections 3.2.2 and 3.2.4: ranks, critical differences 1.25 and 1.12; at 90 % pure C4.5 is
    worse than both with m, and it cannot be told where C4.5+cf belongs.

    His χ² of 9.28 takes no account of equal ranks; Friedman's test by scipy does.
    """
    found = ranks(-AUC)
    assert [round(mean, 3) for mean in found.means] == [3.143, 2.0, 2.893, 1.964]
    assert (round(found.critical_difference, 2), found.n) == (1.25, 14)
    assert found.groups == ((3, 1, 2, 0),)
    assert found.p == pytest.approx(scipy.stats.friedmanchisquare(*AUC.T).pvalue)
    assert 12 * 14 / 20 * ((found.means**2).sum() - 4 * 25 / 4) == pytest.approx(9.28, abs=0.01)
    # of two laws the sign test, which scenes alike for both say nothing to: 3 to 1 of 6
    assert ranks([[1, 2], [1, 2], [1, 2], [2, 1], [1, 1], [3, 3]]).p == pytest.approx(10 / 16)
    loose = ranks(-AUC, 0.9)
    assert round(loose.critical_difference, 2) == 1.12
    assert loose.groups == ((3, 1, 2), (2, 0))
    assert np.allclose(loose.p_values, scikit_posthocs.posthoc_nemenyi_friedman(-AUC).to_numpy())


def test_bars_are_the_largest_groups_and_ties_are_neither_won_nor_lost() -> None:
    """30 scenes of 4 laws: with q = 2.569 the critical difference is 2.569 √(4·5/(6·30)) = 0.856.

    Mean ranks 50/30, 72/30, 82/30 and 96/30: the first reaches the second, the second the last; the
    bar of the last two lies within that. Of two laws 4 to 1, and one alike: 2 (5 + 1)/2⁵.
    """
    found = ranks(np.repeat([[1, 2, 3, 4], [1, 3, 4, 2], [3, 2, 1, 4]], [8, 12, 10], axis=0))
    assert found.means == pytest.approx(np.array([50, 72, 82, 96]) / 30)
    assert found.critical_difference == pytest.approx(0.856, abs=5e-4)
    assert found.groups == ((0, 1), (1, 2, 3))
    assert ranks([[1, 2]] * 4 + [[2, 1], [1, 1]]).p == pytest.approx(12 / 32)


def test_failures_rank_last_together() -> None:
    found = ranks([[1.0, math.inf, math.inf], [2.0, 1.0, math.inf]])
    assert found.means == pytest.approx([1.5, 1.75, 2.75])


@pytest.mark.parametrize(("scenes", "laws"), [(0, 3), (1, 3), (9, 1), (9, 2), (9, 3)])
def test_ranks_where_nothing_differs(scenes: int, laws: int) -> None:
    found = ranks(np.full((scenes, laws), math.inf))
    assert found.p == 1.0
    assert np.all(found.means == (laws + 1) / 2)
    assert found.groups == ((tuple(range(laws)),) if laws > 1 else ())
    assert np.array_equal(found.p_values, np.ones((laws, laws)))
    assert found.n == scenes
    assert (found.critical_difference == 0.0) == (laws == 1)


def test_the_rule_of_verdicts() -> None:
    assert verdict(-2.0, -1.0) == "better"
    assert verdict(-2.0, -1.0, better="more") == "worse"
    assert verdict(1.0, 2.0) == "worse"
    assert verdict(1.0, 2.0, better="more") == "better"
    assert verdict(-2.0, 0.0) == verdict(0.0, 2.0) == verdict(-1.0, 1.0) == "not distinguishable"
    assert verdict(-2.0, -1.0, n=5) == "too few"
    assert distinguishable(1.0, 2.0)
    assert not distinguishable(0.0, 2.0)
    assert not distinguishable(1.0, 2.0, n=5)


def test_numbers_with_the_digits_that_are_known() -> None:
    assert rate_text(rate_of(812, 1000)) == "812 of 1000: 81.2 % (95 %: 78.6 to 83.6 %)"
    assert rate_text(rate_of(10_000, 10_000)) == "10 000 of 10 000: at least 99.963 % (95 %)"
    assert rate_text(rate_of(0, 20)) == "0 of 20: at most 17 % (95 %)"
    assert rate_text(rate_of(1, 1)) == "1 of 1: at least 2 % (95 %)"
    assert rate_text(rate_of(0, 0)) == "0 of 0: nothing is known"
    assert with_interval(0.123456, 0.1201, 0.1268) == "0.1235 (0.1201 to 0.1268)"
    assert with_interval(0.00213, 0.00208, 0.00219, 1e3, "mm") == "2.130 (2.080 to 2.190) mm"
    assert with_interval(1.5, -math.inf, math.inf) == "1.50 (too few for an interval)"
    assert with_interval(3.0, 1.0, math.inf) == "3.00 (1.00 to ∞)"
    assert with_interval(math.nan, -math.inf, math.inf) == "no value"
    assert with_interval(0.0, 0.0, 0.0) == "0 (0 to 0)"
    assert with_interval(1e-9, 0.9e-9, 1.2e-9) == "1.00e-9 (9.0e-10 to 1.20e-9)"
    assert with_interval(-1.5, -math.inf, math.inf) == "-1.50 (too few for an interval)"
    assert with_interval(math.inf, 1.0, math.inf) == "∞ (1 to ∞)"
    assert with_interval(-math.inf, -math.inf, 1.0) == "-∞ (-∞ to 1)"
    assert with_interval(1.5e5, 1.4e5, 1.6e5) == "150000 (140000 to 160000)"
    assert with_interval(1.5e6, 1.4e6, 1.6e6) == "1.50e+6 (1.40e+6 to 1.60e+6)"
    assert with_interval(0.001234, 0.001134, 0.001334) == "0.00123 (0.00113 to 0.00133)"
    assert with_interval(0.000123, 0.000113, 0.000133) == "1.23e-4 (1.13e-4 to 1.33e-4)"
    assert rate_text(rate_of(3, 20)) == "3 of 20: 15 % (95 %: 3 to 38 %)"
    assert rate_text(rate_of(0, 3000)) == "0 of 3000: at most 0.13 % (95 %)"
    assert rate_text(rate_of(0, 3690)) == "0 of 3690: at most 0.100 % (95 %)"
    assert rate_text(rate_of(0, 5000)) == "0 of 5000: at most 7.4e-4 (95 %)"
    assert rate_text(rate_of(5000, 9999)) == "5000 of 9999: 50.01 % (95 %: 49.02 to 50.99 %)"


@pytest.mark.parametrize("confidence", [0.0, 1.0, -1.0, 2.0, math.nan, "0.95"])
def test_a_confidence_is_between_0_and_1(confidence: float) -> None:
    calls = (
        lambda: rate([True], confidence),
        lambda: mcnemar([True], [True], confidence),
        lambda: paired([1.0], [2.0], confidence=confidence),
        lambda: median([1.0], confidence),
        lambda: ranks([[1.0]], confidence),
        lambda: simultaneous(confidence, 3),
    )
    for call in calls:
        with pytest.raises(ConfigurationError, match="confidence must be between 0 and 1"):
            call()


def test_what_cannot_be_compared_is_said() -> None:
    with pytest.raises(InvalidInput, match="one entry each, not of 2 and 3"):
        paired([1.0, 2.0], [1.0, 2.0, 3.0])
    with pytest.raises(InvalidInput, match="one entry each, not of 1 and 2"):
        mcnemar([True], [True, False])
    with pytest.raises(InvalidInput, match="a holds inf"):
        paired([1.0, math.inf], [1.0, 1.0])
    with pytest.raises(InvalidInput, match=r"the ratio of negative values is undefined: -1\.0"):
        paired([1.0], [-1.0], "log-ratio")
    with pytest.raises(InvalidInput, match=r"the ratio of negative values is undefined: -0\.5"):
        paired([-0.5], [1.0], "log-ratio")
    with pytest.raises(InvalidInput, match=r"a must be of shape \(scenes,\)"):
        paired([[1.0]], [1.0])
    with pytest.raises(InvalidInput, match="must hold numbers only"):
        paired(["x"], [1.0])
    with pytest.raises(InvalidInput, match="must be true or false"):
        rate([True, math.nan])
    with pytest.raises(InvalidInput, match="a value is NaN"):
        median([math.nan])
    with pytest.raises(InvalidInput, match="values must hold numbers only"):
        median(["x"])
    with pytest.raises(InvalidInput, match="is not a rate"):
        rate_of(3, 2)
    with pytest.raises(InvalidInput, match="is not a rate"):
        rate_of(-1, 2)
    with pytest.raises(InvalidInput, match="must be numbers, or infinite"):
        ranks([[1.0, math.nan]])
    with pytest.raises(InvalidInput, match="must be numbers, or infinite"):
        profile([[1.0, -math.inf]])
    with pytest.raises(InvalidInput, match=r"shape \(scenes, laws\), not \(3, 0\)"):
        profile(np.empty((3, 0)))
    with pytest.raises(InvalidInput, match=r"shape \(scenes, laws\)"):
        profile([1.0])
    with pytest.raises(ConfigurationError, match="Did you mean 'log-ratio'"):
        paired([1.0], [1.0], "logratio")  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match="unknown direction"):
        paired([1.0], [1.0], better="lower")  # type: ignore[arg-type]


def test_a_rate_of_nothing() -> None:
    assert rate([]) == Rate(0, 0, 0.0, 1.0)
    assert math.isnan(rate([]).share)
    assert mcnemar([], []).p == 1.0
    assert np.all(profile(np.empty((0, 2))).share([1.0]) == 0.0)


NORMAL = np.linspace(-9.0, 9.0, 6001)


def mean_of_families(values: Array) -> float:
    """Of what is known at :data:`NORMAL`, by Simpson's rule."""
    return float(scipy.integrate.simpson(values * scipy.stats.norm.pdf(NORMAL), x=NORMAL))


def likelihood(mean: float, spread: float, counts: list[int], of: list[int]) -> float:
    """Of mixed logistic regression, by quadrature."""
    rates = scipy.special.expit(mean + spread * NORMAL)
    each = [
        mean_of_families(scipy.stats.binom.pmf(*numbers, rates))
        for numbers in zip(counts, of, strict=True)
    ]
    return sum(map(math.log, each))


def rate_of_families(mean: float, spread: float) -> float:
    """The mean rate of all families."""
    return mean_of_families(scipy.special.expit(mean + spread * NORMAL))


def test_families_as_random_effects_against_quadrature() -> None:
    """The greatest likelihood, and that the ends of the interval are as much less likely as the F
    quantile says.
    """
    counts = [58, 90, 80, 40, 99, 70, 93]
    of = [100, 100, 120, 60, 100, 100, 100]
    found = scipy.optimize.minimize(
        lambda x: -likelihood(x[0], math.exp(x[1]), counts, of), [1.0, 0.0], method="Nelder-Mead"
    )
    (across,) = across_families([counts], [of])
    assert across.share == pytest.approx(
        rate_of_families(found.x[0], math.exp(found.x[1])), abs=0.01
    )
    # on a grid of factors of 1.24
    assert across.spread == pytest.approx(math.exp(found.x[1]), rel=0.15)
    drop = scipy.stats.t.ppf(0.975, len(of) - 1) ** 2 / 2.0
    for end in (across.low, across.high):

        def with_share(log_spread: float, share: float = end) -> float:
            spread = math.exp(log_spread)
            mean = scipy.optimize.brentq(lambda m: rate_of_families(m, spread) - share, -9.0, 9.0)
            return -likelihood(mean, spread, counts, of)

        best = scipy.optimize.minimize_scalar(with_share, bounds=(-2.0, 1.5), method="bounded")
        assert best.fun - found.fun == pytest.approx(drop, abs=0.15)


def test_a_law_that_is_better_in_one_family_alone_is_not_better_in_a_further_one() -> None:
    """One that is a little better in all of them is: what counts is that families agree."""
    once, always = across_families(
        [[60, 0, 1, 0, 1, 0, 1], [20] * 7], [[60, 2, 2, 2, 2, 2, 2], [25] * 7]
    )
    assert once.low < 0.5 < always.low
    # as one list of scenes it is
    assert mcnemar([True] * 63 + [False] * 9, [False] * 63 + [True] * 9).low > 0.0


def test_what_never_or_always_happens_in_any_family() -> None:
    """The ends of the grid stand for rates of zero and one."""
    never, always = across_families([[0] * 5, [50] * 5], [[50] * 5, [50] * 5])
    assert (never.share, never.low, always.share, always.high) == (0.0, 0.0, 1.0, 1.0)
    assert 0.01 < never.high < 0.3
    assert always.low == pytest.approx(1.0 - never.high)


@pytest.mark.parametrize(
    ("counts", "of"), [([[1.0]], [[2.0]]), ([[3, 1]], [[2, 2]]), ([[1, 1]], [[2, 2, 2]])]
)
def test_counts_of_families_that_are_none(counts: list[list[float]], of: list[list[float]]) -> None:
    """More successes than scenes, other families, or only one."""
    with pytest.raises(InvalidInput, match="counts"):
        across_families(counts, of)


def test_ranks_with_a_family_left_out() -> None:
    """The second law is first only because of the last family."""
    rates = np.array([[0.9, 0.8, 0.8], [0.9, 0.8, 0.8], [0.1, 0.9, 0.1]])
    assert left_out_ranks(rates).tolist() == [[2, 1, 3], [2, 1, 3], [1, 2, 2]]
    with pytest.raises(InvalidInput, match="two families or more"):
        left_out_ranks(rates[:1])
