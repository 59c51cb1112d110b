"""Parts of other packages, found by their entry points, and names of modules that moved."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from vsconstraints import controllers
from vsconstraints.cli.results import kind_in
from vsconstraints.errors import ConfigurationError
from vsconstraints.plugins import registry
from vsconstraints.plugins.earlier_names import MOVED_MODULES
from vsconstraints.plugins.registry import OWN, Part, in_order, parts_with_packages, registered
from vsconstraints.reports import write_report
from vsconstraints.reports.drawing import figures_of_scenarios

ROOT = Path(__file__).parents[1]
THEIRS = '''
from dataclasses import dataclass
from typing import ClassVar

from vsconstraints.plugins.registry import Command, Listing, Part
from vsconstraints.simulation.disturbances import Disturbances
from vsconstraints.simulation.plant import Plant


def greet(scenario: str, trial: int = 0) -> None:
    """Greet a scenario."""
    print(f"hello {scenario} {trial}")


def grippers():
    return [("claw", "Two fingers.")]


@dataclass(frozen=True)
class Stiff:
    made_by: ClassVar[str] = "theirs:plant"
    stiffness: float


def plant(robot, settings, q0, qd0, period, limits, loop):
    made = Plant(q0, qd0, period, "acceleration", Disturbances(), limits)
    made.stiffness = settings.stiffness
    return made


def section(results, scenario):
    return f"Their words on {scenario}."


PART = Part(
    commands={"greet": Command("theirs:greet", "Theirs", "ur5-fov")},
    listings={"grippers": Listing("theirs:grippers", before="metrics")},
    scenario_tables={"plant": {"stiff": "theirs:Stiff"}},
    report_sections={"words": "theirs:section"},
)
'''


def installed(folder: Path, code: str, value: str = "theirs:PART") -> dict[str, str]:
    """Install a package of others into a folder; return the environment that finds it."""
    metadata = folder / "theirs-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(f"[{registry.GROUP}]\nmy-part = {value}\n")
    (folder / "theirs.py").write_text(code)
    known = os.environ.get("PYTHONPATH", "")
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (known, str(folder))))}


def python(environment: dict[str, str], program: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        env=environment,
        timeout=300,
    )


def command(environment: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    return python(
        environment,
        "import sys; from vsconstraints.cli import main; "
        f"sys.argv = {['vsconstraints', *words]!r}; main()",
    )


def test_a_command_of_another_package_stands_beside_those_of_this_one(tmp_path: Path) -> None:
    environment = installed(tmp_path, THEIRS)
    shown = command(environment, "--help")
    assert "Theirs" in shown.stdout, shown.stderr
    assert "Greet a scenario." in shown.stdout
    done = command(environment, "greet", "ur5-fov", "--trial", "3")
    assert done.stdout == "hello ur5-fov 3\n"
    listed = command(environment, "list", "grippers")
    assert "Two fingers." in listed.stdout


def test_a_scenario_names_the_plant_of_another_package(tmp_path: Path) -> None:
    program = """
from vsconstraints.errors import ConfigurationError
from vsconstraints.scenarios import Scenario
scenario = Scenario.load("example-2d-fov")
setup = scenario.with_override("plant", {"type": "stiff", "stiffness": 4.0}).setup()
print(setup.plant().stiffness)
try:
    scenario.with_override("plant", {"type": "stif", "stiffness": 4.0}).setup()
except ConfigurationError as error:
    print(error)
"""
    done = python(installed(tmp_path, THEIRS), program)
    value, error = done.stdout.splitlines()
    assert value == "4.0"
    assert "Did you mean 'stiff'?" in error
    assert "dynamics, mujoco, stiff" in error


@pytest.mark.parametrize(
    ("code", "value", "told"),
    [
        ("raise RuntimeError('no licence')", "theirs:PART", "no licence"),
        ("PART = 3", "theirs:PART", "must be a Part, not 3"),
        ("", "theirs:PART", "has no attribute 'PART'"),
        (
            THEIRS.replace('"greet": ', '"compare": '),
            "theirs:PART",
            "two parts register compare as commands: those of vsconstraints.cli and theirs",
        ),
        (
            THEIRS.replace("commands=", 'laws={"soft": "theirs:Soft"}, commands='),
            "theirs:PART",
            "registers the laws soft: remove them",
        ),
    ],
)
def test_a_broken_part_is_an_error_that_names_it(
    code: str, value: str, told: str, tmp_path: Path
) -> None:
    done = command(installed(tmp_path, code, value), "list", "shapes")
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert told in done.stderr
    if "two parts" not in told:
        assert "part my-part of theirs" in done.stderr


@pytest.mark.parametrize("function", ["theirs:nothing", "theirs_2:greet", "theirs"])
def test_a_function_that_is_missing_is_an_error_that_names_it(
    function: str, tmp_path: Path
) -> None:
    code = THEIRS.replace('Command("theirs:greet"', f'Command("{function}"')
    done = command(installed(tmp_path, code), "greet", "ur5-fov")
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {function}, which a part names, cannot be imported")


def test_own_parts_need_no_metadata(tmp_path: Path) -> None:
    """The command line of files alone, without any installed package that registers a part."""
    program = """
