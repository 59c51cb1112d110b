"""A metric is two files: a function and a line. The example of docs/results.md, put into a copy of
the package.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from documents import DOCS, ROOT, blocks

CHECK = """
import sys
from pathlib import Path
from test_metrics import made
from test_reports import made as stored, result
from vsconstraints.comparisons.metrics import DEFINITIONS, RESULT_COLUMNS, score
from vsconstraints.reports import write_report

assert RESULT_COLUMNS[-1] == "camera_path_m" and "camera_path_m" in DEFINITIONS
assert score(made([[1.0, 2.0]]), None).result["camera_path_m"] == 0.0
lines = [result("tracking", violated="x"), result("a", camera_path_m=0.25), result("b", camera_path_m=0.5)]
report = write_report(stored(Path(sys.argv[1]), lines), figures=False).read_text()
details = (Path(sys.argv[1]) / "details.md").read_text()
assert "| Shortest way of the camera [mm] |" in report
assert "camera path [mm]" in report and "**250**" in report and "**camera_path_m**: Length" in details
assert "camera_path_m" in (Path(sys.argv[1]) / "results.csv").read_text().splitlines()[0]
"""


def test_one_small_file_and_one_line_are_a_metric(tmp_path: Path) -> None:
    package = shutil.copytree(
        ROOT / "src" / "vsconstraints",
        tmp_path / "src" / "vsconstraints",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    function, line = [
        block.code for block in blocks(DOCS / "results.md") if "camera_path" in block.code
    ]
    folder = package / "comparisons"
    (folder / "camera_path.py").write_text(function, encoding="utf-8")
    table = (folder / "metrics.py").read_text(encoding="utf-8")
    entry = "    " + line.partition("line = ")[2].rstrip() + ",\n"
    table = table.replace("))  # fmt: skip\n", f"{entry}))  # fmt: skip\n", 1)
    table = table.replace(
        "from .record import", "from .camera_path import camera_path\nfrom .record import"
    )
    (folder / "metrics.py").write_text(table, encoding="utf-8")
    paths = os.pathsep.join(map(str, (package.parent, ROOT / "tests")))
    check = [sys.executable, "-c", CHECK, str(tmp_path / "report")]
    done = subprocess.run(
        check, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
