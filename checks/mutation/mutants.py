"""Mutants: source files with one small mistake each."""

from __future__ import annotations

import ast
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from .coverage import first_line

BOUNDARY = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">"}
NEGATION = {ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "==",
            ast.In: "not in", ast.NotIn: "in", ast.Is: "is not", ast.IsNot: "is"}  # fmt: skip
SYMBOL = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
          ast.In: "in",
          ast.NotIn: "not in", ast.Is: "is", ast.IsNot: "is not", ast.Add: "+", ast.Sub: "-",
          ast.Mult: "*",
          ast.Div: "/", ast.Pow: "**", ast.BitAnd: "&", ast.BitOr: "|", ast.And: "and",
          ast.Or: "or"}  # fmt: skip
OPPOSITE = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*", ast.BitAnd: "|",
            ast.BitOr: "&",
            ast.And: "or", ast.Or: "and"}  # fmt: skip
PAIRS = (("min", "max"), ("any", "all"), ("minimum", "maximum"), ("argmin", "argmax"),
         ("floor", "ceil"),
         ("sin", "cos"), ("zeros", "ones"), ("median", "mean"))  # fmt: skip
SWAPPED = {one: other for pair in PAIRS for one, other in (pair, pair[::-1])}
LEFT_OUT = ("abs", "sqrt")
"""Functions that are replaced by their argument."""

WORDS = ("text", "texts", "title", "why", "shown", "beyond", "broken")
"""Names of texts: statements that assign or append to them are not mutated.

Assignments of texts are not mutated either.
"""

KEYWORDS = ("strict", "repr", "init")
"""Arguments that guard against slips or only concern the output."""

GUARD = 1e-8
"""Smaller numbers are tolerances, changed by the factor :data:`GUARDED`; others by 2."""
GUARDED = 1e4


@dataclass(frozen=True)
class Mutant:
    """File with one mistake.

    Attributes
    ----------
    file
        Path in the repository.
    function
        First line of the function (decorators included) that contains the mistake; 0 outside of
        functions.
    line
        Line of the mistake.
    old, new
        That line before and after, with the following lines if the change spans several, without
        indentation.
    source
        The whole file with the mistake.
    why
        Reason, for a named mistake.
    """

    file: str
    function: int
    line: int
    old: str
    new: str
    source: str
    why: str = ""

    @property
    def key(self) -> tuple[str, str, str]:
        """Identification of the mutant, independent of its line number."""
        return self.file, self.old, self.new

    def __str__(self) -> str:
        return f"{self.file}:{self.line}\n    - {self.old}\n    + {self.new}" + (
            f"\n    ({self.why})" if self.why else ""
        )


def mutants_of(root: Path, file: str) -> list[Mutant]:
    """Return all mutants of a file, in the order of its lines."""
    source = (root / file).read_text(encoding="utf-8")
    made = _Mutations(source)
    changes = sorted(set(made.changes(ast.parse(source), 0)))
    return [_spliced(file, source, *change) for change in changes]


def edited(root: Path, file: str, old: str, new: str, why: str) -> Mutant:
    """Return the mutant in which ``new`` replaces ``old``.

    Raises ValueError unless ``old`` is in the file exactly once.
    """
    source = (root / file).read_text(encoding="utf-8")
    if source.count(old) != 1:
        raise ValueError(f"{file} has {source.count(old)} times, not once: {old}")
    start = len(source[: source.index(old)].encode())
    line = source[: source.index(old)].count("\n") + 1
    inside = [
        (node.end_lineno - first, first)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef)
        and node.lineno <= line <= (node.end_lineno or 0)
        and (first := first_line(node))
    ]
    return _spliced(
        file, source, start, start + len(old.encode()), new, min(inside, default=(0, 0))[1], why
    )


def sampled(mutants: list[Mutant], count: int, seed: str) -> list[Mutant]:
    """Draw some of the mutants, the same for the same seed, in their order."""
    if count >= len(mutants):
        return mutants
    chosen = random.Random(seed).sample(range(len(mutants)), count)
    return [mutants[i] for i in sorted(chosen)]


def _spliced(
    file: str, source: str, start: int, end: int, new: str, function: int, why: str = ""
) -> Mutant:
    text = source.encode()
    changed = text[:start] + new.encode() + text[end:]
    first = text.rfind(b"\n", 0, start) + 1
    last = text.find(b"\n", end)
    last_changed = changed.find(b"\n", start + len(new.encode()))
    line = text[:start].count(b"\n") + 1
    before = text[first:last].decode().strip()
    after = changed[first:last_changed].decode().strip()
    return Mutant(file, function, line, before, after, changed.decode(), why)


Change = tuple[int, int, str, int]
"""First and last byte, their replacement, and first line of the function."""