import importlib.metadata
importlib.metadata.entry_points = lambda **selected: []
from vsconstraints.plugins.registry import registered
print(*registered("commands"))
"""
    done = python(dict(os.environ), program)
    assert {"compare", "preview", "run", "evidence"} <= set(done.stdout.split()), done.stderr


def test_every_folder_with_a_part_is_listed() -> None:
    package = ROOT / "src" / "vsconstraints"
    assert {file.parent.name for file in package.glob("*/part.py")} == {*OWN}


def test_everything_that_own_parts_name_exists() -> None:
    for _, part in parts_with_packages():
        names = [each.function for each in (*part.commands.values(), *part.listings.values())]
        names += [name for types in part.scenario_tables.values() for name in types.values()]
        names += [*part.figures, *part.report_sections.values(), *part.results.values()]
        names += part.laws.values()
        for name in names:
            assert registry.load(name) is not None
    assert {*registry.scenario_types("plant")} == {"dynamics", "mujoco"}
    assert {*registry.scenario_types("sensor")} == {"images"}


def test_laws_are_registered_in_the_order_in_which_they_are_shown() -> None:
    assert [*controllers.CONTROLLERS] == [
        "sliding-mode",
        "potential-field",
        "hierarchical-qp",
        "tracking",
        "sliding-mode-ahead",
        "implicit-switch",
        "implicit-switch-with-drift",
        "boundary-layer",
        "super-twisting",
        "implicit-super-twisting",
        "robust-hierarchical-qp",
        "cbf-filter",
        "law",
        "predictive",
        "robust-predictive",
        "resolved-rate",
        "resolved-rate-avoidance",
        "velocity-qp",
        "velocity-hierarchical-qp",
        "velocity-damper",
    ]
    assert [*controllers.CONTROLLERS.values()] == [*controllers.LAWS]
    assert [*controllers.LAWS][-5:] == [*controllers.VELOCITY_LAWS]
    for name, law in controllers.CONTROLLERS.items():
        assert issubclass(law, controllers.Controller)
        assert law.name == name
    with pytest.raises(AttributeError, match="has no attribute 'Nothing'"):
        getattr(controllers, "Nothing")  # noqa: B009
    assert {*registry.WITH_LAWS} == {name for name in OWN if load_part(name).laws}


def load_part(name: str) -> Part:
    part: Part = registry.load(f"vsconstraints.{name}.part:PART")
    return part


@pytest.mark.parametrize(
    "package",
    [
        "arms",
        "cli",
        "controllers",
        "dynamics",
        "paper",
        "prediction",
        "score",
        "stacks",
        "velocity",
    ],
)
def test_a_package_lists_what_it_exports_and_has_it(package: str) -> None:
    module = import_module(f"vsconstraints.{package}")
    assert {*module.__all__} <= {*dir(module)}
    for name in module.__all__:
        assert getattr(module, name) is not None


def test_modules_of_an_earlier_package_can_be_imported_from_it() -> None:
    program = """
from vsconstraints.controllers import planner, predictive, robust_predictive, velocity
from vsconstraints.controllers.velocity import base, compiled, gain
print(base.VelocityController.__name__, compiled.CompiledSpeeds.__name__, gain.VelocityLaw.__name__)
"""
    done = python(dict(os.environ), program)
    assert done.stdout == "VelocityController CompiledSpeeds VelocityLaw\n", done.stderr


def test_a_law_is_read_by_its_earlier_module() -> None:
    law = controllers.VelocityQP(gain=3.0)
    text = pickle.dumps(law, protocol=0)
    earlier = text.replace(b"vsconstraints.velocity.", b"vsconstraints.controllers.velocity.")
    assert earlier != text
    assert pickle.loads(earlier).gain == 3.0


def test_a_law_of_another_package_may_import_laws_of_parts(tmp_path: Path) -> None:
    """In the module of its part, too."""
    code = f"from vsconstraints.controllers import VelocityQP\n{THEIRS}\nclass Soft(VelocityQP):\n    name = 'soft'\n"
    program = """
