"""Command ``vsconstraints run``: a law on a real or simulated arm."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..cli.options import Names
from ..cli.results import ReportOptions, write_report
from ..cli.terminal import NOTHING_DONE, console, errors, note, typed_command
from ..errors import ConfigurationError, StorageError

if TYPE_CHECKING:
    from . import ArmLog

SIMULATED_ARM = "simulated://"
NO_WATCHDOG = "the driver declares no watchdog in the arm"


def arms() -> Iterator[tuple[str, ...]]:
    """Return the kinds of arms by the scheme of their address, for ``vsconstraints list``."""
    from ..cli.listing import described_entry
    from .drivers import DRIVERS, driver_class

    for scheme in DRIVERS:
        yield described_entry(f"{scheme}://", driver_class(scheme))


def run(
    context: typer.Context,
    scenario: str,
    controller: str = "hierarchical-qp",
    robot: str = SIMULATED_ARM,
    images: str | None = None,
    yes: bool = False,
    from_arm: bool = False,
    rate: float | None = None,
    settings: Names = None,
    priority: bool = True,
    out: Path | None = None,
    figures: bool = True,
) -> None:
    """Run a law on an arm, supervised; without --robot a dry run."""
    from ..comparisons import Suite
    from ..comparisons.experiment import chosen_entries
    from ..comparisons.metrics import load_metrics
    from ..comparisons.runs.folder import locked
    from ..compiled import prepare
    from ..plugins.processes import exit_code
    from ..reports.drawing import require_distinct_names
    from ..scenarios import Scenario
    from . import Job, driver_for, image_source, real_time, run_on_arm, store
    from .images import MODEL, SIMULATED
    from .record import punctuality, require_own_folder, room_for_log, save_log

    # a metric that cannot be used, or a clash of names, ends the command before the arm moves
    load_metrics()
    require_distinct_names()
    chosen = Scenario.load(scenario)
    settings = [
        *(settings or ()),
        *([] if rate is None else [f"scenario.sampling_time={1.0 / rate!r}"]),
    ]
    suite = Suite("run", f"{chosen.title}, on an arm", (chosen,), chosen_entries((), [controller]))
    suite = suite.select(settings=settings)
    loaded = suite.scenarios[0]
    entry = suite.controllers[0]
    law = entry.make()
    setup = loaded.setup()
    note(*(text for texts in suite.warnings().values() for text in texts))
    driver = driver_for(robot, setup)
    if driver.real and not yes:
        raise ConfigurationError(
            f"{robot} is a real arm, which would move. Look at the same command without --robot "
            f"first; then stand by "
            "its emergency stop, and give --yes"
        )
    if driver.real and images is None:
        raise ConfigurationError(
            f"{robot} is a real arm: give the source of measurements with --images "
            f"module:function, or --images {MODEL} to predict the image from the joints"
        )
    source = image_source(images or SIMULATED, setup, loaded.folder)
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    out = out or Path("vsconstraints-runs") / f"{loaded.name}--{entry.name}--{stamp}"
    require_own_folder(out)
    context.with_resource(locked(out, "a comparison"))
    prepare()
    if robot == SIMULATED_ARM:
        console.print(
            "Dry run: no arm is connected; the scenario's robot is simulated, as fast as possible."
        )
    elif not driver.real:
        console.print(f"Dry run: {robot} is not a real arm, and nothing moves.")
    saved: Path | None = None

    def keep(log: ArmLog) -> None:
        """Save the log before anything else: a print to a closed terminal raises."""
        nonlocal saved
        # `store` tries again, once the end of the motion has been told
        with suppress(StorageError):
            saved = save_log(out, log, robot)

    with room_for_log(out, setup), real_time(priority and not driver.simulated_time) as permitted:
        if not driver.simulated_time:
            console.print(f"Real time: {'; '.join(permitted.sentences())}.")
            console.print(f"If the loop stops sending: {driver.watchdog or NO_WATCHDOG}.")
            for warning in permitted.warnings():
                errors.print(f"warning: {warning}")
        # custom parts may import neighbouring modules at any time
        with entry.importing_beside(loaded.folder):
            setup, log = run_on_arm(Job(setup, law, driver, source, from_arm=from_arm), keep)
    for line in punctuality(log).lines() if not driver.simulated_time else ():
        console.print(line)
    if log.cause:
        errors.print(f"{log.ended}: {log.cause}")
    note(*log.remarks)
    (console if log.at_rest else errors).print(f"The arm: {log.stop}.")
    trajectory, _ = store(out, suite, setup, log, robot, typed_command(), saved)
    report = write_report(out, ReportOptions(figures, trust=True))
    if trajectory is not None:
        console.print(f"{trajectory.status}: {trajectory.reason}")
    console.print(f"Log and results: {out}. {report}")
    if log.signal:
        raise typer.Exit(exit_code(log.signal))
    if log.ended != "done":
        raise typer.Exit(NOTHING_DONE)
