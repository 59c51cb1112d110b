"""Success on fresh scenes beside the published success: the command, its table, and the page that
shows a result.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vsconstraints.bench.reports.fresh import fresh_page, fresh_rates
from vsconstraints.bench.study import Study
from vsconstraints.cli import app
from vsconstraints.errors import ConfigurationError

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "comparisons" / "fresh.parquet"


def test_fresh_scenes_are_run_by_the_published_laws_and_the_same_seed_gives_the_same_table(
    tmp_path: Path,
) -> None:
    arguments = [
        "testset",
        "fresh",
        "--family",
        "planar-arm",
        "--scenes",
        "1",
        "--out",
        str(tmp_path / "out"),
    ]
    done = CliRunner().invoke(app, [*arguments, "--seed", "5", "--jobs", "1"])
    assert done.exit_code == 0, done.output
    table = tmp_path / "out" / "fresh.parquet"
    fresh = Study.load(table)
    published = Study.load()
    assert {*fresh.laws} == {*published.laws}
    assert {*fresh.runs["condition"]} == {"nominal", "disturbed"}
    assert fresh_page(fresh, published) in done.stdout
    assert "Seed: 5." in done.stdout
    before = fresh.runs
    again = CliRunner().invoke(app, [*arguments, "--seed", "5", "--jobs", "1"])
    assert again.exit_code == 0, again.output
    assert Study.load(table).runs.equals(before)
    other = CliRunner().invoke(app, [*arguments, "--seed", "6", "--jobs", "1"])
    assert isinstance(other.exception, ConfigurationError)


def test_rates_are_compared_on_the_same_families_by_fishers_exact_test() -> None:
    published = Study.load()
    runs = published.runs[published.runs["family"] == "ur5"].copy()
    chosen = (
        (runs["scene"] < 4)
        & (runs["controller"] == "sliding-mode")
        & (runs["condition"] == "nominal")
    )
    fresh = replace(published, runs=runs[chosen].assign(success=[True, True, True, False]))
    # the tea of Fisher (1935): three of four against one of four
    of_four = runs[chosen].assign(success=[False, True, False, False])
    (found,) = fresh_rates(fresh, replace(published, runs=of_four))
    assert (found.law, found.condition) == ("sliding-mode", "nominal")
    assert (found.fresh.share, found.published.share) == (0.75, 0.25)
    assert found.p == pytest.approx(34 / 70)
    all_families = fresh_rates(fresh, published)
    assert all_families[0].published.of == 200
    nowhere = replace(fresh, runs=fresh.runs.assign(condition="limited"))
    with pytest.raises(ConfigurationError, match="no law and condition in common"):
        fresh_rates(nowhere, published)


@pytest.mark.skipif(not KEPT.exists(), reason="the table is part of a clone")
def test_the_page_shows_what_the_kept_table_says() -> None:
    page = (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")
    shown = page.partition("<!-- fresh -->")[2].partition("<!-- end of fresh -->")[0].strip()
    fresh = Study.load(KEPT)
    assert shown == fresh_page(fresh, Study.load())
    scenes = fresh.runs.groupby("family", observed=True)["scene"].nunique()
    command = re.search(r"vsconstraints testset fresh --seed (\d+) --scenes (\d+)", page)
    assert command is not None
    assert {*scenes} == {int(command[2])}
    assert len(scenes) == 10
