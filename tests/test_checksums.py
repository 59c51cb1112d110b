"""What was stored is what is read: changes are refused by name, and so are batches that are not the
plan's.
"""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from checks import stored
from typer.testing import CliRunner

from campaigns import assert_same, campaign, tables
from test_evidence import HERE
from vsconstraints.bench.evidence import (
    Campaign,
    Evidence,
    Shard,
    collect,
    merge,
    parquet,
)
from vsconstraints.bench.evidence import folder as folders
from vsconstraints.cli import app
from vsconstraints.comparisons import StoredComparison, Suite, compare, keep_trajectories
from vsconstraints.comparisons.runs.files import SUMS, recorded, seal
from vsconstraints.comparisons.runs.folder import manifest_of
from vsconstraints.errors import ConfigurationError
from vsconstraints.reports import write_report


def suite(*settings: str) -> Suite:
    return Suite.load().select(
        ["example-2d-fov"], ["sliding-mode"], settings=["scenario.duration=0.05", *settings]
    )


@pytest.fixture(scope="module")
def chosen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("chosen") / "results"
    compare(suite(), folder, workers=0)
    return folder


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> tuple[Campaign, Path]:
    """A campaign whose scenes two machines have run, all of a family in one batch each, and one has
    run all.
    """
    folder = tmp_path_factory.mktemp("parts")
    small = campaign(folder, scenes=4)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vsconstraints.bench.evidence.work.MIN_BATCHES", 1)
        for i in (1, 2):
            collect(small, folder / str(i), replace(HERE, shard=Shard(i, 2), keep="first"))
    return small, folder


def verified(folder: Path) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["verify", str(folder)])
    assert "Traceback" not in done.output
    return (
        (2, str(done.exception))
        if isinstance(done.exception, ConfigurationError)
        else (done.exit_code, done.output)
    )


