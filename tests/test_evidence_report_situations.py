"""The first screen of the report of evidence: the answer, the heat map of situations, and curves
over levels.
"""

from __future__ import annotations

import json
import re
from base64 import b64encode
from hashlib import sha256
from pathlib import Path
from typing import Any

import html5lib
import numpy as np
import pandas as pd
import pytest

from browser import NAMES, browser, program
from made_evidence import drawn_runs, frame, made, run
from test_evidence_report import RATES, check, tables, written
from vsconstraints.bench.families import Family, families
from vsconstraints.bench.reports.across import FEWEST, beyond, regrets
from vsconstraints.bench.reports.dataset import Dataset, Factorial
from vsconstraints.bench.reports.failures import Cell
from vsconstraints.bench.reports.figures import draw_levels
from vsconstraints.bench.reports.ranking import Share, ranking
from vsconstraints.bench.reports.report import write_report_of
from vsconstraints.bench.statistics.judged import UNSUCCESSFUL
from vsconstraints.comparisons.runs.spec import stack_law
from vsconstraints.errors import ConfigurationError
from vsconstraints.reports.page import html_page, page_of
from vsconstraints.simulation.programs import declaration
from vsconstraints.view.replay.campaigns import replayed
from vsconstraints.view.replay.runs import name_of

ROOT = Path(__file__).parents[1]
LADDER = {
    "fast": {"task": {"Kp0": 40.0}},
    "slow": {"task": {"Kp0": 4.0}},
    "late": {"disturbances": {"delay": 3}},
    "disturbed": {"disturbances": {"delay": 1}},
    "fast-late": {"conditions": ["fast", "late"]},
    "late-slow": {"conditions": ["late", "slow"]},
}
RUN = ["nominal", *LADDER]


def test_a_factorial_is_found_by_what_its_conditions_name() -> None:
    found = Factorial.of(LADDER, RUN)
    assert found is not None
    assert found.factors == (("nominal", "fast", "slow"), ("nominal", "late"))
    assert found.conditions["slow", "late"] == "late-slow"
    assert sorted(found.conditions.values()) == sorted({*RUN} - {"disturbed"})
    # of some that were not run, what was
    some = Factorial.of(LADDER, ["nominal", "fast", "slow"])
    assert some is not None
    assert some.factors == (("nominal", "fast", "slow"), ("nominal",))


@pytest.mark.parametrize(
    ("table", "run"),
    [
        ({}, ["nominal"]),
        # a combination is missing
        ({name: said for name, said in LADDER.items() if name != "fast-late"}, RUN),
        # and something else
        ({**LADDER, "fast-late": {"conditions": ["fast", "late"], "task": {"Kp0": 1.0}}}, RUN),
        # two levels are no curve
        ({name: said for name, said in LADDER.items() if "slow" not in name}, RUN),
        (LADDER, ["nominal", "fast"]),
        (LADDER, []),
    ],
)
def test_nothing_else_is_a_factorial(table: dict[str, Any], run: list[str]) -> None:
    assert Factorial.of(table, run) is None


def test_the_ladders_are_the_factorials_among_the_families_that_come_with_the_package() -> None:
    loaded = {name: Family.load(name) for name in families()}
    found = {
        name: Factorial.of(one.tables.get("conditions", {}), one.conditions)
        for name, one in loaded.items()
    }
    assert {name for name, one in found.items() if one} == {
        name for name in loaded if name.startswith("ladder-")
    }
    for one in filter(None, found.values()):
        assert [len(levels) for levels in one.factors] == [3, 3, 2]
        assert len(one.conditions) == len(set(one.conditions.values())) == 18
        assert one.conditions["medium", "late-12", "noisy"] == "medium-late-12-noisy"


def with_ladder(runs: Any, folder: Path, table: dict[str, Any] = LADDER) -> Dataset:
    evidence = made(runs, folder)
    evidence.manifest["configuration"]["families"]["ur5"]["tables"]["conditions"] = table
    return Dataset(evidence, figures=False)


def test_levels_have_a_figure_and_a_line_among_the_situations_and_no_section(
    tmp_path: Path,
) -> None:
    rates = {name: {"a": 0.9, "b": 0.5} for name in RUN}
    dataset = with_ladder(drawn_runs(rates, ["ur5"], 12), tmp_path)
    assert dataset.conditions == ("nominal", "disturbed")
    assert [condition for _, condition in dataset.situations] == RUN
    dataset.figures = True
    report = write_report_of(dataset)
    text, details = (
        path.read_text(encoding="utf-8") for path in (report, report.with_name("details.md"))
    )
    check(text + details, tmp_path)
    assert (tmp_path / "figures" / "levels--ur5.png").is_file()
    headings = re.findall("^### (.*)", text, re.MULTILINE)
    assert headings == ["Without disturbances", "With disturbances"]
    (found,) = [table for table in tables(details) if table[0][0] == "situation"]
    assert [line[0] for line in found[1:]] == [f"ur5, {name}" for name in RUN]
    # a family of which a level is a condition as any other brings it back
    plain = [
        run(controller=law, family="other", condition="late", scene=i)
        for law in "ab"
        for i in range(3)
    ]
    both = frame([*drawn_runs(rates, ["ur5"], 12).to_dict("records"), *plain])
    assert with_ladder(both, tmp_path).conditions == ("nominal", "late", "disturbed")


