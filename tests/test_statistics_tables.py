"""Tables of runs: which runs count, every pair of laws, and laws that are told apart when they
should be.
"""

from __future__ import annotations

import math
from time import process_time
from typing import Any

import numpy as np
import pandas as pd
import pytest
import scipy.stats
from checks import statistics as simulated
from statsmodels.stats.multitest import multipletests

from vsconstraints.bench.statistics import (
    OUTCOMES,
    compare_laws,
    costs,
    judged_metrics,
    medians,
    profile,
    ranks,
    rate_of,
    rates,
)
from vsconstraints.bench.statistics.judged import resolution
from vsconstraints.comparisons.metrics import result_columns, run_metrics
from vsconstraints.errors import ConfigurationError

SCENES = 8


def made(
    law: str, jerk: list[float], status: str = "converged", violated: str = "", **more: Any
) -> pd.DataFrame:
    """Runs of a law with a jerk in every scene; each further column as given, or as in a run
    without events.
    """
    given = {
        "family": "planar",
        "condition": "nominal",
        "half": "held-out",
        "scene": range(len(jerk)),
    }
    quiet = {metric.column: 0.0 for metric in run_metrics() if metric.kind in ("number", "time")}
    run = {
        **given,
        "controller": law,
        **quiet,
        "status": status,
        "violated": violated,
        "jerk_rms": jerk,
    }
    run |= {"violated_tolerant": violated, **more}
    return pd.DataFrame(run)


@pytest.fixture
def runs() -> pd.DataFrame:
    """b's jerk is a's and 1 more; in scene 2 only a counts, in scene 3 only b, in scene 4
    neither.
    """
    a = made("a", [1.0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11])
    b = made("b", [2.0, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12])
    b.loc[2, "status"] = "trapped"
    a.loc[3, "violated"] = "fov[marker 1]"
    a.loc[4, "status"] = b.loc[4, "status"] = "aborted"
    return pd.concat([b, a])


def test_only_scenes_in_which_both_count(runs: pd.DataFrame) -> None:
    line = compare_laws(runs, "jerk_rms").iloc[0]
    assert (line.a, line.b, line.family, line.condition, line.metric) == (
        "a",
        "b",
        "planar",
        "nominal",
        "jerk_rms",
    )
    assert (line.scenes, line.paired, line.only_a, line.only_b) == (11, 8, 1, 1)
    assert (line.difference, line.low, line.high, line.effect, line.differ) == (
        -1.0,
        -1.0,
        -1.0,
        1.0,
        8,
    )
    # in the middle of 1/2, 2/3, 6/7, … 11/12
    assert line.ratio == pytest.approx(math.sqrt(7 / 8 * 8 / 9))
    assert (line.p, line.verdict) == (2 / 2**8, "better")


def test_outcomes_count_every_scene(runs: pd.DataFrame) -> None:
    success = compare_laws(runs, "success").iloc[0]
    assert (success.scenes, success.paired, success.only_a, success.only_b) == (11, 11, 1, 1)
    assert (success.difference, success.effect, success.verdict) == (
        0.0,
        0.5,
        "not distinguishable",
    )
    violation = compare_laws(runs, "violation").iloc[0]
    assert (violation.only_a, violation.only_b) == (1, 0)
    assert violation.difference == pytest.approx(1 / 11)
    assert violation.effect == pytest.approx(0.5 - 0.5 / 11)
    assert violation.differ == 1
    table = rates(runs, "convergence").set_index("controller")
    assert (table.loc["a", "count"], table.loc["b", "count"], table.loc["a", "of"]) == (10, 9, 11)
    known = rate_of(9, 11)
    assert (table.loc["b", "low"], table.loc["b", "high"]) == (known.low, known.high)
    assert list(rates(runs, "success")["count"]) == [9, 9]
    assert list(rates(runs, "violation")["share"]) == [1 / 11, 0.0]


def test_chances_of_outcomes_are_those_of_wins_and_losses() -> None:
    """Of 10 scenes a wins 3 and loses none, by success; by violation it is the other way round."""
    a = made("a", [1.0] * 10)
    b = made("b", [1.0] * 10, violated=["q[1]"] * 3 + [""] * 7)
    runs = pd.concat([a, b])
    for outcome, difference in (("success", 0.3), ("violation", -0.3), ("tolerant success", 0.3)):
        line = compare_laws(runs, outcome).iloc[0]
        assert (line.difference, line.effect) == pytest.approx((difference, 0.65))
    never = compare_laws(pd.concat([a[:5], b[5:]]), "success").iloc[0]
    assert (never.scenes, never.effect, never.low, never.high) == (0, 0.5, -1.0, 1.0)
    assert never.verdict == "too few"


