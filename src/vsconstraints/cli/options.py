"""Options and arguments that several commands have, each declared once, and the names that a shell completes."""

from __future__ import annotations

from collections.abc import Callable
from glob import glob
from importlib import import_module
from pathlib import Path
from typing import Annotated, get_args

import typer


def completed(source: str, files: str = "") -> Callable[[str], list[str]]:
    """What completes a word: the names in ``module:attribute`` of this package, and files with an ending.

    The module is imported only when the user presses Tab. The attribute is a collection, a function that returns one,
    or a Literal.
    """
    module, _, attribute = source.partition(":")

    def complete(incomplete: str) -> list[str]:
        names = getattr(import_module(f"vsconstraints.{module}"), attribute)
        names = get_args(names) or (names() if callable(names) else names)
        found = [str(name) for name in names if str(name).startswith(incomplete)]
        return found + sorted(glob(f"{incomplete}*{files}") if files else ())

    return complete


scenario_names = completed("scenarios:shipped_scenarios", ".toml")
controller_names = completed("controllers:CONTROLLERS")
family_names = completed("scenarios.families:families", ".toml")
keep_names = completed("comparisons.runs.folder:Keep")


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


Scenario = Annotated[str, typer.Argument(help="A name, or the path of a file.", autocompletion=scenario_names)]
Controller = Annotated[str, typer.Option(help="The law.", autocompletion=controller_names)]
Scenarios = Annotated[
    list[str] | None,
    typer.Option(
        "--scenario", help="Only this scenario: a name or a path. Can be repeated.", autocompletion=scenario_names
    ),
]
Controllers = Annotated[
    list[str] | None,
    typer.Option("--controller", help="Only this controller. Can be repeated.", autocompletion=controller_names),
]
Families = Annotated[
    list[str] | None,
    typer.Option("--family", help="Only this family: a name or a path. Can be repeated.", autocompletion=family_names),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a setting, e.g. scenario.sampling_time=0.004, case-study-6r.task.Kp0=30, "
        "hierarchical-qp.solver=osqp, trials=5 or, of a campaign, half=training. Can be repeated.",
    ),
]
Trial = Annotated[int, typer.Option(min=0, help="Of a scenario: which start; 0 is that of the file.")]
Seed = Annotated[int, typer.Option(min=0, help="Of trials, noise and drawn scenes.")]
Half = Annotated[str, typer.Option(help="Of a family's scenes: training or held-out.")]
Out = Annotated[Path, typer.Option(help="Folder for results; what is stored there is not run again.")]
Jobs = Annotated[int | None, typer.Option(min=1, help="Processes; as many as there are cores if not given.")]
RunLimit = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        metavar="SECONDS",
        help="A run that takes longer is ended and fails; 120 s and 0.1 s per sample if not given.",
    ),
]
Keep = Annotated[
    str,
    typer.Option(help="Whose trajectories are kept: none, failed, worst, first or all.", autocompletion=keep_names),
]
Fresh = Annotated[bool, typer.Option("--fresh", help="Run again what is stored, and replace what the folder holds.")]
Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Whether the report has figures.")]
AllFigures = Annotated[
    bool, typer.Option("--all-figures", help="Figures of every scenario of a large suite, not of a selection.")
]
Replays = Annotated[
    bool,
    typer.Option(
        "--replays", help="Replay selected runs of each scenario that has figures: a page for a browser, linked."
    ),
]
Formats = Annotated[
    list[str] | None,
    typer.Option(
        "--format",
        metavar="png|svg|pdf",
        help="Of figures; PNG if not given. Can be repeated.",
        autocompletion=completed("reports.plots:FORMATS"),
    ),
]
Latex = Annotated[
    bool, typer.Option("--latex", help="Write the report's tables for LaTeX, too, into the folder tables.")
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Run code that the stored results name as module:Class, to draw what needs it; else none is imported.",
    ),
]
