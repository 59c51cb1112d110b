"""Features by their value: formulas against ViSP and differences, files, and what is undefined."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenes import NOW, random_goal, random_scene, robot
from vsconstraints.bench.families import Family
from vsconstraints.constraints import ConstraintSet
from vsconstraints.control import ControlStep
from vsconstraints.controllers import HierarchicalQP, Tracking
from vsconstraints.errors import ConfigurationError, SceneError
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.vision.features import (
    FEATURES,
    AreaCentroid,
    CameraPose,
    Depth,
    Feature,
    Goal,
    Hybrid,
    ImagePoints,
    Line,
    Polar,
    Segment,
    Stack,
    View,
    ViewFeature,
)
from vsconstraints.vision.tracking import TrackingGains, VisualTask

BY_VALUE = [kind for kind in FEATURES.values() if issubclass(kind, ViewFeature)]
MARKERS = np.array([[0.1, 0.2], [-0.15, 0.22], [-0.12, -0.17], [0.14, -0.11]])
VIEW = View(MARKERS, np.array([0.8, 0.9, 1.1, 1.0]), None)
GOAL = View(0.7 * MARKERS + 0.02, np.array([1.0, 1.1, 1.2, 1.1]), None)

# --- formulas ---


def at(x: float, y: float, Z: float) -> View:
    return View(np.array([[x, y]]), np.array([Z]), None)


def test_polar_coordinates_and_depths_are_those_of_visp() -> None:
    """ViSP 3.5: vpFeaturePointPolar, and vpFeatureDepth at x = 0.1, y = 0.2, Z = 1.3.

    visjac_p_polar of machinevision-toolbox 2.4.1 has the opposite sign, against its own visjac_p.
    """
    cases = json.loads((Path(__file__).parent / "data" / "visp_features.json").read_text())
    for case in cases["polar"]:
        rho, theta = case["rho"], case["theta"]
        view = at(rho * np.cos(theta), rho * np.sin(theta), case["Z"])
        np.testing.assert_allclose(Polar().value(view, view), [rho, theta], rtol=1e-13)
        np.testing.assert_allclose(Polar().interaction_matrix(view, view), case["L"], atol=1e-12)
    view = at(0.1, 0.2, 1.3)
    np.testing.assert_allclose(Depth().interaction_matrix(view, view), cases["depth"], atol=1e-12)


@pytest.mark.parametrize("kind", BY_VALUE)
def test_matrices_are_the_derivatives_of_the_values(kind: type[ViewFeature]) -> None:
    feature = kind()
    view = feature.seen(VIEW)
    goal = feature.seen(GOAL)
    given = feature.interaction_matrix(view, goal)
    np.testing.assert_allclose(
        given, ViewFeature.interaction_matrix(feature, view, goal), rtol=1e-7, atol=1e-9
    )
    # depths depend on v_z, ω_x and ω_y alone
    assert np.linalg.matrix_rank(given) == min(3 if kind is Depth else 6, len(given))


@pytest.mark.parametrize("name", ["polar", "depth", "ellipse", "area-centroid"])
def test_matrices_are_the_derivatives_for_any_number_of_markers(name: str) -> None:
    """Six markers on a circle, seen at different depths: means are not sums over four."""
    angle = np.linspace(0.1, 5.5, 6)
    view = View(0.2 * np.column_stack((np.cos(angle), np.sin(angle))), 1.0 + 0.05 * angle, None)
    feature = FEATURES[name]()
    assert isinstance(feature, ViewFeature)
    given = feature.interaction_matrix(view, view)
    differences = ViewFeature.interaction_matrix(feature, view, view)
    np.testing.assert_allclose(given, differences, rtol=1e-7, atol=1e-9)


def test_a_line_has_the_matrix_of_its_plane() -> None:
    """Espiau, Chaumette and Rives (1992), for a plane A X + B Y + C Z + D = 0 through the line.

    It is also that of machinevision-toolbox 2.4.1 (visjac_l).
    """
    feature = Line()
    view = feature.seen(VIEW)
    rho, theta = feature.value(view, view)
    P = np.column_stack((view.xy, np.ones(2))) * view.depth[:, None]
    a, b, c = np.cross(P[1] - P[0], [0.3, -0.2, 1.0])
    d = -np.array([a, b, c]) @ P[0]
    co, si = np.cos(theta), np.sin(theta)
    lines = (a * rho * co + b * rho * si + c) / d, (a * si - b * co) / d
    expected = [
        [lines[0] * co, lines[0] * si, -lines[0] * rho, (1 + rho**2) * si, -(1 + rho**2) * co, 0],
        [lines[1] * co, lines[1] * si, -lines[1] * rho, -rho * co, -rho * si, -1],
    ]
    np.testing.assert_allclose(feature.interaction_matrix(view, view), expected, atol=1e-12)
    assert view.xy @ [co, si] == pytest.approx([rho, rho])


def test_area_and_centroid_of_a_square() -> None:
    """Half as far, a square has four times the area: log √(1/4), and the same centroid."""
    square = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.2], [0.0, 0.2]]) - 0.1
    near, far = (View(f * square + 0.05, np.ones(4), None) for f in (2.0, 1.0))
    np.testing.assert_allclose(AreaCentroid().value(near, far), [0.05, 0.05, -np.log(2.0)])


def motions(feature: Feature, goal: Goal, name: str = "panda") -> list[Array]:
    """Task of a control step at three consecutive states."""
    scene, q, qd = random_scene(robot(name), np.random.default_rng(3))
    task = VisualTask(feature, [goal], TrackingGains(5.0))
    step = ControlStep(scene, ConstraintSet([], scene), task)
    found = []
    for k in range(3):
        now = step.evaluate(NOW + 0.01 * k, q + 0.01 * k * qd, qd).task
        found.append(np.column_stack((now.J, now.b, now.error, now.error_rate)))
    return found


def any_goal() -> Goal:
    scene, q, qd = random_scene(robot("panda"), np.random.default_rng(3))
    state = scene.evaluate(NOW, q, qd)
    return random_goal(state, scene.camera, np.random.default_rng(4), 3.1)


@pytest.mark.parametrize(
    "feature",
    [CameraPose(), ImagePoints(), ImagePoints("desired"), ImagePoints("mean")],
    ids=["pose", "current", "desired", "mean"],
)
def test_a_stack_of_one_is_the_compiled_feature(feature: Feature) -> None:
    goal = any_goal()
    for one, other in zip(motions(feature, goal), motions(Stack([feature]), goal), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)


def test_a_stack_is_its_parts_one_below_the_other() -> None:
    goal = any_goal()
    hybrid = motions(Hybrid(2), goal)[0]
    points = motions(ImagePoints(), goal)[0]
    pose = motions(CameraPose(), goal)[0]
    # the gains depend on the whole error, so that b differs
    columns = [i for i in range(hybrid.shape[1]) if i != 7]
    np.testing.assert_allclose(hybrid[:2, columns], points[2:4, columns], atol=1e-9)
    np.testing.assert_allclose(hybrid[3:, columns], pose[3:, columns], atol=1e-9)


def test_angles_are_differenced_on_the_circle() -> None:
    """A segment at 3.1 rad whose goal is at −3.1 rad is 6.2 − 2π away, and stays so beyond π."""
    scene, q, qd = random_scene(robot("panda"), np.random.default_rng(3))
    state = scene.evaluate(NOW, q, qd)
    here = np.array([[-0.1, 0.0], [-0.1 + 0.1 * np.cos(3.1), 0.1 * np.sin(3.1)], [0.2, 0.1]])
    state = replace(state, normalised=replace(state.normalised, position=here))
    goal = Goal(0.0, np.zeros((3, 2)), here * (1.0, -1.0), None, np.ones(3))
    found = Segment().evaluate(state, goal, None).error
    np.testing.assert_allclose(found, [0.0, 0.1 * np.sin(3.1), 0.0, 6.2 - 2 * np.pi], atol=1e-12)
    across = np.array([-np.sin(3.1), np.cos(3.1)])
    here = np.array([[-0.1, 0.05], [-0.1, 0.05] + 0.1 * across, [0.2, 0.1]])
    turned = replace(state, normalised=replace(state.normalised, position=here))
    mirrored = Goal(0.0, np.zeros((3, 2)), here * (-1.0, 1.0), None, np.ones(3))
    line = Line((1, 2)).evaluate(turned, mirrored, None).error
    assert line[1] == pytest.approx(6.2 - 2 * np.pi)
    beyond = Segment().evaluate(state, goal, np.array([0.0, 0.0, 0.0, 6.0])).error
    assert beyond[3] == pytest.approx(6.2)


@pytest.mark.parametrize("kind", [Polar, Depth, Line, Segment, AreaCentroid, Hybrid])
def test_a_reference_is_carried_to_another_goal(kind: type[Feature]) -> None:
    """The error of one state relative to two goals, carried from one to the other."""
    scene, q, qd = random_scene(robot("panda"), np.random.default_rng(3))
    state = scene.evaluate(NOW, q, qd)
    rng = np.random.default_rng(5)
    old, new = (random_goal(state, scene.camera, rng, angle) for angle in (0.4, 1.0))
    feature = kind()
    errors = [feature.evaluate(state, goal, None).error for goal in (old, new)]
    carried = feature.carried(errors[0], old, new, errors[1])
    np.testing.assert_allclose(carried, errors[1], atol=1e-12)


# --- in a closed loop ---

SHORT = {"duration": 4.0}


@pytest.mark.parametrize(
    "feature",
    [
        "polar",
        "line",
        "area-centroid",
        "2.5-d",
        ["ellipse", {"feature": "line", "markers": [2, 4]}],
    ],
)
def test_runs_converge_to_the_goal_of_their_feature(feature: Any) -> None:
    key = "task.features" if isinstance(feature, list) else "task.feature"
    scenario = Scenario.load("ur5-fov").with_override(key, feature)
    for name, value in {**SHORT, "sampling_time": 0.008}.items():
        scenario = scenario.with_override(name, value)
    setup = scenario.setup()
    run = simulate(setup, HierarchicalQP())
    assert run.status == "converged", run.reason
    assert run.feature_error_px[-1] < 2.0 < run.feature_error_px[0]
    np.testing.assert_allclose(run.feature_error_px, 600.0 * np.abs(run.error).max(axis=1))


# --- features of one's own ---

OWN = '''
import numpy as np
from vsconstraints.vision.features import ViewFeature


class Tangents(ViewFeature):
    """Angles of the first marker: s = (atan x, atan y)."""

    name = "tangents"
    angles = slice(0, 2)

    def __init__(self, factor: float = 1.0):
        super().__init__([1])
        self.factor = factor

    def size(self, markers):
        return 2

    def value(self, view, goal):
        return np.arctan(view.xy[0])

    def interaction_matrix(self, view, goal):
        L = view.point_rows[0, :2] / (1.0 + view.xy[0, :, None] ** 2)
        L[1] *= self.factor
        return L


class Derived(Tangents):
    name = "derived"
    interaction_matrix = ViewFeature.interaction_matrix


class Broken(Tangents):
    name = "broken"

    def value(self, view, goal):
        return np.arctan(view.xy[0]) / (0.0 if view is goal else 1.0)


class Raises(Tangents):
    def __init__(self):
        raise OSError("no data")


class Depths(ViewFeature):
    needs = ("pose",)

    def size(self, markers):
        return markers

    def value(self, view, goal):
        return np.log(view.depth) + 0.0 * view.camera.t[0]


class ByPose(Depths):
    name = "by-pose"
    needs = ("depth",)


class Unpacked(Derived):
    name = "unpacked"
    needs = ()

    def value(self, view, goal):
        xy, depth, camera = view
        return depth[:2] / depth[:2]


class Constant(Derived):
    name = "constant"

    def value(self, view, goal):
        return np.array([1.0, 2.0])


class Sizes(Derived):
    name = "sizes"

    def size(self, markers):
        return 3
'''


@pytest.fixture
def own(tmp_path: Path) -> Callable[[str], Scenario]:
    (tmp_path / "own.py").write_text(OWN)

    def load(task: str) -> Scenario:
        (tmp_path / "own.toml").write_text(f'extends = "ur5-fov"\nduration = 0.1\n[task]\n{task}')
        return Scenario.load(tmp_path / "own.toml")

    return load


def test_a_feature_of_ones_own_is_named_in_a_file(own: Callable[[str], Scenario]) -> None:
    scenario = own('feature = "own:Tangents"')
    assert scenario.own_parts == ("own:Tangents",)
    assert [path.name for path in scenario.files] == ["own.py"]
    given = simulate(scenario.setup(), Tracking())
    derived = simulate(own('features = ["own:Derived"]').setup(), Tracking())
    np.testing.assert_allclose(given.q, derived.q, atol=1e-8)
    assert "derived by differences" not in given.reason
    assert "matrix of the feature derived is derived by differences" in derived.reason


@pytest.mark.parametrize("factor", [-1.0, 1.01])
def test_a_wrong_matrix_is_refused_at_the_start(
    own: Callable[[str], Scenario], factor: float
) -> None:
    setup = own(f'feature = "own:Tangents"\nfactor = {factor}').setup()
    with pytest.raises(ConfigurationError, match=r"feature tangents is not the derivative") as told:
        setup.check_start()
    assert "component 2 by v_y" in str(told.value)
    assert ("its sign is wrong" in str(told.value)) == (factor < 0.0)
    with pytest.raises(ConfigurationError, match="by differences, but"):
        setup.control().command(Tracking(), 0.0, setup.q0, setup.qd0)


@pytest.mark.parametrize(
    ("task", "words"),
    [
        ('feature = "own:Nothing"', "has no Feature named 'Nothing'"),
        ('feature = "own:Raises"', "Raises cannot be made with .*no data"),
        ('feature = "own:Tangents"\ncolour = 1', "unknown key in own.task 'colour'"),
        ('feature = "elipse"', "Did you mean 'ellipse'.*module:Class"),
        ('feature = "line"\nmarkers = [1, 2, 3]', "two markers.*not of 3"),
        ('feature = "line"\nmarkers = [1, 5]', "from 1 to 4; there is no marker 5"),
        ('feature = "polar"\nmarkers = [2, 2]', "different numbers"),
        ("features = []", "one or more features"),
        ('features = ["line"]\nfeature = "line"', "not both"),
        ('features = [{ feature = "line", marker = 1 }]', r"features\[0\] 'marker'"),
        ('feature = "own:Broken"', "at a goal, the feature broken is not defined"),
        ('feature = "own:Unpacked"', "component 1 is nan.*if it uses depth, declare it in needs"),
        (
            'feature = "own:Depths"',
            r"feature Depths uses view\.depth .*add 'depth' .*needs = \('pose', 'depth'\)",
        ),
        ('feature = "own:ByPose"', r"by-pose uses view\.camera .*add 'pose' to needs of ByPose"),
        (
            'feature = "own:Sizes"',
            r"feature sizes has 2 components .*size is 3: let Sizes\.size return",
        ),
        (
            'feature = "depth"\ngoals = [{ markers_px = [[9, 9], [0, 9], [0, 0], [9, 0]] }]',
            "needs the markers' depths",
        ),
        (
            'feature = "2.5-d"\ngoals = [{ markers_px = [[9, 9], [0, 9], [0, 0], [9, 0]], '
            "depth_m = [1, 1, 1, 1] }]",
            "needs goals with a camera pose: camera_at_q or camera_pose",
        ),
        (
            'feature = "area-centroid"\n'
            "goals = [{ markers_px = [[0, 0], [9, 9], [18, 18], [27, 27]] }]",
            "at a goal, .*has no area in the image",
        ),
        (
            'feature = "segment"\ngoals = [{ markers_px = [[9, 9], [9, 9], [0, 0], [9, 0]] }]',
            "two markers coincide.*choose other markers",
        ),
        (
            'feature = "polar"\ngoals = [{ markers_px = [[0, 0], [9, 9], [0, 9], [9, 0]] }]',
            "on the optical axis",
        ),
    ],
)
def test_what_cannot_be_meant(own: Callable[[str], Scenario], task: str, words: str) -> None:
    with np.errstate(all="ignore"), pytest.raises(ConfigurationError, match=words):
        own(task).setup()


def test_a_value_that_does_not_change_is_no_goal_reached(own: Callable[[str], Scenario]) -> None:
    setup = own('feature = "own:Constant"').setup()
    with pytest.raises(ConfigurationError, match="matrix of the feature constant is zero at the"):
        setup.check_start()
    own('features = ["own:Constant", "line"]').setup().check_start()


def test_a_value_that_needs_depths_may_move_its_view() -> None:
    twist = np.array([0.1, 0.0, 0.1, 0.0, 0.2, 0.0])

    class Moved(Polar):
        needs = ("depth",)

        def value(self, view: View, goal: View) -> Array:
            return view.moved(twist, 0.5).xy[0]

    expected = VIEW.moved(twist, 0.5).xy[0]
    np.testing.assert_array_equal(Moved().defined_value(VIEW, GOAL), expected)


def test_a_value_has_no_number_for_what_it_does_not_declare() -> None:
    """Not even by its place in the tuple; the matrix has all."""

    class ByPlace(Polar):
        def value(self, view: View, goal: View) -> Array:
            return np.asarray(view[1])

    class OfOther(Polar):
        def value(self, view: View, goal: View) -> Array:
            line = Line()
            return line.value(line.seen(view), line.seen(goal._replace(xy=goal.xy)))

    np.testing.assert_array_equal(OfOther().defined_value(VIEW, GOAL), Line().value(VIEW, GOAL))
    assert ByPlace.name == "polar"
    with pytest.raises(SceneError, match="not defined here: its component 1 is nan"):
        ByPlace().defined_value(VIEW, VIEW)


@pytest.mark.parametrize("name", ["polar", "depth", "ellipse", "area-centroid"])
def test_differences_are_as_accurate_for_markers_a_millimetre_away(name: str) -> None:
    """Values change by v/Z: a step that suits 1 m would be as long as the distance."""
    feature = FEATURES[name]()
    assert isinstance(feature, ViewFeature)
    near = feature.seen(View(VIEW.xy, 1e-3 * VIEW.depth, None))
    given = feature.interaction_matrix(near, near)
    differences = ViewFeature.interaction_matrix(feature, near, near)
    np.testing.assert_allclose(differences, given, rtol=1e-6, atol=1e-9 * np.abs(given).max())


def test_a_matrix_with_one_entry_that_is_no_number_is_refused() -> None:
    class OneMissing(Polar):
        name = "one-missing"

        def interaction_matrix(self, view: View, goal: View) -> Array:
            L = super().interaction_matrix(view, goal)
            L[0, 0] = np.nan
            return L

    setup = Scenario.load("ur5-fov").setup()
    setup.task.feature = OneMissing()
    with pytest.raises(SceneError, match="interaction matrix of the feature one-missing is not fi"):
        setup.control().evaluate(0.0, setup.q0, setup.qd0)


def test_a_feature_that_is_undefined_at_the_start_is_named() -> None:
    scenario = Scenario.load("ur5-fov").with_override("task.feature", "area-centroid")
    setup = scenario.with_override("task.markers", [1, 2, 1 + 2, 4]).setup()
    turned = setup.task.goals[0].normalised[::-1]
    setup.task.goals = (replace(setup.task.goals[0], normalised=turned),)
    with pytest.raises(ConfigurationError, match=r"at the start, the feature area-centroid .*side"):
        setup.check_start()


def test_a_value_that_is_no_number_ends_the_sample_and_is_forgotten() -> None:
    class Sometimes(Polar):
        name = "sometimes"

        def value(self, view: View, goal: View) -> Array:
            value = super().value(view, goal)
            return value * (np.nan if broken else 1.0)

    broken = False
    setup = Scenario.load("ur5-fov").setup()
    setup.task.feature = Sometimes()
    setup.task.velocity = "differences"
    step = setup.control()
    first = step.evaluate(0.0, setup.q0, setup.qd0)
    memory = step.packed.remembered()
    broken = True
    with pytest.raises(SceneError, match="feature sometimes is not defined here: its component 1"):
        step.evaluate(0.002, setup.q0, setup.qd0)
    for one, other in zip(memory, step.packed.memory, strict=True):
        np.testing.assert_array_equal(one, other)
    assert np.isfinite(first.task.b).all()


def test_stored_tables_run_no_feature_unless_trusted(own: Callable[[str], Scenario]) -> None:
    for task in ('feature = "own:Tangents"', 'features = ["line", { feature = "own:Tangents" }]'):
        with pytest.raises(ConfigurationError, match=r"own:Tangents.*--trust"):
            replace(own(task), trusted=False).setup()


# --- families ---


@pytest.mark.parametrize("chain", [["ur5"], ["ur5", "other.toml"]])
def test_families_outside_the_package_extend_those_in_it(
    tmp_path: Path, chain: Sequence[str]
) -> None:
    (tmp_path / "other.toml").write_text('extends = "ur5"\nduration = 3.0\n')
    (tmp_path / "mine.toml").write_text(
        f'extends = "{chain[-1]}"\ntitle = "Mine"\n[conditions.disturbed.disturbances]\ndelay = 2\n'
    )
    mine = Family.load(tmp_path / "mine.toml")
    theirs = Family.load("ur5")
    assert mine.title == "Mine"
    assert mine.conditions == theirs.conditions
    assert mine.tables["q0"] == theirs.tables["q0"]
    assert mine.tables["conditions"]["disturbed"]["disturbances"]["delay"] == 2
    (tmp_path / "mine.toml").write_text('extends = "ur6"\n')
    with pytest.raises(ConfigurationError, match="unknown scenario or family 'ur6'"):
        Family.load(tmp_path / "mine.toml")
