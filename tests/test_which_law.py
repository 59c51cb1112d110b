"""The page of laws, against the laws."""

import csv
import gzip
import json
import re
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from vsconstraints.bench.reports.ranking import ranked
from vsconstraints.bench.study import SCENE, SHIPPED
from vsconstraints.comparisons import Suite
from vsconstraints.controllers import CONTROLLERS, DEMANDS, RESOLVERS, Hierarchy, law_ranges
from vsconstraints.controllers.ranges import ROWS
from vsconstraints.errors import ConfigurationError

ROOT = Path(__file__).parents[1]


def table() -> dict[str, list[str]]:
    """What the two tables of "Which law?" say of each law: its parts, uses, parameters, hard,
    success, properties.
    """
    text = (
        (ROOT / "docs" / "laws.md")
        .read_text(encoding="utf-8")
        .partition("## Which law?")[2]
        .partition("\n## ")[0]
    )
    lines = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line[:3] == "| `"
    ]
    assert {len(line) for line in lines} == {4}, "a table with more columns does not fit the page"
    found: dict[str, list[str]] = {}
    for name, *cells in lines:
        found[name.strip("`")] = [*cells, *found.get(name.strip("`"), [])]
    assert {len(cells) for cells in found.values()} == {6}
    return found


@pytest.mark.parametrize("suite", ["laws", "laws-disturbed"])
def test_every_law_of_the_suites_is_in_the_table_with_what_it_uses(suite: str) -> None:
    lines = table()
    for entry in Suite.load(ROOT / "comparisons" / f"{suite}.toml").controllers:
        law = entry.make()
        parts, uses, parameters, *_ = lines[entry.name]
        assert uses == (", ".join(law.uses) or "–"), entry.name
        demand = getattr(law, "demand", None)
        resolver = getattr(law, "resolver", None)
        named = (
            f"{demand.name} × {resolver.name}"
            if demand is not None and resolver is not None
            else "–"
        )
        assert parts == named, entry.name
        ranges = law_ranges(entry.law, entry.options, entry.folder)
        stated = ", ".join(
            f"{name} {one}" for name, one in ranges.items() if one is not ROWS.get(name)
        )
        assert parameters == stated or (not stated and parameters in ("–", "u⁺ of the rows")), (
            entry.name
        )


def kept(name: str, scenes: int) -> tuple[Any, Any]:
    """A table of so many scenes that is kept, and the success of its laws in each condition, in per
    cent.
    """
    runs = pd.read_parquet(ROOT / "comparisons" / f"{name}.parquet")
    assert runs.drop_duplicates(["family", "scene"]).shape[0] == scenes
    return runs, (
        100.0 * runs.groupby(["controller", "condition"])["success"].mean()
    ).round().unstack()


def test_what_the_page_says_of_a_policy_is_that_of_the_kept_runs() -> None:
    page = (
        (ROOT / "docs" / "own-controller.md")
        .read_text(encoding="utf-8")
        .partition("## 7. A learned law")[2]
    )
    said = {
        law: [*map(int, shares)]
        for law, *shares in re.findall(r"`([\w-]+)`\s(\d+)/(\d+)/(\d+)", page)
    }
    _, success = kept("policy", 200)
    assert said == {
        law: [*own[["nominal", "disturbed", "limited"]]] for law, own in success.iterrows()
    }


def test_what_the_page_says_of_tuned_laws_is_that_of_the_kept_runs() -> None:
    page = (
        (ROOT / "docs" / "which-law.md")
        .read_text(encoding="utf-8")
        .partition("0 / 20 / 100 evaluations")[2]
    )
    lines = re.findall(
        r"^\| `(.+?)` \| \d+ / \d+ / \d+ \| (\d+) → (\d+) \| (\d+) → (\d+) \|$", page, re.MULTILINE
    )
    _, success = kept("tuned-laws", 350)
    assert {law for law, *_ in lines} == {
        law for law in success.index if not law.endswith("-tuned")
    }
    for law, *said in lines:
        own = [
            success.loc[name, when]
            for when in ("nominal", "disturbed")
            for name in (law, f"{law}-tuned")
        ]
        assert [*map(int, said)] == own, law


