"""``python -m checks.structure [FOLDER]``: size and dependencies of the package's folders.

A room is a folder of the package. Rooms stand on floors: a room is one floor above the highest room
that it imports. An import counts anywhere, at the top of a file, inside a function or for type
checkers only, except those of :data:`NAMED`; importing a module imports the packages that contain
it. The exit code is 1 if a limit of density or size below is exceeded, if there
are more floors or parameters than allowed, if imports form a circle, if an import crosses the
border between the core and its optional parts, or if a definition has no reference. Lines have no
limit: a limit makes code denser, not simpler. Density has one: tokens per line of code, and the
share of assignments that pack several values into one statement. So has the size of the core, in
tokens. Pages and words of README and docs are counted, too.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

CORE = [
    "errors",
    "rows",
    "plugins",
    "formulas",
    "qp",
    "compiled",
    "robots",
    "vision",
    "constraints",
    "controllers",
    "control",
    "simulation",
    "scenarios",
    "comparisons",
    "reports",
    "cli",
]
"""Rooms of the core: each imports only those before it, and none imports an optional part."""

PARTS = {
    "prediction": set[str](),
    "velocity": set[str](),
    "dynamics": set[str](),
    "images": set[str](),
    "arms": set[str](),
    "score": set[str](),
    "stacks": set[str](),
    "bench": set[str](),
    "view": {"bench", "images"},
    "paper": {"bench", "view"},
}
"""Optional parts, with the other parts that each may import: ``view`` shows runs of campaigns and
rendered images; a study of ``paper`` is a campaign, and its figures show scenes in space."""

NAMED = {
    "vsconstraints": {"view"},
    "vsconstraints.controllers": {"prediction", "velocity"},
    "vsconstraints.plugins.earlier_names": {*PARTS, "controllers"},
}
"""Modules that may name modules of further rooms: what packages export for notebooks and as laws,
and the names under which modules were found earlier. All are imported at their first use."""

MAX_FLOORS = 15
"""Twelve of the core, and three of parts that import one another: bench, view and paper."""

MAX_PARAMETERS = 8
LONG_FILE = 300
"""Files with more lines are listed, but allowed."""

MAX_TOKENS_PER_LINE = 8.5
MAX_TOKENS_PER_LINE_OF_ROOM = 9.5
"""Largest density of the whole package and of a room; other packages of the field have 5 to 8."""

MAX_CORE_TOKENS = 255_000
"""Largest size of the core. What a comparison of the basic laws does not need is a part."""

MAX_PACKED = 0.02
"""Largest share of assignments of the form ``a, b = x, y``, swaps included."""

FEW_LINES = 100
"""Lines of code up to which density is not judged."""

COUNTED = (tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING)
"""Kinds of tokens that count."""


class Lines(NamedTuple):
    """Numbers of lines: code, docstrings and comments, and blank."""

    code: int
    docs: int
    blank: int

    @classmethod
    def of(cls, text: str, tree: ast.Module) -> Lines:
        """Count the lines of one file; comments on separate lines count as docs."""
        strings = {line for first, last in docstrings(tree) for line in range(first, last + 1)}
        numbered = list(enumerate(text.splitlines(), start=1))
        blank = sum(not line.strip() and number not in strings for number, line in numbered)
        comments = sum(
            line.lstrip().startswith("#") and number not in strings for number, line in numbered
        )
        docs = len(strings) + comments
        return cls(len(numbered) - docs - blank, docs, blank)


class Density(NamedTuple):
    """Numbers of tokens of code, of assignments, and of packed assignments."""

    tokens: int
    assignments: int
    packed: int

    @classmethod
    def of(cls, text: str, tree: ast.Module) -> Density:
        """Count the tokens and assignments of one file; docstrings have no tokens of code."""
        strings = {line for first, last in docstrings(tree) for line in range(first, last + 1)}
        tokens = 0
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type in COUNTED and token.start[0] not in strings:
                tokens += 1
        assignments = [node for node in ast.walk(tree) if isinstance(node, ast.Assign)]
        packed = 0
        for node in assignments:
            if isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple):
                packed += 1
        return cls(tokens, len(assignments), packed)


class Module(NamedTuple):
    """One file of the package."""

    name: str
    file: Path
    tree: ast.Module
    lines: Lines
    density: Density


def docstrings(tree: ast.Module) -> Iterator[tuple[int, int]]:
    """Yield first and last line of all strings that are statements.

    These are docstrings of modules, classes and functions, and strings after values.
    """
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            yield node.lineno, node.end_lineno or node.lineno


def read(root: Path) -> dict[str, Module]:
    """Read all modules below a folder, by dotted name."""
    modules = {}
    for file in sorted(root.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        tree = ast.parse(text)
        parts = file.relative_to(root).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        modules[name] = Module(name, file, tree, Lines.of(text, tree), Density.of(text, tree))
    return modules


def imports(module: Module, names: set[str]) -> set[str]:
    """Return modules of the package that a module imports, with the packages that contain them.

    Packages that contain the module itself are left out.
    """
    package = module.name if module.file.name == "__init__.py" else module.name.rpartition(".")[0]
    targets = set()
    for node in ast.walk(module.tree):
        if isinstance(node, ast.ImportFrom):
            around = (
                package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            )
            base = ".".join([*around, *([node.module] if node.module else [])])
            targets |= {
                f"{base}.{alias.name}" if f"{base}.{alias.name}" in names else base
                for alias in node.names
            }
        elif isinstance(node, ast.Import):
            targets |= {alias.name for alias in node.names}
    own = f"{module.name}."
    packages = {
        target[:end] for target in targets for end, letter in enumerate(target) if letter == "."
    }
    packages = {name for name in packages if not own.startswith(f"{name}.")}
    return (targets | packages) & names - {module.name}


def named(module: Module, names: set[str]) -> set[str]:
    """Return modules of the package that a module names in strings, as for ``import_module``.

    Such a string is ``package.module``, ``package.module:name``, or the same without the package or
    relative to the module's own package. Docstrings do not count.
    """
    docs = {line for first, last in docstrings(module.tree) for line in range(first, last + 1)}
    root = module.name.partition(".")[0]
    package = module.name if module.file.name == "__init__.py" else module.name.rpartition(".")[0]
    found = set()
    for node in ast.walk(module.tree):
        if not (isinstance(node, ast.Constant) and isinstance(node.value, str)):
            continue
        if node.lineno in docs or not re.fullmatch(r"\.*\w+(\.\w+)*(:\w*)?", node.value):
            continue
        text = node.value.partition(":")[0]
        dots = len(text) - len(text.lstrip("."))
        if dots:
            around = package.split(".")[: len(package.split(".")) - dots + 1]
            candidates = [".".join([*around, text.lstrip(".")])]
        elif "." in text:
            candidates = [text, f"{root}.{text}"]
        else:
            candidates = []
        found |= {name for name in candidates if name in names}
    return found - {module.name}


def crossings(modules: dict[str, Module], graph: dict[str, set[str]]) -> list[str]:
    """Return a sentence for each module that imports or names a module across a border.

    A room of the core may name no later one of :data:`CORE` and no part, and a part only those
    parts that are written down in :data:`PARTS`.
    """
    sentences = []
    order = {room: i for i, room in enumerate(CORE)}
    for name, module in modules.items():
        room = room_of(name)
        allowed = PARTS.get(room, set()) | NAMED.get(name, set())
        targets = graph[name] | named(module, {*modules})
        for target in sorted(targets):
            other = room_of(target)
            if other in allowed | {room}:
                continue
            if other in PARTS or order.get(other, -1) > order.get(room, len(CORE)):
                sentences.append(f"{name} imports {target}")
    return sentences


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return groups of names, sorted, in which each name is reached from each other."""

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
    groups = {
        tuple(sorted(other for other in reach[name] if name in reach[other])) for name in graph
    }
    return [list(group) for group in sorted(groups) if group]


