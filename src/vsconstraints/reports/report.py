"""The report of a comparison: report.md, the same as a page, and the figures it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ..comparisons import StoredComparison
from ..comparisons.runs.folder import held
from ..errors import StorageError
from ..plugins.extras import demand
from .closing import closing
from .drawing import Drawn, draw_all, draw_endings, draw_overview, remove_stale, scenario_jobs
from .failures import failures
from .headlines import findings
from .opening import opening
from .outcomes import outcomes
from .page import write_pages
from .plots import PNG, Formats
from .replays import add_replays
from .results import Results
from .scenario_section import scenarios_section
from .summary import summary
from .telling import telling


def write_report(
    folder: Path,
    *,
    figures: bool = True,
    all_figures: bool = False,
    formats: Formats = PNG,
    replays: bool = False,
    trust: bool = False,
    on_drawn: Callable[[int, int], None] = lambda done, total: None,
    on_remark: Callable[[str], None] = lambda remark: None,
) -> Path:
    """Write report.md, the same as report.html, and its figures from what a comparison left in its folder.

    The same comparison gives the same text, byte for byte. Whatever is missing in the folder, a trajectory or a run,
    is named in the report and left out of its figures.

    Parameters
    ----------
    folder
        Where the comparison is stored.
    figures
        Whether to draw figures; without them a report takes no time, and those that are there stay as they are.
    all_figures
        Whether to draw those of every scenario of a large suite, too, not of the most telling ones alone.
    formats
        In which figures are written; the report shows the first.
    replays
        Whether to replay the most telling runs of those scenarios in pages for a browser, and to link them.
    trust
        Whether own constraints that scenarios name as ``module:Class`` are imported, to draw what they are; else
        nothing that the folder names is run, and the report says what is not drawn.
    on_drawn
        Told how many scenarios have their figures, and how many there are.
    on_remark
        Told what a reader should know of what is stored: see :class:`StoredComparison`.

    Returns
    -------
    Path
        Where the report is.

    Raises
    ------
    ConfigurationError
        if there is no comparison in the folder, it is not what was stored, another process is storing one, or the
        extra ``replay`` is needed.
    StorageError
        if the report cannot be written.
    """
    if replays:
        demand("replay")
    stored = StoredComparison.load(folder, trust)
    for remark in stored.remarks:
        on_remark(remark)
    results = Results(stored)
    with held(folder, "a comparison"):
        try:
            chosen = results.scenarios if all_figures else telling(results)
            pictures = _draw(results, chosen, formats, on_drawn) if figures else _none(results)
            if replays:
                add_replays(results, chosen, pictures.scenarios)
            return _write(folder, results, pictures)
        except OSError as error:
            raise StorageError(f"the report cannot be written to {folder}: {error}") from error


def _write(folder: Path, results: Results, pictures: Pictures) -> Path:
    # of one scenario there is no heat map
    first, second = (pictures.endings, pictures.overview) if pictures.endings else (pictures.overview, "")
    parts = [
        opening(results, first),
        findings(results),
        summary(results),
        second,
        outcomes(results),
        scenarios_section(results, pictures.scenarios),
        failures(results, pictures.scenarios),
        closing(results),
    ]
    report = folder / "report.md"
    write_pages(report, "\n\n".join(text for text in parts if text) + "\n")
    return report


@dataclass(frozen=True)
class Pictures:
    """What was drawn: figures of scenarios by name, and those of the whole comparison with their captions."""

    scenarios: Mapping[str, Drawn]
    endings: str = ""
    overview: str = ""


def _none(results: Results) -> Pictures:
    return Pictures({name: Drawn() for name in results.scenarios})


def _draw(results: Results, chosen: Sequence[str], formats: Formats, on_drawn: Callable[[int, int], None]) -> Pictures:
    folder = results.stored.folder / "figures"
    folder.mkdir(exist_ok=True)
    whole = [partial(draw, results, folder, formats) for draw in (draw_endings, draw_overview)]
    drawn, (endings, overview) = draw_all(scenario_jobs(results, chosen, formats), whole, on_drawn)
    remove_stale(folder, (name for one in drawn.values() for name in one.files.values()), formats)
    return Pictures(drawn, endings, overview)
