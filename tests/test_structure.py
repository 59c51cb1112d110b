"""The code's structure: nothing imports in circles, and what counts is counted."""

import ast
import csv
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from checks import structure


def package(folder, **files):
    (folder / "p").mkdir()
    for name, text in {"__init__": "", **files}.items():
        (folder / "p" / f"{name}.py").write_text(text)
    return structure.main([str(folder)])


def test_circles_are_found_wherever_imports_stand(tmp_path, capsys):
    """At the top, in a function, for type checkers only, and through a package around what is
    imported.
    """
    inside = "def f():\n    from .c import x\n\n\nf()\n"
    typed = "from typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n    from .a import f\n\nx = 1\n"
    (tmp_path / "circle").mkdir()
    assert package(tmp_path / "circle", a="from . import b\n", b=inside, c=typed) == 1
    assert "circles of imports: p.a, p.b, p.c" in capsys.readouterr().out
    (tmp_path / "chain").mkdir()
    assert package(tmp_path / "chain", a="from . import b\n", b=inside, c="x = 1\n") == 0
    assert "circles of imports: none" in capsys.readouterr().out
    for room, text in (("q", "from ..r.deep import x\n"), ("r", "from ..q import y\n")):
        (tmp_path / "chain" / "p" / room).mkdir()
        (tmp_path / "chain" / "p" / room / "__init__.py").write_text(text if room == "r" else "")
        (tmp_path / "chain" / "p" / room / "deep.py").write_text(text if room == "q" else "x = 1\n")
    assert structure.main([str(tmp_path / "chain")]) == 1
    assert "circles of imports: q, r" in capsys.readouterr().out


def test_floors_are_counted(tmp_path, capsys):
    names = {"a": "", "b": "from .a import x\n", "c": "from .b import x\nfrom .a import x\n"}
    assert package(tmp_path, **names) == 0
    lines = {
        line.split()[0]: line.split()[-1]
        for line in capsys.readouterr().out.splitlines()
        if line[:1] in "abc"
    }
    assert {name: lines[name] for name in names} == {"a": "1", "b": "2", "c": "3"}
    assert lines["all"] == "3"


def test_long_parameter_lists_are_named(tmp_path, capsys):
    assert (
        package(tmp_path, rows="x = 1\n\n\ndef f(self, a, b, c, d, e, g, h, *, i, j):\n    pass\n")
        == 1
    )
    said = capsys.readouterr().out
    assert "parameters: 9 p.rows.f, 8 allowed" in said
    assert structure.main([str(tmp_path / "nowhere")]) == 2


def test_dense_code_is_named(tmp_path, capsys):
    """A line of many tokens, and an assignment of two values at once; swaps count as well."""
    text = "a, b = 1, 2\na, b = b, a\nc = [1, 2, 3, 4, 5, 6, 7, 8, 9]\n"
    assert package(tmp_path, a=34 * text) == 1
    said = capsys.readouterr().out
    assert "all: 11.67 tokens per line of code, 8.5 allowed" in said
    assert "a: 11.67 tokens per line of code, 9.5 allowed" in said
    assert "66.7% of the assignments are packed, 2% allowed" in said


def test_a_core_that_grows_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(structure, "MAX_CORE_TOKENS", 5)
    assert package(tmp_path, **{"rows.a": "first = 1\nsecond = 2\n"}) == 1
    assert "the core has 6 tokens, 5 allowed" in capsys.readouterr().out


def test_pages_and_words_are_counted(tmp_path, capsys):
    """README and pages beside the package, pages in folders not."""
    (tmp_path / "docs" / "api").mkdir(parents=True)
    for name, text in (
        ("README.md", "one two"),
        ("docs/a.md", "| three |\n"),
        ("docs/api/b.md", "not counted"),
    ):
        (tmp_path / name).write_text(text)
    (tmp_path / "src").mkdir()
    assert package(tmp_path / "src", a="x = 1\n") == 0
    assert "documentation: 2 pages, 5 words" in capsys.readouterr().out