def test_points_over_levels_are_shares_with_their_intervals(tmp_path: Path) -> None:
    rates = {name: {"a": 0.9, "b": 0.1 * k} for k, name in enumerate(RUN)}
    dataset = with_ladder(drawn_runs(rates, ["ur5"], 12), tmp_path)
    (factorial,) = dataset.factorials.values()
    rankings = {name: ranking(dataset, name) for name in factorial.conditions.values()}
    sheet = draw_levels(factorial, rankings, dataset.laws)
    assert sheet is not None
    panels = sheet.figure.axes
    assert [ax.get_title(loc="left") for ax in panels] == ["nominal", "late"]
    for ax, second in zip(panels, ("nominal", "late"), strict=True):
        for law, container in zip(dataset.laws, ax.containers, strict=True):
            shares = [
                rankings[factorial.conditions[level, second]].shares[law]
                for level in factorial.factors[0]
            ]
            line, _, (bars,) = container.lines
            assert line.get_ydata() == pytest.approx([100.0 * one.value for one in shares])
            for (low, high), one in zip(bars.get_segments(), shares, strict=True):
                assert (low[1], high[1]) == pytest.approx((100.0 * one.low, 100.0 * one.high))


@pytest.mark.slow
def test_a_report_of_many_conditions_stays_short(tmp_path: Path) -> None:
    """Twenty conditions of three ladders, ten laws."""
    table = Family.load("ladder-planar").tables["conditions"]
    rates = {name: {f"law-{k}": 0.5 + 0.05 * k for k in range(10)} for name in ("nominal", *table)}
    evidence = made(drawn_runs(rates, ["one", "two", "three"], 6), tmp_path)
    for family in evidence.manifest["configuration"]["families"].values():
        family["tables"]["conditions"] = table
    report = write_report_of(Dataset(evidence, figures=False))
    assert len(report.read_text(encoding="utf-8").splitlines()) < 300


def test_the_answer_says_what_another_choice_loses(tmp_path: Path) -> None:
    """Of 60 scenes a succeeds in all, b in 54, c in 30, d in 6: the median of the others is c."""
    good = {"a": 60, "b": 54, "c": 30, "d": 6}
    lines = [run(controller=law, scene=i, status="converged" if i < n else "trapped", step_time_median_us=7.0 * n)
             for law, n in good.items() for i in range(60)]  # fmt: skip
    text = written(frame(lines), tmp_path)
    (line,) = tables(text)[0][1:]
    assert line[:5] == [
        "Without disturbances",
        "a and 1 tie",
        "100 (94.0–100)",
        "420",
        "see its code",
    ]
    assert [re.match("≈ [0-9]+|[0-9]+", cell)[0] for cell in line[5:]] == ["≈ 10", "50", "90"]  # type: ignore[index]
    (data,) = json.loads((tmp_path / "claims.json").read_text(encoding="utf-8"))["answers"]
    assert (data["law"], data["ties"], data["second"], data["median"]) == ("a", ["b"], "b", "c")
    assert data["loss[worst]"] == pytest.approx(0.9)


def test_tables_say_what_a_stack_declared(tmp_path: Path) -> None:
    """Its URDF is a model, so that no finding says that it works without one."""
    good = {"mine": 60, "sliding-mode": 40, "predictive": 20}
    said = {"mine": declaration("mine 2.0", ("urdf", "q"), "velocity")}
    lines = [
        run(controller=law, scene=scene, reason=said.get(law, ""))
        | {"status": "converged" if scene < n else "trapped"}
        for law, n in good.items()
        for scene in range(60)
    ]
    entries = {law: {"type": law} for law in good} | {"mine": {"type": stack_law()}}
    text = written(frame(lines), tmp_path, controllers=entries)
    found = [
        line[head.index("required information")]
        for head, *others in tables(text)
        if "required information" in head
        for line in others
        if "mine" in line[0] + line[1]
    ]
    assert found == ["urdf, q"] * 3  # the answer, the headline and all controllers
    assert "of a stack, all that it declared" in text
    (implementations,) = [
        {line[0]: line[head.index("implementation")] for line in others}
        for head, *others in tables(text)
        if "implementation" in head
    ]
    assert implementations["mine"] == "external" != implementations["sliding-mode"]
    assert "Best without a model: **sliding-mode**" in text