from vsconstraints.controllers import make_controller
from vsconstraints.plugins.registry import parts_with_packages
print(make_controller("theirs:Soft").name, len(parts_with_packages()))
"""
    done = python(installed(tmp_path, code), program)
    assert done.stdout.startswith("soft "), done.stderr


def test_two_parts_must_not_register_one_name(monkeypatch: pytest.MonkeyPatch) -> None:
    twice = [
        ("mine", Part(report_sections={"words": "a:b"})),
        ("theirs", Part(report_sections={"words": "c:d"})),
    ]
    monkeypatch.setattr(registry, "parts_with_packages", lambda: twice)
    told = "two parts register words as report sections: those of mine and theirs"
    with pytest.raises(ConfigurationError, match=told):
        registered("report_sections")


def add_part(monkeypatch: pytest.MonkeyPatch, part: Part) -> None:
    """Let a package ``theirs`` register a part beside all others."""
    others = parts_with_packages()
    monkeypatch.setattr(registry, "parts_with_packages", lambda: (*others, ("theirs", part)))


def test_a_part_must_not_replace_a_law_of_the_core(monkeypatch: pytest.MonkeyPatch) -> None:
    """No law is made then, by whatever name: a law would silently be another one."""
    laws = {"tracking": "vsconstraints.prediction.predictive:PredictiveControl"}
    monkeypatch.setattr("vsconstraints.prediction.part.PART", Part(laws=laws))
    controllers.registered_laws.cache_clear()
    told = (
        "two parts register tracking as laws: those of vsconstraints.controllers and "
        "vsconstraints.prediction"
    )
    try:
        for name in ("tracking", "sliding-mode"):
            with pytest.raises(ConfigurationError, match=told):
                controllers.make_controller(name)
    finally:
        controllers.registered_laws.cache_clear()


def test_a_part_must_not_replace_the_reports_of_comparisons(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    add_part(monkeypatch, Part(results={"a comparison": "theirs:KIND"}))
    told = "register a comparison as results: those of vsconstraints.cli and theirs"
    with pytest.raises(ConfigurationError, match=told):
        kind_in(ROOT / "reports" / "default")


def test_a_part_must_not_draw_a_figure_over_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """The files of both would have the same names."""
    names = [figure.name for figure in figures_of_scenarios()]
    assert len(names) == len({*names})
    add_part(monkeypatch, Part(figures=("vsconstraints.reports.figures:PHI",)))
    told = "two parts register phi as figures: those of vsconstraints.reports and theirs"
    with pytest.raises(ConfigurationError, match=told):
        figures_of_scenarios()


@pytest.mark.parametrize("figures", [True, False])
@pytest.mark.parametrize(
    ("part", "told"),
    [
        (Part(figures=("vsconstraints.reports.figures:PHI",)), "phi as figures"),
        (Part(report_sections={"replay": "theirs:section"}), "replay as report sections"),
    ],
)
def test_a_report_is_refused_before_it_is_begun_if_a_name_is_taken(
    figures: bool, part: Part, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever is in the folder, and also if no figure is to be drawn."""
    add_part(monkeypatch, part)
    with pytest.raises(ConfigurationError, match=f"two parts register {told}: those of .* theirs"):
        write_report(tmp_path, figures=figures)


@pytest.mark.parametrize(
    ("field", "told"),
    [
        ('figures=("vsconstraints.reports.figures:PHI",)', "phi as figures"),
        ('results={"a comparison": "theirs:KIND"}', "a comparison as results"),
    ],
)
def test_nothing_is_run_if_a_name_of_its_report_is_taken(
    field: str, told: str, tmp_path: Path
) -> None:
    code = f"from vsconstraints.plugins.registry import Part\nPART = Part({field})\n"
    out = tmp_path / "out"
    words = ("--scenario", "example-2d-fov", "--controller", "tracking", "--no-figures")
    done = command(installed(tmp_path, code), "compare", *words, "--out", str(out))
    assert done.returncode == 2
    assert f"two parts register {told}: those of vsconstraints." in done.stderr
    assert "and theirs" in done.stderr
    assert not out.exists()


def test_order_is_that_of_the_parts_but_where_a_name_goes_before_another() -> None:
    values = {"a": 1, "b": 2, "c": 3, "d": 4}
    assert [*in_order(values, {"c": "b", "d": "unknown"})] == ["a", "c", "b", "d"]


def test_an_earlier_name_is_the_module_of_today() -> None:
    """In a process that has imported none of them before, and also as an attribute."""
    program = """
from importlib import import_module
from vsconstraints.plugins.earlier_names import MOVED_MODULES
for earlier, today in MOVED_MODULES.items():
    before = import_module(earlier)
    now = import_module(today)
    assert before is now, earlier
    assert now.__name__ == now.__spec__.name == today
for name in [*MOVED_MODULES, *MOVED_MODULES.values()]:
    package, _, module = name.rpartition(".")
    assert getattr(import_module(package), module) is import_module(name), name
print(len(MOVED_MODULES))
"""
    done = python(dict(os.environ), program)
    assert done.stdout == f"{len(MOVED_MODULES)}\n", done.stderr


def test_an_earlier_constant_is_what_its_function_returns() -> None:
    from vsconstraints import comparisons
    from vsconstraints.comparisons import metrics

    assert comparisons.DEFINITIONS == metrics.DEFINITIONS == metrics.definitions()
    with pytest.raises(AttributeError, match=r"vsconstraints\.comparisons' has no attribute 'X'"):
        comparisons.X  # noqa: B018


def test_a_class_by_an_earlier_name_is_no_second_class() -> None:
    from vsconstraints.bench.learning import Policy
    from vsconstraints.bench.learning.policy import Policy as Within
    from vsconstraints.plugins.classes import imported_class

    assert imported_class("vsconstraints.learning:Policy", Policy) is Policy is Within
    assert import_module("vsconstraints.vision.images.board") is import_module(
        "vsconstraints.images.board"
    )
