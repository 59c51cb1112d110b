"""The reference of scenario files names every key the loader knows, with its type and default, and no other."""

from __future__ import annotations

import ast
import inspect
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from documents import DOCS, ROOT, blocks, reader_folder, run
from vsconstraints.constraints.curves import SHAPES
from vsconstraints.scenarios import CONSTRAINTS, Scenario, section, shipped_scenarios
from vsconstraints.scenarios.constraint_types import SOLIDS

PAGE = DOCS / "scenarios.md"
SHARED = ("`constraints`", "Forbidden regions", "Distances between bodies")
"""Headings whose keys several types have."""

KEY = re.compile(r"^\| ((?:`\w+`(?:, )?)+) \| ([^|`]+) \| ([^|]+) \|", flags=re.M)
"""A line of the reference: keys, type, default."""

SHAPE_PARAMETERS = {key for shape in SHAPES.values() for key in inspect.signature(shape).parameters}
SHARED_TABLES = ("motion", "curve", "points", "obstacle", "bodies")
"""Tables inside a constraint, whatever its type."""

METHODS = ("take", "number", "array", "section", "sections", "choice")
"""How a key is asked for."""

Known = dict[tuple[str, str], tuple[str, Any]]
"""How the loader reads a key of a table, and its default."""


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Known:
    """Every key that is asked for while the shipped scenarios and the page's examples are loaded."""
    found: Known = {}
    types: dict[str, str] = {}
    depth = 0

    def recorder(name: str, original: Any) -> Any:
        def method(self: section.Section, key: str, *arguments: Any, **named: Any) -> Any:
            nonlocal depth
            depth += 1
            try:
                value = original(self, key, *arguments, **named)
            finally:
                depth -= 1
            if depth == 0:
                bound = inspect.signature(original).bind(self, key, *arguments, **named)
                bound.apply_defaults()
                kind = str(bound.arguments.get("kind", name)) if name == "take" else name
                if key == "type":
                    types[self.where] = value
                found[_table(self.where, types), key] = kind, bound.arguments.get("default", [])
            return value

        return method

    with pytest.MonkeyPatch.context() as patch:
        for name in METHODS:
            patch.setattr(section.Section, name, recorder(name, getattr(section.Section, name)))
        for name in shipped_scenarios():
            Scenario.load(name).setup()
        folder = reader_folder(tmp_path_factory.mktemp("reader"))
        patch.chdir(folder)
        names: dict[str, Any] = {}
        for block in blocks(PAGE):
            if block.language != "sh":
                run(block, folder, names)
    # a curve's own parameters are those of its shape, which the page lists with the shapes
    return {at: how for at, how in found.items() if at not in {("constraints.curve", key) for key in SHAPE_PARAMETERS}}


def _table(where: str, types: dict[str, str]) -> str:
    """Name in the reference of the table at ``name.task.goals[0]``: without the scenario's name and numbers."""
    path = re.sub(r"\[\d+\]", "", where.partition(".")[2])
    if not path.startswith("constraints"):
        return path
    inside = [name for name in SHARED_TABLES if path == f"constraints.{name}"]
    return path if inside else types.get(where, "constraints")


def by_title() -> dict[str, dict[str, tuple[str, str]]]:
    """Type and default of each key below each heading of the page."""
    found = {}
    for text in re.split(r"^### ", PAGE.read_text(encoding="utf-8"), flags=re.M)[1:]:
        title, _, body = text.partition("\n")
        found[title] = {
            key: (kind, default) for keys, kind, default in KEY.findall(body) for key in re.findall(r"\w+", keys)
        }
    return found


def documented() -> dict[str, dict[str, tuple[str, str]]]:
    """The same by the tables that the headings name; those that say so have another heading's keys too."""
    text, titles = PAGE.read_text(encoding="utf-8"), by_title()
    tables: dict[str, dict[str, tuple[str, str]]] = {"": titles["Top level"]}
    for title, keys in titles.items():
        body = text.partition(f"### {title}\n")[2].partition("\n#")[0]
        others = re.findall(r"Also the keys of \[[^\]]+\]\(#([\w-]+)\)", body)
        shared = [titles[one] for one in SHARED if one.lower().replace(" ", "-") in others]
        for name in re.findall(r"`([^`]+)`", title):
            tables[name] = {key: value for one in (keys, *shared) for key, value in one.items()}
    return tables