def test_success_in_the_table_is_that_of_the_kept_runs() -> None:
    runs, success = kept("laws", 500)
    lines = table()
    suite = Suite.load(ROOT / "comparisons" / "laws.toml")
    for entry in suite.controllers:
        shares = "–" if entry.name == "tracking" else "{nominal:.0f}/{disturbed:.0f}/{limited:.0f}"
        known = shares.format(**success.loc[entry.name]) if entry.name in success.index else shares
        assert lines[entry.name][4] == known, entry.name
    order = success["disturbed"].sort_values(ascending=False).index
    page = (ROOT / "docs" / "which-law.md").read_text(encoding="utf-8").partition("Of 36 [laws")[2]
    nominal = runs[runs["condition"] == "nominal"]
    ties = len(
        ranked(nominal.pivot(index=SCENE, columns="controller", values="success"), "nominal").front
    )
    assert (len(order), ties) == (36, int(re.findall(r" (\d+) tie ", page)[0]))
    assert [*order[:5]] == [
        "robust-predictive",
        "robust-hierarchical-qp",
        "predictive",
        *re.findall(r"`(.+?)`", page)[:2],
    ]


def test_the_page_names_every_resolver_that_keeps_the_box() -> None:
    text = (ROOT / "docs" / "laws.md").read_text(encoding="utf-8")
    sentence = text.partition("A box for the accelerations is kept exactly by ")[2].partition(";")[
        0
    ]
    named = re.findall(r"`(.+?)`", sentence)
    keep = {kind.name for kind in RESOLVERS if issubclass(kind, Hierarchy)}
    assert {*named} == keep | {"predictive", "robust-predictive"}


def test_what_the_page_says_of_what_is_not_convex_is_what_the_report_says() -> None:
    with (ROOT / "reports" / "default" / "results.csv").open(encoding="utf-8", newline="") as file:
        lines = [line for line in csv.DictReader(file) if line["controller"] != "tracking"]
    arrived = {
        scenario: {
            line["controller"]
            for line in lines
            if line["scenario"] == scenario and line["status"] == "converged"
        }
        for scenario in ("example-2d-heart-concave", "example-2d-bowl")
    }
    assert arrived == {"example-2d-heart-concave": {"predictive"}, "example-2d-bowl": set()}
    text = (ROOT / "docs" / "which-law.md").read_text(encoding="utf-8")
    assert all(scenario in text for scenario in arrived)


def cells(line: str) -> list[str]:
    return [cell.strip(" *") for cell in line.strip("|").split("|")]


def test_what_the_page_says_of_tuning_and_disturbances_is_what_the_kept_study_says() -> None:
    claims = json.loads(
        (ROOT / "reports" / "evidence" / "claims.json").read_text(encoding="utf-8")
    )["table"]
    lost = [100.0 * (line["nominal"] - line["disturbed"]) for line in claims]
    page = " ".join((ROOT / "docs" / "which-law.md").read_text(encoding="utf-8").split())
    assert f"every law succeeds less often, by {min(lost):.0f} to {max(lost):.0f} points" in page
    last = {line["law"] for line in sorted(claims, key=lambda line: line["disturbed"])[:2]}
    (noise,) = (
        line
        for line in page.split("| ")
        if line.startswith("`sliding-mode-ahead`, `sliding-mode`, the last two")
    )
    assert last == {*re.findall(r"`(.+?)`", noise)}
    assert '"disturbed"' in (ROOT / "comparisons" / "tuning.toml").read_text(encoding="utf-8")
    assert "strength" in law_ranges("potential-field")


RUNGS = ("nominal", "medium", "fast", "late-36", "noisy", "fast-late-36-noisy")
ROBUST = "robust-hierarchical-qp-observer"


@pytest.fixture(scope="module")
def study() -> Any:
    return pd.read_parquet(SHIPPED)


def success(runs: Any, law: str) -> int:
    """In per cent."""
    return round(100.0 * runs[runs["controller"] == law]["success"].mean())


def test_the_table_of_the_ladders_is_that_of_the_kept_runs(study: Any) -> None:
    rungs = study[study["family"].str.startswith("ladder") & (study["scene"] < 40)]
    text = (
        (ROOT / "docs" / "benchmark.md")
        .read_text(encoding="utf-8")
        .partition("| law | paper's regime |")[2]
    )
    lines = [
        cells(line) for line in text.partition("\n\n")[0].splitlines() if line.startswith("| `")
    ]
    assert len(lines) == 9
    for named, *numbers in lines:
        known = [success(rungs[rungs["condition"] == rung], named.strip("`")) for rung in RUNGS]
        assert [int(number) for number in numbers] == known, named
    assert rungs[rungs["condition"] == "fast"].drop_duplicates(["family", "scene"]).shape[0] == 120


