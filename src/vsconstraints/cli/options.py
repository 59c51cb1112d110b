"""Options and arguments that several commands have, each declared once, and the names that a shell completes."""

from __future__ import annotations

from collections.abc import Callable
from glob import glob
from importlib import import_module
from pathlib import Path
from typing import Annotated, get_args

import typer
from typer import Argument, Option


def completed(source: str, ending: str = "", files: str = "") -> Callable[[str], list[str]]:
    """What completes a word: the names in ``module:attribute`` of this package, with an ending, and files with theirs.

    The module is imported only when the user presses Tab. The attribute is a collection, a function that returns one,
    or a Literal.
    """
    module, _, attribute = source.partition(":")

    def complete(incomplete: str) -> list[str]:
        names = getattr(import_module(f"vsconstraints.{module}"), attribute)
        names = get_args(names) or (names() if callable(names) else names)
        found = [f"{name}{ending}" for name in names if f"{name}{ending}".startswith(incomplete)]
        return found + sorted(glob(f"{incomplete}*{files}") if files else ())

    return complete


scenario_names = completed("scenarios:shipped_scenarios", files=".toml")
controller_names = completed("controllers:CONTROLLERS")
family_names = completed("scenarios.families:families", files=".toml")
keep_names = completed("comparisons.runs.folder:Keep")
format_names = completed("reports.plots:FORMATS")


class _BehindColon(str):
    """A word that completes a colon in bash, where what is inserted begins after it."""

    def startswith(self, *prefix: object) -> bool:
        """Yes: Typer drops what does not begin like the word that is completed."""
        return True


def run_names(context: typer.Context, incomplete: str) -> list[str]:
    """What completes ``SCENARIO:CONTROLLER``, or the file of a stored run.

    A scenario that is the only one to begin like the word comes with its laws: a shell ends a word that is complete. To
    bash a colon is a word of its own, and what completes the word behind it is the law alone.
    """
    before = list(context.params.get("runs") or ())
    if incomplete == ":":
        return [_BehindColon(name) for name in controller_names("")]
    if before[-1:] == [":"]:
        return controller_names(incomplete)
    scenario, colon, controller = incomplete.partition(":")
    scenarios, files = [scenario] if colon else scenario_names(incomplete), sorted(glob(f"{incomplete}*.npz"))
    if len(scenarios) == 1 and not files:
        return [f"{scenarios[0]}:{name}" for name in controller_names(controller)]
    return [*(f"{name}:" for name in scenarios), *files]


Names = list[str] | None
Scenario = Annotated[str, Argument(help="A name, or the path of a file.", autocompletion=scenario_names)]
Controller = Annotated[str, Option(help="The law.", autocompletion=controller_names)]
_SCENARIO = "Only this scenario: a name or a path. Can be repeated."
_CONTROLLER = "Only this controller. Can be repeated."
_FAMILY = "Only this family: a name or a path. Can be repeated."
Scenarios = Annotated[Names, Option("--scenario", help=_SCENARIO, autocompletion=scenario_names)]
Controllers = Annotated[Names, Option("--controller", help=_CONTROLLER, autocompletion=controller_names)]
Families = Annotated[Names, Option("--family", help=_FAMILY, autocompletion=family_names)]
_SET = (
    "Change a setting, e.g. scenario.sampling_time=0.004, case-study-6r.task.Kp0=30, hierarchical-qp.solver=osqp, "
    "trials=5 or, of a campaign, half=training. Can be repeated."
)
Settings = Annotated[Names, Option("--set", metavar="KEY=VALUE", help=_SET)]
Trial = Annotated[int, Option(min=0, help="Of a scenario: which start; 0 is that of the file.")]
Seed = Annotated[int, Option(min=0, help="Of trials, noise and drawn scenes.")]
Half = Annotated[str, Option(help="Of a family's scenes: training or held-out.")]
Out = Annotated[Path, Option(help="Folder for results; what is stored there is not run again.")]
Jobs = Annotated[int | None, Option(min=1, help="Processes; as many as there are cores if not given.")]
_TIME = "Commands arrive as late as calls take: measured, or those of a file or of a folder of results."
TimePasses = Annotated[str | None, Option(metavar="measured|FILE|FOLDER", help=_TIME)]
_SLOWER = "How many times as slow as said the computer is, where time passes."
Slower = Annotated[float | None, Option(metavar="FACTOR", help=_SLOWER)]
_BUDGET = "Laws are called as often as so much time per T_s of the scene allows, where time passes."
Budget = Annotated[float | None, Option(metavar="MICROSECONDS", help=_BUDGET)]
_LIMIT = "A run that takes longer is ended and fails; 120 s and 0.1 s per sample if not given."
RunLimit = Annotated[float | None, Option(min=0.0, metavar="SECONDS", help=_LIMIT)]
_KEEP = "Whose trajectories are kept: none, failed, worst, first or all."
Keep = Annotated[str, Option(help=_KEEP, autocompletion=keep_names)]
Fresh = Annotated[bool, Option("--fresh", help="Run again what is stored, and replace what the folder holds.")]
Figures = Annotated[bool, Option("--figures/--no-figures", help="Whether the report has figures.")]
AllFigures = Annotated[bool, Option("--all-figures", help="Figures of every scenario of a large suite.")]
Replays = Annotated[bool, Option("--replays", help="Replay selected runs of each scenario in linked pages.")]
_FORMAT = "Of figures; PNG if not given. Can be repeated."
Formats = Annotated[Names, Option("--format", metavar="png|svg|pdf", help=_FORMAT, autocompletion=format_names)]
Latex = Annotated[bool, Option("--latex", help="Write the report's tables for LaTeX, too, into the folder tables.")]
Trust = Annotated[bool, Option("--trust", help="Run code that the stored results name as module:Class.")]
