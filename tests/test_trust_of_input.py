"""What files and ports may do that come from elsewhere: docs/trust.md, cell by cell."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from distributed import Client, LocalCluster

from documents import DOCS
from test_calibration import ros, written
from test_urdf import TETRAHEDRON
from vsconstraints import Camera, Robot
from vsconstraints.bench.tuning.problem import Judged
from vsconstraints.bench.tuning.tune import Journal
from vsconstraints.comparisons import Suite
from vsconstraints.compiled import prepare
from vsconstraints.errors import VsconstraintsError

NETWORK = ("socket.connect", "socket.bind", "socket.getaddrinfo", "socket.sendto", "urllib.Request")
PROCESSES = ("os.system", "os.exec", "os.posix_spawn", "os.fork", "subprocess.Popen")
CHANGES = (
    "os.remove",
    "os.rename",
    "os.mkdir",
    "os.rmdir",
    "os.truncate",
    "os.symlink",
    "os.link",
    "shutil.",
)
MARK = "HAS_RUN"
OWN = (
    f"import os\nos.environ['{MARK}'] = '1'\nfrom vsconstraints.controllers import Tracking as "
    f"Law\n"
)


@dataclass
class Seen:
    """What was done: files read and changed, addresses spoken to, processes."""

    read: set[str] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    network: set[str] = field(default_factory=set)
    run: set[str] = field(default_factory=set)


_seen: list[Seen] = []


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    for seen in _seen or ():  # None once the interpreter ends
        if event == "open" and isinstance(arguments[0], (str, os.PathLike)):
            _, mode, flags = arguments
            writes = (
                any(letter in mode for letter in "wax+")
                if mode
                else flags & (os.O_WRONLY | os.O_RDWR)
            )
            (seen.written if writes else seen.read).add(os.fspath(arguments[0]))
        elif event.startswith(CHANGES):
            seen.written.add(str(arguments[0]))
        elif event.startswith(NETWORK):
            seen.network.add(repr(arguments[1:]))
        elif event.startswith(PROCESSES):
            seen.run.add(event)


sys.addaudithook(_note)


@contextmanager
def watched(seen: Seen | None = None) -> Iterator[Seen]:
    """What is done meanwhile, added to what was."""
    seen = seen or Seen()
    os.environ.pop(MARK, None)
    _seen.append(seen)
    try:
        yield seen
    finally:
        _seen.remove(seen)
        if os.environ.pop(MARK, ""):
            seen.run.add("own code")


def toml(folder: Path) -> Seen:
    """A suite with a law of its own, and a scenario that names a calibration; without the law
    nothing is run.
    """
    written(folder / "eye.yaml", ros())
    (folder / "mine.py").write_text(OWN)
    (folder / "scene.toml").write_text('extends = "ur5-fov"\n[camera]\ncalibration = "eye.yaml"\n')
    suite = folder / "suite.toml"
    for controllers, runs in (
        ('[controllers.mine]\ntype = "mine:Law"\n', True),
        ("[controllers.tracking]\n", False),
    ):
        suite.write_text(f'scenarios = ["scene.toml"]\n{controllers}')
        with watched() as seen:
            loaded = Suite.load(suite).checked()
            loaded.scenarios[0].setup()
            for entry in loaded.controllers:
                entry.make()
        assert seen.run == ({"own code"} if runs else set())
        if runs:
            found = seen
    assert {Path(path).name for path in found.read if path.startswith(str(folder))} >= {
        "suite.toml",
        "eye.yaml",
    }
    return found


def calibration(folder: Path) -> Seen:
    (folder / "mine.py").write_text(OWN)
    file = written(folder / "eye.yaml", ros())
    with watched() as seen:
        Camera.from_calibration(file)
    for value in (
        "!!python/module:mine",
        "!!python/object/apply:os.system ['touch here']",
        "!include /etc/passwd",
    ):
        file.write_text(f"image_width: {value}\n")
        with watched(seen), suppress(VsconstraintsError):
            Camera.from_calibration(file)
        with watched(seen), suppress(VsconstraintsError):
            Camera((600.0, 600.0), (640.0, 480.0)).mounted(camera_in_tip=file)
    entity = '<!DOCTYPE opencv_storage [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    file.write_text(f"{entity}<opencv_storage><image_width>&x;</image_width></opencv_storage>")
    with watched(seen), suppress(VsconstraintsError):
        Camera.from_calibration(file)
    assert {path for path in seen.read if "site-packages" not in path} <= {str(folder / "eye.yaml")}
    return seen


def urdf(folder: Path) -> Seen:
    """With a mesh, an entity that stands for another file, and meshes that would have to be
    fetched.
    """
    (folder / "a.stl").write_text(TETRAHEDRON)
    secret = folder / "secret.txt"
    secret.write_text("swordfish")
    arm = (
        '<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY x SYSTEM "{entity}">]><robot '
        'name="arm"><link name="base"/>'
    )
    arm += (
        '<link name="tip"><collision><geometry><mesh '
        'filename="{mesh}"/></geometry></collision></link>'
    )
    arm += (
        '<joint name="{name}" type="revolute"><parent link="base"/><child link="tip"/><axis '
        'xyz="0 0 1"/>'
    )
    arm += '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
    seen = Seen()
    outcomes = []
    for mesh, name in (("a.stl", "one"), ("http://127.0.0.1:9/a.stl", "one"), ("a.stl", "&x;")):
        (folder / "arm.urdf").write_text(arm.format(mesh=mesh, name=name, entity=secret.as_uri()))
        with watched(seen):
            try:
                outcomes.append(repr(Robot.from_urdf(folder / "arm.urdf", "tip")))
            except VsconstraintsError as error:
                outcomes.append(f"refused: {error}")
    assert not outcomes[0].startswith("refused")
    assert not any("swordfish" in outcome for outcome in outcomes)
    assert str(secret) not in seen.read
    return seen


def journal(folder: Path) -> Seen:
    kept = folder / "journal.jsonl"
    with watched() as seen:
        Journal(kept).add(("law", "{}"), {"": Judged((0.1, 3.0, 1.0), 0.0, 1, 1, 1)})
        kept.write_bytes(kept.read_bytes() + b'{"law": "mine:Law"')
        assert ("law", "{}") in Journal(kept)
    assert seen.written == {str(kept)} == seen.read
    seen.written.clear()  # but for itself
    return seen


def dask(folder: Path) -> Seen:
    """Anything, without keys: which is why the recipe has them (tests/test_cluster.py)."""
    found = Seen()
    code = (
        f"(open({str(folder / 'here')!r}, 'w').close(), __import__('socket').socket().close(), "
        f"4)[2]"
    )
    with (
        LocalCluster(
            n_workers=1, processes=False, dashboard_address=":0", protocol="tcp", host="127.0.0.1"
        ) as local,
        Client(local.scheduler_address, set_as_default=False) as anybody,
    ):
        assert anybody.submit(eval, code).result() == 4
    assert (folder / "here").exists()
    found.run = {"eval"}
    found.written = {"here"}
    found.network = {"socket"}
    return found


ROWS: dict[str, Callable[[Path], Seen]] = {
    "scenario, suite, family or campaign (TOML)": toml,
    "calibration of a camera, hand–eye calibration (YAML, XML)": calibration,
    "URDF, SRDF or mesh": urdf,
    "journal of a tuning": journal,
    "port of a Dask scheduler or worker": dask,
}


def cells() -> dict[str, list[str]]:
    lines = (DOCS / "trust.md").read_text("utf-8").splitlines()
    return {
        cells[0]: cells[1:]
        for cells in (
            [cell.strip() for cell in line.strip("|").split("|")]
            for line in lines
            if line.startswith("| ")
        )
    }


@pytest.mark.parametrize("row", ROWS)
def test_each_cell(row: str, tmp_path: Path) -> None:
    prepare()  # compiling may take a second process
    run, _, write, network = cells()[row]
    seen = ROWS[row](tmp_path)
    own = {path for path in seen.written if "cache" not in path and path != os.devnull}
    assert run.startswith("yes") == bool(seen.run), seen.run
    assert write.startswith("yes") == bool(own), own
    assert network.startswith("yes") == bool(seen.network), seen.network
