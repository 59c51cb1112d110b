"""What users of stacks report: verdicts from numbers, and the side of the laws of this package."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from checks import reported
from checks.reported import REPORTS, Report, law_of, show, verdict

DOCUMENTATION = Path(__file__).parents[1] / "docs" / "stacks.md"


def numbers_of(report: Report, first: float, control: float = 0.0) -> dict[str, float]:
    """Return numbers of the first stack and, if there is one, of the control."""
    numbers = {report.control: control} if report.control else {}
    return numbers | {next(iter(report.stacks)): first}


@pytest.mark.parametrize(
    ("name", "first", "control", "answer"),
    [
        ("pink-159", 5.0, 0.0, "reproduces"),
        ("pink-159", 4.9, 0.0, "does NOT reproduce"),
        ("pink-159", np.nan, 0.0, "does NOT reproduce"),
        ("roboplan-250", 10.0, 9.0, "reproduces"),
        ("roboplan-250", 10.0, 10.0, "reproduces in part: so does OInK, gain 50, without limits"),
        ("roboplan-250", 9.0, 10.0, "does NOT reproduce"),
        ("placo-7", 20.0, 0.0, f"reproduces in part: the scene has {REPORTS['placo-7'].differs}"),
        ("placo-7", 19.0, 0.0, "does NOT reproduce"),
    ],
)
def test_the_verdict_is_that_of_the_first_stack_and_its_control(
    name: str, first: float, control: float, answer: str
) -> None:
    report = REPORTS[name]
    assert verdict(report, numbers_of(report, first, control)) == answer
    laws_alone = dict.fromkeys(report.laws, 100.0)
    assert verdict(report, laws_alone) == "not run"


@pytest.mark.parametrize("report", REPORTS.values(), ids=REPORTS)
def test_a_control_is_a_stack_and_laws_exist(report: Report) -> None:
    assert report.control in ("", *report.stacks)
    for name, options in report.laws.items():
        law_of(name, options).make()


@pytest.mark.parametrize("report", REPORTS.values(), ids=REPORTS)
def test_the_documentation_agrees_on_what_reproduces_in_part(report: Report) -> None:
    (line,) = (
        line
        for line in DOCUMENTATION.read_text(encoding="utf-8").splitlines()
        if line.startswith(f"| {report.issue} |")
    )
    documented = line.split("|")[-2].partition(":")[0].strip()
    if report.differs:
        assert documented == "in part"
    elif not report.control:
        assert documented == "yes"


def test_without_their_environments_the_laws_run_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The laws return from outside the range, as the documentation says of pink#206."""
    show(REPORTS["pink-206"], tmp_path)
    *lines, last = capsys.readouterr().out.splitlines()[2:]
    assert last == "  pink#206 not run"
    assert [line.split()[0] for line in lines] == [*REPORTS["pink-206"].laws]
    assert all(" 0.0 mrad outside at the end" in line for line in lines)


def test_reversals_are_those_of_the_joint_that_turns_most_often() -> None:
    """Rest, and speeds of at most 1 mrad/s, are no changes of direction."""
    run = SimpleNamespace(qd=np.array([[1, 1], [0, -1], [1, 1], [-5e-4, 0], [1, -1]]))
    assert reported.reversals(run) == 3.0  # type: ignore[arg-type]
