"""``vsconstraints frames``: the images that a run is controlled by, as a film or as files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import completions
from .terminal import console, progress_bar


def frames(
    scenario: Annotated[
        str,
        typer.Argument(
            help="A name, or the path of a file; by images if it does not say so.", autocompletion=completions.scenarios
        ),
    ],
    out: Annotated[Path, typer.Option(help="A film (.gif or .mp4), or a folder for PNGs.")],
    controller: Annotated[
        str, typer.Option(help="Which law.", autocompletion=completions.controllers)
    ] = "sliding-mode",
    trial: Annotated[int, typer.Option(min=0, help="Which start; 0 is that of the file.")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of trials and noise.")] = 0,
) -> None:
    """Run a scenario whose control sees rendered images, and write these, with the tags that are found in them."""
    from ..comparisons.runs.spec import ControllerSpec
    from ..reports.frames import kind_of, write_frames
    from ..scenarios import Scenario
    from ..simulation import simulate

    kind_of(out)
    loaded = Scenario.load(scenario)
    if "sensor" not in loaded.tables:
        loaded = loaded.with_override("sensor", "images")
    setup = loaded.setup(trial, seed)
    law = ControllerSpec.called(controller, folder=Path()).make()
    with progress_bar() as progress:
        bar = progress.add_task("simulating", total=None)
        run = simulate(setup, law)
        total = setup.photographer().settings.number(float(run.t[-1])) + 1
        progress.update(bar, description="writing images", total=total)
        count = write_frames(setup, run, out, lambda: progress.advance(bar))
    console.print(f"{run.status}{': ' if run.reason else ''}{run.reason}")
    console.print(f"{count} images: {out}")
