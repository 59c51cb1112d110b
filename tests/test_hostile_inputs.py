"""Inputs that are none: each is refused with an error of this package that says what, where, and
what is right.
"""

from __future__ import annotations

import io
import json
import os
import signal
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from vsconstraints.bench.advice import advise
from vsconstraints.bench.evidence import Campaign, Evidence
from vsconstraints.bench.families.frozen import TestSet
from vsconstraints.bench.learning import policy
from vsconstraints.bench.learning.environment import ServoEnv
from vsconstraints.bench.learning.policy import read_weights
from vsconstraints.bench.study import SHIPPED, Situation, Study
from vsconstraints.comparisons import Suite
from vsconstraints.comparisons.tables import read_table
from vsconstraints.constraints.bodies import disabled_pairs
from vsconstraints.constraints.image_constraint import MAX_POINTS, zero_lines
from vsconstraints.controllers import Tracking
from vsconstraints.errors import ConfigurationError, InvalidInput, VsconstraintsError, listed
from vsconstraints.images.detectors import DETECTORS
from vsconstraints.images.tag_pose import locate_board
from vsconstraints.plugins.provenance import digest
from vsconstraints.plugins.regular_files import read_regular
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.vision.calibration import read_calibration

# --- files that are none ---


def _pipe(folder: Path) -> Path:
    os.mkfifo(folder / "pipe.toml")
    return folder / "pipe.toml"


NO_FILES: dict[str, Callable[[Path], Path]] = {
    "a named pipe": _pipe,
    "a device": lambda folder: Path("/dev/zero"),
    "a folder": lambda folder: folder,
}

READERS: dict[str, Callable[[Path], Any]] = {
    "a suite": Suite.load,
    "a campaign": Campaign.load,
    "weights": read_weights,
    "a study": Study.load,
    "a table": read_table,
    "an SRDF": disabled_pairs,
    "a calibration": read_calibration,
}


@pytest.fixture
def hurry() -> Iterator[None]:
    """End a test that waits."""

    def late(number: int, frame: object) -> None:
        raise TimeoutError("it waits")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.usefixtures("hurry")
@pytest.mark.parametrize("kind", NO_FILES)
@pytest.mark.parametrize("reader", READERS)
def test_what_is_no_file_is_refused_and_never_waited_for(
    kind: str, reader: str, tmp_path: Path
) -> None:
    path = NO_FILES[kind](tmp_path)
    with pytest.raises(ConfigurationError) as told:
        READERS[reader](path)
    assert path.name in str(told.value)


@pytest.mark.usefixtures("hurry")
def test_pipes_in_folders_of_results_and_test_sets_are_not_waited_for(tmp_path: Path) -> None:
    for name in ("manifest.json", "index.json"):
        os.mkfifo(tmp_path / name)
    for load in (Evidence.load, TestSet.load):
        with pytest.raises(ConfigurationError):
            load(tmp_path)
    assert digest(tmp_path / "manifest.json") == ""


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large.toml"
    with path.open("wb") as file:
        file.truncate(1_000_000_000)
    with pytest.raises(ConfigurationError, match=r"large\.toml: it has more than 100 MB"):
        Suite.load(path)
    assert read_regular(path.with_name("large.toml"), 2_000_000_000)[:3] == b"\0\0\0"


# --- weights ---


