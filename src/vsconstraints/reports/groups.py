"""Controllers that share a figure: all where there are few, otherwise those that require the same information."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..comparisons.runs.spec import BASELINE, ControllerSpec
from ..controllers import CONTROLLERS
from ..controllers.demand import USES
from ..scenarios.toml import toml_text
from .markdown import enumeration, plain
from .numbers import number

MAX_LAWS = 8  #: How many controllers a figure shows beside tracking alone.
#: Title, and what laws use that belong there: a law belongs to the last kind of which it uses any.
KINDS: tuple[tuple[str, set[str]], ...] = (
    (f"Laws without {USES['period']}, {USES['Lf']}, memory or model", set()),
    (f"Laws that use {USES['period']}", {USES["period"]}),
    (f"Laws that use {USES['Lf']}", {USES["Lf"]}),
    ("Laws with memory", {"memory", USES["last_rate"]}),
    ("Laws with a model", {"model"}),
    ("Own laws", {"own"}),
)


class Group(NamedTuple):
    """Laws that are shown together, behind tracking alone where that was run.

    ``title`` says what they have in common, ``suffix`` ends the names of their figures, and ``listed`` is the title
    with the names of the laws; all empty where all laws stand together.
    """

    controllers: tuple[str, ...]
    title: str = ""
    suffix: str = ""
    listed: str = ""

    @property
    def sentence(self) -> str:
        """The title behind a caption."""
        return f" {self.title}." if self.title else ""


def required_information(name: str, entry: Mapping[str, Any]) -> tuple[str, ...] | None:
    """What a controller requires beside rows and task; None for an own one, whose code says it."""
    kind = str(entry.get("type", name))
    if kind not in CONTROLLERS:
        return None
    return ControllerSpec.from_table(name, entry).make().uses


def controller_cells(name: str, entry: Mapping[str, Any]) -> list[str]:
    """Type, options and required information of a controller of a manifest, for a table."""
    text = plain(", ".join(f"{key} = {_cell(value)}" for key, value in entry.items() if key != "type"))
    information = information_text(required_information(name, entry))
    return [plain(entry.get("type", name)), text or "defaults", information]


def _cell(value: Any) -> Any:
    return number(value) if isinstance(value, float) else toml_text(value) if isinstance(value, Mapping) else value


def information_text(required: Sequence[str] | None) -> str:
    """The required information of a controller, for a cell."""
    return "see its code" if required is None else plain(", ".join(required)) or "none"


def kind_of(required: Sequence[str] | None) -> int:
    """Which of :data:`KINDS` a controller is of."""
    used = {"own"} if required is None else set(required)
    return max(k for k, (_, any_of) in enumerate(KINDS) if not any_of or any_of & used)


def grouped(entries: Mapping[str, Mapping[str, Any]]) -> tuple[Group, ...]:
    """The groups of a suite's controllers, as few and as even as :data:`MAX_LAWS` allows, sorted by kind."""
    laws = [name for name in entries if name != BASELINE]
    count = -(-len(laws) // MAX_LAWS)
    if count <= 1:
        return (Group(tuple(entries)),)
    kinds = {name: kind_of(required_information(name, entries[name])) for name in laws}
    laws.sort(key=lambda name: kinds[name])
    groups = []
    for k in range(count):
        own = laws[k * len(laws) // count : (k + 1) * len(laws) // count]
        by_kind = {title: [name for name in own if kinds[name] == i] for i, (title, _) in enumerate(KINDS)}
        listed = {title: f"{title}: {enumeration(names)}" for title, names in by_kind.items() if names}
        controllers = (*(name for name in entries if name == BASELINE), *own)
        groups.append(Group(controllers, "; ".join(listed), f"--{k + 1}", "; ".join(listed.values())))
    return tuple(groups)