@pytest.mark.parametrize(
    "function",
    [
        "def f(a, b, c, d, e, g, h, i, j):\n    f()",
        "def f(a, b, c, d, e, g, h, i, *, j):\n    f()",
        "def f(a, b, c, d, e, g, h, *i, j):\n    f()",
        "def f(a, b, c, d, e, g, h, i, **j):\n    f()",
        "async def f(a, b, c, d, e, g, h, i, j):\n    f()",
        "@formula\ndef f(a, b, c, d, e, g, h, i, j):\n    f()",
        "@compiled('void()', IN_PLACE)\ndef f(a, b, c, d, e, g, h, i, j):\n    f()",
        "class A:\n    def f(self, a, b, c, d, e, g, h, i, j):\n        A.f()",
    ],
)
def test_nine_parameters_are_too_many_everywhere(function, tmp_path, capsys):
    """However they are given, and whatever decorates the function: one fewer is allowed."""
    (tmp_path / "nine").mkdir()
    assert package(tmp_path / "nine", a=f"{function}\n") == 1
    assert "exceeded: parameters: 9 p.a.f, 8 allowed\n" in capsys.readouterr().out
    (tmp_path / "eight").mkdir()
    assert package(tmp_path / "eight", a=f"{function}\n".replace("a, ", "")) == 0


def test_only_listed_commands_have_more_parameters(tmp_path):
    many = "def {}(a, b, c, d, e, g, h, i, j):\n    {}()\n"
    part = "_SOME = 'p.cli.some'\nPART = Part({'run': Command(f'{_SOME}:run', 'panel', 'x')})\n"
    cli = tmp_path / "p" / "cli"
    cli.mkdir(parents=True)
    for name, text in (("__init__", ""), ("part", part)):
        (cli / f"{name}.py").write_text(text)
    (cli / "some.py").write_text(many.format("run", "helper") + many.format("helper", "run"))
    assert structure.long_parameter_lists(structure.read(tmp_path)) == ["9 p.cli.some.helper"]


CROSSING = [
    "from ..bench import x",
    "from .. import bench",
    "from ..bench.deep import x",
    "import vsconstraints.bench.deep",
    "def f():\n    from ..bench import x\n    f()",
    "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ..bench.deep import x",
    "import_module('vsconstraints.bench.deep')",
    "import_module('..bench.deep', __package__)",
    "load('vsconstraints.bench.deep:x')",
    "PLACES = {'x': 'bench.deep'}",
]


def tree(folder, **texts):
    """Write a package with the room ``bench`` and files by room; return the borders crossed."""
    for room, text in {"bench": "", "": "", **texts}.items():
        place = folder / "vsconstraints" / room
        place.mkdir(parents=True, exist_ok=True)
        (place / "__init__.py").write_text("")
        (place / "deep.py").write_text(f"x = 1\n{text}\n")
    modules = structure.read(folder)
    graph = {name: structure.imports(module, {*modules}) for name, module in modules.items()}
    return structure.crossings(modules, graph)


@pytest.mark.parametrize("text", CROSSING)
@pytest.mark.parametrize("room", ["control", "images"])
def test_no_import_crosses_into_a_part(room, text, tmp_path):
    """Neither from the core nor from a part that may not, however the import is written."""
    found = tree(tmp_path, **{room: text})
    assert found
    assert all(
        line.startswith(f"vsconstraints.{room}.deep imports vsconstraints.bench") for line in found
    )


@pytest.mark.parametrize("text", [text.replace("bench", "control") for text in CROSSING])
def test_no_room_of_the_core_imports_a_later_one(text, tmp_path):
    (found, *_) = tree(tmp_path, control="", vision=text)
    assert found.startswith("vsconstraints.vision.deep imports vsconstraints.control")
    assert tree(tmp_path, vision="", control=text.replace("control", "vision")) == []


