"""``vsconstraints families``: which there are, and what the scenes of one are like."""

from __future__ import annotations

from collections import Counter
from math import isnan
from typing import TYPE_CHECKING, Annotated

import typer

from . import completions
from .terminal import NOTHING_DONE, console, progress_bar

if TYPE_CHECKING:
    from ..scenarios.families import Family
    from ..scenarios.families.summary import Summary


def families(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names or paths of families to draw from; if not given, all are listed.",
            autocompletion=completions.families,
        ),
    ] = None,
    scenes: Annotated[int, typer.Option(min=1, max=10_000_000, help="How many scenes are drawn of each.")] = 100,
    half: Annotated[str, typer.Option(help="training or held-out.")] = "held-out",
    seed: Annotated[int, typer.Option(min=0, help="Of all scenes.")] = 0,
) -> None:
    """List the families of scenes; of those that are named, draw scenes and say what they are like."""
    from ..scenarios.families import Family
    from ..scenarios.families import families as shipped
    from ..scenarios.families.summary import summarised

    if not names:
        for name in shipped():
            family = Family.load(name)
            console.print(f"{name}: {family.title} ({', '.join(family.conditions)})")
        return
    chosen = [Family.load(name) for name in names]
    found = 0
    for family in chosen:
        with progress_bar() as progress:
            bar = progress.add_task(f"drawing {family.name}", total=scenes)
            summary = summarised(family, scenes, half, seed, lambda bar=bar: progress.advance(bar))  # type: ignore[misc]
        _print(family, summary)
        found += len(summary.found)
    if not found:
        raise typer.Exit(NOTHING_DONE)


def _print(family: Family, summary: Summary) -> None:
    drawn, accepted = len(summary.scenes), len(summary.found)
    attempts = sum(scene.attempts for scene in summary.scenes)
    console.print(f"{family.name}: {family.title}")
    console.print(f"  conditions: {', '.join(family.conditions)}")
    console.print(
        f"  {accepted} of {drawn} scenes found in {attempts} attempts ({summary.acceptance:.0%} accepted), "
        f"{summary.seconds / drawn * 1e3:.0f} ms a scene"
    )
    _counts("rejected", summary.rejected, attempts, "attempts")
    _counts("tracking alone leaves", summary.challenged, accepted, "scenes")
    if not isnan(summary.beyond_limits):
        console.print(
            f"  under its limits, no law could hold {summary.beyond_limits:.0%} of the scenes from where tracking "
            "alone meets a row"
        )
    if summary.timed:
        late = sum(scene.too_far for scene in summary.timed)
        console.print(f"  under its limits, no law can arrive in time in {late} of {len(summary.timed)} scenes")


def _counts(what: str, counts: Counter[str], of: int, unit: str) -> None:
    console.print(f"  {what}{'' if counts else ': nothing'}")
    for name, count in counts.most_common():
        console.print(f"    {count:6d}  {count / of:4.0%} of {unit}  {name}")
