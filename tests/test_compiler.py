"""What happens where there is no compiler, and what is kept of what is compiled."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from vsconstraints import compiled as kernels
from vsconstraints.compiled import checksums
from vsconstraints.compiled.cache import CachedFunction, sources, state_of

SCRIPT = """
import sys, numpy as np
from vsconstraints.controllers import HierarchicalQP, SlidingMode
from vsconstraints.rows import Rows, Task
assert "numba" not in sys.modules
rows = Rows(np.array([0.1, -9.0]), np.array([[1.0, 2.0], [0.5, 0.1]]), np.zeros(2), np.ones(2), ("a", "b"))
task = Task(np.eye(2), np.array([3.0, 4.0]))
for law in (SlidingMode(), SlidingMode(), HierarchicalQP()):
    command = law.command(rows, task)
    print(*command.qdd.tolist(), command.status, command.solver)
print("numba" in sys.modules)
"""


def run(folder, **environment):
    """Output and errors of the script."""
    source = str(Path(kernels.__file__).parents[2])
    path = os.pathsep.join([str(folder), source])
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env={**os.environ, "PYTHONPATH": path, **environment},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split("\n")[:-1], done.stderr


def test_compilation_can_be_turned_off(tmp_path):
    lines, errors = run(tmp_path, VSCONSTRAINTS_COMPILE="0")
    assert (lines[-1], errors) == ("False", "")


@pytest.mark.parametrize(
    ("numba", "reason"),
    [
        (
            "raise ImportError('Numba needs NumPy 1.0 or less')",
            "ImportError: Numba needs NumPy 1.0 or less",
        ),
        ("", "'numba' has no attribute '__version__'"),
    ],
)
def test_a_broken_compiler_is_told_once_and_the_definition_runs(tmp_path, numba, reason):
    expected, _ = run(tmp_path, VSCONSTRAINTS_COMPILE="0")
    (tmp_path / "numba.py").write_text(numba)
    lines, errors = run(tmp_path)
    assert lines[:-1] == expected[:-1]
    assert errors.count("RuntimeWarning") == 1
    assert reason in errors
    assert "without its compiler" in errors


def test_compilation_that_numba_is_told_to_leave_out_is_left_out(tmp_path):
    expected, _ = run(tmp_path, VSCONSTRAINTS_COMPILE="0")
    lines, errors = run(tmp_path, NUMBA_DISABLE_JIT="1")
    assert lines[:-1] == expected[:-1]
    assert errors.count("RuntimeWarning") == 1
    assert "NUMBA_DISABLE_JIT is set" in errors


@pytest.mark.parametrize("cut", ["nbi", "nbc"])
def test_a_compiled_file_that_was_cut_short_is_made_again(tmp_path, cut):
    code = "from vsconstraints import compiled as kernels; assert kernels.load('polylines')"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "VSCONSTRAINTS_COMPILE": "alone"}
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", code],
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        (file,) = tmp_path.rglob(f"polylines.search_*.{cut}")
        assert file.stat().st_size > 100
        os.truncate(file, 40)


def load_polylines(cache, code="", **variables):
    """A process that loads one module by a cache: what it writes to its standard error."""
    code = code or "from vsconstraints import compiled as kernels; assert kernels.load('polylines')"
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(cache),
        "VSCONSTRAINTS_COMPILE": "alone",
        **variables,
    }
    environment = {name: value for name, value in environment.items() if value is not None}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, (done.returncode, done.stderr)
    return done.stderr


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_a_damaged_compiled_file_is_made_again_with_a_note(tmp_path, kind):
    """Machine code with flipped bits would end every process that runs it, without an error."""
    load_polylines(tmp_path)
    (file,) = tmp_path.rglob(f"polylines.search_*.{kind}")
    whole = bytearray(file.read_bytes())
    for k in range(10):
        whole[(2 * k + 1) * len(whole) // 20] ^= 1 << (k % 8)
    file.write_bytes(whole)
    told = load_polylines(tmp_path)
    assert f"{file} is damaged and compiled again" in told
    assert load_polylines(tmp_path) == ""


def test_a_file_whose_checksum_was_not_written_is_made_again_without_a_note(tmp_path):
    """As where the process was ended in between."""
    load_polylines(tmp_path)
    (file,) = tmp_path.rglob("polylines.search_*.nbc.sha256")
    file.unlink()
    begun = file.with_suffix("").stat().st_mtime_ns
    assert "damaged" not in load_polylines(tmp_path)
    assert file.with_suffix("").stat().st_mtime_ns > begun
    assert load_polylines(tmp_path) == ""


def test_a_file_that_is_written_again_gets_another_checksum(tmp_path, capfd):
    file = tmp_path / "kernel.nbi"
    file.write_text("first")
    checksums.seal([file])
    file.write_text("second")
    later = file.stat().st_mtime_ns + 10**9
    os.utime(file, ns=(later, later))
    checksums.seal([file])
    checksums.remove_damaged([file])
    assert file.read_text() == "second"
    assert capfd.readouterr().err == ""


def test_a_checksum_that_cannot_be_read_is_one_of_a_damaged_file(tmp_path, capfd, monkeypatch):
    file = tmp_path / "kernel.nbi"
    file.write_text("whole")
    checksums.seal([file])

    def unreadable(file):
        raise OSError("input/output error")

    monkeypatch.setattr(checksums, "written_sum", unreadable)
    checksums.remove_damaged([file])
    assert not file.exists()
    assert "damaged" in capfd.readouterr().err


HOMELESS = """
import os, pwd

