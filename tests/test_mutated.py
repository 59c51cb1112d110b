"""Wrong scenarios and suites are refused, or they are fine: nothing else happens, whatever is wrong
with them.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import mutated
from vsconstraints.comparisons import Suite, compare
from vsconstraints.comparisons.runs.files import SUMS
from vsconstraints.errors import VsconstraintsError
from vsconstraints.reports import write_report
from vsconstraints.scenarios import Scenario

LONGEST = 3000
"""Characters of a message, names of all candidates included."""


def start(path: Path) -> None:
    """What happens to a scenario before it is simulated."""
    Scenario.load(path).setup(trial=1).check_start()


def outcomes(path: Path, files: list[mutated.Mutated], use: Callable[[Path], object]) -> list[str]:
    """What using these files raises, empty where nothing; errors that are not this package's end
    the test.
    """
    found = []
    for file in files:
        path.write_bytes(file.content)
        try:
            use(path)
        except VsconstraintsError as error:
            found.append(str(error))
        except BaseException as error:
            raise AssertionError(f"{file.what} raises {type(error).__name__}: {error}") from error
        else:
            found.append("")
    return found


@pytest.mark.parametrize(
    ("make", "use"), [(mutated.scenarios, start), (mutated.suites, Suite.load)]
)
def test_what_is_wrong_is_refused(
    make: Callable[..., list[mutated.Mutated]], use: Callable[[Path], object], tmp_path: Path
) -> None:
    files = list(make(400, seed=9))
    found = outcomes(tmp_path / mutated.FILE, files, use)
    refused = [text for text in found if text]
    # else the files are changed too much, or too little, to tell anything
    assert 0.5 < len(refused) / len(found) < 0.98
    for text in refused:
        assert 10 < len(text) < LONGEST, text
        assert "\n" not in text, text


def test_the_same_seed_gives_the_same_files() -> None:
    assert list(mutated.scenarios(20, seed=1)) == list(mutated.scenarios(20, seed=1))
    assert list(mutated.scenarios(20, seed=1)) != list(mutated.scenarios(20, seed=2))


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A comparison that ends before anything happens."""
    folder = tmp_path_factory.mktemp("stored")
    settings = ["scenario.duration=0.05", "scenario.start_deviation=0.01", "trials=2"]
    suite = Suite.load().select(["example-2d-fov"], ["sliding-mode"], settings=settings)
    compare(suite, folder, workers=1)
    (folder / SUMS).unlink()  # which would tell that anything was changed
    return folder


@pytest.mark.parametrize("name", ["results.csv", "constraints.csv", "manifest.json"])
def test_edited_tables_are_refused_or_shown(stored: Path, name: str, tmp_path: Path) -> None:
    folder = shutil.copytree(stored, tmp_path / "copy")
    files = list(mutated.edited((folder / name).read_bytes(), 150, seed=4))
    found = outcomes(folder / name, files, lambda path: write_report(path.parent, figures=False))
    assert 0.2 < sum(map(bool, found)) / len(found) < 0.98
    for text in found:
        assert "\n" not in text, text
        assert name in text or not text, text
