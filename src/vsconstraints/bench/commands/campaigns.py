"""Commands ``families``, ``evidence``, ``merge``, ``advise``, ``tune``: laws on drawn scenes."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, replace
from functools import partial
from itertools import count
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import typer

from ...cli.options import Names
from ...cli.results import ReportOptions, write_report
from ...cli.terminal import (
    NOTHING_DONE,
    console,
    errors,
    note,
    note_processes,
    print_columns,
    progress,
    say,
    stop,
    typed_command,
)
from ...errors import ConfigurationError, unknown_name
from ...plugins.extras import demand

if TYPE_CHECKING:
    from ..advice import Advice, Judged
    from ..evidence import Campaign, Plan
    from ..evidence import Keep as Kept
    from ..families import Family
TEXTS: dict[str, str] = tomllib.loads(
    Path(__file__).with_name("texts.toml").read_text(encoding="utf-8")
)
ROWS = "rows"  # information that every law requires


def families(names: Names = None, scenes: int = 100, half: str = "held-out", seed: int = 0) -> None:
    """List the families of scenes, or draw and describe scenes of the named ones."""
    from ..families import Family
    from ..families import families as shipped

    loaded = [Family.load(name) for name in names or shipped()]
    if not names:
        for family in loaded:
            console.print(f"{family.name}: {family.title} ({', '.join(family.conditions)})")
    else:
        found = [_print_drawn(family, scenes, half, seed) for family in loaded]
        if not any(found):
            raise typer.Exit(NOTHING_DONE)


def listed_families() -> Iterator[tuple[str, str]]:
    """Return the shipped families with their titles, for ``vsconstraints list``."""
    from ..families import Family
    from ..families import families as shipped

    for name in shipped():
        yield name, Family.load(name).title


def _print_drawn(family: Family, scenes: int, half: str, seed: int) -> int:
    """Draw scenes, describe them, and return the number of scenes found."""
    from ..families.family import summarised

    done = count(1)
    with progress() as show:

        def on_drawn() -> None:
            show(f"drawing {family.name}", next(done), scenes)

        summary = summarised(family, scenes, half, seed, on_drawn)
    accepted = len(summary.found)
    say(
        TEXTS["family"],
        family=family,
        scenes=scenes,
        summary=summary,
        accepted=accepted,
        attempts=sum(scene.attempts for scene in summary.scenes),
    )
    return accepted


def evidence(
    campaign: Path | None = None,
    out: Path = Path("vsconstraints-evidence"),
    scenes: int | None = None,
    families: Names = None,
    controllers: Names = None,
    stacks: Names = None,
    jobs: int | None = None,
    cluster: str | None = None,
    keep: str = "none",
    shard: str = "1/1",
    settings: Names = None,
    fresh: bool = False,
    figures: bool = True,
    formats: Names = None,
    latex: bool = False,
    run_limit: float | None = None,
    time_passes: str | None = None,
    slower: float | None = None,
    budget_us: float | None = None,
) -> None:
    """Run every controller on thousands of drawn scenes, and write a report.

    Scores are stored in Parquet files.
    """
    from ..evidence import MEASURED, Campaign, Plan, Shard, processes

    if cluster is not None and jobs is not None:
        raise ConfigurationError(
            "--jobs sets the number of processes on this machine, and --cluster uses none"
        )
    wanted = ReportOptions(figures, formats=formats, latex=latex, trust=True)
    chosen = Campaign.load(campaign).select(families or (), controllers or (), scenes)
    chosen = chosen.with_stacks(stacks or ())
    chosen = chosen.with_settings(settings or ()).checked()
    note_processes(jobs)
    if cluster is not None and time_passes == MEASURED:
        raise ConfigurationError(
            "call times are measured on this machine: with --cluster, give a file of them"
        )
    stored_times = None if fresh else out
    chosen = with_call_times(chosen, stored_times, jobs, time_passes, slower, budget_us)
    plan = Plan(Shard.parsed(shard), cast("Kept", keep), run_limit, fresh)
    workers: AbstractContextManager[Any] = nullcontext(processes(jobs))
    if cluster is not None:
        from ..evidence.cluster import cluster as connected

        workers = connected(cluster, chosen.on_each_machine())
    run_campaign(chosen, out, plan, workers, wanted)


def with_call_times(
    chosen: Campaign,
    out: Path | None,
    jobs: int | None,
    source: str | None,
    slower: float | None,
    budget_us: float | None,
) -> Campaign:
    """Return the campaign with commands delayed by the laws' call times from ``source``.

    Times that must be measured are kept with the results in ``out``.
    """
    from ..evidence import call_times, processes

    if source is None:
        if slower is not None or budget_us is not None:
            raise ConfigurationError("--slower and --budget-us need --time-passes")
        return chosen
    with progress() as show:
        on_progress = partial(show, "measuring calls")
        times = call_times(source, chosen, out, processes(jobs), on_progress)
    if slower is not None:
        times = replace(times, slower=slower)
    if budget_us is not None:
        times = replace(times, budget_s=1e-6 * budget_us)
    return times.of(chosen)


def run_campaign(
    chosen: Campaign,
    out: Path,
    plan: Plan,
    workers: AbstractContextManager[Any],
    wanted: ReportOptions,
) -> None:
    """Run a campaign with a progress bar, print a summary, and write its report."""
    from ..evidence import collect

    with workers as opened, progress() as show:
        finished = collect(
            chosen,
            out,
            replace(plan, workers=opened),
            command=typed_command(),
            on_progress=lambda now: show("scenes", now.done, now.scenes),
        )
    state = finished.progress
    for kind, failed in state.failed.items():
        name = " · ".join(kind)
        reason = state.reasons[kind]
        errors.print(f"{name}: {failed} of {state.of_kind[kind]} runs failed, {reason}")
    if state.stored_before:
        console.print(
            f"{state.stored_before} of {state.scenes} scenes were stored in {out} already."
        )
    if finished.interrupted:
        stop(finished.interrupted, f"{state.done} of {state.scenes} scenes are stored in {out}")
    new_scenes = state.done - state.stored_before
    console.print(
        f"{new_scenes} scenes, {state.runs} runs in {finished.wall_time:.1f} s: "
        f"{finished.rate:.1f} runs a second. Stored in {out}"
    )
    if plan.shard.of == 1:
        console.print(write_report(out, wanted))
    if state.all_failed:
        errors.print("error: all runs of the compared controllers failed; see column reason")
        raise typer.Exit(NOTHING_DONE)


def merge(
    out: Path,
    shards: list[Path],
    figures: bool = True,
    formats: Names = None,
    latex: bool = False,
    trust: bool = False,
) -> None:
    """Merge parts of a campaign and write its report."""
    from ..evidence import merge as merge_shards

    wanted = ReportOptions(figures, formats=formats, latex=latex, trust=trust)
    merged = merge_shards(out, shards)
    note(*merged.remarks)
    console.print(
        f"{merged.scenes} scenes, {merged.runs} runs of {len(shards)} folders. Stored in {out}"
    )
    console.print(write_report(out, wanted))


def advise(
    scenario: str | None = None,
    joints: int | None = None,
    latency_ms: float | None = None,
    noise_px: float | None = None,
    rows: Names = None,
    unknown_motion: bool | None = None,
    may_use: Names = None,
    study: list[Path] | None = None,
    keep: Path | None = None,
    as_json: bool = False,
    trust: bool = False,
) -> None:
    """Recommend a law for a scene, with settings, confidence, and the loss of other choices."""
    demand("evidence", "advice")
    from ...scenarios import CONSTRAINTS, Scenario
    from ...scenarios.toml import toml_items, toml_text
    from ..advice import advise as advice_for
    from ..statistics import rate_text
    from ..study import SHIPPED, Situation, Study

    for kind in {*(rows or ())} - {*CONSTRAINTS}:
        raise unknown_name("type of constraints", kind, CONSTRAINTS)
    delay = None if latency_ms is None else latency_ms / 1e3
    types = tuple(sorted({*rows})) if rows else None
    asked = Situation(
        joints, constraints=types, delay=delay, noise=noise_px, unknown_motion=unknown_motion
    )
    if scenario is not None:
        if asked.specified:
            raise ConfigurationError(
                f"{scenario} already states {', '.join(asked.specified)}: give a scenario or these "
                "options, not both"
            )
        asked = Situation.of(Scenario.load(scenario))
    elif not asked.specified and keep is None:
        raise ConfigurationError(
            "advise needs a scenario, or options such as --joints 6 --latency-ms 30"
        )
    with progress() as show:
        runs = Study.load(
            study or SHIPPED, trust, partial(show, "scenes"), custom_laws=keep is not None
        )
    if keep is not None:
        runs.keep(keep)
        console.print(f"{len(runs.runs)} runs: {keep}")
    if asked.specified:
        # only laws that come with the package are recommended
        runs = runs if keep is None else Study.load(keep)
        known = {ROWS}
        for law in runs.laws.values():
            known.update(law.make().uses)
        for word in {*(may_use or ())} - known:
            raise unknown_name("information", word, known)
        found = advice_for(runs, asked, may_use or None)
        if as_json:
            console.print(_json(found))
        else:
            texts = {"rate_text": rate_text, "toml_items": toml_items, "toml_text": toml_text}
            best = found.laws[0]
            say(TEXTS["advice"], advice=found, best=best, **texts)
            _print_choices(found.laws[:8])


def _print_choices(laws: Sequence[Judged]) -> None:
    """Print the compared laws, the recommended one first, each with its loss against that one."""
    from ..statistics import with_interval

    lines: list[list[str]] = []
    for law in laws:
        loss = law.loss
        lost = with_interval(loss.difference, loss.low, loss.high, 100.0)
        lines.append(
            [
                f"{'≈' if law.best else ' '} {law.law.name}",
                f"{law.success.share:.1%}",
                lost if lines else "",
                "" if isnan(law.call_us) else f"{law.call_us:.3g}",
                ", ".join(law.requires) or "rows",
            ]
        )
    console.print()
    header = ["law", "success", "loses [points]", "a call [µs]", "requires"]
    print_columns(header, lines, wrapped={4: 24})
    console.print("≈ not distinguishable from the law that succeeds most often")


def _json(advice: Advice) -> str:
    """Return the whole advice as JSON."""
    laws = []
    for law in advice.laws:
        entry = {
            **law._asdict(),
            "law": law.law.name,
            "settings": law.law.table,
            "success": {"share": law.success.share, **asdict(law.success)},
            "tolerant": asdict(law.tolerant),
            "loss": law.loss._asdict(),
            "call_us": None if isnan(law.call_us) else law.call_us,
        }
        laws.append(entry)
    data = {**advice._asdict(), "laws": laws}
    return json.dumps(data, ensure_ascii=False, indent=1)


def tune(
    campaign: Path | None = None,
    out: Path = Path("vsconstraints-tuning"),
    evaluations: int = 40,
    seeds: int = 3,
    scenes: int = 10,
    families: Names = None,
    controllers: Names = None,
    settings: Names = None,
    jobs: int | None = None,
) -> None:
    """Tune every law with the same budget on training scenes, and write settings for campaigns."""
    demand("tune")
    from ...reports.page import where
    from ..evidence import Campaign
    from ..reports.tuning import REPORT
    from ..reports.tuning import write_report as write_tuning
    from ..tuning import Budget, Problem
    from ..tuning.tune import TUNED
    from ..tuning.tune import tune as run

    for setting in settings or ():
        key = setting.partition("=")[0].strip()
        if key in ("half", "scenes"):
            why = "tuning uses training scenes only: set their number with --scenes"
            raise ConfigurationError(f"--set {key}: {why}")
    chosen = Campaign.load(campaign).select(
        families or (), controllers or (), settings=settings or ()
    )
    problem = Problem(chosen, Budget(evaluations, seeds, scenes))
    note_processes(jobs)
    with progress(out) as show:
        show("starting")
        tuning = run(problem, out, workers=jobs, command=typed_command(), on_progress=show)
        write_tuning(tuning, out)
    console.print(f"Settings: {out / TUNED}. {where(out / REPORT)}")