def heat_map_of(page: str) -> Any:
    root = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(page)
    (box,) = [element for element in root.iter("div") if element.get("class") == "heat"]
    return root, box


def test_every_cell_of_the_heat_map_leads_to_its_worst_run(tmp_path: Path) -> None:
    dataset = Dataset(made(drawn_runs(RATES, ["planar-arm", "ur5"], 30), tmp_path), figures=False)
    page = page_of(write_report_of(dataset)).read_text(encoding="utf-8")
    root, box = heat_map_of(page)
    cards = {
        element.get("id"): "".join(element.itertext())
        for element in root.iter("div")
        if element.get("class") == "run"
    }
    lines = [list(line) for line in box.iter("tr")]
    assert ["".join(cell.itertext()) for cell in lines[0][1:]] == [*dataset.laws]
    by_cell = dataset.runs.set_index(["family", "condition", "controller"])
    led = list[str]()
    data = json.loads((tmp_path / "claims.json").read_text(encoding="utf-8"))["situations"]
    assert len(data) == len(cards) == 2 * len(RATES) * len(dataset.laws)
    for (family, condition), line in zip(dataset.situations, lines[1:], strict=True):
        assert "".join(line[0].itertext()) == f"{family}, {condition}"
        for law, cell in zip(dataset.laws, line[1:], strict=True):
            own = by_cell.loc[(family, condition, law)]
            (link,) = list(cell)
            assert float(cell.get("data-value")) == pytest.approx(own["success"].mean())
            led.append(link.get("href").removeprefix("#"))
            (command,) = re.findall("vsconstraints replay .*", cards[led[-1]])
            scene = int(command.split(":")[2])
            assert command == f"vsconstraints replay .:{family}:{scene}:{condition}:{law}"
            worst = own[own["scene"] == scene].iloc[0]
            assert worst["violation_depth"] == own["violation_depth"].max()
            assert worst["status"] in cards[led[-1]]
            (entry,) = [
                e
                for e in data
                if (e["family"], e["condition"], e["law"]) == (family, condition, law)
            ]
            assert entry["worst_scene"] == scene
            assert entry["endings"] == {
                n: (own["ending"] == n).sum() for n in ("success", *UNSUCCESSFUL)
            }
    assert sorted(led) == sorted(cards)


def test_the_text_of_every_cell_can_be_read() -> None:
    """At least 4.5 : 1 on whatever ground, which is as dark as the share is small (WCAG 2)."""

    def luminance(colour: str) -> float:
        digits = colour[1:] if len(colour) == 7 else "".join(2 * c for c in colour[1:])
        parts = [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]
        linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    grounds = []
    for k in range(101):
        ground, ink = map(luminance, Cell(Share(k / 100, 0.0, 1.0), False, {}, 0, "", "").colours)
        assert (max(ground, ink) + 0.05) / (min(ground, ink) + 0.05) >= 4.5
        grounds.append(ground)
    assert grounds == sorted(grounds)


def test_the_only_script_of_a_page_is_that_of_its_heat_map(tmp_path: Path) -> None:
    page = page_of(
        write_report_of(Dataset(made(drawn_runs(RATES, ["ur5"], 6), tmp_path), figures=False))
    )
    text = page.read_text(encoding="utf-8")
    (script,) = re.findall("<script>(.*?)</script>", text, re.DOTALL)
    assert f"script-src 'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'" in text
    assert "script" not in html_page(
        "# A report\n\n<details><summary>x</summary>\n\ny\n\n</details>\n"
    )


def test_a_reason_from_elsewhere_is_shown_as_it_stands(tmp_path: Path) -> None:
    lines = [run(controller=law, scene=i, status="failed", reason="<img src=x onerror=stolen> `b` "
                                                                  "[c](d)")
             for law in "ab" for i in range(3)]  # fmt: skip
    page = page_of(write_report_of(Dataset(made(frame(lines), tmp_path), figures=False))).read_text(
        encoding="utf-8"
    )
    root, _ = heat_map_of(page)
    assert not list(root.iter("img"))
    cards = [
        "".join(element.itertext()) for element in root.iter("div") if element.get("class") == "run"
    ]
    assert len(cards) == 2
    assert all("failed: <img src=x onerror=stolen> `b` [c](d)" in card for card in cards)


def test_a_run_of_a_campaign_is_named_by_folder_family_scene_condition_and_controller(
    tmp_path: Path,
) -> None:
    assert name_of("some/folder:planar-arm:12:nominal:sliding-mode") == "planar-arm-12"
    assert name_of("example-2d-fov:tracking:1") == "example-2d-fov"
    with pytest.raises(ConfigurationError, match="holds no evidence"):
        replayed(f"{tmp_path}:planar-arm:12:nominal:sliding-mode")