def floors(graph: dict[str, set[str]]) -> dict[str, int]:
    """Return the floor of each name, from 1; names in a circle share one."""
    together = {name: frozenset(group) for group in circles(graph) for name in group}
    known: dict[str, int] = {}

    def floor(name: str) -> int:
        if name not in known:
            group = together.get(name, frozenset([name]))
            below = {other for member in group for other in graph[member]} - group
            height = 1 + max(map(floor, below), default=0)
            known.update(dict.fromkeys(group, height))
        return known[name]

    return {name: floor(name) for name in graph}


def room_of(name: str) -> str:
    """Return the room of a module: the second part of its name, empty for the package itself."""
    return [*name.split("."), ""][1]


def long_parameter_lists(modules: dict[str, Module]) -> list[str]:
    """Return functions with more parameters than allowed, positional or by keyword.

    ``self`` and ``cls`` do not count, ``*args`` counts once. Commands are excluded, because their
    parameters are options; the ``part.py`` of each part names them.
    """
    found = []
    commands = set()
    for module in modules.values():
        if module.name.endswith(".part"):
            commands |= commands_of(module)
    for module in modules.values():
        for node in ast.walk(module.tree):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                continue
            every = node.args
            name = f"{module.name}.{getattr(node, 'name', 'lambda')}"
            listed = [each.arg for each in (*every.posonlyargs, *every.args, *every.kwonlyargs)]
            count = (
                len(listed)
                - (listed[:1] in (["self"], ["cls"]))
                + sum(map(bool, (every.vararg, every.kwarg)))
            )
            if count > MAX_PARAMETERS and name not in commands:
                found.append(f"{count} {name}")
    return sorted(found, key=lambda entry: -int(entry.split()[0]))


