"""What a shell offers when the user presses Tab: names, looked up where they are defined."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from glob import glob
from typing import get_args

Names = Callable[[], Iterable[object]]


def offered(names: Names, files: str = "") -> Callable[[str], list[str]]:
    """What completes a word: names that begin like it, and files and folders if a kind of files is given, too."""

    def complete(incomplete: str) -> list[str]:
        found = [str(name) for name in names() if str(name).startswith(incomplete)]
        return found + sorted(glob(f"{incomplete}*{files}") if files else ())

    return complete


def _scenarios() -> Iterable[object]:
    from ..scenarios import shipped_scenarios

    return shipped_scenarios()


def _controllers() -> Iterable[object]:
    from ..controllers import CONTROLLERS

    return CONTROLLERS


def _families() -> Iterable[object]:
    from ..families import families

    return families()


def _studies() -> Iterable[object]:
    from ..studies import STUDIES

    return STUDIES


def _figures() -> Iterable[object]:
    from ..reproduction.figures import FIGURES

    return FIGURES


def _claims() -> Iterable[object]:
    from ..reproduction import all_claims

    claims = all_claims()
    return (*dict.fromkeys(claim.number for claim in claims), *(claim.key for claim in claims))


def _ways_to_keep() -> Iterable[object]:
    from ..runs.keep import Keep

    return get_args(Keep)


scenarios = offered(_scenarios, ".toml")
controllers = offered(_controllers)
families = offered(_families, ".toml")
studies = offered(_studies)
figures = offered(_figures)
claims = offered(_claims)
ways_to_keep = offered(_ways_to_keep)
