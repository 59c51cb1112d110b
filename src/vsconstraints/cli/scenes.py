"""``preview``, ``replay`` and ``frames``: a scene before a run, a run in motion, and the images that it is based on."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from ..errors import ConfigurationError
from ..plugins.extras import demand
from ..reports.plots import FORMATS
from . import options
from .terminal import USAGE_ERROR, console, errors, note, progress

_FAMILY = "Instead of a scenario: a family, of which one scene."
_RUN = (
    "SCENARIO:CONTROLLER, which is simulated now (with :TRIAL behind it for another start), or of a campaign "
    "FOLDER:FAMILY:SCENE:CONDITION:CONTROLLER, or the file of a stored run, "
    "FOLDER/trajectories/SCENARIO--CONTROLLER--TRIAL.npz. Up to four, of one scenario."
)
_SCENARIO = "A name, or the path of a file."
_Scenario = Annotated[str | None, Argument(help=_SCENARIO, autocompletion=options.scenario_names)]
_Family = Annotated[str | None, Option(help=_FAMILY, autocompletion=options.family_names)]
_Picture = Annotated[Path | None, Option(help="The picture; preview-NAME.png if not given.")]
_Runs = Annotated[list[str], Argument(metavar="RUN...", help=_RUN, autocompletion=options.run_names)]
_Page = Annotated[Path | None, Option(help="The page; replay-SCENARIO.html if neither this nor a film is asked for.")]


def preview(
    scenario: _Scenario = None,
    family: _Family = None,
    scene: Annotated[int, Option(min=0, help="Of a family: which one.")] = 0,
    half: options.Half = "held-out",
    condition: Annotated[str, Option(help="Of a family.")] = "nominal",
    trial: options.Trial = 0,
    seed: options.Seed = 0,
    out: _Picture = None,
    figure: Annotated[bool, Option("--figure/--no-figure", help="Whether there is a picture.")] = True,
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


def replay(
    runs: _Runs,
    out: _Page = None,
    gif: Annotated[Path | None, Option(help="A film as GIF, for pages that show pictures.")] = None,
    mp4: Annotated[Path | None, Option(help="A film as MP4.")] = None,
    seed: options.Seed = 0,
    trust: options.Trust = False,
) -> None:
    """Show runs in motion: one HTML file with arm, image and rows that needs no network, or a film."""
    from ..reports.replay import write_film, write_replay
    from ..reports.replay.runs import campaign_run, name_of, select_run

    if out is not None and out.suffix.lower() not in (".html", ".htm"):
        raise ConfigurationError(f"a replay is a page, and ends in .html: not {out.name!r}. --gif and --mp4 make films")
    films = [path for path in (gif, mp4) if path is not None]
    page = out or (None if films else Path(f"replay-{name_of(runs[0])}.html"))
    if page is not None:
        demand("replay")
    if any(map(campaign_run, runs)):
        demand("evidence", "a run of a campaign")
        from ..reports.evidence import replayed
    selected = [replayed(run, trust, note) if campaign_run(run) else select_run(run, seed, trust, note) for run in runs]
    for path in films:
        note(*write_film(selected, path))
        console.print(f"Film: {path}")
    if page is not None:
        note(*write_replay(selected, page))
        console.print(f"Replay: {page}")


def frames(
    scenario: options.Scenario,
    out: Annotated[Path, Option(help="A film (.gif or .mp4), or a folder for PNGs.")],
    controller: options.Controller = "sliding-mode",
    trial: options.Trial = 0,
    seed: options.Seed = 0,
) -> None:
    """Run a scenario by rendered images, whatever its sensor, and write them with the tags that are detected."""
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
    with progress() as show:
        show("simulating")
        run = simulate(setup, law)
        total, written = setup.photographer().settings.number(float(run.t[-1])) + 1, count(1)
        images = write_frames(setup, run, out, lambda: show("writing images", next(written), total))
    console.print(f"{run.status}{': ' if run.reason else ''}{run.reason}")
    console.print(f"{images} images: {out}")
