"""Studies: what they run, what they conclude from it, and what a failure costs."""

import csv
import math
import runpy
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image

from vsconstraints.comparisons.run import perform
from vsconstraints.comparisons.runs.spec import ControllerSpec, RunSpec
from vsconstraints.errors import ConfigurationError
from vsconstraints.paper.studies import (
    STUDIES,
    RunSummary,
    Study,
    StudyResult,
    data_file,
    figure_file,
    run_studies,
)
from vsconstraints.paper.studies.gradient_error import ErrorCase
from vsconstraints.paper.studies.laws import LAWS
from vsconstraints.paper.studies.pareto import front, not_kept, scaled_gains, unused
from vsconstraints.paper.studies.sampling_time import TimeCase
from vsconstraints.paper.studies.shrinking_region import RegionCase
from vsconstraints.paper.studies.summary import (
    clearance_distance,
    gains,
    joint_distance,
    pixel_distance,
)
from vsconstraints.paper.studies.switching_gain import GainCase
from vsconstraints.paper.studies.unselected_experiments import (
    compared,
    counted,
    kept_scenes,
    why_not,
)
from vsconstraints.reports.plots import Sheet
from vsconstraints.scenarios import Scenario


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Every study in its small form, run once, and the folder it was written to."""
    folder = tmp_path_factory.mktemp("studies")
    done = []
    results = run_studies(
        folder=folder, workers=2, small=True, on_progress=lambda *now: done.append(now)
    )
    return results, folder, done


@pytest.mark.parametrize("name", STUDIES)
class TestEveryStudy:
    def test_is_described(self, name):
        study = STUDIES[name]
        assert study.name == name
        assert study.title
        assert study.question.endswith("?")
        assert study.figure_caption.endswith(".")
        assert set(study.claims) <= set(range(1, 13))

    @pytest.mark.parametrize("size", [False, True])
    def test_runs_are_different(self, name, size):
        runs = STUDIES[name].runs(small=size)
        assert len(set(runs.values())) == len(runs)
        assert [type(run) for run in runs.values()] == [RunSpec] * len(runs)

    def test_small_form_answers(self, name, small):
        results, folder, _ = small
        result = results[name]
        assert result.failures == ()
        assert result.sentences
        assert not [sentence for sentence in result.sentences if "nan" in sentence]
        assert result.numbers
        assert len(result.points) >= len(STUDIES[name].runs(small=True))
        assert {"status", "reason"} <= set(result.points[0])
        with data_file(folder, name).open(encoding="utf-8") as file:
            lines = list(csv.DictReader(file))
        assert len(lines) == len(result.points)
        with Image.open(figure_file(folder, name)) as image:
            assert image.width == 1200

    def test_survives_runs_that_all_failed(self, name, tmp_path):
        study = STUDIES[name]
        lost = dict.fromkeys(study.runs(), RunSummary("failed", "lost"))
        result = study.evaluate(lost)
        assert len(result.failures) == len(lost)
        assert all(point["status"] == "failed" for point in result.points)
        study.draw(result, tmp_path / "figure.png")
        assert (tmp_path / "figure.png").exists()


def test_progress_counts_every_different_run_once(small):
    _, _, done = small
    different = {run for study in STUDIES.values() for run in study.runs(small=True).values()}
    total = len(different) + len({run.name for run in different})
    assert done == [(k, total) for k in range(total + 1)]


class TestWhatThePaperClaims:
    def test_potential_field_becomes_sliding_mode(self, small):
        numbers = small[0]["shrinking-region"].numbers
        name = ("example-2d-fov", "priority")
        assert numbers[(*name, "distance_falls")] == 1.0
        assert (
            numbers[(*name, "distance_smallest_region")]
            < 0.1 * numbers[(*name, "distance_largest_region")]
        )
        assert (
            numbers[(*name, "distance_smallest_region")]
            < numbers["example-2d-fov", "sampling_distance"]
        )

    def test_additive_blend_does_not(self, small):
        numbers = small[0]["shrinking-region"].numbers
        assert numbers["example-2d-fov", "additive", "distance_smallest_region"] > (
            10.0 * numbers["example-2d-fov", "sampling_distance"]
        )

    def test_condition_12_is_sufficient_but_not_necessary(self, small):
        numbers = small[0]["switching-gain"].numbers
        assert numbers["above_bound",] >= 2
        assert (
            numbers["above_bound_in_band",]
            == numbers["above_bound_allowed",]
            == numbers["above_bound",]
        )
        assert numbers["below_bound_allowed",] >= 1
        assert 18.0 < numbers[50.0, "bound_12"] < 20.0

    def test_too_small_a_gain_leaves_the_band_though_sigma_holds(self, small):
        outcomes = {p["switching_gain"]: p["outcome"] for p in small[0]["switching-gain"].points}
        assert outcomes == {
            5.0: "violated",
            10.0: "beyond band",
            20.0: "band, not sliding",
            40.0: "sliding",
        }

    def test_band_is_proportional_to_the_sampling_time(self, small):
        numbers = small[0]["sampling-time"].numbers
        name = ("example-2d-fast-high-gain",)
        assert numbers[(*name, "exponent")] == pytest.approx(1.0, abs=0.1)
        assert numbers[(*name, "longest_run")] == 1.0
        assert 1.0 < numbers[(*name, "greatest_excess")] < 1.6
        assert numbers[(*name, "greatest_share_of_expected")] < 1.1

    def test_gradient_error_of_the_paper_leaves_the_image_to_no_marker(self, small):
        points = [p for p in small[0]["gradient-error"].points if p["gradient_error"] == 0.3]
        assert len(points) == len(LAWS)
        # the boundary lies 5.3 % of L inside the image
        assert max(p["violation"] for p in points) < 100.0 * 0.05 / 0.95

    def test_barrier_uses_more_of_the_space_the_faster_it_may_approach(self, small):
        unused = {
            p["parameter"]: p["unused"]
            for p in small[0]["pareto"].points
            if p["controller"] == "hierarchical-qp"
        }
        assert unused[20.0] <= unused[5.0]


def summary(status="converged", *, q=0.0, pixel=0.0, clearance=0.0, **given):
    """A made-up run of two joints, one marker and one row over ten seconds."""
    t = np.linspace(0.0, 10.0, 11)
    result = {
        "utilization": 0.99,
        "violation_depth": 0.0,
        "acceleration_variation": 1.0,
        "violated": "",
    }
    result.update(given.pop("result", {}))
    return RunSummary(
        status,
        "",
        result,
        given.pop("rows", {}),
        given.pop("Ts", 0.005),
        t,
        np.full((11, 2), q),
        np.full((11, 1), clearance),
        np.full((11, 1, 2), pixel),
        **given,
    )


class TestDistances:
    def test_of_known_trajectories(self):
        one = summary(q=1.0, clearance=0.3, pixel=3.0)
        other = summary(q=4.0, clearance=0.1, pixel=0.0)
        assert joint_distance(one, other) == pytest.approx(3.0 * math.sqrt(2.0))
        assert clearance_distance(one, other) == pytest.approx(0.2)
        assert pixel_distance(one, other) == pytest.approx(3.0 * math.sqrt(2.0))

    def test_of_a_run_that_left_nothing(self):
        for distance in (joint_distance, clearance_distance, pixel_distance):
            assert math.isnan(distance(summary(), RunSummary("failed", "lost")))

    def test_over_the_time_that_both_have(self):
        short = RunSummary(
            "aborted", "", t=np.array([0.0, 2.0]), q=np.array([[1.0, 0.0], [1.0, 0.0]])
        )
        assert joint_distance(summary(), short) == pytest.approx(1.0)


class TestDrift:
    def test_what_condition_12_needs_is_what_moves_phi(self):
        """Between samples φ changes as L_fφ + L_gφ q̈ says, with the tracking command where no row
        acts.
        """
        made = perform(RunSpec("example-2d-fast", overrides={"duration": 1.0}))
        found = gains(made)
        phi = made.trajectory.phi
        active = phi >= 0.0
        enters, row = np.nonzero(active[1:] & ~active[:-1])
        assert len(enters)
        change = (phi[enters + 1, row] - phi[enters, row]) / made.sampling_time
        assert found["entry_push"] == pytest.approx(change.max(), rel=0.05)
        assert found["needed_gain"] == pytest.approx(made.needed_gain().max(), rel=1e-9)

    @pytest.mark.parametrize("known", [True, False])
    def test_a_motion_that_the_controller_is_not_told_of_is_left_out(self, known):
        made = perform(
            RunSpec(
                "moving-sphere", overrides={"constraints.0.motion.known": known, "duration": 1.5}
            )
        )
        assert (made.trajectory.phi >= 0.0).any()
        same = gains(made)["needed_gain"] == pytest.approx(made.needed_gain().max(), rel=1e-9)
        assert same == known

    def test_without_an_active_row_there_is_none(self):
        assert gains(perform(RunSpec("example-2d-fov", overrides={"duration": 0.1}))) == {}


class TestEvaluation:
    def test_shrinking_region_on_a_field_that_approaches_and_one_that_does_not(self):
        case = partial(RegionCase, "example-2d-fov")
        runs = {case("sliding-mode"): summary(), case("halved"): summary(q=0.001)}
        for region, near, far in ((0.5, 1.0, 1.0), (0.01, 0.1, 0.5), (0.001, 0.0, 2.0)):
            runs[case("priority", region)] = summary(q=near)
            runs[case("additive", region)] = summary(q=far)
        numbers = STUDIES["shrinking-region"].evaluate(runs).numbers
        assert numbers["example-2d-fov", "priority", "distance_falls"] == 1.0
        assert numbers["example-2d-fov", "additive", "distance_falls"] == 0.0
        assert numbers["example-2d-fov", "sampling_distance"] == pytest.approx(
            0.001 * math.sqrt(2.0)
        )
        assert numbers["example-2d-fov", "priority", "distance_smallest_region"] == 0.0

    def test_switching_gain_finds_the_thresholds(self):
        def run(depth, phi, samples):
            gains = {
                "needed_gain": 15.0,
                "entry_push": 16.0,
                "phi_max": phi,
                "longest_run": samples,
            }
            return summary(result={"violation_depth": depth}, **gains)

        runs = {
            GainCase(50.0, 5.0): run(0.1, 1.0, 30),
            GainCase(50.0, 10.0): run(0.0, 0.2, 20),
            GainCase(50.0, 20.0): run(0.0, 0.06, 3),
            GainCase(50.0, 40.0): run(0.0, 0.06, 1),
        }
        numbers = STUDIES["switching-gain"].evaluate(runs).numbers
        assert numbers[50.0, "smallest_allowed"] == 10.0
        assert numbers[50.0, "smallest_in_band"] == 20.0
        assert numbers[50.0, "smallest_sliding"] == 40.0
        assert numbers[50.0, "bound_12"] == 15.0
        assert numbers[50.0, "bound_sampled"] == 31.0
        assert (
            numbers["above_bound",],
            numbers["below_bound",],
            numbers["below_bound_allowed",],
        ) == (2.0, 2.0, 1.0)

    def test_switching_gain_counts_only_what_holds_for_all_larger_ones(self):
        made = {10.0: summary(phi_max=0.0), 20.0: summary("failed"), 40.0: summary(phi_max=0.0)}
        runs = {GainCase(50.0, gain): run for gain, run in made.items()}
        assert STUDIES["switching-gain"].evaluate(runs).numbers[50.0, "smallest_allowed"] == 40.0

    def test_sampling_time_finds_the_exponent(self):
        def run(Ts):
            return summary(
                Ts=Ts,
                entry_push=4.0,
                longest_run=1,
                result={"phi_band": 15.0 * Ts**2, "phi_band_bound": 10 * Ts},
            )

        runs = {TimeCase("example-2d-fov", 1e3 * Ts): run(Ts) for Ts in (0.001, 0.01, 0.1)}
        numbers = STUDIES["sampling-time"].evaluate(runs).numbers
        assert numbers["example-2d-fov", "exponent"] == pytest.approx(2.0)
        assert numbers["example-2d-fov", "greatest_share_of_expected"] == pytest.approx(1.5 / 14.0)

    def test_gradient_error_compares_with_the_same_controllers_exact_run(self):
        case = partial(ErrorCase, "example-2d-fov")
        runs = {
            case("sliding-mode", 0.0): summary(),
            case("sliding-mode", 0.3): summary(
                pixel=5.0, result={"violation_depth": 0.01, "violated": "fov"}
            ),
            case("potential-field", 0.0): summary(pixel=5.0),
            case("potential-field", 0.3): summary(pixel=5.0),
        }
        result = STUDIES["gradient-error"].evaluate(runs)
        assert result.numbers[
            "example-2d-fov", "sliding-mode", 0.3, "deviation_px"
        ] == pytest.approx(5.0 * math.sqrt(2.0))
        assert result.numbers["example-2d-fov", "potential-field", 0.3, "deviation_px"] == 0.0
        assert "violates fov by 1.00 % of L" in result.sentences[0]

    def test_a_run_on_the_front_is_beaten_by_none(self):
        def point(unused, variation, violation=0.0, status="converged"):
            return {
                "unused": unused,
                "acceleration_variation": variation,
                "not_kept": status
                if status != "converged"
                else "a row is violated"
                if violation
                else "",
            }

        best = [point(0.1, 9.0), point(1.0, 3.0), point(5.0, 1.0)]
        beaten = [
            point(1.0, 4.0),
            point(6.0, 1.0),
            point(0.01, 0.01, 2.0),
            point(0.0, 0.0, 0.0, "unfinished"),
        ]
        assert front([*beaten, *best]) == best


class Key(NamedTuple):
    key: str


class TinyStudy(Study):
    """Runs of half a second, some of which go wrong."""

    name = "tiny"
    title = "Tiny"
    question = "Does it go on?"
    claims = ()
    columns = ("status", "reason")
    figure_caption = "Nothing."

    def __init__(self, laws, spoiled=""):
        self.laws = laws
        self.spoiled = spoiled

    def runs(self, *, small=False):
        return {
            Key(key): RunSpec("example-2d-fov", ControllerSpec(law), {"duration": 0.1})
            for key, law in self.laws.items()
        }

    def lines(self, case, run, results):
        return [{}]

    def numbers(self, points):
        if self.spoiled == "numbers":
            raise ZeroDivisionError("in numbers")
        return {}

    def sentences(self, points, numbers):
        return []

    def figure(self, result):
        if self.spoiled == "figure":
            raise ZeroDivisionError("in figure")
        return Sheet()


DEADLY = """import os
from vsconstraints.controllers import Tracking
class Deadly(Tracking):
    name = 'deadly'
    def solve(self, rows, task):
        os._exit(3)