class _Mutations:
    """Finds changes of a file. Texts, annotations and arguments of decorators are left alone."""

    def __init__(self, source: str) -> None:
        self.text = source.encode()
        self.starts = [0]
        for line in self.text.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self.starts[node.lineno - 1] + node.col_offset, self.starts[
            node.end_lineno - 1
        ] + node.end_col_offset

    def changes(self, node: ast.AST, function: int) -> Iterator[Change]:
        """Yield changes of this node and all nodes below it."""
        if isinstance(node, ast.JoinedStr) or _only_said(node):
            return
        if isinstance(node, ast.FunctionDef):
            for default in (
                *node.args.defaults,
                *(d for d in node.args.kw_defaults if d is not None),
            ):
                yield from self.changes(default, function)
            for statement in node.body:
                yield from self.changes(statement, first_line(node))
            return
        for start, end, new in self.of(node):
            yield start, end, new, function
        for below in self.below(node):
            yield from self.changes(below, function)

    def below(self, node: ast.AST) -> Iterator[ast.AST]:
        if isinstance(node, (ast.Raise, ast.Import, ast.ImportFrom)):
            return
        if (
            isinstance(node, ast.If)
            and isinstance(node.test, ast.Name)
            and node.test.id == "TYPE_CHECKING"
        ):
            return
        if isinstance(node, ast.keyword) and node.arg in KEYWORDS:
            return
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "option":
            # default and meaning; the range in which tuning searches is a choice
            yield from (*node.args[:2], *node.keywords)
            return
        if isinstance(node, ast.Assign) and any(
            isinstance(t, ast.Name) and t.id == "__all__" for t in node.targets
        ):
            return
        for name, value in ast.iter_fields(node):
            if name not in ("annotation", "decorator_list", "returns", "type_params"):
                yield from (
                    one
                    for one in (value if isinstance(value, list) else [value])
                    if isinstance(one, ast.AST)
                )

    def of(self, node: ast.AST) -> Iterator[tuple[int, int, str]]:
        """Yield changes of this node only."""
        if isinstance(node, ast.Constant):
            yield from ((*self.span(node), new) for new in _other_constants(node.value))
        elif isinstance(node, ast.Compare):
            yield from self.of_comparison(node)
        elif isinstance(node, ast.BinOp) and type(node.op) in OPPOSITE:
            yield self.between(node.left, node.op, node.right, OPPOSITE[type(node.op)])
        elif isinstance(node, ast.BoolOp):
            for left, right in zip(node.values, node.values[1:], strict=False):
                yield self.between(left, node.op, right, OPPOSITE[type(node.op)])
        elif isinstance(node, ast.UnaryOp) and not isinstance(node.op, ast.UAdd):
            yield self.span(node)[0], self.span(node.operand)[0], ""
        elif isinstance(node, (ast.If, ast.While, ast.IfExp)):
            yield from self.negated(node.test)
        elif isinstance(node, ast.comprehension):
            for condition in node.ifs:
                yield from self.negated(condition)
        elif isinstance(node, ast.Call):
            yield from self.left_out(node)
        elif isinstance(node, (ast.Name, ast.Attribute)) and isinstance(node.ctx, ast.Load):
            yield from self.of_name(node)
        elif isinstance(node, (ast.AugAssign, ast.Raise, ast.Continue, ast.Break)) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
        ):
            yield *self.span(node), "pass"

    def of_comparison(self, node: ast.Compare) -> Iterator[tuple[int, int, str]]:
        """Yield changes of the operators of a comparison."""
        lefts = [node.left, *node.comparators[:-1]]
        for left, operator, right in zip(lefts, node.ops, node.comparators, strict=True):
            for table in (BOUNDARY, NEGATION):
                if type(operator) in table:
                    yield self.between(left, operator, right, table[type(operator)])

    def of_name(self, node: ast.Name | ast.Attribute) -> Iterator[tuple[int, int, str]]:
        """Yield the change of a name into its counterpart, such as ``min`` into ``max``."""
        name = node.id if isinstance(node, ast.Name) else node.attr
        if name in SWAPPED:
            end = self.span(node)[1]
            yield end - len(name.encode()), end, SWAPPED[name]

    def between(
        self, left: ast.expr, operator: ast.AST, right: ast.expr, new: str
    ) -> tuple[int, int, str]:
        symbol = SYMBOL[type(operator)].encode()
        start = self.text.index(symbol, self.span(left)[1], self.span(right)[0])
        return start, start + len(symbol), new

    def negated(self, condition: ast.expr) -> Iterator[tuple[int, int, str]]:
        """Negate a condition; comparisons and logic have separate changes."""
        if not isinstance(condition, (ast.Compare, ast.BoolOp, ast.UnaryOp, ast.Constant)):
            start, end = self.span(condition)
            yield start, end, f"not ({self.text[start:end].decode()})"

    def left_out(self, call: ast.Call) -> Iterator[tuple[int, int, str]]:
        name = call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")
        if name in LEFT_OUT and len(call.args) == 1:
            start, end = self.span(call.args[0])
            yield *self.span(call), f"({self.text[start:end].decode()})"


def _only_said(node: ast.AST) -> bool:
    target: ast.AST | None = None
    if isinstance(node, ast.Assign):
        if _is_text(node.value):
            return True
        target = node.targets[0]
    elif isinstance(node, ast.AugAssign):
        target = node.target
    elif (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Call)
        and isinstance(node.value.func, ast.Attribute)
    ):
        target = node.value.func.value
    return isinstance(target, ast.Name) and target.id in WORDS


def _is_text(value: ast.AST) -> bool:
    if isinstance(value, ast.IfExp):
        return _is_text(value.body) or _is_text(value.orelse)
    return isinstance(value, ast.JoinedStr) or (
        isinstance(value, ast.Constant) and isinstance(value.value, str)
    )


def _other_constants(value: object) -> list[str]:
    if isinstance(value, bool):
        return [repr(not value)]
    if isinstance(value, int):
        return [repr(value + 1), repr(value - 1)]
    if isinstance(value, float) and value == 0.0:
        return ["1.0", "-1.0"]
    if isinstance(value, float) and abs(value) < float("inf"):
        factor = GUARDED if 0.0 < abs(value) < GUARD else 2.0
        return [repr(value * factor), repr(value / factor)]
    return []
