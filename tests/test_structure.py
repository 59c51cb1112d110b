"""The code's structure: nothing imports in circles, and what counts is counted."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from checks import structure


def test_nothing_is_imported_in_circles(capsys):
    assert structure.main([]) == 0
    said = capsys.readouterr().out
    assert "circles of imports: none" in said


def test_circles_and_long_lists_are_found(tmp_path, capsys):
    package = tmp_path / "p"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "a.py").write_text("from . import b\n\n\ndef f(self, a, b, c, d, e, g, h, *, i, j):\n    pass\n")
    (package / "b.py").write_text("from .c import x\n")
    (package / "c.py").write_text("from .a import f\n\nx = 1\n")
    assert structure.main([str(tmp_path)]) == 1
    said = capsys.readouterr().out
    assert "circles of imports: p.a, p.b, p.c" in said
    assert "longest parameter lists: 9 p/a.py: f" in said
    assert "9 lines of Python in 4 files" in said
    assert structure.main([str(tmp_path / "nowhere")]) == 2


def test_the_page_on_structure_names_what_is_there():
    """Folders and files under ``src/vsconstraints``, of which all folders are named, and tests by name."""
    root = Path(__file__).parents[1]
    page = (root / "docs" / "structure.md").read_text(encoding="utf-8")
    paths = re.findall(r"`([a-z_/]+(?:/|\.py))`", page)
    tests = re.findall(r"`(test_\w+)`", page)
    assert len(paths) > 40
    assert len(tests) > 5
    package = root / "src" / "vsconstraints"
    assert [path for path in paths if not (package / path).exists()] == []
    assert {f"{file.parent.name}/" for file in package.glob("*/__init__.py")} <= set(paths)
    text = "".join(file.read_text(encoding="utf-8") for file in (root / "tests").glob("test_*.py"))
    assert [test for test in tests if f"def {test}(" not in text] == []
