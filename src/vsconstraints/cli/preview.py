"""``vsconstraints preview``: start and goals of a scenario, before anything is simulated."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import ConfigurationError
from ..reports.plots import FORMATS
from . import completions
from .terminal import USAGE_ERROR, console, errors


def preview(
    scenario: Annotated[
        str | None, typer.Argument(help="A name, or the path of a file.", autocompletion=completions.scenarios)
    ] = None,
    family: Annotated[
        str | None,
        typer.Option(help="Instead of a scenario: a family, of which one scene.", autocompletion=completions.families),
    ] = None,
    scene: Annotated[int, typer.Option(min=0, help="Of a family: which one.")] = 0,
    half: Annotated[str, typer.Option(help="Of a family: training or held-out.")] = "held-out",
    condition: Annotated[str, typer.Option(help="Of a family.")] = "nominal",
    trial: Annotated[int, typer.Option(min=0, help="Of a scenario: which start; 0 is that of the file.")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of trials, and of a family's scenes.")] = 0,
    out: Annotated[Path | None, typer.Option(help="The picture; preview-NAME.png if not given.")] = None,
    figure: Annotated[bool, typer.Option("--figure/--no-figure", help="Whether there is a picture.")] = True,
) -> None:
    """Draw image and arm at the start and at each goal, and say which rows are near, before simulating anything."""
    from ..reports.preview import FIGURE, Preview, lines
    from ..scenarios import Scenario
    from ..scenarios.families import Family

    if (scenario is None) == (family is None):
        raise ConfigurationError("preview takes a scenario, or --family with --scene")
    if out is not None and out.suffix.removeprefix(".") not in FORMATS:
        raise ConfigurationError(f"the picture is a figure: --out {out} must end in .png, .svg or .pdf")
    if family is not None:
        drawn = Family.load(family).scene(scene, half, seed)
        seen = Preview.of_scenario(drawn.scenario(condition), seed=drawn.noise)
    else:
        seen = Preview.of_scenario(Scenario.load(str(scenario)), trial, seed)
    for line in lines(seen):
        console.print(line)
    for warning in seen.warnings:
        errors.print(f"warning: {warning}")
    if figure:
        path = out or Path(f"preview-{seen.name}.png")
        path.parent.mkdir(parents=True, exist_ok=True)
        FIGURE.write(path, seen)
        console.print(f"Picture: {path}")
    if seen.refusal:
        raise typer.Exit(USAGE_ERROR)
