"""Code blocks of the README and the documentation, and how each kind of them is run."""

from __future__ import annotations

import re
import shlex
import shutil
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent
from typing import Any

import typer
import yaml

from vsconstraints.bench.evidence import CallTimes, Campaign
from vsconstraints.bench.families import Family
from vsconstraints.cli import app
from vsconstraints.comparisons import Suite
from vsconstraints.controllers import Tracking
from vsconstraints.scenarios import Scenario
from vsconstraints.scenarios.toml import read_toml
from vsconstraints.simulation import simulate

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *(path for path in sorted(DOCS.rglob("*.md")) if "_build" not in path.parts),
]
REFERENCE = sorted((DOCS / "api").glob("*.rst"))
BASE = "ur5-fov"
"""The scenario that TOML blocks without a robot are changes of."""


@dataclass(frozen=True)
class Block:
    """A fenced block: its language as written, its text, and the line it begins on."""

    page: Path
    line: int
    language: str
    code: str

    @property
    def file(self) -> str | None:
        """The name that a comment in the first line gives it, to be saved under."""
        found = re.match(r"(?:#|<!--)\s*([\w-]+\.(?:py|toml|urdf|srdf))\b", self.code)
        return found[1] if found else None

    @property
    def where(self) -> str:
        """For messages."""
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks(page: Path) -> Iterator[Block]:
    """The fenced blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    for found in re.finditer(r"^(`{3,})([^\n`]*)\n(.*?)^\1\s*$", text, flags=re.S | re.M):
        yield Block(page, text.count("\n", 0, found.start()) + 1, found[2].strip(), found[3])


def examples(page: Path) -> Iterator[Block]:
    """The Python examples of a page of the reference, in order."""
    text = page.read_text(encoding="utf-8")
    for found in re.finditer(r"^\.\. code-block:: python\n\n((?:   .*\n|\n)+)", text, flags=re.M):
        yield Block(page, text.count("\n", 0, found.start()) + 2, "python", dedent(found[1]))


def reader_folder(folder: Path) -> Path:
    """Make the folder look as a reader's who has the repository: its folders, and the examples
    themselves.
    """
    for name in ("comparisons", "controllers", "examples"):
        (folder / name).symlink_to(ROOT / name)
    for path in (ROOT / "examples").iterdir():
        if path.is_file():
            shutil.copy(path, folder)
    return folder


def run(block: Block, folder: Path, names: dict[str, Any]) -> None:
    """Run a block in a reader's folder; python blocks of a page share their names."""
    if block.file:
        (folder / block.file).write_text(block.code, encoding="utf-8")
    RUN[block.language](block, folder, names)


def _python(block: Block, folder: Path, names: dict[str, Any]) -> None:
    code = "\n" * block.line + block.code  # so that tracebacks show the page's lines
    exec(compile(code, str(block.page), "exec"), names)


def _toml(block: Block, folder: Path, names: dict[str, Any]) -> None:
    """Load a suite, draw scenes of a family, or simulate a few samples of a scenario or a change of
    :data:`BASE`.
    """
    tables = tomllib.loads(block.code)
    if "calls" in tables:
        assert CallTimes(**tables).sentence
        return
    path = folder / (block.file or f"line-{block.line}.toml")
    whole = {"robot", "extends", "controllers"} & set(tables)
    path.write_text(("" if whole else f'extends = "{BASE}"\n') + block.code, encoding="utf-8")
    if "controllers" in tables:
        (Campaign if "families" in tables else Suite).load(path)
        return
    if "conditions" in tables:
        Family.load(path).require_scenes()
        return
    scenario = Scenario.load(path)
    scenario = scenario.with_override("duration", 4.0 * scenario.tables["sampling_time"])
    done = simulate(scenario.setup(), Tracking())
    assert done.status == "unfinished", done.reason


def _markup(block: Block, folder: Path, names: dict[str, Any]) -> None:
    assert block.file, "a robot's description is a file that other blocks name"


def _shell(block: Block, folder: Path, names: dict[str, Any]) -> None:
    for line in block.code.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        while words:
            end = words.index("&&") if "&&" in words else len(words)
            command = words[:end]
            words = words[end + 1 :]
            COMMANDS[command[0]](command[1:], folder)


def _vsconstraints(arguments: list[str], folder: Path) -> None:
    """Parse as the command line does; a comparison's scenarios, controllers and settings are looked
    up too.
    """
    group: Any = typer.main.get_command(app)
    name, *rest = arguments
    if name.startswith("--"):
        assert any(name in option.opts for option in group.params), (
            f"vsconstraints has no option {name!r}"
        )
        return
    assert name in group.commands, f"vsconstraints has no command {name!r}"
    command = group.commands[name]
    if words := getattr(command, "commands", None):  # a further word says which of its commands
        command = words[rest[0]]
        name = rest[0]
        rest = rest[1:]
    given = command.make_context(name, rest).params
    if name == "compare":
        suite = Suite.load(given["suite"])
        suite.select(
            given["scenarios"] or (),
            given["controllers"] or (),
            given["seed"],
            given["settings"] or (),
        )


def _pip(arguments: list[str], folder: Path) -> None:
    known = read_toml(ROOT / "pyproject.toml")["project"]["optional-dependencies"]
    asked = [extra for argument in arguments for extra in re.findall(r"\[(\w+)\]", argument)]
    assert set(asked) <= set(known), asked


def _sphinx(arguments: list[str], folder: Path) -> None:
    assert arguments == ["-W", "docs", "docs/_build"]


def _citation(block: Block, folder: Path, names: dict[str, Any]) -> None:
    """What a bibliography is told is what CITATION.cff says."""
    told = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    (paper,) = told["references"]
    said = " ".join(block.code.split())
    for text in (
        told["title"],
        f"version {told['version']}",
        told["date-released"].year,
        paper["title"],
        paper["doi"],
    ):
        assert str(text) in said, text
    assert f"pages = {{{paper['start']}--{paper['end']}}}" in said


def _dask(block: Block, folder: Path, names: dict[str, Any]) -> None:
    """Settings of Dask; it knows every one of them."""
    import dask
    import distributed  # noqa: F401  # adds its own

    def require_known(settings: dict[str, Any], known: dict[str, Any]) -> None:
        for name, value in settings.items():
            assert name in known, name
            if isinstance(value, dict):
                require_known(value, known[name])

    require_known(yaml.safe_load(block.code), dask.config.config)


def _anything(arguments: list[str], folder: Path) -> None:
    """Nothing of ours to check."""


RUN = {
    "python": _python,
    "toml": _toml,
    "xml": _markup,
    "sh": _shell,
    "yaml": _dask,
    "bibtex": _citation,
}
OTHERS = dict.fromkeys(("mypy", "pytest", "dask", "openssl"), _anything)
COMMANDS = {"vsconstraints": _vsconstraints, "pip": _pip, "sphinx-build": _sphinx, **OTHERS}