def _archive(*members: tuple[str, bytes]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return file.getvalue()


def _array(header: str, body: bytes = b"") -> bytes:
    text = header.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + body


HUGE = "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }"
WEIGHTS = {
    "no archive": b"nothing",
    "empty": b"",
    "a cut archive": _archive(("W0.npy", _array(HUGE)))[:60],
    "an array of 8 TB": _archive(("W0.npy", _array(HUGE))),
    "a header that is no Python": _archive(("W0.npy", _array("{'descr': '<f8"))),
    "a header with an open bracket": _archive(("W0.npy", _array("(((("))),
    "another type": _archive(
        ("W0.npy", _array("{'descr': 'x9', 'fortran_order': False, 'shape': (1,), }"))
    ),
    "a negative shape": _archive(
        ("W0.npy", _array("{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }"))
    ),
    "a version that is not known": _archive(("W0.npy", b"\x93NUMPY\x09\x00")),
    "no array": _archive(("W0.npy", b"text")),
}


@pytest.mark.parametrize("kind", WEIGHTS)
def test_weights_that_are_none_are_refused(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "weights.npz"
    path.write_bytes(WEIGHTS[kind])
    with pytest.raises(
        ConfigurationError,
        match=r"weights\.npz: weights cannot be read: .+write them with numpy\.savez",
    ):
        read_weights(path)


def test_weights_that_expand_to_more_than_they_may_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(policy, "MAX_BYTES", 10_000_000)
    np.savez_compressed(tmp_path / "weights.npz", W0=np.zeros((1500, 1000)), b0=np.zeros(1500))
    assert (tmp_path / "weights.npz").stat().st_size < 100_000
    with pytest.raises(ConfigurationError, match="its arrays have 12 MB, and may have 10"):
        read_weights(tmp_path / "weights.npz")


# --- laws and scenes ---


class Unprepared(Tracking):
    """Raises when it begins."""

    name = "unprepared"

    def reset(self, *arguments: Any, **options: Any) -> None:
        raise KeyError("no data")


def test_a_law_that_cannot_begin_fails_and_its_exception_is_told() -> None:
    ended = simulate(Scenario.load("example-2d-fov").setup(), Unprepared())
    assert ended.status == "failed"
    assert "KeyError: 'no data'" in ended.reason
    assert len(ended.t) == 0


@pytest.mark.parametrize("Ts", [5e-324, 1e-300, 1e-12])
def test_a_sampling_time_that_is_none_is_refused(Ts: float) -> None:
    scenario = Scenario.load("example-2d-fov").with_override("sampling_time", Ts)
    for duration in (15.0, 10.0 * Ts):
        with pytest.raises(
            VsconstraintsError, match=r"sampling_time must be 1e-09 s or more, not .* in seconds"
        ):
            scenario.with_override("duration", duration).setup()


def test_many_remarks_are_counted() -> None:
    assert listed(["a", "b"], "rows") == ["a", "b"]
    many = listed([f"row {i} is violated" for i in range(2000)], "rows")
    assert len("; ".join(many)) < 1000
    assert many[-1] == "… and 1,990 more rows"


def test_thousands_of_rows_that_are_violated_at_the_start_are_counted() -> None:
    setup = Scenario.load("example-2d-fov").setup()
    start = setup.world().evaluate(0.0, setup.q0, setup.qd0)
    zero = np.zeros(2000)
    labels = [f"row {i}" for i in range(2000)]
    rows = SimpleNamespace(
        labels=labels, phi=zero, Lf=zero, Lg=np.zeros((2000, setup.scene.robot.n))
    )
    violated = SimpleNamespace(pixels=start.pixels, rows=rows, sigma=np.ones(2000))
    world: Any = SimpleNamespace(evaluate=lambda *state: violated)
    remarks = [text for text in setup.check_start(world) if "violated at the start" in text]
    assert len(remarks) == 11
    assert remarks[0] == "row 0 is violated at the start: σ = 1"
    assert remarks[-1] == "… and 1,990 more rows that are violated at the start"


@pytest.mark.parametrize(
    ("size", "coarse"),
    [((640.0, 480.0), False), ((3840.0, 2160.0), False), ((6400.0, 4800.0), True)],
)
def test_the_grid_of_a_large_image_is_bounded(size: tuple[float, float], coarse: bool) -> None:
    """The curve is found all the same, to less than a hundredth of a pixel, and of ordinary cameras
    as before.
    """
    points = []

    def sigma(uv: Any) -> Any:
        return np.hypot(uv[..., 0], uv[..., 1]) - 100.0

    def gradient(uv: Any) -> Any:
        return uv / np.maximum(np.hypot(uv[..., 0], uv[..., 1]), 1e-9)[..., None]

    def grid(u: Any, v: Any) -> Any:
        points.append((len(u), len(v)))
        return np.hypot(u[None, :], v[:, None]) - 100.0

    (line,) = zero_lines(sigma, gradient, grid, size)
    ((across, down),) = points
    assert across * down <= 1.01 * MAX_POINTS
    assert ((across, down) != (int(1.25 * size[0]) + 1, int(1.25 * size[1]) + 1)) is coarse
    assert np.abs(np.hypot(*line.T) - 100.0).max() < 0.01


# --- studies ---


@pytest.fixture(scope="module")
def table() -> Any:
    """A few scenes of the study that comes with the package."""
    whole = pq.read_table(SHIPPED)
    return whole.filter(pa.array(whole["scene"].to_numpy() < 1))


ODD = {
    "empty": lambda n, kind: pa.nulls(n, kind),
    "text": lambda n, kind: pa.array(["x"] * n),
    "a whole number": lambda n, kind: pa.array([7] * n),
    "no number": lambda n, kind: pa.array([float("nan")] * n),
    "infinite": lambda n, kind: pa.array([float("inf")] * n),
    "a list": lambda n, kind: pa.array([[1]] * n),
    "negative": lambda n, kind: pa.array([-1] * n),
}
ASKED = Situation(joints=6, noise=0.5, delay=0.03, unknown_motion=True, constraints=("fov",))


@pytest.mark.parametrize("what", ODD)
def test_columns_of_a_study_that_hold_something_else(what: str, table: Any, tmp_path: Path) -> None:
    """Either the study is refused, or there is advice: never anything else.

    All columns are empty once; what else may stand in them is tried in every third.
    """
    path = tmp_path / "study.parquet"
    refused: dict[str, str] = {}
    place = list(ODD).index(what)
    for at, name in enumerate(table.column_names):
        if what != "empty" and at % 3 != place % 3:
            continue
        odd = table.set_column(at, name, ODD[what](table.num_rows, table[name].type))
        pq.write_table(odd.replace_schema_metadata(table.schema.metadata), path)
        try:
            advise(Study.load(path), ASKED)
        except VsconstraintsError as error:
            refused[name] = str(error)
    assert all("study.parquet" in text for text in refused.values())
    if what == "empty":
        assert {
            "family",
            "scene",
            "condition",
            "controller",
            "constraints",
            "status",
        } <= {*refused}


@pytest.mark.parametrize(
    ("key", "value"),
    [("requires", {"sliding-mode": 3}), ("requires", {}), ("frozen", {"ur5": 3}), ("files", {"a": 1}), ("files", 1),
     ("controllers", {"sliding-mode": 3})],
)  # fmt: skip
def test_facts_of_a_study_that_are_something_else(
    key: str, value: object, table: Any, tmp_path: Path
) -> None:
    path = tmp_path / "study.parquet"
    facts = json.loads(table.schema.metadata[b"vsconstraints"])
    changed = json.dumps({**facts, key: value}).encode()
    pq.write_table(
        table.replace_schema_metadata({**table.schema.metadata, b"vsconstraints": changed}), path
    )
    with pytest.raises(ConfigurationError):
        Study.load(path)


# --- the environment ---


@pytest.fixture(scope="module")
def servo() -> ServoEnv:
    return ServoEnv("planar-arm", count=3)


@pytest.mark.parametrize("scene", [1.5, 3, -1, "x", True, None, float("nan"), 10**30, [1]])
def test_scenes_that_an_environment_does_not_have(scene: object, servo: ServoEnv) -> None:
    with pytest.raises(
        ConfigurationError, match="planar-arm: scene must be an integer from 0 to 2"
    ):
        servo.reset(options={"scene": scene})
    assert servo.reset(options={"scene": np.int64(2)})[1]["scene"] == 2


@pytest.mark.parametrize(
    "action", [[np.nan] * 3, [np.inf] * 3, [0.0] * 4, "x", None, np.zeros((3, 1)), 0.0, [1, "x", 2]]
)
def test_actions_that_are_none(action: object, servo: ServoEnv) -> None:
    servo.reset(options={"scene": 1})
    with pytest.raises(InvalidInput, match="an action must be"):
        servo.step(action)  # type: ignore[arg-type]
    assert np.isfinite(servo.step(np.zeros(3))[1])


@pytest.mark.parametrize(
    "settings",
    [{"count": 0}, {"count": 1.5}, {"acceleration": -1.0}, {"acceleration": np.nan}, {"violation_weight": "x"},
     {"violation_weight": np.nan}, {"law": 3}, {"scenes": 3}, {"half": "x"}, {"condition": "x"}],
)  # fmt: skip
def test_environments_that_are_none(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError, match=next(iter(settings))):
        ServoEnv(**settings)


# --- images ---

IMAGES: dict[str, Any] = {
    "nothing": None,
    "text": "x",
    "a list": [[0] * 200] * 200,
    "one row": np.zeros(100, np.uint8),
    "colours": np.zeros((200, 200, 3), np.uint8),
    "numbers": np.zeros((200, 200)),
    "flags": np.zeros((200, 200), bool),
    "objects": np.zeros((5, 5), object),
    "empty": np.zeros((0, 0), np.uint8),
    "without rows": np.zeros((0, 5), np.uint8),
}


@pytest.mark.parametrize("kind", IMAGES)
@pytest.mark.parametrize("detector", DETECTORS)
def test_arrays_that_are_no_images(kind: str, detector: str) -> None:
    found = DETECTORS[detector]()
    with pytest.raises(
        InvalidInput, match=r"an image must be an array \(H, W\) of grey levels, uint8, not"
    ):
        found.find(IMAGES[kind])
    with pytest.raises(
        InvalidInput, match=r"an image must be an array \(H, W\) of grey levels, uint8, not"
    ):
        locate_board(IMAGES[kind], found, None, None)  # type: ignore[arg-type]