def test_what_the_page_says_of_what_changed_is_what_the_kept_runs_say(study: Any) -> None:
    page = " ".join((ROOT / "docs" / "which-law.md").read_text(encoding="utf-8").split())
    disturbed = study[study["condition"] == "disturbed"]
    for words, family in (
        ("the ladder of the Panda ({} against {} %)", "ladder-panda"),
        ("where things move ({} against {} %)", "moving"),
        ("the free camera ({} against {} %)", "free-camera"),
        ("the UR5 ({} against {} %)", "ur5"),
    ):
        own = disturbed[disturbed["family"] == family]
        assert words.format(success(own, "predictive"), success(own, ROBUST)) in page
    rungs = study[study["family"].str.startswith("ladder") & (study["scene"] < 40)]
    slow, fast, late = (
        rungs[rungs["condition"] == name] for name in ("nominal", "fast", "late-36")
    )
    assert (
        f"falls from {success(slow, 'hierarchical-qp')} to {success(late, 'hierarchical-qp')} %"
        in page
    )
    assert f"its robust form keeps {success(late, 'robust-hierarchical-qp')} %" in page
    field, other = (success(disturbed, law) for law in ("potential-field", "hierarchical-qp"))
    assert field > other
    assert (
        f"{field} % with disturbances, more than `hierarchical-qp`, but "
        f"{success(fast, 'potential-field')} %" in page
    )


def test_success_over_rows_at_once_is_that_of_the_kept_runs(study: Any) -> None:
    """Those that tracking violates, as the test set has them."""
    folder = ROOT / "src" / "vsconstraints" / "bench" / "families" / "testset-v1"
    challenged = {
        (file.name.partition(".")[0], scene["number"]): len(scene["challenged"])
        for file in folder.glob("*.held-out.jsonl.gz")
        for scene in map(json.loads, gzip.decompress(file.read_bytes()).splitlines())
    }
    rows = [challenged[key] for key in zip(study["family"], study["scene"], strict=True)]
    study = study.assign(rows=pd.cut(rows, [0, 1, 2, 4, 17], labels=False))
    scenes = study[study["condition"] == "nominal"].drop_duplicates(["family", "scene"])
    text = (
        (ROOT / "docs" / "benchmark.md")
        .read_text(encoding="utf-8")
        .partition("- **Several rows at once**")[2]
    )
    said = " ".join(text.partition("\n\n")[0].split())
    assert (
        f"({', '.join(str(n) for n in scenes['rows'].value_counts().sort_index())} scenes)" in said
    )

    def shares(law: str, condition: str) -> str:
        own = study[(study["controller"] == law) & (study["condition"] == condition)]
        return "/".join(f"{100.0 * share:.0f}" for share in own.groupby("rows")["success"].mean())

    found = re.findall(
        r"([\d/]+)(?: %)? for `(.+?)`(?: \((?:disturbed )?([\d/]+)\))?", said.partition("- **")[0]
    )
    assert [law for _, law, _ in found][:: len(found) - 1] == ["sliding-mode", "robust-predictive"]
    for nominal, law, disturbed in found:
        assert nominal == shares(law, "nominal"), law
        assert disturbed in ("", shares(law, "disturbed")), law


def test_the_page_names_laws_that_can_be_run_and_says_how() -> None:
    text = (ROOT / "docs" / "which-law.md").read_text(encoding="utf-8")
    suite = Suite.load(ROOT / "comparisons" / "laws.toml")
    named = {name for name in table() if f"`{name}`" in text}
    for name in named:
        assert name in {entry.name for entry in suite.select(controllers=[name]).controllers}
    assert named - {*CONTROLLERS}
    assert "comparisons/laws.toml --controller" in text
    with pytest.raises(
        ConfigurationError, match=r"a suite can name others, as comparisons/laws\.toml"
    ):
        Suite.load().select(controllers=["saturation"])


def test_both_suites_have_the_same_laws_with_the_same_settings() -> None:
    suites = [
        Suite.load(ROOT / "comparisons" / f"{name}.toml").controllers
        for name in ("laws", "laws-disturbed")
    ]
    assert suites[1] == suites[0]


def test_the_suites_have_every_demand_and_every_resolver() -> None:
    laws = [entry.make() for entry in Suite.load(ROOT / "comparisons" / "laws.toml").controllers]
    for part, kinds in (("demand", DEMANDS), ("resolver", RESOLVERS)):
        tried = {getattr(law, part).name for law in laws if hasattr(law, part)}
        # tracking alone is the one that asks for nothing
        assert {kind.name for kind in kinds} - tried <= {"nothing"}


def test_the_default_comparison_is_readable() -> None:
    """The paper's three laws and three of the field's, beside tracking."""
    names = [entry.name for entry in Suite.load().controllers]
    assert names[:4] == ["tracking", "sliding-mode", "potential-field", "hierarchical-qp"]
    assert {*names[4:]} == {"implicit-switch", "cbf-filter", "predictive"}
