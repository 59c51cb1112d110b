"""One figure of the paper, also with another law, or the claims of one number, without the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from string import ascii_lowercase
from typing import Any

from ..comparisons.run import unfinished
from ..comparisons.runs.spec import ControllerSpec, RunSpec
from ..compiled import prepare
from ..errors import ConfigurationError, shown, unknown_name
from ..reports.plots import PNG, Figure, Formats
from .figures import FIGURES
from .report import TOPICS
from .runner import Progress, drawn, figures_folder, made, study_results
from .verdicts import CLAIMS, Claim, Finding, all_claims


def redraw(
    numbers: Sequence[int],
    folder: Path,
    *,
    controller: str | None = None,
    workers: int | None = None,
    on_progress: Progress = lambda what, done, total: None,
    formats: Formats = PNG,
) -> dict[Path, str]:
    """Redraw some figures of the paper, from the runs that they show alone.

    Parameters
    ----------
    numbers
        The paper's.
    folder
        ``figures`` goes below it; made if it is not there.
    controller
        A law in the place of the paper's: a name, or ``module:Class``. The figure's file is called after it, too.
    workers, on_progress, formats
        See :func:`reproduce`.

    Returns
    -------
    dict
        By each figure's file why it is not there; an empty text if it is.

    Raises
    ------
    ConfigurationError
        for a number without a figure, a law that cannot be made, and if the folder cannot be made.
    """
    chosen = chosen_figures(numbers, controller)
    place = figures_folder(folder)
    prepare()
    specs = list(dict.fromkeys(need for figure in chosen.values() for need in figure.needs))
    with unfinished(None) as kept:
        runs = made(specs, kept, workers, partial(on_progress, "simulating"))
    why = drawn(chosen, runs, place, workers, partial(on_progress, "drawing"), formats)
    return {place / figure.file_in(formats): why[number] for number, figure in chosen.items()}


def chosen_figures(numbers: Sequence[int], controller: str | None = None) -> dict[int, Figure]:
    """Figures by number, with another law if one is named; raises ConfigurationError for what there is not."""
    for number in numbers:
        if number not in FIGURES:
            raise ConfigurationError(
                f"there is no counterpart of Fig. {number}. Available: {', '.join(map(str, FIGURES))}; Figs. 1 and 13 "
                "of the paper show frames and a laboratory"
            )
    chosen = {number: FIGURES[number] for number in numbers}
    if controller is None:
        return chosen
    law = ControllerSpec(controller, folder=Path.cwd())
    law = replace(law, name=law.make().name)
    return {number: with_law(figure, law) for number, figure in chosen.items()}


def with_law(figure: Figure, law: ControllerSpec) -> Figure:
    """A figure of the same scenes with another law; one that shows no run stays as it is."""
    if not figure.needs:
        return figure
    needs = tuple(replace(need, controller=law) for need in figure.needs)
    return replace(figure, name=f"{figure.name}--{law.name}", needs=needs)


def check(
    asked: Sequence[str],
    folder: Path,
    *,
    workers: int | None = None,
    on_progress: Progress = lambda what, done, total: None,
) -> dict[Claim, Finding]:
    """Measure some claims of the paper, on what they need alone.

    Parameters
    ----------
    asked
        Numbers, such as ``"5"`` for all claims of it, or keys, such as ``"5d"``.
    folder
        Figures and tables of studies go below it, where a claim rests on any.
    workers, on_progress
        See :func:`reproduce`.

    Returns
    -------
    dict
        In the order of the report.

    Raises
    ------
    ConfigurationError
        for a claim that there is not, and if the folder cannot be made.
    """
    chosen = chosen_claims(asked)
    needs = list(dict.fromkeys(need for claim in chosen for need in claim.needs))
    prepare()
    with unfinished(None) as kept:
        runs = made(
            [need for need in needs if isinstance(need, RunSpec)], kept, workers, partial(on_progress, "simulating")
        )
        names = [need for need in needs if isinstance(need, str)]
        studies: Mapping[str, Any] = (
            study_results(folder, workers, partial(on_progress, "studying"), kept, names) if names else {}
        )
        available: dict[RunSpec | str, Any] = dict(chain(runs.items(), studies.items()))
        return {claim: claim.check(available) for claim in chosen}


def chosen_claims(asked: Sequence[str]) -> list[Claim]:
    """The claims of some numbers and keys, each once; raises ConfigurationError for what there is not."""
    keys: set[str] = set()
    for one in asked:
        number = one.rstrip(ascii_lowercase)
        of_number = [claim.key for claim in all_claims() if str(claim.number) == number]
        if not of_number:
            topics = ", ".join(f"{number} ({topic})" for number, topic in TOPICS.items())
            raise ConfigurationError(f"unknown claim {shown(one)}. Available: {topics}")
        if one not in CLAIMS and not one.isdecimal():
            raise unknown_name("claim", one, of_number)
        keys |= {one} if one in CLAIMS else set(of_number)
    return [claim for claim in all_claims() if claim.key in keys]
