"""``vsconstraints frames``: the images that a run is controlled by, as a film or as files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .terminal import console


def frames(
    scenario: Annotated[str, typer.Argument(help="A name, or the path of a file; by images if it does not say so.")],
    out: Annotated[Path, typer.Option(help="A film (.gif or .mp4), or a folder for PNGs.")],
    controller: Annotated[str, typer.Option(help="Which law.")] = "sliding-mode",
    trial: Annotated[int, typer.Option(min=0, help="Which start; 0 is that of the file.")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of trials and noise.")] = 0,
) -> None:
    """Run a scenario whose control sees rendered images, and write these, with the tags that are found in them."""
    from ..controllers import make_controller
    from ..frames import write_frames
    from ..scenarios import Scenario
    from ..simulation import simulate

    loaded = Scenario.load(scenario)
    if "sensor" not in loaded.tables:
        loaded = loaded.with_override("sensor", "images")
    setup = loaded.setup(trial, seed)
    run = simulate(setup, make_controller(controller, {}, None))
    count = write_frames(setup, run, out)
    console.print(f"{run.status}{': ' if run.reason else ''}{run.reason}")
    console.print(f"{count} images: {out}")
