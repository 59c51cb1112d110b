"""Folders of one campaign, read together: what they hold is what one folder would hold."""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from campaigns import assert_same
from vsconstraints.bench.evidence import Evidence, merge, parquet
from vsconstraints.bench.evidence.folder import stored_batches, stored_files, write_batch
from vsconstraints.bench.study import Study
from vsconstraints.cli import app
from vsconstraints.comparisons.runs.files import SUMS, seal
from vsconstraints.errors import ConfigurationError

KEPT = Path(__file__).parents[1] / "reports" / "real-world"
FAMILIES = ("panda", "ur5")
SCENES = 7


def copied(folder: Path, families: tuple[str, ...] = FAMILIES, **changes: Any) -> Path:
    """Copy the first scenes of the kept campaign, with changes of its configuration."""
    folder.mkdir()
    manifest = json.loads((KEPT / "manifest.json").read_text("utf-8"))
    manifest["configuration"] |= {"scenes": SCENES, **changes}
    (folder / "manifest.json").write_text(json.dumps(manifest), "utf-8")
    for table in parquet.tables():
        (folder / table).mkdir()
        for family in families:
            shutil.copy(KEPT / table / f"part-{family}-0000000-0000006.parquet", folder / table)
    seal(folder, stored_files(folder))
    return folder


def with_scenes(folder: Path, family: str, scenes: list[int], factor: float = 1.0) -> Path:
    """Store scenes of the kept campaign as a batch; ``factor`` changes a score of one run."""
    copied(folder, ())
    (batch,) = (
        batch
        for batch in stored_batches(KEPT)
        if batch.facts.family == family and 0 in batch.scenes
    )
    part = batch.of(scenes)
    tables = {name: part.table(name) for name in parquet.tables()}
    runs = tables["runs"]
    values = runs["acceleration_variation"].to_pylist()
    values[-1] *= factor
    place = runs.column_names.index("acceleration_variation")
    tables["runs"] = runs.set_column(place, runs.field(place), [values])
    facts = replace(batch.facts, scenes=part.scenes, runs=runs.num_rows)
    write_batch(folder, part.name_of_scenes, tables, facts)
    seal(folder, stored_files(folder))
    return folder


def tables(evidence: Evidence) -> dict[str, pd.DataFrame]:
    return {name: getattr(evidence, name) for name in parquet.tables()}


def test_parts_are_read_as_the_whole_in_any_order(tmp_path: Path) -> None:
    whole = copied(tmp_path / "whole")
    parts = [copied(tmp_path / family, (family,)) for family in FAMILIES]
    expected = tables(Evidence.load(whole))
    for folders in (parts, parts[::-1], [parts[0], *parts]):
        evidence = Evidence.load(folders)
        assert_same(expected, tables(evidence))
        assert evidence.missing_scenes(range(SCENES)) == ""
    runs = len(expected["runs"])
    assert (evidence.manifest["finished"], evidence.manifest["runs"]) == (2 * SCENES, runs)
    # several folders may hold the same one: only those that `merge` has copied are counted
    assert "trajectories" not in evidence.manifest
    merged = merge(tmp_path / "merged", parts)
    assert (merged.scenes, merged.runs) == (2 * SCENES, runs)
    assert_same(expected, tables(Evidence.load(tmp_path / "merged")))


def test_the_footer_of_each_file_is_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = [copied(tmp_path / family, (family,)) for family in FAMILIES]
    read: list[Path] = []
    facts_of = parquet.facts_of
    monkeypatch.setattr(parquet, "facts_of", lambda path: (read.append(path), facts_of(path))[1])
    evidence = Evidence.load(parts)
    assert len(evidence.batches) == len(evidence.own_files) + 2 == 2
    assert sorted(read) == sorted(path for part in parts for path in part.rglob("*.parquet"))
    assert replace(evidence).batches is evidence.batches
    assert len(evidence.batches) == 2


def test_no_folder_is_no_evidence() -> None:
    with pytest.raises(ConfigurationError, match="no folder of evidence is given"):
        Evidence.load([])


def test_scenes_in_two_folders_count_once(tmp_path: Path) -> None:
    whole = copied(tmp_path / "whole")
    some = with_scenes(tmp_path / "some", "panda", [0, 1, 2, 5])
    assert_same(tables(Evidence.load(whole)), tables(Evidence.load([whole, some])))
    evidence = Evidence.load([some, copied(tmp_path / "other", ("ur5",))])
    assert evidence.missing_scenes(range(SCENES)) == "panda 3–4, panda 6–6"
    assert set(evidence.scenes.loc[evidence.scenes["family"] == "panda", "scene"]) == {0, 1, 2, 5}
    with pytest.raises(ConfigurationError, match="scenes panda 3–4, panda 6–6 are missing"):
        merge(tmp_path / "out", [some, tmp_path / "other"])


def test_different_results_of_a_scene_are_named(tmp_path: Path) -> None:
    whole = copied(tmp_path / "whole")
    changed = with_scenes(tmp_path / "changed", "panda", [2, 3], 1.0 + 1e-15)
    with pytest.raises(
        ConfigurationError, match=r"scene 3 of panda is in .* and in .*, with different runs"
    ):
        Evidence.load([whole, changed])