def test_imports_that_are_written_down_are_allowed(tmp_path):
    """Of the core by everyone, of a part by one that may, and a part's own; words are no imports."""
    from_core = "from ..control import x\nfrom . import y"
    words = '"""See vsconstraints.bench.deep."""\nx = "bench"\ny = "a bench.deep of wood"'
    rooms = {"control": words, "view": "from ..bench.deep import x", "bench": from_core}
    assert tree(tmp_path, **rooms) == []


def test_a_forbidden_import_in_the_package_ends_the_check(tmp_path, capsys):
    root = Path(__file__).parents[1] / "src"
    shutil.copytree(root, tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__", "*.gz"))
    file = tmp_path / "src" / "vsconstraints" / "simulation" / "loop.py"
    file.write_text(file.read_text("utf-8") + "\n\ndef f():\n    from ..images import sensor\n")
    assert structure.main([str(tmp_path / "src")]) == 1
    assert "vsconstraints.simulation.loop imports vsconstraints.images" in capsys.readouterr().out


def test_what_nothing_refers_to_is_named(tmp_path, capsys):
    """A name that stands where it is defined and nowhere else, unless a decorator has it."""
    text = (
        "def used():\n    pass\n\n\ndef unused():\n    used()\n\n\n@registered\ndef kept():\n  "
        "  pass\n"
    )
    assert package(tmp_path, a=text) == 1
    assert "exceeded: nothing refers to p.a.unused\n" in capsys.readouterr().out


def test_lines_are_told_apart():
    """By hand: a text of three lines with a blank one in it, a comment, code, and what is between
    them.
    """
    module = (
        '"""One.\n\nTwo.\n"""\n\n# a remark\nx = 1  # code\n"""Of x."""\n\n\ny = '
        '"""no\ndocstring"""\n'
    )
    assert structure.Lines.of(module, structure.ast.parse(module)) == (3, 6, 3)


def test_the_page_on_structure_names_what_is_there():
    """Folders and files under ``src/vsconstraints``, of which all folders are named, and tests by
    name.
    """
    root = Path(__file__).parents[1]
    page = (root / "docs" / "structure.md").read_text(encoding="utf-8")
    paths = re.findall(r"`([a-z_/]+(?:/|\.py))`", page)
    tests = re.findall(r"`(test_\w+)`", page)
    assert len(paths) > 40
    assert len(tests) >= 2  # of the pairs that stand twice
    package = root / "src" / "vsconstraints"
    assert [
        path for path in paths if not (package / path).exists() and not (root / path).exists()
    ] == []
    assert {f"{file.parent.name}/" for file in package.glob("*/__init__.py")} <= set(paths)
    text = "".join(file.read_text(encoding="utf-8") for file in (root / "tests").glob("test_*.py"))
    assert [test for test in tests if f"def {test}(" not in text] == []


def test_the_page_on_structure_states_the_limits_and_counts_the_named_mutants():
    root = Path(__file__).parents[1]
    page = " ".join((root / "docs" / "structure.md").read_text(encoding="utf-8").split())
    mutation = root / "checks" / "mutation"
    with (mutation / "noticed.tsv").open(encoding="utf-8", newline="") as file:
        noticed = {
            (line["file"], line["old"], line["new"])
            for line in csv.DictReader(file, delimiter="\t")
        }
    reasoned = {
        (mutant["file"], mutant["old"], mutant["new"])
        for mutant in tomllib.loads((mutation / "named.toml").read_text(encoding="utf-8"))["mutant"]
    }
    assert f"`--named`: {len(noticed)} mutants, each against one test" in page
    assert f"{len(reasoned)} of the named mutants have a reason" in page
    limits = (
        f"{structure.MAX_TOKENS_PER_LINE} of the package, "
        f"{structure.MAX_TOKENS_PER_LINE_OF_ROOM} of a folder",
        f"{structure.MAX_PACKED:.0%}".replace("%", " %"),
        f"{structure.MAX_CORE_TOKENS:,}",
        str(structure.MAX_FLOORS),
    )
    for limit in limits:
        assert f"| {limit} |" in page


def test_what_stands_twice_says_so_beside_it():
    """Each file of the table of pairs names the test that holds it and the other one together."""
    root = Path(__file__).parents[1]
    page = (root / "docs" / "structure.md").read_text(encoding="utf-8")
    table = page.split("## What stands twice")[1].split("## ")[0]
    rows = [line.split("|")[1:-1] for line in table.splitlines() if line.startswith("| ")][1:]
    assert rows
    for _, *files, test in rows:
        for file in re.findall(r"`([a-z_/]+\.py)`", "".join(files)):
            text = (root / "src" / "vsconstraints" / file).read_text(encoding="utf-8")
            assert test.strip(" `") in text, f"{file} does not name {test}"


def test_names_of_the_glossary_are_names_in_the_code():
    """Each name of the last column stands in the package, and no term is listed twice."""
    root = Path(__file__).parents[1]
    page = (root / "docs" / "glossary.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:-1] for line in page.splitlines() if line.startswith("| ")]
    rows = [row for row in rows if row[0].strip() != "term"]
    assert len(rows) > 25
    terms = [term.strip() for row in rows for term in row[0].split(",")]
    assert len(set(terms)) == len(terms)
    texts = [file.read_text(encoding="utf-8") for file in (root / "src").rglob("*.py")]
    words = set(re.findall(r"\w+", "".join(texts)))
    for *_, names in rows:
        for name in re.findall(r"`(\w+)`", names):
            assert name in words, name


PUBLIC = {"_replace", "_fields", "_exit"}
"""Of named tuples and of ``os``."""


def private(name: str) -> bool:
    """Whether a name is private; names that Python and notebooks ask for are not."""
    return name.startswith("_") and not name.startswith(("__", "_repr_")) and name not in PUBLIC


def test_no_test_needs_private_names():
    """Of modules and of what they make: what a test sets on itself or defines is its own."""
    found = []
    for file in Path(__file__).parent.rglob("*.py"):
        nodes = list(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))
        own = {
            node.attr
            for node in nodes
            if isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id == "self"
        }
        words = [node.attr for node in nodes if isinstance(node, ast.Attribute)]
        words += [
            alias.name for node in nodes if isinstance(node, ast.ImportFrom) for alias in node.names
        ]
        words += [
            argument.value.rpartition(".")[2]
            for node in nodes
            if isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and node.func.attr == "setattr"
            for argument in node.args[:2]
            if isinstance(argument, ast.Constant) and isinstance(argument.value, str)
        ]
        found += [f"{file.name}: {word}" for word in words if private(word) and word not in own]
    assert found == []


@pytest.mark.parametrize(
    ("statement", "others", "most_s"),
    [
        ("from vsconstraints.controllers import SlidingMode", {"typer", "rich"}, 0.3),
        (
            "from vsconstraints.controllers import make_controller; make_controller('sliding-mode')",
            {"typer", "rich"},
            0.3,
        ),
        ("import vsconstraints.cli", set(), 0.3),
        ("import vsconstraints.cli.application", set(), 0.5),
    ],
)
def test_a_law_and_the_help_load_nothing_that_they_do_not_need(
    statement: str, others: set[str], most_s: float
):
    """In little time beside that of NumPy, and without what takes as long to import."""
    heavy = {
        "pinocchio",
        "coal",
        "numba",
        "scipy",
        "qpsolvers",
        "daqp",
        "osqp",
        "proxsuite",
        "cvxpy",
        "matplotlib",
    }
    code = (
        f"import sys, time, numpy\nbefore = time.process_time()\n{statement}\n"
        f"print(sorted({heavy | others} & set(sys.modules)), time.process_time() - before)"
    )
    done = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        for _ in range(3)
    ]
    loaded, seconds = zip(*(run.stdout.rsplit(maxsplit=1) for run in done), strict=True)
    assert set(loaded) == {"[]"}
    assert (
        min(map(float, seconds)) < most_s
    )  # half of it or less on a machine that does nothing else