"""


@pytest.fixture(scope="module")
def spoiled(tmp_path_factory):
    """Results of studies of which two go wrong themselves and one has runs that do, made
    together.
    """
    folder = tmp_path_factory.mktemp("spoiled")
    (folder / "deadly_law.py").write_text(DEADLY)
    laws = {
        "good": "sliding-mode",
        "bad": "no-such-law",
        "deadly": "deadly_law:Deadly",
        "two": "tracking",
    }
    studies = {
        "numbers": TinyStudy({"one": "tracking"}, "numbers"),
        "figure": TinyStudy({"one": "tracking"}, "figure"),
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        return run_studies(folder=folder, workers=2, studies={**studies, "other": TinyStudy(laws)})


class TestFailures:
    def test_a_run_that_cannot_be_made_or_whose_process_dies_costs_itself_only(self, spoiled):
        result = spoiled["other"]
        assert [point["status"] == "failed" for point in result.points] == [
            False,
            True,
            True,
            False,
        ]
        bad, deadly = result.failures
        assert "no-such-law" in bad
        assert deadly == "deadly: failed, the process that ran it died"

    @pytest.mark.parametrize(("where", "points"), [("numbers", 0), ("figure", 1)])
    def test_an_evaluation_or_drawing_that_raises_costs_no_other_study(
        self, spoiled, where, points
    ):
        assert len(spoiled[where].points) == points
        (failure,) = spoiled[where].failures
        assert f"in {where}" in failure

    def test_unknown_names_are_refused_with_those_there_are(self):
        with pytest.raises(ConfigurationError, match="Did you mean 'pareto'"):
            run_studies(["paretto"])

    def test_a_folder_that_cannot_be_made_is_refused(self, tmp_path):
        (tmp_path / "file").write_text("")
        with pytest.raises(ConfigurationError, match="cannot be written"):
            run_studies(["pareto"], tmp_path / "file")


def test_obstacles_of_unknown_velocity_are_met_with_the_gain_of_their_scenario():
    unknown = [case for case in STUDIES["non-static"].runs() if not case.known]
    shipped = {
        case.scenario: Scenario.load(case.scenario).tables["constraints"][0] for case in unknown
    }
    assert len(unknown) == 5
    assert all(
        case.speed and case.switching_gain == shipped[case.scenario]["switching_gain"]
        for case in unknown
    )


def test_gains_are_scaled_row_by_row():
    assert scaled_gains("case-study-6r", 1.0) == {}
    assert scaled_gains("case-study-6r", 2.0)["constraints.3.switching_gain"] == pytest.approx(0.4)
    assert len(scaled_gains("case-study-6r", 2.0)) == 4


def test_results_are_data():
    assert StudyResult("tiny").points == ()


EXAMPLES = Path(__file__).parent.parent / "examples"
DRAWING = runpy.run_path(str(EXAMPLES / "draw_experiment_scenes.py"))


class TestUnselectedExperiments:
    def test_kept_scenes_are_those_that_are_drawn(self):
        experiment = DRAWING["DRAWN"][1]
        scenes, rejected = DRAWING["draw"](experiment, 2, DRAWING["SEED"])
        assert scenes == kept_scenes()[experiment.scenario]["scenes"][:2]
        assert rejected["no marker crosses the boundary by 3 px"] > 0

    @pytest.mark.parametrize("experiment", DRAWING["DRAWN"], ids=lambda one: one.scenario)
    def test_kept_scenes_are_many_and_of_the_geometry(self, experiment):
        kept = kept_scenes()[experiment.scenario]
        assert len(kept["scenes"]) == experiment.kept > 100
        assert sum(kept["rejected"].values()) > 1000
        for scene in kept["scenes"][:5]:
            scenario = Scenario.load(experiment.scenario)
            for key, value in scene.items():
                scenario = scenario.with_override(key, value)
            setup = scenario.setup()
            (goal,) = setup.task.goals
            pixels = np.array([setup.scene.glance(setup.q0)[0], goal.pixels])
            assert setup.scene.camera.sees(pixels).all()
            assert (experiment.depth(pixels) < -4.9).all()

    def test_depth_is_that_of_the_scenarios_own_boundary(self):
        for experiment in DRAWING["DRAWN"]:
            setup = Scenario.load(experiment.scenario).setup()
            constraint = setup.constraints.constraints[0]
            pixels = np.random.default_rng(0).uniform(-300.0, 300.0, (200, 2)) * [1.0, 0.75]
            assert ((experiment.depth(pixels) > 0.0) == (constraint.sigma(pixels) > 0.0)).all()

    @staticmethod
    def run(
        status="converged",
        *,
        clearance=1.0,
        phi=0.01,
        pixel=0.0,
        speed=0.1,
        rows=("fov[marker 1]",),
    ):
        made = {
            label: {
                "clearance_min": clearance,
                "usage_max": 1.0 - clearance / 200.0,
                "phi_max": phi,
            }
            for label in rows
        }
        return replace(summary(status, pixel=pixel, rows=made), qd=np.full((11, 2), speed))

    @pytest.mark.parametrize(
        ("change", "why"),
        [
            ({}, ""),
            ({"status": "trapped"}, "trapped"),
            ({"phi": -0.01}, "no row acts"),
            ({"rows": ("fov[marker 1]", "fov[marker 2]")}, "more than one row"),
            ({"rows": ("range[joint 1].upper",)}, "another kind"),
            ({"clearance": -0.1}, "crossed"),
        ],
    )
    def test_scenes_are_rejected_by_the_run_without_an_error_alone(self, change, why):
        found = why_not("fov", self.run(**change))
        assert why in found
        assert bool(found) == bool(why)

    @pytest.mark.parametrize(
        ("change", "similar", "satisfactory", "little", "applied"),
        [
            ({"pixel": 31.9 / np.sqrt(2.0)}, True, True, True, True),
            ({"pixel": 32.1 / np.sqrt(2.0)}, False, True, True, True),
            ({"pixel": 0.005}, True, True, True, False),
            ({"pixel": 1.0, "clearance": -0.01}, False, False, True, True),
            ({"pixel": 1.0, "status": "trapped"}, False, False, False, True),
            ({"pixel": 1.0, "speed": 0.1109}, True, True, False, True),
            ({"pixel": 300.0}, False, False, True, True),
        ],
    )
    def test_what_an_error_changes(self, change, similar, satisfactory, little, applied):
        line = compared("fov", self.run(**change), self.run())
        assert line["clearance_share"] == pytest.approx(
            100.0 * change.get("clearance", 1.0) / 200.0
        )
        found = [line[what] for what in ("similar", "satisfactory", "little_speed", "applied")]
        assert found == [similar, satisfactory, little, applied]

    def test_counts_leave_out_the_shipped_scene(self):
        line = {"similar": True, "satisfactory": False, "little_speed": True, "applied": True}
        points = [
            {**line, "case": "plus", "scene": scene, "track_px": 2.0, "speed_share": 5.0}
            for scene in ("shipped", "0", "1")
        ]
        numbers = counted(points)
        assert (numbers["scenes"], numbers["similar"], numbers["satisfactory"]) == (2.0, 2.0, 0.0)


class TestKeptBoundaries:
    @staticmethod
    def row(**changes):
        row = {
            "kind": "fov",
            "longest_positive_run_s": 0.01,
            "phi_max": 0.3,
            "switching_gain": 10.0,
        }
        return {**row, "violation_depth": 0.0, "usage_max": 0.99, "challenged": True, **changes}

    @pytest.mark.parametrize(
        ("changes", "why"),
        [
            ({}, ""),
            ({"longest_positive_run_s": 0.015}, "φ ≥ 0 for 3 samples"),
            ({"violation_depth": 1e-6}, "is violated"),
            ({"kind": "speed", "violation_depth": 0.01, "phi_max": 0.099}, ""),
            ({"kind": "speed", "phi_max": 0.101}, "is violated"),
        ],
    )
    def test_like_is_compared_with_like(self, changes, why):
        found = not_kept(summary(rows={"one": self.row(**changes)}))
        assert why in found
        assert bool(found) == bool(why)

    def test_a_run_that_does_not_arrive_is_not_compared(self):
        assert not_kept(summary("unfinished", rows={"one": self.row()})) == "unfinished"

    def test_unused_space_is_that_of_challenged_rows(self):
        rows = {
            "a": self.row(usage_max=0.98),
            "b": self.row(usage_max=1.2),
            "c": self.row(usage_max=0.1, challenged=False),
        }
        assert unused(summary(rows=rows)) == pytest.approx(1.0)
        assert math.isnan(unused(summary()))
