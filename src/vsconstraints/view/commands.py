"""Commands ``preview``, ``replay`` and ``frames``: pictures of a scene or of a run."""

from __future__ import annotations

from itertools import count
from pathlib import Path

import typer

from ..cli.terminal import USAGE_ERROR, console, errors, note, progress
from ..errors import ConfigurationError
from ..plugins.extras import demand
from ..reports.formats import FORMATS


def preview(
    scenario: str | None = None,
    family: str | None = None,
    scene: int = 0,
    half: str = "held-out",
    condition: str = "nominal",
    trial: int = 0,
    seed: int = 0,
    out: Path | None = None,
    figure: bool = True,
) -> None:
    """Draw image and arm at the start and at each goal, and list the nearest rows.

    No simulation is run.
    """
    from ..bench.families import Family
    from ..scenarios import Scenario
    from .preview import FIGURE, Preview, lines

    if (scenario is None) == (family is None):
        raise ConfigurationError("preview needs a scenario, or --family with --scene")
    if out is not None and out.suffix.removeprefix(".") not in FORMATS:
        raise ConfigurationError(f"the picture's file --out {out} must end in .png, .svg or .pdf")
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
    runs: list[str],
    out: Path | None = None,
    gif: Path | None = None,
    mp4: Path | None = None,
    seed: int = 0,
    trust: bool = False,
) -> None:
    """Show runs in motion, in one HTML file or a film.

    The HTML file shows arm, image and rows, and needs no network.
    """
    from .replay import write_film, write_replay
    from .replay.runs import campaign_run, name_of, select_run

    if out is not None and out.suffix.lower() not in (".html", ".htm"):
        raise ConfigurationError(
            f"the replay's file must end in .html, not be {out.name!r}. For films use --gif and "
            "--mp4"
        )
    films = [path for path in (gif, mp4) if path is not None]
    page = out or (None if films else Path(f"replay-{name_of(runs[0])}.html"))
    if page is not None:
        demand("replay")
    if any(map(campaign_run, runs)):
        demand("evidence", "a run of a campaign")
        from .replay.campaigns import replayed
    selected = []
    for run in runs:
        if campaign_run(run):
            selected.append(replayed(run, trust, note))
        else:
            selected.append(select_run(run, seed, trust, note))
    for path in films:
        note(*write_film(selected, path))
        console.print(f"Film: {path}")
    if page is not None:
        note(*write_replay(selected, page))
        console.print(f"Replay: {page}")


def frames(
    scenario: str, out: Path, controller: str = "sliding-mode", trial: int = 0, seed: int = 0
) -> None:
    """Run a scenario by rendered images, whatever its sensor, and write the images.

    A film also shows the detected tags.
    """
    from ..comparisons.runs.spec import ControllerSpec
    from ..scenarios import Scenario
    from ..simulation import simulate
    from .frames import kind_of, write_frames

    kind_of(out)
    loaded = Scenario.load(scenario)
    if "sensor" not in loaded.tables:
        loaded = loaded.with_override("sensor", "images")
    setup = loaded.setup(trial, seed)
    entry = ControllerSpec.called(controller, folder=Path())
    law = entry.make()
    with progress() as show:
        show("simulating")
        # custom parts may import neighbouring modules at any time
        with entry.importing_beside(loaded.folder):
            run = simulate(setup, law)
        settings = setup.photographer().settings
        total = settings.number(float(run.t[-1])) + 1
        written = count(1)

        def on_frame() -> None:
            show("writing images", next(written), total)

        images = write_frames(setup, run, out, on_frame)
    console.print(f"{run.status}{': ' if run.reason else ''}{run.reason}")
    console.print(f"{images} images: {out}")