def nobody(*arguments):
    raise KeyError("getpwuid(): uid not found: 12345")

# as in a container whose user has no entry in /etc/passwd
pwd.getpwuid = pwd.getpwnam = nobody
from vsconstraints import compiled as kernels
assert kernels.load("polylines") and kernels.load("compiler").compiles()
"""


def test_a_user_without_a_home_runs_compiled(tmp_path):
    told = load_polylines(tmp_path, HOMELESS, HOME=None, XDG_CACHE_HOME=None)
    assert "without its compiler" not in told


def test_that_something_is_compiled_once_is_said_once(tmp_path):
    """Of the control step at first; a later process names what was not needed before, and the next
    one is silent.
    """
    more = "from vsconstraints.compiled import load; load('polylines'); load('delay')"
    told = [
        load_polylines(tmp_path),
        load_polylines(tmp_path, more),
        load_polylines(tmp_path, more),
    ]
    assert [text.count("compiling the control step, once") for text in told] == [1, 0, 0]
    assert [text.count("which nothing has needed before") for text in told] == [0, 1, 0]
    assert told[2] == ""


NESTED = """
from vsconstraints.compiled.cache import state_of

def shaped(x):
    names = x in {"a", "b", "c", "d", "e"}
    return sum(map(lambda each: each if names else 2.0 * each, [x]))

print(state_of("", (shaped,)))
"""


def test_a_formula_has_the_same_state_in_every_process(tmp_path):
    """Also one with functions inside, whose addresses differ, and with sets, whose order does."""
    names = set()
    for seed in ("1", "2", "3"):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONHASHSEED": seed}
        done = subprocess.run(
            [sys.executable, "-c", NESTED],
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=True,
        )
        names.add(done.stdout)
    assert len(names) == 1


def test_a_cache_that_cannot_be_written_is_told_once_and_the_definition_runs(tmp_path):
    expected, _ = run(tmp_path, VSCONSTRAINTS_COMPILE="0")
    (tmp_path / "file").write_text("not a folder")
    lines, errors = run(tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "file" / "cache"))
    assert lines[:-1] == expected[:-1]
    assert errors.count("RuntimeWarning") == 1
    assert "no folder to keep compiled code in" in errors


READ_ONLY = """
import os, sys, tempfile
cache, real, open_one = sys.argv[1], os.access, tempfile.TemporaryFile

def access(path, mode, **options):
    return not (mode & os.W_OK and str(path).startswith(cache)) and real(path, mode, **options)

def temporary(*arguments, dir=None, **options):
    if str(dir).startswith(cache):
        raise PermissionError(13, "Permission denied", str(dir))
    return open_one(*arguments, dir=dir, **options)

