"""The README's, the documentation's and the examples' code does what they say."""

from __future__ import annotations

import ast
import pkgutil
import re
import runpy
import shutil
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path

import nbformat
import pytest
from typer.testing import CliRunner

import vsconstraints
from documents import DOCS, PAGES, REFERENCE, ROOT, RUN, Block, blocks, examples, reader_folder, run
from vsconstraints.bench.evidence import Campaign, call_times, processes
from vsconstraints.bench.families import Family, families
from vsconstraints.cli import app
from vsconstraints.comparisons import Suite, compare
from vsconstraints.comparisons.metrics import constraint_columns, result_columns
from vsconstraints.comparisons.record import FACTS, RunRecord
from vsconstraints.comparisons.runs.spec import RunTiming
from vsconstraints.comparisons.suite import BASELINE
from vsconstraints.controllers import Tracking
from vsconstraints.scenarios import Scenario
from vsconstraints.scenarios.toml import read_toml
from vsconstraints.simulation import Trajectory, simulate

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
NOT_RUN: dict[tuple[str, str], str] = {
    (
        "trust.md",
        "t = 0.85 s: the commanded accelerations (up to 1.2e+02) are too large for the rows to be "
        "verified: rounding exceeds",
    ): "what a message says",
    (
        "structure.md",
        " errors → rows, plugins         what all others use: errors; rows φ ≤ 0, task, command; "
        "registry of parts",
    ): "a drawing",
    (
        "structure.md",
        '[project.entry-points."vsconstraints.parts"]',
    ): "lines of another package's pyproject.toml",
    (
        "results.md",
        '[project.entry-points."vsconstraints.parts"]',
    ): "lines of another package's pyproject.toml",
    ("stacks-in-view.md", "[controllers.mine]"): "lines of comparisons/stacks.toml",
    (
        "stacks-in-view.md",
        "python -m checks.stacks run envs --entry mine --family ur5 --condition limit-2 "
        "--out my-runs",
    ): "commands that make hundreds of runs and write into the repository",
}
"""Blocks of the language ``text``, which cannot be run, by page and first line, and why they
cannot.
"""


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_block_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(reader_folder(tmp_path))
    monkeypatch.syspath_prepend(tmp_path)
    names = {"__name__": "__main__"}
    for block in blocks(page):
        if block.language != "text":
            assert block.language in RUN, (
                f"{block.where}: nothing runs the language {block.language!r}"
            )
            try:
                run(block, tmp_path, names)
            except BaseException as error:
                error.add_note(f"in the block at {block.where}")
                raise


@pytest.mark.parametrize("page", REFERENCE, ids=lambda path: path.stem)
def test_the_reference_has_examples_that_run(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(reader_folder(tmp_path))
    found = list(examples(page))
    assert found or page.stem == "index"
    for block in found:
        run(block, tmp_path, {"__name__": "__main__"})


def test_blocks_that_are_not_run_have_a_reason() -> None:
    left = [block for page in PAGES for block in blocks(page) if block.language == "text"]
    assert {(block.page.name, block.code.partition("\n")[0]) for block in left} == set(NOT_RUN)


def test_every_block_is_fenced() -> None:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert len(re.findall(r"^`{3}", text, flags=re.M)) == 2 * len(list(blocks(page))), page.name
        outside = re.sub(r"^(`{3,}|\$\$).*?^\1", "", text, flags=re.S | re.M)
        assert not re.findall(r"^(?: {4,}|\t).*", outside, flags=re.M), page.name


@pytest.mark.parametrize(
    "code", ["vsconstraints compare --no-such-option", "vsconstraints fly", "rm -r ."]
)
def test_a_wrong_command_would_be_found(code: str, tmp_path: Path) -> None:
    with pytest.raises((Exception, SystemExit)):
        run(Block(ROOT / "README.md", 1, "sh", code), tmp_path, {})


@pytest.mark.parametrize(
    "path", [*PAGES, *NOTEBOOKS], ids=lambda path: path.relative_to(ROOT).as_posix()
)
def test_links_lead_somewhere(path: Path) -> None:
    links = re.findall(r"\]\(([^)#\s]+)", path.read_text(encoding="utf-8"))
    for link in links:
        if not link.startswith("http"):
            assert (path.parent / link).exists(), f"{path.name}: {link}"


def test_the_reference_has_every_module() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in (DOCS / "api").glob("*.rst"))
    named = {
        name
        for names in re.findall(r"^\.\. (?:package|automodule):: (.*)$", text, flags=re.M)
        for name in names.split()
    }
    modules = {
        f"vsconstraints.{module.name}" for module in pkgutil.iter_modules(vsconstraints.__path__)
    }
    assert modules - named == {"vsconstraints.cli"}  # suites.md tells of it
    assert all(find_spec(name) for name in named)