def test_sums_are_those_of_sha256sum(chosen: Path, parts: tuple[Campaign, Path]) -> None:
    for folder in (chosen, parts[1] / "1"):
        done = subprocess.run(
            ["sha256sum", "--check", "--strict", SUMS], cwd=folder, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        kept = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
        assert set(recorded(folder) or ()) == kept - {SUMS, ".vsconstraints-lock"}
        assert verified(folder)[0] == 0


FILES = (
    "manifest.json",
    "results.csv",
    "constraints.csv",
    "trajectories/example-2d-fov--tracking--0.npz",
)


@pytest.mark.parametrize("name", FILES)
def test_a_changed_file_of_a_comparison_is_named(name: str, chosen: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(chosen, tmp_path / "copy")
    content = bytearray((folder / name).read_bytes())
    content[len(content) // 2] ^= 1
    (folder / name).write_bytes(content)
    for read in (StoredComparison.load, write_report):
        with pytest.raises(
            ConfigurationError,
            match=rf"is incomplete or changed: changed since they were stored .*: {name}",
        ):
            read(folder)
    code, said = verified(folder)
    assert code == 1
    assert name in said
    (folder / name).unlink()
    if name != "manifest.json":
        assert verified(folder)[0] == 1
    if name.endswith("npz"):
        assert "The trajectory of tracking is missing" in write_report(folder).read_text(
            encoding="utf-8"
        )
    else:
        with pytest.raises(ConfigurationError, match="missing"):
            write_report(folder)


def test_what_was_put_into_a_folder_later_is_refused(chosen: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(chosen, tmp_path / "copy")
    shutil.copy(folder / FILES[-1], folder / "trajectories" / "example-2d-fov--sliding-mode--1.npz")
    with pytest.raises(ConfigurationError, match=r"not in checksums\.sha256 .*sliding-mode--1"):
        write_report(folder)


def test_the_same_command_makes_again_what_was_changed(chosen: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(chosen, tmp_path / "copy")
    path = folder / FILES[-1]
    other = folder / "trajectories" / "example-2d-fov--sliding-mode--0.npz"
    path.write_bytes(other.read_bytes())
    assert compare(suite(), folder, workers=0).stored_before == 1
    assert verified(folder)[0] == 0
    assert path.read_bytes() != other.read_bytes()
    keep_trajectories(folder, "none")
    assert verified(folder)[0] == 0


def test_a_command_that_is_killed_leaves_what_can_be_read_and_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between any two files that it writes."""

    class Killed(BaseException):
        pass

    for moment in range(100):
        folder = tmp_path / str(moment)
        left = [moment]

        def counted(*arguments: Any, real: Callable[..., Any], left: list[int] = left) -> Any:
            left[0] -= 1
            if left[0] < 0:
                raise Killed
            return real(*arguments)

        with monkeypatch.context() as patch:
            for place in (
                "runner.write_table",
                "runner.append_lines",
                "runner.add_sums",
                "runner.remove_changed",
                "runs.store.write_json",
                "runs.store.seal",
            ):
                path, _, name = f"vsconstraints.comparisons.{place}".rpartition(".")
                module = sys.modules[path]
                real = getattr(module, name)
                patch.setattr(
                    module,
                    name,
                    lambda *arguments, real=real: counted(*arguments, real=real),
                )
            try:
                compare(suite(), folder, workers=0)
            except Killed:
                ended = True
            else:
                ended = False
        if (
            ended
            and (folder / "constraints.csv").is_file()
            and "finished" not in manifest_of(folder)
        ):
            (remark,) = StoredComparison.load(folder).remarks
            assert "is unfinished; files without checksums: manifest.json, results.csv" in remark
        assert (verified(folder)[0] != 0) == ended
        compare(suite(), folder, workers=0)
        assert verified(folder)[0] == 0
        if not ended:
            break
    assert moment > 10


def arrow(folder: Path, name: str) -> dict[str, Any]:
    return {
        table: parquet.read([folders.batch_file(folder, table, name)], parquet.tables()[table])
        for table in parquet.tables()
    }


def rewritten(
    folder: Path, change: Callable[[dict[str, pd.DataFrame], dict[str, Any]], None]
) -> str:
    """Change lines and facts of a folder's only batch, and make its checksums anew; its name."""
    import pyarrow as pa

    (name,) = folders.batch_names(folder)
    found = arrow(folder, name)
    frames = {table: lines.to_pandas() for table, lines in found.items()}
    facts = parquet.facts_of(folders.batch_file(folder, "runs", name))
    change(frames, facts)
    for table, lines in found.items():
        new = pa.Table.from_pandas(frames[table], schema=lines.schema, preserve_index=False)
        parquet.write(folders.batch_file(folder, table, name), new, facts)
    (folder / SUMS).unlink()
    seal(folder, folders.stored_files(folder))
    return name


def cut(*names: str) -> Callable[[dict[str, pd.DataFrame], dict[str, Any]], None]:
    def change(frames: dict[str, pd.DataFrame], facts: dict[str, Any]) -> None:
        for name in names:
            frames[name] = frames[name].iloc[:-1]
        facts["runs"] = len(frames["runs"])

    return change


def emptied(frames: dict[str, pd.DataFrame], facts: dict[str, Any]) -> None:
    for name, frame in frames.items():
        frames[name] = frame.iloc[:0]
    facts["runs"] = 0


def doubled(frames: dict[str, pd.DataFrame], facts: dict[str, Any]) -> None:
    frames["runs"] = pd.concat([frames["runs"].iloc[:-1], frames["runs"].iloc[:1]])


def in_place(
    table: str, column: str, value: Any
) -> Callable[[dict[str, pd.DataFrame], dict[str, Any]], None]:
    def change(frames: dict[str, pd.DataFrame], facts: dict[str, Any]) -> None:
        frames[table].loc[0, column] = value

    return change


def said(**values: Any) -> Callable[[dict[str, pd.DataFrame], dict[str, Any]], None]:
    return lambda frames, facts: facts.update(values)


def of_other_law(frames: dict[str, pd.DataFrame], facts: dict[str, Any]) -> None:
    facts["identity"]["controllers"]["hierarchical-qp"]["alpha"] = 9.0


WRONG = {
    "a run removed": (cut("runs"), "it has no run .*quick"),
    "a run removed, not from the count": (
        lambda frames, facts: frames.update(runs=frames["runs"].iloc[1:]),
        "it has 11 runs of 12",
    ),
    "emptied": (emptied, "it has 0 lines of 2 scenes"),
    "a run twice": (doubled, "it has (no run|more than once)"),
    "rows emptied": (
        lambda frames, facts: frames.update(rows=frames["rows"].iloc[:0]),
        "its rows are not those",
    ),
    "a foreign law": (in_place("runs", "controller", "mine"), "it has (no|a) run"),
    "a foreign law in a row": (in_place("rows", "controller", "mine"), "its rows are not those"),
    "a foreign condition": (in_place("runs", "condition", "windy"), "it has (no|a) run"),
    "a foreign scene": (in_place("runs", "scene", 77), "it has (no|a) run"),
    "another half": (in_place("scenes", "half", "training"), "its scenes are not those"),
    "a scene that there is not": (said(scenes=[0, 77]), r"its scenes are \(0, 77\), of 4"),
    "the same scene twice": (said(scenes=[0, 0]), "its scenes are"),
    "a foreign family": (said(family="mine"), "it is of the family 'mine'"),
    "another setting": (of_other_law, "with another controllers"),
    "no facts": (lambda frames, facts: facts.clear(), "it is not a batch of a campaign"),
    "an unknown fact": (said(more=1), "it is not a batch of a campaign"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_batch_that_is_not_the_plans_is_refused_by_name(
    what: str, parts: tuple[Campaign, Path], tmp_path: Path
) -> None:
    one, two = (shutil.copytree(parts[1] / name, tmp_path / name) for name in "12")
    change, words = WRONG[what]
    name = rewritten(one, change)
    for read in (Evidence.load, lambda folder: merge(tmp_path / "merged", [folder, two])):
        with pytest.raises(ConfigurationError, match=rf"{name}\.parquet.*{words}"):
            read(one)
    assert not (tmp_path / "merged").exists()
    code, text = verified(one)
    assert code == 1
    assert name in text


def test_merging_takes_nothing_that_was_changed_or_is_gone(
    parts: tuple[Campaign, Path], tmp_path: Path
) -> None:
    one, two = (shutil.copytree(parts[1] / name, tmp_path / name) for name in "12")
    (trajectory, *_) = sorted((one / "trajectories").glob("*.npz"))
    content = trajectory.read_bytes()
    for change in (lambda: trajectory.write_bytes(content[:-1]), trajectory.unlink):
        change()
        with pytest.raises(
            ConfigurationError, match=f"1 is incomplete or changed: .*{trajectory.name}"
        ):
            merge(tmp_path / "merged", [one, two])
        assert not (tmp_path / "merged").exists()
    trajectory.write_bytes(content)
    merge(tmp_path / "merged", [one, two])
    assert verified(tmp_path / "merged")[0] == 0
    alone = tmp_path / "alone"
    collect(parts[0], alone, HERE)
    assert_same(tables(alone), tables(tmp_path / "merged"))
    # a batch that is there under two names
    (name,) = folders.batch_names(one)
    for table in parquet.tables():
        shutil.copy(
            folders.batch_file(one, table, name), folders.batch_file(one, table, f"{name}-again")
        )
    (one / SUMS).unlink()
    with pytest.raises(ConfigurationError, match="has scene 0 of quick, too"):
        Evidence.load(one)


def test_no_flipped_bit_of_a_batch_gives_other_numbers_even_without_sums(
    parts: tuple[Campaign, Path], tmp_path: Path
) -> None:
    """By the checksums of its pages alone, and what its footer has to say."""
    folder = shutil.copytree(parts[1] / "1", tmp_path / "copy")
    (folder / SUMS).unlink()
    expected = tables(folder)
    chance = random.Random(4)
    files = list(folder.rglob("*.parquet"))
    refused = 0
    for _ in range(250):
        path = chance.choice(files)
        whole = path.read_bytes()
        content = bytearray(whole)
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
        path.write_bytes(content)
        try:
            assert_same(expected, tables(folder))
        except ConfigurationError:
            refused += 1
        path.write_bytes(whole)
    assert refused > 100


def test_a_command_that_is_refused_leaves_checksums_alone(
    parts: tuple[Campaign, Path], chosen: Path, tmp_path: Path
) -> None:
    one = shutil.copytree(parts[1] / "1", tmp_path / "1")
    two = shutil.copytree(chosen, tmp_path / "2")
    old = shutil.copytree(one, tmp_path / "old", ignore=shutil.ignore_patterns(SUMS))
    for folder in (one, old):
        before = recorded(folder)
        with pytest.raises(ConfigurationError, match="another campaign"):
            collect(parts[0].select(settings=["seed=9"]), folder, HERE)
        assert recorded(folder) == before
    before = recorded(two)
    with pytest.raises(ConfigurationError, match="another comparison"):
        compare(suite("scenario.duration=0.06"), two, workers=0)
    assert recorded(two) == before


def test_verifying_names_what_is_not_there(
    parts: tuple[Campaign, Path], chosen: Path, tmp_path: Path
) -> None:
    code, text = verified(
        shutil.copytree(chosen, tmp_path / "bare", ignore=shutil.ignore_patterns(SUMS))
    )
    assert (code, "has no checksums" in text) == (1, True)
    few = tmp_path / "few"
    collect(replace(parts[0], scenes=2), few, HERE)
    path = few / "manifest.json"
    path.write_text(path.read_text().replace('"scenes": 2', '"scenes": 4'))
    (few / SUMS).unlink()
    seal(few, folders.stored_files(few))
    code, text = verified(few)
    assert (code, "scenes quick 2–3 are missing" in text) == (1, True)
    (tmp_path / "none").mkdir()
    code, text = verified(tmp_path / "none")
    assert code == 2
    assert "no comparison and no campaign" in text


def test_some_changed_copies_are_refused_or_read(tmp_path_factory: pytest.TempPathFactory) -> None:
    """A share of what ``python -m checks.stored`` does; the fuzz itself sees what it looks for."""
    fuzz = stored.Fuzz(tmp_path_factory.mktemp("fuzz"))
    assert [text for number in range(150) for text in fuzz.findings(0, number)] == []
    assert min(fuzz.outcomes["read"], fuzz.outcomes["refused"]) > 30
    with fuzz.watch.over(fuzz.root / "at") as did:
        sys.path.insert(0, str(fuzz.root))
        __import__("planted")
        sys.path.remove(str(fuzz.root))
        (fuzz.root / "elsewhere").write_text("x")
    assert [text.split()[0] for text in did] == ["import", "open", "open"]
    assert fuzz.marker.exists()
