"""``python -m checks.calibrations [--files N] [--seed S]``: damaged calibration files.

Files of OpenCV and ROS with a few changes, most of them harmful, are read as in scenarios. Each
must give a camera, or an error of this package that reveals nothing of the content of other files.
Reading must stay within a time limit, and must not run, import or open anything else. Failures are
printed with the file's number; then the exit code is 1. The same seed gives the same files.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from vsconstraints import Camera
from vsconstraints.errors import CalibrationWarning, VsconstraintsError

LIMIT = 5.0
"""Time limit of reading a file [s]; a millisecond is usual."""

SECRET = "correct horse battery staple"
"""Text in each file at a place without calibration data; no message may contain it."""

LONGEST = 600
"""Greatest length of a message, including its path."""

FORBIDDEN = (
    "import",
    "compile",
    "exec",
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "subprocess.Popen",
    "socket.connect",
)
"""Beginnings of audit events that no data may cause."""

MATRIX = "  rows: {}\n  cols: {}\n  data: [{}]\n"
ENTRIES = "603.2, 0., 322.4, 0., 601.8, 236.1, 0., 0., 1."
LENS = "-0.2831, 0.1042, 0.0007, -0.0004, -1.68e-07"
HEAD = "image_width: 640\nimage_height: 480\n"

FILES = (
    # as OpenCV writes it
    f'%YAML:1.0\n---\ncalibration_time: "{SECRET}"\n{HEAD}camera_matrix: !!opencv-matrix\n'
    + MATRIX.format(3, 3, ENTRIES).replace("  data", "  dt: d\n  data")
    + "distortion_coefficients: !!opencv-matrix\n"
    + MATRIX.format(1, 5, LENS).replace("  data", "  dt: d\n  data"),
    # as ROS writes it, to a file and to a terminal
    f"{HEAD}camera_name: "
    f"{SECRET}\ncamera_matrix:\n{MATRIX.format(3, 3, ENTRIES)}distortion_model: plumb_bob\n"
    f"distortion_coefficients:\n{MATRIX.format(1, 5, LENS)}",
    f"header:\n  stamp:\n    secs: 0\n  frame_id: '{SECRET}'\nheight: 480\nwidth: "
    f"640\ndistortion_model: plumb_bob\n"
    f"D: [{LENS}]\nK: [{ENTRIES}]\nbinning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: "
    f"0\n  height: 0\n---\n",
    # as OpenCV writes it in XML, and as Kalibr does
    f'<?xml version="1.0"?>\n<opencv_storage>\n<calibration_time>"{SECRET}"</calibration_time>\n'
    "<image_width>640</image_width>\n<image_height>480</image_height>\n"
    '<camera_matrix type_id="opencv-matrix">\n<rows>3</rows>\n<cols>3</cols>\n<dt>d</dt>\n'
    f"<data>{ENTRIES.replace(',', '')}</data></camera_matrix>\n"
    "<distortion_coefficients "
    'type_id="opencv-matrix">\n<rows>1</rows>\n<cols>5</cols>\n<dt>d</dt>\n'
    f"<data>{LENS.replace(',', '')}</data></distortion_coefficients>\n</opencv_storage>\n",
    f"cam0:\n  camera_model: pinhole\n  distortion_coeffs: [{LENS}]\n  distortion_model: radtan\n"
    f"  intrinsics: [603.2, 601.8, 322.4, 236.1]\n  resolution: [640, 480]\n  rostopic: {SECRET}\n",
    # files of other programs
    f"user: admin\npassword: {SECRET}\n",
    f"[mysqld]\npassword = {SECRET}\n\tsocket=/run/x: y\n",
)

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n"
    for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)

VALUES = (
    "", "~", "null", "true", "yes", "0", "-1", "640", "480.5", "1e400", "-1e400", "1.0e+400",
    "5e-324", "1e308",
    ".inf", "-.Inf", ".nan", "inf", "nan", "0x10", "0o7", "1_000", "1:30:00", "2026-13-45",
    "2026-11-22",
    "2026-11-22T25:61:61Z", "9" * 5000, "x" * 100_000, "words", "'", '"', "|", ">", "%", "@", "`",
    "&a", "*a",
    "!!int x", "!!float y", "!!binary z", "!!timestamp 1", "!!set {a}", "!!omap [a: 1]", "!!null x",
    "!", "!<>",
    "!!python/object/apply:os.system ['touch "
    "owned']", "!!python/name:os.system", "!!python/module:antigravity",
    "!!python/object/new:subprocess.Popen [['touch', "
    "'owned']]", "{<<: [x]}", "? [a]\n: b", "{[a]: b}", "{{a: b}: c}",
    "[]", "[[]]", "{}", "[1, [2, 3]]", "[640, 480]", "{rows: 3, cols: 3, data: x}",
    "{rows: 1e9, cols: 1e9, data: []}",
    "{rows: -1, cols: -9, data: [1, 2, 3, 4, 5, 6, 7, 8, "
    "9]}", "[" * 500 + "]" * 500, "[" * 100_000, "{a: " * 5000,
    "- " * 5000, "\n ? " * 3000, "[" + "1, " * 50_000 + "1]", "fisheye", "equidistant",
    "rational_polynomial", "\x00",
    "<!DOCTYPE a [<!ENTITY b SYSTEM "
    "'file:///etc/passwd'>]>", "&b;", "<", "<_/>", "<a>" * 1000, "none",
    "opencv_fisheye", "\x85", "\u2028", "\ud800", "\ufeff", "\t", "---", "...", "%YAML:1.0",
    "%TAG ! x",
)  # fmt: skip
"""Replacements of a value, or insertions."""


def mutated(seed: int, number: int) -> bytes:
    """Return a file with one to four changes; the same for the same numbers."""
    chance = random.Random(f"{seed} {number}")
    text = chance.choice(FILES[:5] * 5 + FILES)
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        text = chance.choice((_value, _value, _value, _inserted, _lines, _bomb))(text, chance)
    data = text.encode("utf-8", "surrogatepass")
    if chance.random() < 0.3:
        data = _bytes(data, chance)
    return data


def _value(text: str, chance: random.Random) -> str:
    lines = text.split("\n")
    at = chance.randrange(len(lines))
    key, colon, _ = lines[at].partition(":")
    lines[at] = f"{key}{colon} {chance.choice(VALUES)}"
    return "\n".join(lines)


def _inserted(text: str, chance: random.Random) -> str:
    at = chance.randrange(len(text) + 1)
    return text[:at] + chance.choice(VALUES) + text[at:]


def _lines(text: str, chance: random.Random) -> str:
    lines = text.split("\n")
    at, to = (chance.randrange(len(lines)) for _ in range(2))
    moved = lines[at : at + chance.randrange(3)] * chance.choice((1, 1, 30))
    return "\n".join([*lines[:to], *moved, *lines[to + chance.randrange(2) :]])


def _bomb(text: str, chance: random.Random) -> str:
    return BOMB + chance.choice((text, text.replace("640", "*i"), text.replace("[", "[*i, ")))


def _bytes(data: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(data) + 1)
    flipped = bytes([data[at] ^ 1 << chance.randrange(8)]) if at < len(data) else b""
    return chance.choice(
        (data[:at] + flipped + data[at + 1 :], data[:at], data[at:], data[:at] + data[at + 3 :])
    )


class Watch:
    """Notes events while a file is read, by an audit hook, which cannot be removed."""

    def __init__(self) -> None:
        self.allowed: Path | None = None
        self.seen: list[str] = []
        sys.addaudithook(self._note)

    def _note(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.allowed is not None and (
            event.startswith(FORBIDDEN)
            or (event == "open" and str(arguments[0]) != str(self.allowed))
        ):
            self.seen.append(f"{event} {arguments!r:.100}")


def judge(path: Path, watch: Watch) -> tuple[str, str]:
    """Read a file; return the outcome, and the failure, if any."""
    begun = perf_counter()
    watch.allowed = path
    outcome = "read"
    wrong = ""
    try:
        with warnings.catch_warnings(action="ignore", category=CalibrationWarning):
            Camera.from_calibration(path)
    except VsconstraintsError as error:
        outcome = "refused"
        said = str(error)
        if SECRET[:12] in said or len(said) > LONGEST:
            wrong = f"says too much: {said!r:.500}"
    except Exception as error:  # any other error is a finding
        outcome = "raised"
        wrong = f"{type(error).__name__}: {error!s:.500}"
    watch.allowed = None
    if watch.seen:
        wrong = f"did more than read it: {watch.seen}"
        watch.seen = []
    if perf_counter() - begun > LIMIT:
        wrong = f"took {perf_counter() - begun:.1f} s"
    return outcome, wrong


def findings(seed: int, numbers: range, folder: Path) -> tuple[list[str], Counter[str]]:
    """Read these files; return failures, and the number of files by outcome."""
    watch = Watch()
    found = []
    outcomes = Counter[str]()
    path = folder / "camera.yaml"
    path.write_bytes(FILES[0].encode())
    Camera.from_calibration(path)  # imports the modules that reading needs
    for number in numbers:
        path.write_bytes(mutated(seed, number))
        with np.errstate(all="ignore"):
            outcome, wrong = judge(path, watch)
        outcomes[outcome] += 1
        found += [f"file {number} of seed {seed}: {wrong}"] if wrong else []
    return found, outcomes


def main(arguments: Sequence[str] | None = None) -> int:
    """Read all files and print failures; return 1 if there are any."""
    parser = argparse.ArgumentParser(
        prog="python -m checks.calibrations", description="Read any calibration file."
    )
    parser.add_argument("--files", type=int, default=10_000, help="how many (default: 10000)")
    parser.add_argument("--seed", type=int, default=0, help="of all files (default: 0)")
    chosen = parser.parse_args(arguments)
    begun = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        found, outcomes = findings(chosen.seed, range(chosen.files), Path(folder))
    for line in found:
        print(line)
    said = ", ".join(f"{number} {outcome}" for outcome, number in sorted(outcomes.items()))
    print(f"{chosen.files} files in {perf_counter() - begun:.0f} s: {said}; {len(found)} findings")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