def commands_of(part: Module) -> set[str]:
    """Return the functions that a part registers as commands, as dotted names."""
    constants = {
        target.id: node.value.value
        for node in part.tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    found = set()
    for node in ast.walk(part.tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "Command":
            text = node.args[0]
            values = text.values if isinstance(text, ast.JoinedStr) else [text]
            words = [
                constants[ast.unparse(value.value)]
                if isinstance(value, ast.FormattedValue)
                else str(value.value)
                for value in values
                if isinstance(value, ast.FormattedValue | ast.Constant)
            ]
            found.add("".join(words).replace(":", "."))
    return found


def unreferenced(modules: dict[str, Module], root: Path) -> list[str]:
    """Return functions and classes whose names appear only in their definition.

    Definitions with decorators are excluded. Names count in the package and its data files, and in
    documents, examples and commands beside it; tests do not count.
    """
    texts = [path for path in root.rglob("*") if path.suffix in (".py", ".md", ".html", ".toml")]
    for name in ("docs", "examples", "benchmarks", "checks", "notebooks", "README.md"):
        place = root.parent / name
        texts += (
            [place]
            if place.is_file()
            else [p for p in place.rglob("*") if p.suffix in (".py", ".md", ".ipynb")]
        )
    words = Counter(
        word for path in texts for word in re.findall(r"\w+", path.read_text(encoding="utf-8"))
    )
    defined: dict[str, list[str]] = {}
    for module in modules.values():
        # called by numba, and by the packages that adapters are for
        if module.name.endswith(("numba_interface", "accelerator")) or ".adapters." in module.name:
            continue
        for node in ast.walk(module.tree):
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not re.fullmatch(
                r"__\w+__|_repr_html_", node.name
            ):
                defined.setdefault(node.name, []).extend(
                    [] if node.decorator_list else [module.name]
                )
    return sorted(
        f"{where[0]}.{name}"
        for name, where in defined.items()
        if where and words[name] <= len(where)
    )


def too_dense(modules: list[Module], rooms: dict[str, list[Module]]) -> list[str]:
    """Return a sentence for each limit of density and size that the package exceeds."""
    sentences = []
    limits = dict.fromkeys(rooms, MAX_TOKENS_PER_LINE_OF_ROOM)
    for name, inside in {**rooms, "all": modules}.items():
        code = sum(module.lines.code for module in inside)
        per_line = sum(module.density.tokens for module in inside) / max(code, 1)
        limit = limits.get(name, MAX_TOKENS_PER_LINE)
        if code > FEW_LINES and per_line > limit:
            sentences.append(f"{name}: {per_line:.2f} tokens per line of code, {limit} allowed")
    core = [module for room in CORE for module in rooms.get(room, [])]
    tokens = sum(module.density.tokens for module in core)
    if tokens > MAX_CORE_TOKENS:
        sentences.append(f"the core has {tokens} tokens, {MAX_CORE_TOKENS} allowed")
    code = sum(module.lines.code for module in modules)
    packed = sum(module.density.packed for module in modules)
    share = packed / max(sum(module.density.assignments for module in modules), 1)
    if code > FEW_LINES and share > MAX_PACKED:
        sentences.append(f"{share:.1%} of the assignments are packed, {MAX_PACKED:.0%} allowed")
    return sentences


def main(arguments: list[str]) -> int:
    """Print the results described by the module."""
    root = Path(arguments[0]) if arguments else Path(__file__).parents[1] / "src"
    modules = read(root)
    if not modules:
        print(f"there is no Python file in {root}", file=sys.stderr)
        return 2
    graph = {}
    for name, module in modules.items():
        at_first_use = NAMED.get(name, set())  # such imports make no circle
        targets = imports(module, {*modules})
        graph[name] = {target for target in targets if room_of(target) not in at_first_use}
    rooms: dict[str, list[Module]] = {}
    for module in modules.values():
        rooms.setdefault(room_of(module.name), []).append(module)
    between = {
        room: {room_of(target) for module in inside for target in graph[module.name]} - {room, ""}
        for room, inside in rooms.items()
        if room
    }
    heights = floors(between)
    exceeded = []

    def line(title: str, inside: list[Module], floor: str) -> None:
        lines = Lines(*map(sum, zip(*(module.lines for module in inside), strict=True)))
        tokens = sum(module.density.tokens for module in inside)
        numbers = f"{sum(lines):7} {len(inside):6} {lines.code:6} {lines.docs:6} {lines.blank:6}"
        print(f"{title:13}{numbers} {tokens:7} {tokens / max(lines.code, 1):6.1f} {floor:>6}")

    counts = f"{'lines':>7} {'files':>6} {'code':>6} {'docs':>6} {'blank':>6}"
    print(f"{'room':13}{counts} {'tokens':>7} {'/ line':>6} {'floor':>6}")
    order = {room: i for i, room in enumerate([*CORE, *PARTS])}
    for room, inside in sorted(
        rooms.items(), key=lambda entry: (order.get(entry[0], -1), entry[0])
    ):
        line(room or "(package)", inside, str(heights.get(room, "")))
    for title, chosen in (("core", CORE), ("parts", [*PARTS])):
        inside = [module for room in chosen for module in rooms.get(room, [])]
        if inside:
            line(title, inside, "")
    line("all", [*modules.values()], str(max(heights.values(), default=0)))
    if max(heights.values(), default=0) > MAX_FLOORS:
        exceeded.append(f"{max(heights.values())} floors, {MAX_FLOORS} allowed")
    exceeded += crossings(modules, graph)
    exceeded += too_dense([*modules.values()], rooms)
    exceeded += [
        f"parameters: {entry}, {MAX_PARAMETERS} allowed" for entry in long_parameter_lists(modules)
    ]
    exceeded += [f"nothing refers to {name}" for name in unreferenced(modules, root)]
    pages = [page for name in ("README.md", "docs/*.md") for page in root.parent.glob(name)]
    words = sum(len(page.read_text(encoding="utf-8").split()) for page in pages)
    print(f"documentation: {len(pages)} pages, {words} words")
    print(f"dependencies between rooms: {sum(map(len, between.values()))}")
    long = sorted(((sum(module.lines), module.name) for module in modules.values()), reverse=True)
    listed = "; ".join(f"{count} {name}" for count, name in long if count > LONG_FILE)
    print(f"files of more than {LONG_FILE} lines: {listed or 'none'}")
    loops = circles(graph) + circles(between)
    print(f"circles of imports: {'; '.join(', '.join(group) for group in loops) or 'none'}")
    print("exceeded: " + ("; ".join(exceeded) or "nothing"))
    return 1 if loops or exceeded else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