@pytest.mark.parametrize("first", ["a", "b"])
def test_ratios_of_nothing_negative(first: str) -> None:
    """One negative value leaves differences alone; zeros have ratios."""
    usual = np.arange(1.0, 10.0)
    odd = np.arange(1.0, 10.0)[::-1] ** 2
    for value in (-1.0, 0.0):
        odd[0] = value
        runs = pd.concat([made(law, (usual if law == first else odd).tolist()) for law in "ab"])
        line = compare_laws(runs, "jerk_rms").iloc[0]
        a, b = (usual, odd) if first == "a" else (odd, usual)
        differ = [(x, y) for x, y in zip(a, b, strict=True) if x != y]
        assert line.differ == len(differ)
        assert line.p == scipy.stats.binomtest(sum(x < y for x, y in differ), len(differ)).pvalue
        if value < 0.0:
            assert math.isnan(line.ratio)
        else:
            assert line.ratio == pytest.approx(
                np.median([x / y if y else math.inf for x, y in differ])
            )


def test_medians_are_of_runs_that_count(runs: pd.DataFrame) -> None:
    line = medians(runs, "jerk_rms").set_index("controller").loc["a"]
    assert (line.counted, line.of, line["median"]) == (9, 11, 7.0)
    # of 9 values, the second and the last but one: 2 (1 + 9)/2⁹ = 0.04
    assert (line.low, line.high) == (2.0, 10.0)


def test_costs_put_failures_at_infinity(runs: pd.DataFrame) -> None:
    found = costs(runs, "jerk_rms")
    assert found.left_out == 0
    assert np.isinf(found.table.loc[("planar", "nominal", "held-out", 4)]).all()
    assert profile(found.table).solved == pytest.approx([9 / 11, 9 / 11])
    assert ranks(found.table).means == pytest.approx(
        [(1 * 9 + 2 + 1.5) / 11, (2 * 9 + 1 + 1.5) / 11]
    )
    more = costs(made("a", [1.0, 2.0], utilization=[0.5, math.nan]), "utilization")
    assert (more.table["a"].tolist(), more.left_out) == ([-0.5], 1)


def test_depth_counts_where_rows_were_violated_and_bands_where_sliding_was_not_lost() -> None:
    scenes = [1.0] * SCENES
    runs = pd.concat(
        [
            made(
                "a",
                scenes,
                violated="q[1]",
                violation_depth=0.1,
                sliding_lost_s=0.0,
                phi_band=1.0,
                phi_band_bound=2.0,
            ),
            made(
                "b",
                scenes,
                violation_depth=0.2,
                sliding_lost_s=[0.0] * 6 + [0.1] * 2,
                phi_band=3.0,
                phi_band_bound=2.0,
            ),
            made("c", scenes, phi_band=[1.0] * 7 + [0.0], phi_band_bound=[2.0] * 7 + [0.0]),
        ]
    )
    assert compare_laws(runs, "violation_depth").paired.tolist() == [8, 8, 8]
    assert compare_laws(runs, "jerk_rms").paired.tolist() == [0, 0, 8]
    band = compare_laws(runs, "phi_band / phi_band_bound")
    assert band.paired.tolist() == [0, 0, 6]
    assert band.iloc[2].ratio == pytest.approx(3.0)
    assert band.verdict.tolist() == ["too few", "too few", "worse"]
    assert band.p_corrected.tolist() == [1.0, 1.0, band.p[2]]  # what is too few is no test


