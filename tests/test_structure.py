"""The code's structure: nothing imports in circles, and what counts is counted."""

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