def test_different_settings_are_named(tmp_path: Path) -> None:
    folders = [copied(tmp_path / "a"), copied(tmp_path / "b", title="Another")]
    with pytest.raises(
        ConfigurationError,
        match=r"a and .*b are not parts of one campaign: title is .* in the first and 'Another' in",
    ):
        Evidence.load(folders)


def of_version(folder: Path, version: str, family: str) -> Path:
    """Copy the scenes of a family, with another version in the manifest."""
    copied(folder, (family,))
    path = folder / "manifest.json"
    manifest = {**json.loads(path.read_text("utf-8")), "version": version}
    path.write_text(json.dumps(manifest), "utf-8")
    (folder / SUMS).unlink()
    seal(folder, stored_files(folder))
    return folder


def test_several_folders_keep_their_version(tmp_path: Path) -> None:
    """A study of another version is refused, whether its folders are read together or merged."""
    old = [of_version(tmp_path / family, "0.0.1", family) for family in FAMILIES]
    merge(tmp_path / "merged", old)
    for folders in (old, tmp_path / "merged"):
        with pytest.raises(ConfigurationError, match=r"is of version 0\.0\.1"):
            Study.load(folders)
    other = of_version(tmp_path / "other", "0.0.2", FAMILIES[1])
    with pytest.raises(ConfigurationError, match="the package's version differs"):
        Evidence.load([old[0], other])


@pytest.mark.parametrize(
    ("installed", "remedy"),
    [
        ({}, r"install ours 2\.0, theirs 1\.0, and merge again"),
        ({"ours": "2.0"}, r"install theirs 1\.0, and merge again"),
        ({"ours": "2.1", "theirs": "1.0"}, r"install ours 2\.0, and merge again"),
        ({"ours": "2.0", "theirs": "1.0"}, "merge with the version that wrote it"),
    ],
)
def test_a_column_that_would_be_lost_is_not_merged(
    installed: dict[str, str], remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The table holds a metric that is not installed; the remedy names only missing packages."""
    metrics = {"ours": "2.0", "theirs": "1.0"}
    # `vsconstraints.bench.evidence.merge` is the function
    merging = sys.modules["vsconstraints.bench.evidence.merge"]
    monkeypatch.setattr(merging, "packages_with_metrics", lambda: installed)
    folder = with_scenes(tmp_path / "theirs", "panda", list(range(SCENES)))
    ur5 = copied(tmp_path / "ur5", ("ur5",))
    (batch,) = stored_batches(folder)
    tables = {name: batch.table(name) for name in parquet.tables()}
    runs = tables["runs"]
    tables["runs"] = runs.append_column("camera_path_m", [[0.5] * runs.num_rows])
    identity = {**batch.facts.identity, "metrics": metrics}
    write_batch(folder, batch.name, tables, replace(batch.facts, identity=identity))
    seal(folder, stored_files(folder))
    with pytest.raises(ConfigurationError, match="metrics"):
        Evidence.load([folder, ur5])
    (other,) = stored_batches(ur5)
    tables = {name: other.table(name) for name in parquet.tables()}
    identity = {**other.facts.identity, "metrics": metrics}
    write_batch(ur5, other.name, tables, replace(other.facts, identity=identity))
    seal(ur5, stored_files(ur5))
    with pytest.raises(ConfigurationError, match=f"camera_path_m; {remedy}"):
        merge(tmp_path / "merged", [folder, ur5])
    assert not (tmp_path / "merged").exists()


def say(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def test_commands_take_several_folders(tmp_path: Path) -> None:
    parts = [copied(tmp_path / family, (family,)) for family in FAMILIES]
    refused = say("verify", parts[0])
    assert refused.exit_code == 1
    assert "scenes ur5 0–6 are missing" in " ".join(refused.output.split())
    assert say("verify", *parts).exit_code == 0
    for words, why in (
        (parts, "needs a folder of its own: --out"),
        ((*parts, "--out", parts[0]), "holds results"),
    ):
        refused = say("report", *words, "--no-figures")
        assert isinstance(refused.exception, ConfigurationError)
        assert why in str(refused.exception)
    before = sorted(tmp_path.rglob("*"))
    assert say("report", *parts, "--no-figures", "--out", tmp_path / "page").exit_code == 0
    kept = [path for path in sorted(tmp_path.rglob("*")) if tmp_path / "page" not in path.parents]
    assert kept == sorted([*before, tmp_path / "page"])
    assert say("report", copied(tmp_path / "whole"), "--no-figures").exit_code == 0
    page = (tmp_path / "page" / "report.html").read_text("utf-8")
    for family in FAMILIES:  # from the folder of the report
        assert f"vsconstraints replay ../{family}:{family}:" in page
    assert "replay ../" not in (tmp_path / "whole" / "report.html").read_text("utf-8")
    assert "vsconstraints replay ../" in (tmp_path / "page" / "details.md").read_text("utf-8")
    claims = [(tmp_path / name / "claims.json").read_text("utf-8") for name in ("page", "whole")]
    assert claims[0] == claims[1]


def test_folders_without_scenes_hold_none(tmp_path: Path) -> None:
    """The first folder is not read in the place of all."""
    part = copied(tmp_path / "part", FAMILIES[:1])
    evidence = Evidence.load([part, copied(tmp_path / "other", FAMILIES[1:])])
    assert Evidence.load(part).batches
    assert not replace(evidence, combined=()).batches
