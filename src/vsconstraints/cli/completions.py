"""What a shell offers when the user presses Tab: names, looked up where they are defined."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from glob import glob
from typing import get_args

import typer

Names = Callable[[], Iterable[object]]


def offered(names: Names, files: str = "") -> Callable[[str], list[str]]:
    """What completes a word: names that begin like it, and files and folders if a kind of files is given, too."""

    def complete(incomplete: str) -> list[str]:
        found = [str(name) for name in names() if str(name).startswith(incomplete)]
        return found + sorted(glob(f"{incomplete}*{files}") if files else ())

    return complete


class BehindColon(str):
    """A word that completes a colon in bash, where what is inserted begins after it."""

    def startswith(self, *prefix: object) -> bool:
        """Yes: Typer drops what does not begin like the word that is completed."""
        return True


def runs(context: typer.Context, incomplete: str) -> list[str]:
    """What completes ``SCENARIO:CONTROLLER``, or the file of a stored run.

    A scenario that is the only one to begin like the word comes with its laws: a shell ends a word that is complete. To
    bash a colon is a word of its own, and what completes the word behind it is the law alone.
    """
    before = list(context.params.get("runs") or ())
    if incomplete == ":":
        return [BehindColon(name) for name in controllers("")]
    if before[-1:] == [":"]:
        return controllers(incomplete)
    scenario, colon, controller = incomplete.partition(":")
    found, files = [scenario] if colon else scenarios(incomplete), sorted(glob(f"{incomplete}*.npz"))
    if len(found) == 1 and not files:
        return [f"{found[0]}:{name}" for name in controllers(controller)]
    return [*(f"{name}:" for name in found), *files]


def _scenarios() -> Iterable[object]:
    from ..scenarios import shipped_scenarios

    return shipped_scenarios()


def _controllers() -> Iterable[object]:
    from ..controllers import CONTROLLERS

    return CONTROLLERS


def _families() -> Iterable[object]:
    from ..scenarios.families import families

    return families()


def _studies() -> Iterable[object]:
    from ..paper.studies import STUDIES

    return STUDIES


def _figures() -> Iterable[object]:
    from ..paper.figures import FIGURES

    return FIGURES


def _claims() -> Iterable[object]:
    from ..paper import all_claims

    claims = all_claims()
    return (*dict.fromkeys(claim.number for claim in claims), *(claim.key for claim in claims))


def _formats() -> Iterable[object]:
    from ..reports.plots.formats import FORMATS

    return FORMATS


def _ways_to_keep() -> Iterable[object]:
    from ..comparisons.runs.folder import Keep

    return get_args(Keep)


def _robots() -> Iterable[object]:
    from ..arms import DRIVERS

    return (f"{scheme}://" for scheme in DRIVERS)


def _images() -> Iterable[object]:
    from ..arms.images import MODEL, SIMULATED

    return MODEL, SIMULATED


scenarios = offered(_scenarios, ".toml")
controllers = offered(_controllers)
families = offered(_families, ".toml")
studies = offered(_studies)
figures = offered(_figures)
claims = offered(_claims)
formats = offered(_formats)
ways_to_keep = offered(_ways_to_keep)
robots = offered(_robots)
images = offered(_images)
