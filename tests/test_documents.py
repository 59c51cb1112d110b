"""The README's and examples' code does what they say."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from vsconstraints.comparisons import Suite, compare
from vsconstraints.scenarios import Scenario
from vsconstraints.scenarios.section import read_toml
from vsconstraints.simulation import simulate

ROOT = Path(__file__).parent.parent
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCKS = [
    pytest.param(code, id=f"{path.stem}-{i}")
    for path in DOCUMENTS
    for i, code in enumerate(re.findall(r"```python\n(.*?)```", path.read_text(encoding="utf-8"), flags=re.S))
]


@pytest.mark.parametrize("code", BLOCKS)
def test_python_blocks_run(code: str) -> None:
    exec(compile(code, "block", "exec"), {"__name__": "block"})


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)\)", path.read_text(encoding="utf-8"))
    for link in links:
        if not link.startswith("http"):
            assert (path.parent / link).exists(), f"{path.name}: {link}"


def test_the_readme_shows_the_examples_as_they_are() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    cautious = (ROOT / "examples" / "cautious.py").read_text(encoding="utf-8")
    for block in re.findall(r"```python\n(.*?)```", readme, flags=re.S):
        for found in re.findall(r"^class .*?(?=^\S|\Z)", block, flags=re.S | re.M):
            assert found.strip() in cautious
    arm = (ROOT / "examples" / "my-arm.toml").read_text(encoding="utf-8")
    (toml,) = re.findall(r"```toml\n(.*?)```", readme, flags=re.S)
    assert toml in arm
    assert len(arm.splitlines()) <= 12


def test_own_loop_reaches_its_goal(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(ROOT / "examples" / "own_loop.py"), run_name="__main__")
    millimetres, milliradians = map(float, re.findall(r"([\d.]+) m(?:m|rad)", capsys.readouterr().out))
    assert millimetres < 5.0
    assert milliradians < 5.0


def test_own_parts_take_part_in_a_comparison(tmp_path: Path) -> None:
    suite = Suite.load(ROOT / "examples" / "own-parts.toml").select(settings=["scenario.duration=0.5"])
    finished = compare(suite, tmp_path, workers=2)
    assert {key[1] for key in finished.scores} == {"tracking", "sliding-mode", "cautious"}
    assert all(result.result["status"] == "unfinished" for result in finished.scores.values())
    labels = [row["constraint"] for row in finished.scores["own-scenario", "cautious", 0].constraints]
    assert "horizon[marker 2]" in labels


def test_my_arm_is_challenged_and_kept_in_its_limits() -> None:
    from vsconstraints.controllers import HierarchicalQP, Tracking

    scenario = Scenario.load(ROOT / "examples" / "my-arm.toml")
    free, kept = simulate(scenario.setup(), Tracking()), simulate(scenario.setup(), HierarchicalQP())
    assert free.clearance.min() < -0.1
    assert kept.clearance.min() > -1e-6
    assert kept.status == "converged"


@pytest.mark.parametrize("path", sorted((ROOT / "comparisons").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_suites_can_be_run(path: Path) -> None:
    suite = Suite.load(path)
    assert suite.title == read_toml(path)["title"]


def test_a_single_controller_can_be_imported_without_the_rest() -> None:
    code = (
        "import sys\nfrom vsconstraints.controllers import SlidingMode\n"
        "heavy = {'matplotlib', 'typer', 'rich', 'osqp', 'proxsuite', 'cvxpy', 'qpsolvers'} & set(sys.modules)\n"
        "print(sorted(heavy))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