def test_result_files_are_described_whole() -> None:
    text = (DOCS / "results.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", text, flags=re.S | re.M))
    described = {
        title: set(re.findall(r"`(\w+)`", _first_cells(body))) for title, body in sections.items()
    }
    stored = {field.name for kind in (Trajectory, RunRecord) for field in fields(kind)}
    in_facts = {"trajectory", "kinds", "units", *FACTS}
    assert described["`results.csv`"] == set(result_columns())
    assert described["`constraints.csv`"] == set(constraint_columns())
    assert described["Trajectories"] == stored - in_facts | {"facts"}


def test_suite_keys_are_described_whole() -> None:
    code = ast.parse((ROOT / "src/vsconstraints/comparisons/suite.py").read_text(encoding="utf-8"))
    # files are read by the signatures of these
    keys = [part for part in ast.walk(code) if getattr(part, "name", "") in ("suite", "_variants")]
    asked = {
        each.arg for part in keys for each in part.args.args if each.arg not in ("where", "folder")
    }
    asked |= {field.name for field in fields(RunTiming)}
    text = _first_cells((DOCS / "suites.md").read_text(encoding="utf-8"))
    assert set(re.findall(r"`(\w+)`", text)) == asked


def _first_cells(text: str) -> str:
    return "\n".join(re.findall(r"^\| ([^|]*) \|", text, flags=re.M))


def test_no_cluster_takes_a_fixed_port() -> None:
    """The dashboard's is 8787 unless it is given, and a warning, which is an error here, where that
    is in use.
    """
    for path in (*PAGES, *Path(__file__).parent.rglob("*.py")):
        for options in re.findall(
            r"LocalCluster\((.*?)\) as ", path.read_text(encoding="utf-8"), flags=re.S
        ):
            assert not options.strip() or 'dashboard_address=":0"' in options, path


def marked_block(page: Path, name: str) -> str:
    """The code block of a page that `.ci/run` runs by this name."""
    (found,) = re.findall(
        rf"<!-- ci: {name} -->\n```sh\n(.*?)\n```", page.read_text(encoding="utf-8"), re.DOTALL
    )
    return found


def test_the_readme_has_two_commands_that_the_gate_runs() -> None:
    """One installs and runs the main job, the other installs and passes the tests, without further
    extras.
    """
    assert marked_block(ROOT / "README.md", "compare") == "pip install . && vsconstraints compare"
    assert marked_block(ROOT / "README.md", "test") == 'pip install -e ".[test]" && pytest'
    gate = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    before, _, after = gate.partition("run_block compare")
    assert "pip install" not in before.partition("venv/bin/activate")[2]
    between, _, _ = after.partition("run_block test")
    assert "run_block install" not in between
    assert "pip install" not in between
    for name in re.findall(r"run_block (\w+)", gate):
        pages = (ROOT / "README.md", ROOT / "CONTRIBUTING.md")
        assert (
            sum(f"<!-- ci: {name} -->" in page.read_text(encoding="utf-8") for page in pages) == 1
        )


