"""``python -m checks.structure [FOLDER]``: how large the code is, longest parameter lists, and circles of imports."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

MOST_PARAMETERS = 8
"""More than so many are listed."""


def functions(tree: ast.AST) -> Iterator[tuple[ast.FunctionDef, int]]:
    """Every function of a module, with the number of its parameters but for self and cls."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            given = node.args
            names = [argument.arg for argument in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
            yield node, len(names) - (names[:1] in (["self"], ["cls"]))


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
    names = {module_name(file, root): file for file in files}
    lines = sum(text.count("\n") for text in texts.values())
    others = sum(file.read_text(encoding="utf-8").count("\n") for file in root.rglob("*.toml"))
    print(f"{lines} lines of Python in {len(files)} files, {others} of TOML")
    for folder in sorted({file.parent for file in files}):
        within = [file for file in files if file.parent == folder]
        print(f"  {sum(texts[file].count(chr(10)) for file in within):6d} {folder.relative_to(root)}")
    longest = sorted(
        (count, f"{file.relative_to(root)}: {node.name}") for file in files for node, count in functions(trees[file])
    )[::-1]
    listed = [one for one in longest if one[0] > MOST_PARAMETERS] or longest[:1]
    print("longest parameter lists: " + "; ".join(f"{count} {where}" for count, where in listed))
    found = circles({name: imports(name, file, trees[file], {*names}) for name, file in names.items()})
    print("circles of imports: " + ("; ".join(", ".join(group) for group in found) or "none"))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
