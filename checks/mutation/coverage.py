"""Coverage of test files, kept between runs.

The coverage of a test file is valid as long as nothing changes that it depends on: the test file,
the modules beside it that it imports, the data of all tests, files of the package without functions
(data and tables), and the source files whose functions its tests enter. Where compiled code runs
compiled, it also depends on all files of that code.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType
from typing import Any

ENTERED = "__entered__"
"""Array of flags, one for each function, which instrumented functions set."""


@dataclass
class Reached:
    """Duration and coverage of one test.

    Attributes
    ----------
    seconds
        CPU time.
    functions
        Source file, relative to the tree, and first line of each function that the test enters.
    """

    seconds: float = 0.0
    functions: set[tuple[str, int]] = field(default_factory=set)


@dataclass(frozen=True)
class Instrumented:
    """Source files whose functions record that they are entered.

    Attributes
    ----------
    functions
        Source file, relative to the tree, and first line of each function; a function's place in
        this list is its place among the flags.
    code
        Code of each file, by its path.
    """

    functions: list[tuple[str, int]]
    code: dict[str, CodeType]


def instrumented(root: Path, files: Iterable[str]) -> Instrumented:
    """Compile source files so that each function first sets its flag."""
    functions: list[tuple[str, int]] = []
    code = {}
    for file in files:
        module = ast.parse((root / file).read_text(encoding="utf-8"))
        for node in ast.walk(module):
            if isinstance(node, ast.FunctionDef):
                record = ast.parse(f"{ENTERED}[{len(functions)}] = 1").body
                has_docstring = ast.get_docstring(node, clean=False) is not None
                node.body[has_docstring:has_docstring] = record
                functions.append((file, first_line(node)))
        path = str(root / file)
        compiled: Any = compile(module, path, "exec", dont_inherit=True)
        code[path] = compiled
    return Instrumented(functions, code)


def first_line(function: ast.FunctionDef) -> int:
    """Return the line of the first decorator, or of the function if it has none."""
    return min([function.lineno, *(decorator.lineno for decorator in function.decorator_list)])


class CoverageCache:
    """Coverage of test files, in one JSON file for each.

    Parameters
    ----------
    folder
        Folder of the JSON files.
    root
        The tree; it holds ``src`` and ``tests``.
    settings
        What else coverage depends on, such as a time limit.
    """

    def __init__(self, folder: Path, root: Path, settings: str = "") -> None:
        self.folder = folder
        self.root = root
        self._known_digests: dict[Path, str] = {}
        self.shared = self._shared_digest(settings)

    def get(self, test_file: str) -> dict[str, Reached] | None:
        """Return the kept coverage of a test file's tests, or None if there is no valid one."""
        try:
            kept = json.loads(self._path(test_file).read_text(encoding="utf-8"))
            if kept["shared"] != self.shared:
                return None
            if kept["dependencies"] != self._digests(kept["dependencies"]):
                return None
            functions = [(str(file), int(line)) for file, line in kept["functions"]]
            return {
                str(test): Reached(float(seconds), {functions[i] for i in entered})
                for test, (seconds, entered) in kept["tests"].items()
            }
        except (OSError, ValueError, KeyError, TypeError, IndexError):
            # absent, cut short by an interrupted run, or of another form: watched again
            return None

    def put(self, test_file: str, tests: Mapping[str, Reached], sources: Iterable[str]) -> None:
        """Keep the coverage of a test file's tests, which enter functions of these files."""
        functions = sorted({place for reached in tests.values() for place in reached.functions})
        position = {place: i for i, place in enumerate(functions)}
        kept = {
            "shared": self.shared,
            "dependencies": self._digests([*self._test_files(test_file), *sources]),
            "functions": functions,
            "tests": {
                test: [reached.seconds, sorted(position[place] for place in reached.functions)]
                for test, reached in tests.items()
            },
        }
        self.folder.mkdir(parents=True, exist_ok=True)
        unfinished = self.folder / f"{os.getpid()}.unfinished"
        unfinished.write_text(json.dumps(kept), encoding="utf-8")
        unfinished.replace(self._path(test_file))

    def _path(self, test_file: str) -> Path:
        return self.folder / f"{Path(test_file).stem}.json"

    def _test_files(self, test_file: str) -> list[str]:
        """Return a test file and the modules beside it that it imports, directly or not."""
        folder = Path(test_file).parent
        found = [test_file]
        waiting = [test_file]
        while waiting:
            for name in _imported(self.root / waiting.pop()):
                module = (folder / f"{name}.py").as_posix()
                if module not in found and (self.root / module).is_file():
                    found.append(module)
                    waiting.append(module)
        return found

    def _digests(self, files: Iterable[str]) -> dict[str, str]:
        return {file: self._digest(self.root / file) for file in sorted(set(files))}

    def _shared_digest(self, settings: str) -> str:
        """Digest of all that every test file may depend on."""
        files = [self.root / "pyproject.toml"]
        for path in sorted((self.root / "tests").rglob("*")):
            is_data = path.suffix != ".py" and "__pycache__" not in path.parts
            if is_data or path.name == "conftest.py":
                files.append(path)
        for name in ("src", "controllers", "examples", "comparisons"):
            files += [path for path in sorted((self.root / name).rglob("*")) if _no_code(path)]
        text = "".join(f"{path.relative_to(self.root)} {self._digest(path)}\n" for path in files)
        return hashlib.sha256(f"{sys.version}\n{settings}\n{text}".encode()).hexdigest()

    def _digest(self, path: Path) -> str:
        """Return the digest of a file, or an empty string if it is none."""
        if path not in self._known_digests:
            is_source = path.is_file() and "__pycache__" not in path.parts
            content = path.read_bytes() if is_source else None
            self._known_digests[path] = (
                "" if content is None else hashlib.sha256(content).hexdigest()
            )
        return self._known_digests[path]


def _imported(file: Path) -> set[str]:
    """Return the names of the modules that a file imports."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names


def cache_folder() -> Path:
    """Return the folder for coverage below the user's cache folder."""
    folder = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(folder) / "vsconstraints" / "mutation"


def _no_code(path: Path) -> bool:
    """Return True for a file without functions: data, or tables in Python."""
    if "__pycache__" in path.parts:
        return False
    return path.suffix != ".py" or "def " not in path.read_text(encoding="utf-8")