def test_every_pair_is_corrected_within_its_group() -> None:
    rng = np.random.default_rng(0)
    base = rng.lognormal(size=40)
    laws = [made(law, base * np.exp(rng.normal(0.05 * i, 0.1, 40))) for i, law in enumerate("abcd")]
    other = [
        law.assign(condition="disturbed", jerk_rms=law.jerk_rms.to_numpy()[::-1])
        for law in laws[:2]
    ]
    table = compare_laws(pd.concat([*laws, *other]), "jerk_rms")
    nominal = table[table.condition == "nominal"]
    disturbed = table[table.condition == "disturbed"]
    assert (len(nominal), len(disturbed)) == (6, 1)
    assert nominal.p_corrected.to_numpy() == pytest.approx(
        multipletests(nominal.p, method="bonferroni")[1]
    )
    # the interval is that of one pair at 1 − .05/6, and says the same as the test
    known = scipy.stats.quantile_test(laws[0].jerk_rms - laws[1].jerk_rms, q=0.0, p=0.5)
    assert tuple(nominal.iloc[0][["low", "high"]]) == pytest.approx(
        tuple(known.confidence_interval(1.0 - 0.05 / 6))
    )
    assert ((nominal.low > 0.0) | (nominal.high < 0.0)).tolist() == (
        nominal.p_corrected <= 0.05
    ).tolist()
    assert (nominal.verdict != "not distinguishable").tolist() == (
        nominal.p_corrected <= 0.05
    ).tolist()
    assert {"not distinguishable"} < set(nominal.verdict)
    assert disturbed.p_corrected.tolist() == disturbed.p.tolist()
    line = nominal[(nominal.a == "a") & (nominal.b == "c")].iloc[0]
    wins = int((laws[0].jerk_rms < laws[2].jerk_rms).sum())
    assert line.p == pytest.approx(scipy.stats.binomtest(wins, 40).pvalue)
    against = compare_laws(pd.concat(laws), "jerk_rms", "b")
    assert against[["a", "b"]].to_numpy().tolist() == [["a", "b"], ["c", "b"], ["d", "b"]]
    pooled = compare_laws(pd.concat([*laws, *other]), "jerk_rms", by=())
    assert (len(pooled), pooled.scenes.max(), pooled.scenes.min()) == (6, 80, 40)


def test_tables_do_not_depend_on_the_order_of_runs(runs: pd.DataFrame) -> None:
    mixed = runs.sample(frac=1.0, random_state=1)
    kinds = dict.fromkeys(
        ("family", "condition", "half", "controller", "status", "violated"), "category"
    )
    for metric in ("jerk_rms", "success"):
        known = compare_laws(runs, metric)
        pd.testing.assert_frame_equal(compare_laws(mixed, metric), known)
        pd.testing.assert_frame_equal(compare_laws(mixed.astype(kinds), metric), known)
    pd.testing.assert_frame_equal(costs(mixed, "jerk_rms").table, costs(runs, "jerk_rms").table)


def test_scenes_that_one_law_has_not_run_are_not_its_failures(runs: pd.DataFrame) -> None:
    part = runs[(runs.controller == "b") | (runs.scene < 9)]
    assert compare_laws(part, "success").iloc[0].scenes == 9
    assert compare_laws(part, "jerk_rms").iloc[0].only_b == 1
    assert costs(part, "jerk_rms").left_out == 2


@pytest.mark.parametrize("name", [*judged_metrics(), *OUTCOMES])
@pytest.mark.parametrize("scenes", [0, 1, 7])
def test_every_metric_of_few_scenes(name: str, scenes: int) -> None:
    """Tables, never crashes: no scenes, one, few; values that are missing or infinite; a law that
    always fails.
    """
    rng = np.random.default_rng(scenes)
    odd = {
        metric.column: rng.choice([0.0, 1.0, math.nan, math.inf], scenes)
        for metric in run_metrics()
        if metric.header
    }
    odd.pop("compiled", None)
    laws = [made(law, [1.0] * scenes, phi_band_bound=1.0) for law in ("a", "b")]
    laws += [made("odd", [1.0] * scenes, **{k: v for k, v in odd.items() if k != "jerk_rms"})]
    laws += [made("fails", [math.nan] * scenes, status="failed")]
    runs = pd.concat(laws)
    table = compare_laws(runs, name)
    if scenes:
        assert len(table) == 6
        assert table.verdict[0] == ("not distinguishable" if scenes >= 6 else "too few")
        assert not table[["p", "p_corrected", "effect", "low", "high"]].isna().any().any()
    else:
        assert len(table) == 0
    assert len(compare_laws(runs, name, "a") if scenes else []) == (3 if scenes else 0)
    if name not in OUTCOMES:
        assert len(medians(runs, name)) == (4 if scenes else 0)
        assert set(costs(runs, name).table.columns) == (
            {"a", "b", "odd", "fails"} if scenes else set()
        )


def test_a_remaining_error_that_reports_do_not_show_does_not_distinguish() -> None:
    runs = pd.concat(
        [
            made(law, [1.0] * 20, final_translation_error_m=error)
            for law, error in (("a", 1e-9), ("b", 5e-8))
        ]
    )
    line = compare_laws(runs, "final_translation_error_m").iloc[0]
    # a thousandth of the millimetre shown
    assert resolution(judged_metrics()["final_translation_error_m"]) == 1e-6
    assert resolution(judged_metrics()["jerk_rms"]) == 0.0
    assert (line.differ, line.p, line.verdict) == (0, 1.0, "not distinguishable")
    assert compare_laws(runs, "final_translation_error_m", least=0.0).verdict.tolist() == ["better"]


