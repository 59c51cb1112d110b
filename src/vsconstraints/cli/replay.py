"""``vsconstraints replay``: runs seen in motion, in a browser or as a film."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import ConfigurationError
from . import completions
from .terminal import Trust, console, note


def replay(
    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN...",
            help="SCENARIO:CONTROLLER, which is simulated now (with :TRIAL behind it for another start), or the file "
            "of a stored run, FOLDER/trajectories/SCENARIO--CONTROLLER--TRIAL.npz. Up to four, of one scenario.",
            autocompletion=completions.runs,
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="The page; replay-SCENARIO.html if neither this nor a film is asked for.")
    ] = None,
    gif: Annotated[Path | None, typer.Option(help="A film as GIF, for pages that show pictures.")] = None,
    mp4: Annotated[Path | None, typer.Option(help="A film as MP4.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of trials that are simulated now.")] = 0,
    trust: Trust = False,
) -> None:
    """Show runs in motion: one HTML file with arm, image and rows that needs no network, or a film.

    For example: vsconstraints replay ur5-fov:tracking ur5-fov:sliding-mode
    """
    from ..plugins.extras import demand
    from ..reports.replay import write_film, write_replay
    from ..reports.replay.runs import name_of, select_run

    if out is not None and out.suffix.lower() not in (".html", ".htm"):
        raise ConfigurationError(f"a replay is a page, and ends in .html: not {out.name!r}. --gif and --mp4 make films")
    films = [path for path in (gif, mp4) if path is not None]
    if out is not None or not films:
        demand("replay")
    asked = [select_run(run, seed, trust, note) for run in runs]
    for path in films:
        for remark in write_film(asked, path):
            note(remark)
        console.print(f"Film: {path}")
    if out is not None or not films:
        page = out or Path(f"replay-{name_of(runs[0])}.html")
        for remark in write_replay(asked, page):
            note(remark)
        console.print(f"Replay: {page}")