@pytest.mark.skipif(
    program() is None, reason=f"no browser: none of {', '.join(NAMES)} is installed"
)
def test_the_heat_map_is_sorted_by_a_click_and_scrolls_in_its_box_on_a_phone(
    tmp_path: Path,
) -> None:
    rates = {name: {f"a-law-of-a-longer-name-{k}": 0.1 * k for k in range(10)} for name in RATES}
    dataset = Dataset(made(drawn_runs(rates, ["planar-arm", "ur5"], 30), tmp_path), figures=False)
    page_file = page_of(write_report_of(dataset))
    column = (
        "[...document.querySelectorAll('.heat tbody tr')].map(row => +row.cells[5].dataset.value)"
    )
    names = "[...document.querySelectorAll('.heat tbody th')].map(cell => cell.textContent)"
    with browser(tmp_path / "browser") as page:
        page.ask(
            "Emulation.setDeviceMetricsOverride",
            width=390,
            height=800,
            deviceScaleFactor=1,
            mobile=False,
        )
        page.open(page_file.as_uri())
        page.wait(
            "document.readyState === 'complete' && document.querySelectorAll('.heat button').length"
        )
        assert page.value("document.documentElement.scrollWidth") <= 390
        assert page.value(
            "(box => box.scrollWidth > box.clientWidth)(document.querySelector('.heat'))"
        )
        before = page.value(column)
        original = page.value(names)
        assert before != sorted(before)
        click = "document.querySelectorAll('.heat thead button')[{}].click()"
        for order in (True, False):
            page.value(click.format(5))
            assert page.value(column) == sorted(before, reverse=order)
        page.value(click.format(0))
        assert page.value(names) == original
        page.value("document.querySelector('.heat td a').click()")
        shown = (
            "[...document.querySelectorAll('.run')].filter(card => "
            "card.getBoundingClientRect().height > 0)"
        )
        assert page.value(f"{shown}.map(card => card.id)") == ["run-1-1"]
        assert page.complaints == []


def test_laws_beside_the_best_known_motions_by_hand() -> None:
    """The second scene cannot be solved as far as is known, and of the third nothing is known:
    neither counts.
    """
    known = pd.DataFrame(
        {"family": "a", "scene": [0, 1, 3], "outcome": ["reachable", "unknown", "reachable"]}
        | {"best_time_s": [1.0, np.nan, 2.0], "law_space": [0.9, np.nan, 0.5]}
    )
    runs = pd.DataFrame(
        {"family": "a", "scene": [0, 1, 2, 3] * 2, "controller": ["one"] * 4 + ["other"] * 4}
        | {"success": [True] * 4 + [True, True, True, False]}
        | {"settling_time_s": [2.0, 9.0, 9.0, 6.0, 1.5, 9.0, 9.0, 1.0], "utilization": 0.7}
    )
    found = regrets(runs, known)
    assert [(own["success"].count, own["success"].of) for own in found.values()] == [(2, 2), (1, 2)]
    # medians of 2 and 3; 1.5
    assert [own["time"] for own in found.values()] == pytest.approx([2.5, 1.5])
    assert [own["space"] for own in found.values()] == pytest.approx([0.0, -0.2])


def test_only_scenes_of_the_test_set_stand_beside_its_best_motions(tmp_path: Path) -> None:
    """Families of the same names, but drawn otherwise, have no such table; the kept study has
    one.
    """
    report = (ROOT / "reports" / "evidence" / "report.md").read_text(encoding="utf-8")
    assert (
        "| predictive"
        in report.partition("## Beside the best known motions")[2].partition("\n## ")[0]
    )
    assert "best known motions" not in written(
        drawn_runs(RATES, ["planar-arm", "ur5"], 20), tmp_path
    )


def test_a_law_is_behind_in_a_further_family_where_it_is_in_all_that_were_run() -> None:
    """One law loses 40 points in every family; another has the same rate as the first in each."""
    rates = {"nominal": {"sliding-mode": 0.5, "hierarchical-qp": 0.9, "predictive": 0.9}}
    names = ["planar-arm", "ur5", "panda", "six-axis", "free-camera", "moving"]
    (found,) = beyond(Dataset(made(drawn_runs(rates, names, 100), Path()), figures=False))
    assert found.behind == {"sliding-mode"}
    assert found.laws[2] == "sliding-mode"
    assert found.ranks.shape == (6, 3)
    assert set(found.ranks[:, 2]) == {3}
    assert [found.cell(law)[0] for law in found.laws] == [
        "≈",
        "≈",
        found.shares["sliding-mode"].cell[0],
    ]
    assert found.shares["sliding-mode"].high < 0.6 < 0.8 < found.shares["predictive"].low
    few = drawn_runs(rates, names[: FEWEST - 1], 100)
    assert beyond(Dataset(made(few, Path()), figures=False)) == []