def test_metrics_and_their_directions_are_those_of_reports() -> None:
    known = judged_metrics()
    assert known["utilization"].better == "more"
    assert {
        "settling_time_s",
        "acceleration_variation",
        "violation_depth",
        "phi_band / phi_band_bound",
    } <= set(known)
    assert not {"phi_band", "duration_s", "status", "step_time_median_us", "compiled"} & set(known)
    assert {metric.column for metric in known.values()} <= set(result_columns())
    more = [made(law, [1.0] * 9, utilization=used) for law, used in (("a", 0.9), ("b", 0.8))]
    assert compare_laws(pd.concat(more), "utilization").verdict.tolist() == ["better"]


def test_what_cannot_be_compared_is_said(runs: pd.DataFrame) -> None:
    with pytest.raises(
        ConfigurationError, match=r"unknown metric 'jerk'\. Did you mean 'jerk_rms'"
    ):
        compare_laws(runs, "jerk")
    with pytest.raises(ConfigurationError, match="unknown metric 'status'"):
        medians(runs, "status")
    with pytest.raises(
        ConfigurationError, match=r"unknown outcome 'succes'\. Did you mean 'success'"
    ):
        rates(runs, "succes")
    with pytest.raises(
        ConfigurationError,
        match="no column 'violated_tolerant'; another version may have scored them",
    ):
        rates(runs.drop(columns="violated_tolerant"), "tolerant success")
    with pytest.raises(ConfigurationError, match=r"unknown controller 'z'.* Available: a, b"):
        compare_laws(runs, "jerk_rms", "z")
    with pytest.raises(
        ConfigurationError,
        match="22 runs appear twice, the first of them planar, nominal, held-out, 0, b",
    ):
        compare_laws(pd.concat([runs, runs]), "jerk_rms")
    with pytest.raises(
        ConfigurationError, match="no column 'half'; needed are family, condition, half, scene"
    ):
        rates(runs.drop(columns="half"))
    with pytest.raises(ConfigurationError, match="no column 'robot'"):
        rates(runs, by=("robot",))
    with pytest.raises(ConfigurationError, match="no column 'jerk_rms'"):
        compare_laws(runs.drop(columns="jerk_rms"), "jerk_rms")
    compare_laws(runs.drop(columns="sliding_lost_s"), "jerk_rms")
    for missing in ("phi_band_bound", "sliding_lost_s"):
        with pytest.raises(ConfigurationError, match=f"no column '{missing}'"):
            compare_laws(runs.drop(columns=missing), "phi_band / phi_band_bound")
    with pytest.raises(ConfigurationError, match="confidence must be between 0 and 1"):
        compare_laws(runs, "jerk_rms", confidence=95)


@pytest.mark.parametrize("case", simulated.CASES, ids=lambda case: case.what)
def test_intervals_cover(case: Any) -> None:
    """The demand of ``python -m checks.statistics``, with 2 % room: so many repetitions have a
    deviation of 1.3 %.
    """
    found = simulated.coverage(case, 300, seed=0)
    assert case.least - 0.02 <= found.share <= case.most + 0.02


@pytest.mark.parametrize("question", simulated.QUESTIONS, ids=lambda question: question.what)
def test_laws_are_told_apart_when_they_differ_and_only_then(question: Any) -> None:
    assert simulated.answered(question, 100, seed=0).count >= 95


@pytest.mark.parametrize("laws", [3, 8])
@pytest.mark.parametrize("world", simulated.WORLDS, ids=lambda world: world.what)
def test_of_all_verdicts_on_several_laws_none_is_false_in_95_of_100(world: Any, laws: int) -> None:
    """And all intervals hold at once. An interval for each pair alone with a corrected Wilcoxon p
    errs in 22.
    """
    false, held = simulated.families(world, laws, 60, seed=0)
    assert false.share <= simulated.promised(60)
    assert held.share >= 1.0 - simulated.promised(60)


def test_few_scenes_with_ties_are_compared_in_no_time() -> None:
    """SciPy's Wilcoxon test permutes them: a quarter of a minute for three laws on 13 scenes.

    CPU time is limited: the machine may be busy.
    """
    ties = simulated.table(simulated.WORLDS[2], 3, 0, np.random.default_rng(1), 13)
    started = process_time()
    compare_laws(ties, "jerk_rms")
    assert process_time() - started < 4.0
