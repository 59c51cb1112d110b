"""Command line: ``vsconstraints compare``, ``preview``, ``run``, ``report`` and more."""

from __future__ import annotations

import gc
import inspect
import sys
from collections.abc import Callable
from io import TextIOWrapper
from typing import Annotated

import typer

from .. import __version__
from ..errors import StorageError, VsconstraintsError, WorkersLost
from ..plugins.processes import INTERRUPTS, exit_code, obey_signals, signal_of
from . import arm, campaigns, options, paper, results, scenes, score, testset
from .terminal import NOTHING_DONE, USAGE_ERROR, console, errors

_HELP = "Compare controllers that keep visual servoing inside its limits."
app = typer.Typer(help=_HELP, no_args_is_help=True, pretty_exceptions_enable=False)


def list_(what: options.Names = None) -> None:
    """List the contents of the package, or describe a kind or a name."""
    from .listing import print_listing

    print_listing(what or ())


#: Commands by purpose, each with an example, in the order in which ``--help`` shows them.
GROUPS: dict[str, dict[str, tuple[Callable[..., None], str]]] = {
    "Laws in a few scenes": {
        "compare": (results.compare, "--scenario ur5-fov --controller cbf-filter"),
        "list": (list_, "laws"),
        "report": (results.report, "vsconstraints-results --latex"),
        "diff": (results.diff, "before after --metric settling_time_s"),
        "verify": (results.verify, "vsconstraints-results"),
    },
    "A look at a scene, or at a run of it": {
        "preview": (scenes.preview, "ur5-fov"),
        "replay": (scenes.replay, "ur5-fov:tracking ur5-fov:sliding-mode"),
        "frames": (scenes.frames, "ur5-images --out images.gif"),
    },
    "On an arm, or recorded": {
        "run": (arm.run, "ur5-fov --controller cbf-filter --robot loopback://"),
        "score": (score.score, "run.csv --scenario ur5-fov"),
    },
    "The paper, and general questions": {
        "reproduce": (paper.reproduce, "--figure 9"),
        "study": (paper.study, "pareto"),
    },
    "Thousands of drawn scenes": {
        "families": (campaigns.families, "six-axis --scenes 20"),
        "evidence": (campaigns.evidence, "--family six-axis --scenes 50"),
        "merge": (campaigns.merge, "whole part-1 part-2"),
        "advise": (campaigns.advise, "ur5-fov"),
        "tune": (campaigns.tune, "--family six-axis --controller cbf-filter"),
        "testset run": (testset.run, "--family planar-arm --entry my_law:MyLaw"),
        "testset fresh": (testset.fresh, "--scenes 20 --out fresh"),
        "testset verify": (testset.verify, "--redraw 0.01"),
        "testset leaderboard": (testset.leaderboard, "mine.parquet --rerun 0.01"),
        "testset make": (testset.make, "--scenes 50 --seed 7 --out my-testset"),
    },
}
_TESTSET = "Run laws on a frozen test set, check it, or make one."
_testset = typer.Typer(
    no_args_is_help=True, help=f"Example: vsconstraints testset run --scenes 20\n\n{_TESTSET}"
)

for _panel, _commands in GROUPS.items():
    for _name, (_command, _arguments) in _commands.items():
        _text = inspect.getdoc(_command) or ""
        _help = options.literal(f"Example: vsconstraints {_name} {_arguments}\n\n{_text}")
        _group, _, _word = _name.rpartition(" ")
        _to, _panel_of = (_testset, None) if _group else (app, _panel)
        _declare = _to.command(
            _word, help=_help, short_help=_text.partition("\n")[0], rich_help_panel=_panel_of
        )
        _declare(options.described(_name, _command))
app.add_typer(_testset, name="testset", short_help=_TESTSET, rich_help_panel=_panel)


def _version(value: bool) -> None:
    if value:
        console.print(f"vsconstraints {__version__}")
        raise typer.Exit


_Version = Annotated[
    bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
]


@app.callback(help=_HELP)
def _options(version: _Version = False) -> None: ...


def main() -> None:
    """Run the command line.

    Errors of this package and of the system end it with one line, see ``docs/trust.md``.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # names and paths may contain characters that the terminal's encoding lacks
            stream.reconfigure(errors="backslashreplace")
    obey_signals()
    try:
        app()
    except (VsconstraintsError, OSError) as error:
        errors.print(f"error: {' '.join(str(error).splitlines())}")
        sys.exit(NOTHING_DONE if isinstance(error, StorageError | WorkersLost) else USAGE_ERROR)
    except INTERRUPTS as interrupt:
        errors.print("Interrupted.")
        sys.exit(exit_code(signal_of(interrupt)))
    finally:
        # garbage collection of all loaded objects would make the exit ten times as long
        gc.freeze()
