"""``python -m checks.structure [FOLDER]``: how large the code is, its long files and parameter lists, circular imports.

Of every folder: lines of code, of docstrings (comments among them), and blank ones. A parameter list may be longer than
others where each parameter is an option of the command line, or where compiled code takes numbers one by one.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

MOST_PARAMETERS = 8
"""More than so many are listed."""

MOST_LINES = 300
"""Longer files are listed."""


class Lines(NamedTuple):
    """What the lines of files are."""

    code: int
    docstrings: int
    blank: int

    @classmethod
    def of(cls, text: str, tree: ast.Module) -> Lines:
        """Those of one file; comments that stand alone count with docstrings."""
        told = {line for first, last in docstrings(tree) for line in range(first, last + 1)}
        every = list(enumerate(text.splitlines(), start=1))
        blank = sum(not line.strip() and number not in told for number, line in every)
        comments = sum(line.lstrip().startswith("#") and number not in told for number, line in every)
        said = len(told) + comments
        return cls(len(every) - said - blank, said, blank)

    @classmethod
    def together(cls, parts: list[Lines]) -> Lines:
        """The sum of all."""
        return cls(*map(sum, zip(*parts, strict=True)))


def docstrings(tree: ast.Module) -> Iterator[tuple[int, int]]:
    """First and last line of every text that stands by itself: of modules, classes, functions, and after values."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            assert node.end_lineno is not None
            yield node.lineno, node.end_lineno


def functions(tree: ast.AST) -> Iterator[tuple[ast.FunctionDef, int]]:
    """Every function of a module, with the number of its parameters but for self and cls."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            given = node.args
            names = [argument.arg for argument in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
            yield node, len(names) - (names[:1] in (["self"], ["cls"]))


def why_long(node: ast.FunctionDef) -> str:
    """What excuses a long parameter list: they are options of the command line, or compiled code is called."""
    if "typer." in ast.unparse(node.args) or "Option(" in ast.unparse(node.args):
        return " (options)"
    marks = " ".join(ast.unparse(mark) for mark in node.decorator_list)
    return " (compiled)" if "formula" in marks or "compiled" in marks else ""


def module_name(file: Path, root: Path) -> str:
    """The name under which a file is imported."""
    parts = file.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(name: str, file: Path, tree: ast.Module, modules: set[str]) -> set[str]:
    """Modules of the tree that a module imports when it is imported, relative imports being the only ones."""
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    found = set()
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.level:
            parts = package.split(".")
            base = ".".join([*parts[: len(parts) - node.level + 1], *([node.module] if node.module else [])])
            found |= {f"{base}.{alias.name}" if f"{base}.{alias.name}" in modules else base for alias in node.names}
    return found & modules - {name}


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Modules that import each other, as sorted groups: those from which each other one of the group is reached."""

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        waiting = [*graph[start]]
        while waiting:
            at = waiting.pop()
            if at not in seen:
                seen.add(at)
                waiting += graph[at]
        return seen

    reach = {name: reached(name) for name in graph}
    groups = {tuple(sorted(other for other in reach[name] if name in reach[other])) for name in graph}
    return [list(group) for group in sorted(groups) if group]


def main(arguments: list[str]) -> int:
    """Print what the module says; 1 if there are circles."""
    root = Path(arguments[0]) if arguments else Path(__file__).parents[1] / "src"
    files = sorted(root.rglob("*.py"))
    if not files:
        print(f"there is no Python file in {root}", file=sys.stderr)
        return 2
    texts = {file: file.read_text(encoding="utf-8") for file in files}
    trees = {file: ast.parse(text) for file, text in texts.items()}
    lines = {file: Lines.of(texts[file], trees[file]) for file in files}
    total = Lines.together([*lines.values()])
    others = sum(file.read_text(encoding="utf-8").count("\n") for file in root.rglob("*.toml"))
    print(f"{sum(total)} lines of Python in {len(files)} files, {others} of TOML")
    print(f"  {'lines':>6} {'code':>6} {'docs':>6} {'blank':>6}")
    print(f"  {sum(total):6} {total.code:6} {total.docstrings:6} {total.blank:6} in all")
    for folder in sorted({file.parent for file in files}):
        own = Lines.together([lines[file] for file in files if file.parent == folder])
        print(f"  {sum(own):6} {own.code:6} {own.docstrings:6} {own.blank:6} {folder.relative_to(root)}")
    long_files = sorted(((sum(of), str(file.relative_to(root))) for file, of in lines.items()), reverse=True)
    listed = [f"{count} {where}" for count, where in long_files if count > MOST_LINES]
    print(f"files of more than {MOST_LINES} lines: {'; '.join(listed) or 'none'}")
    longest = sorted(
        ((count, f"{file.relative_to(root)}: {node.name}{why_long(node)}") for file in files
         for node, count in functions(trees[file])), reverse=True,
    )  # fmt: skip
    named = [one for one in longest if one[0] > MOST_PARAMETERS] or longest[:1]
    print("longest parameter lists: " + "; ".join(f"{count} {where}" for count, where in named))
    names = {module_name(file, root): file for file in files}
    found = circles({name: imports(name, file, trees[file], {*names}) for name, file in names.items()})
    print("circles of imports: " + ("; ".join(", ".join(group) for group in found) or "none"))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
