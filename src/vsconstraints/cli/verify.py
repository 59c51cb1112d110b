"""``vsconstraints verify FOLDER``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import ConfigurationError
from .terminal import NOTHING_DONE, console, errors


def verify(
    folder: Annotated[Path, typer.Argument(help="Folder of a comparison, or of a campaign.")],
) -> None:
    """Say whether stored results are whole: every file as it was stored, every run that was planned, and no other.

    Exit code 1 if something was changed, is missing, unfinished or carries no checksum; 2 if the folder cannot be read.
    """
    from ..comparisons.runs.folder import kind_of

    # a manifest that cannot be read says of nothing what it is
    kind = kind_of(folder) or ("a comparison" if (folder / "results.csv").is_file() else None)
    if kind is None or kind == "a tuning":
        raise ConfigurationError(f"{folder} holds no comparison and no campaign")
    whole, problems = _evidence(folder) if kind == "evidence" else _comparison(folder)
    for problem in problems:
        errors.print(problem if problem.startswith(str(folder)) else f"{folder}: {problem}")
    if problems:
        raise typer.Exit(NOTHING_DONE)
    console.print(f"{folder} is whole: {whole}.")


def _comparison(folder: Path) -> tuple[str, list[str]]:
    from ..comparisons import StoredComparison
    from ..comparisons.folder import stored_files
    from ..comparisons.record import run_file
    from ..reports.results import Results

    try:
        results = Results(StoredComparison.load(folder, trust=True))  # nothing of it is built
    except ConfigurationError as error:
        return "", [str(error)]
    problems = _of_files(folder, stored_files(folder))
    if results.finished < results.planned:
        problems.append(f"{results.finished} of {results.planned} runs have a line in results.csv")
    for name in results.scenarios:
        for law in results.controllers:
            for line in results.runs(name, law):
                path = run_file(folder, name, law, int(line["trial"]))
                if path.is_file() and results.stored.run(name, law, int(line["trial"])) is None:
                    problems.append(f"{path.name} cannot be read")
    return f"{results.finished} runs of {len(results.scenarios)} scenarios", problems


def _evidence(folder: Path) -> tuple[str, list[str]]:
    from ..plugins.extras import demand

    demand("evidence", "a campaign")
    from ..comparisons.evidence import Evidence, Shard
    from ..comparisons.evidence.folder import MARK, Facts, shard_file, shard_names, stored_files
    from ..comparisons.evidence.stored import missing_scenes

    try:
        evidence = Evidence.load(folder, trust=True)  # nothing of it is built
    except ConfigurationError as error:
        return "", [str(error)]
    problems = _of_files(folder, stored_files(folder))
    configuration, shard = evidence.manifest["configuration"], Shard(*evidence.manifest.get("shard", (1, 1)))
    facts = [Facts.of(shard_file(folder, MARK, name)) for name in shard_names(folder)]
    if lost := missing_scenes(configuration, facts, shard.scenes(configuration["scenes"])):
        problems.append(f"scenes {lost} are not there")
    return f"{len(evidence.runs)} runs in {len(evidence.scenes)} scenes of {len(evidence.families)} families", problems


def _of_files(folder: Path, paths: list[Path]) -> list[str]:
    """What is otherwise than it was recorded, trajectories included, which readers can do without."""
    from ..comparisons.runs.files import Difference, recorded

    sums = recorded(folder)
    if sums is None:
        return ["it carries no checksums: it cannot be told whether a file in it was changed"]
    return Difference.of(folder, sums, paths).problems()