def test_the_readme_counts_laws_and_scenes_as_the_default_comparison_has_them() -> None:
    words = {6: "six", 7: "seven", 8: "eight", 9: "nine", 10: "ten", 11: "eleven", 12: "twelve"}
    suite = Suite.load()
    laws = [law.name for law in suite.controllers if law.name != BASELINE]
    text = (
        f"compares {words[len(laws)]} laws with unconstrained tracking in "
        f"{words[len(suite.scenarios)]} scenes"
    )
    assert text in (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"Compared: {len(laws)} controllers" in (
        ROOT / "reports" / "default" / "report.md"
    ).read_text(encoding="utf-8")


def test_what_the_test_set_does_not_cover_is_said() -> None:
    """Its arms servo by pose, and its only family by image points has no arm: README and which-law
    say so.
    """
    by_image = []
    for name in families():
        tables = Family.load(name).tables
        if tables["task"]["feature"] == "image-points":
            by_image.append(name)
    assert by_image == ["free-camera"]
    for page in (ROOT / "README.md", ROOT / "docs" / "which-law.md"):
        text = " ".join(page.read_text(encoding="utf-8").split())
        assert re.search(
            r"servo by pose; only (its|the) free camera, one (of the ten families|family), servos by image",
            text,
        )


def test_the_readme_shows_the_examples_as_they_are() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = "".join(
        (ROOT / path).read_text(encoding="utf-8")
        for path in ("controllers/cautious.py", "examples/horizon.py")
    )
    for block in re.findall(r"```python\n(.*?)```", readme, flags=re.S):
        for found in re.findall(r"^class .*?(?=^\S|\Z)", block, flags=re.S | re.M):
            assert found.strip() in shown
    arm = (ROOT / "examples" / "my-arm.toml").read_text(encoding="utf-8")
    (toml,) = re.findall(r"```toml\n(.*?)```", readme, flags=re.S)
    assert toml in arm
    assert len(arm.splitlines()) <= 13


def test_the_example_law_is_the_same_wherever_it_is_shown() -> None:
    example = (ROOT / "controllers" / "cautious.py").read_text(encoding="utf-8")
    (law,) = re.findall(r"^class Cautious.*", example, flags=re.S | re.M)
    notebook = nbformat.read(ROOT / "notebooks" / "own-law.ipynb", as_version=4)
    shown = [
        (ROOT / name).read_text(encoding="utf-8")
        for name in ("README.md", "docs/first-five-minutes.md")
    ]
    for text in (*shown, "\n".join(cell.source for cell in notebook.cells)):
        assert law.strip() in text


def test_the_example_law_keeps_scenes_that_it_was_not_made_for() -> None:
    """Twelve held-out scenes of the six-axis arm with all kinds of rows, all of which tracking
    violates.
    """
    law = runpy.run_path(str(ROOT / "controllers" / "cautious.py"))["Cautious"]()
    family = Family.load("six-axis")
    for number in range(12):
        setup = family.scene(number, half="held-out").setup("nominal")
        alone, kept = (float(simulate(setup, each).sigma.max()) for each in (Tracking(), law))
        assert alone > 0.0, number
        assert kept <= 0.0, number


def test_own_loop_reaches_its_goal(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(ROOT / "examples" / "own_loop.py"), run_name="__main__")
    (off,) = map(float, re.findall(r"within ([\d.]+) px", capsys.readouterr().out))
    assert off < 0.5


def test_own_parts_take_part_in_a_comparison(tmp_path: Path) -> None:
    suite = Suite.load(ROOT / "examples" / "own-parts.toml").select(
        settings=["scenario.duration=0.5"]
    )
    finished = compare(suite, tmp_path, workers=2)
    assert {key[1] for key in finished.scores} == {"tracking", "sliding-mode", "cautious"}
    assert all(result.result["status"] == "unfinished" for result in finished.scores.values())
    labels = [
        row["constraint"] for row in finished.scores["own-scenario", "cautious", 0].constraints
    ]
    assert "horizon[marker 2]" in labels


def test_my_arm_is_challenged_and_kept_in_its_limits() -> None:
    from vsconstraints.controllers import HierarchicalQP, Tracking

    scenario = Scenario.load(ROOT / "examples" / "my-arm.toml")
    free = simulate(scenario.setup(), Tracking())
    kept = simulate(scenario.setup(), HierarchicalQP())
    assert free.clearance.min() < -0.1
    assert kept.clearance.min() > -1e-6
    assert kept.status == "converged"


SHORT = "--set scenario.duration=0.1 --no-figures --out arm"


@pytest.mark.parametrize(
    "command",
    [
        f"compare --scenario my-arm.toml --controller hierarchical-qp {SHORT}",
        "preview my-arm.toml",
        "advise my-arm.toml",
        f"run my-arm.toml {SHORT}",
        f"run my-arm.toml --robot loopback://?time=simulated&patience=5 {SHORT}",
    ],
)
def test_every_command_takes_my_arm(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As its reader has it: beside the URDF file, in a folder of its own."""
    for name in ("my-arm.toml", "six_axis.urdf"):
        shutil.copy(ROOT / "examples" / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, command.split())
    assert result.exit_code == 0, (result.output, result.exception)


@pytest.mark.parametrize(
    "path", sorted((ROOT / "comparisons").glob("*.toml")), ids=lambda path: path.stem
)
def test_shipped_suites_can_be_run(path: Path) -> None:
    tables = read_toml(path)
    if "calls" in tables:
        assert call_times(str(path), Campaign.load(), None, processes(1)).calls == tables["calls"]
        return
    loaded = Campaign.load(path) if "families" in tables else Suite.load(path)
    assert loaded.title == tables["title"]