# whoever tests may be one to whom every file can be written
os.access, tempfile.TemporaryFile = access, temporary
from vsconstraints import compiled as kernels
assert kernels.load("polylines") is not None
"""


def test_a_filled_cache_that_cannot_be_written_is_used(tmp_path):
    """As of an image that one user builds and another one runs."""
    cache_folder = tmp_path / "cache"
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(cache_folder),
        "VSCONSTRAINTS_COMPILE": "alone",
    }
    fill = "from vsconstraints import compiled as kernels; assert kernels.load('polylines')"
    subprocess.run(
        [sys.executable, "-c", fill], env=environment, check=True, capture_output=True, timeout=300
    )

    def files():
        return {path: path.stat().st_mtime_ns for path in cache_folder.rglob("*") if path.is_file()}

    before = files()
    for path in (cache_folder, *cache_folder.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", READ_ONLY, str(cache_folder)],
        env={**environment, "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    for path in (cache_folder, *cache_folder.rglob("*")):
        path.chmod(0o755)
    assert (done.returncode, done.stderr) == (0, "")
    assert files() == before
    assert [path.name for path in tmp_path.iterdir()] == ["cache"]


PYTHON = {"accelerator", "cache", "checksums", "compiler", "numba_interface", "signatures"}
"""Modules in which nothing is compiled."""


def test_what_is_compiled_is_kept_by_the_state_of_all_code_it_calls():
    """Also of the files that kernels take constants from, which are compiled in and leave no
    trace.
    """
    compiler = kernels.load("compiler")
    package = Path(kernels.__file__).parents[1]
    files = {file.relative_to(package).with_suffix("").as_posix() for file in sources()}
    types = {"rows", "errors"}  # neither holds constants
    compiled = [*package.glob("compiled/*.py"), *package.glob("**/kernels/*.py")]
    assert {kernel.parent.parent.name for kernel in compiled} >= {
        "dynamics",
        "prediction",
        "velocity",
    }
    for kernel in compiled:
        own = kernel.relative_to(package).with_suffix("")
        assert own.as_posix() in files
        if kernel.stem in PYTHON:
            continue
        for node in ast.walk(ast.parse(kernel.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level == len(own.parts):
                module = (node.module or "").replace(".", "/")
                if module in types:
                    continue
                names = (
                    [f"{module}/{name.name}" for name in node.names]
                    if (package / module).is_dir()
                    else [module]
                )
                assert set(names) <= files, f"{kernel.name} imports from {names}"
    assert all(file.is_file() for file in sources())
    folder = compiler.interface.cache_folder(kernels.load("polylines").search.py_func)
    state = state_of(f"{compiler.numba.__version__} {sys.version} {compiler.interface.settings()}")
    assert any(folder.glob(f"polylines.search_{state}-*.nbi"))


def test_a_second_process_compiles_what_may_be_needed_next(tmp_path):
    """Here one needs the search alone; the second process begins with the laws, and ends with the
    first.

    Another one compiles what is asked of it, but where all was found compiled. Nor does a process
    that the first one starts, and that compiles something else, say again what it said.
    """
    code = (
        "import subprocess, sys, time; from pathlib import Path; from vsconstraints.compiled "
        "import load\n"
        "load('polylines')\n"
        "load('compiler').compile_ahead(['projection'])\n"
        "other = 'from vsconstraints.compiled import load; load(\"delay\")'\n"
        "subprocess.run([sys.executable, '-c', other], check=True)\n"
        "for name in sys.argv[2:]:\n"
        "    while not any(Path(sys.argv[1]).rglob(name + '.*.nbi')): time.sleep(0.2)"
    )
    for name, variables in (("alone", {"VSCONSTRAINTS_COMPILE": "alone"}), ("together", {})):
        kept = tmp_path / name
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(kept), **variables}
        awaited = ["task_priority", "projection"] if name == "together" else []
        done = subprocess.run(
            [sys.executable, "-c", code, str(kept), *awaited],
            env=environment, capture_output=True, text=True, timeout=240, check=True,
        )  # fmt: skip
        assert done.stderr.count("compiling the control step, once, for") == 1
        assert any(kept.rglob("polylines.*.nbi"))
    compiled = {file.name.partition(".")[0] for file in (tmp_path / "alone").rglob("*.nbi")}
    assert compiled >= {"polylines", "delay"}
    assert not compiled & {"task_priority", "projection"}
    found = (
        "import os; from vsconstraints.compiled import load\n"
        "load('polylines')\n"
        "load('compiler').compile_ahead(['saturation'])\n"
        "try: os.waitpid(-1, os.WNOHANG)\n"
        "except ChildProcessError: print('no other process')"
    )
    done = subprocess.run(
        [sys.executable, "-c", found], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout == "no other process\n"


def test_code_that_was_not_used_for_long_is_removed(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))

    def law():
        """A function of this module."""

    for i in range(12):
        for name in (f"test_compiler.law_{i:016}-1.py311", f"test_compiler.law_{i:016}-1.py311.1"):
            file = tmp_path / f"{name}.{'nbc' if name.endswith('.1') else 'nbi'}"
            file.touch()
            checksums.sum_file(file).touch()
            os.utime(checksums.sum_file(file), (1e9 + i, 1e9 + i))
    (tmp_path / "test_compiler.laws_0123456789abcdef-1.py311.nbi").touch()
    CachedFunction(law, "0123456789abcdef", tmp_path).remove_old(8)
    kept = {path.name.partition("-")[0] for path in tmp_path.iterdir()}
    last = {f"test_compiler.law_{i:016}" for i in range(4, 12)}
    assert kept == {"test_compiler.laws_0123456789abcdef", *last}


def test_of_several_that_need_a_function_one_compiles_it(tmp_path, monkeypatch):
    """The others wait: a function's lock is not held twice."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    order = []

    def other():
        with made.lock():
            order.append("second")

    made = CachedFunction(other, "0123456789abcdef", tmp_path)

    waiting = threading.Thread(target=other)
    with made.lock():
        waiting.start()
        waiting.join(0.2)
        order.append("first")
    waiting.join()
    assert order == ["first", "second"]