TABLES = documented()


def _keys_of(table: str) -> dict[str, tuple[str, str]]:
    common = TABLES["constraints"] if table in CONSTRAINTS else {}
    return {**common, **TABLES.get(table, {})}


def test_every_key_is_in_the_reference(known: Known) -> None:
    missing = sorted(f"{table or 'the file'}: {key}" for table, key in known if key not in _keys_of(table))
    assert not missing, f"docs/scenarios.md does not tell of {missing}"


def test_every_key_in_the_reference_is_known(known: Known) -> None:
    read: dict[str, set[str]] = {}
    for table, key in known:
        read.setdefault(table, set()).add(key)
        if table in ("constraints", *CONSTRAINTS):
            read.setdefault("any constraint", set()).add(key)
    read[""].add("extends")
    read["constraints.curve"].update(SHAPE_PARAMETERS)
    unknown = []
    for title, keys in by_title().items():
        # what a heading says of several tables, or for several types, is known if one of them has it
        tables = ["any constraint"] if title in SHARED else re.findall(r"`([^`]+)`", title) or [""]
        unknown += [f"{title}: {key}" for key in keys if not any(key in read[table] for table in tables)]
    assert not unknown, f"docs/scenarios.md tells of {unknown}, which the loader does not know"


KINDS = {
    "number": "number",
    "array": "number",
    "section": "table",
    "sections": "list of tables",
    "choice": "string",
    "<class 'str'>": "string",
    "<class 'int'>": "integer",
    "<class 'bool'>": "boolean",
    "<class 'dict'>": "table",
    "<class 'list'>": "list",
}


def test_types_and_defaults_are_those_of_the_loader(known: Known) -> None:
    for (table, key), (read_as, default) in known.items():
        kind, written = _keys_of(table)[key]
        where = f"{table or 'the file'}, {key}"
        wanted = KINDS.get(read_as)
        assert wanted is None or wanted in kind, f"{where} is a {wanted}, not {kind}"
        if default is section.REQUIRED:
            assert written == "required" or "required" in _meaning(table, key), where
        elif default is None:
            assert written == "–", where
        elif written.startswith("*"):
            assert isinstance(default, np.ndarray | list), f"{where} has no computed default"
        else:
            value = tomllib.loads(f"value = {written.strip('`')}")["value"]
            assert np.array_equal(value, default), f"{where} has the default {default}, not {value}"


def _meaning(table: str, key: str) -> str:
    """The line of a key, in any table of the heading."""
    text = PAGE.read_text(encoding="utf-8")
    return " ".join(re.findall(rf"^\|.*`{key}`.*$", text, flags=re.M))


def test_shapes_and_their_defaults_are_in_the_reference() -> None:
    text = PAGE.read_text(encoding="utf-8")
    lines = re.findall(r"^\| `(\w+)` \| `(\w+)` \| \w+ \| `?([\w.]+)`? \|", text, flags=re.M)
    code = [
        (name, key, "required" if option.default is option.empty else str(option.default))
        for name, shape in SHAPES.items()
        for key, option in inspect.signature(shape).parameters.items()
    ]
    assert sorted(lines) == sorted(code)
    assert all(f'`"{name}"`' in text for name in SOLIDS)


def _asked_for() -> Iterator[tuple[str, str]]:
    """Every key that the loader's source asks a section for, wherever it does."""
    for path in sorted((ROOT / "src/vsconstraints/scenarios").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.args:
                first, asks = node.args[0], node.func.attr in METHODS
                if asks and isinstance(first, ast.Constant) and isinstance(first.value, str):
                    yield Path(path).name, first.value


def test_the_examples_reach_every_branch_of_the_loader(known: Known) -> None:
    reached = {key for _, key in known}
    left = sorted(f"{file}: {key}" for file, key in _asked_for() if key not in reached)
    assert not left, f"no example on docs/scenarios.md uses {left}"
