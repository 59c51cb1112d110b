"""Calibration files as OpenCV and ROS write them, and what cannot be used of them."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from vsconstraints import Camera
from vsconstraints.errors import ConfigurationError
from vsconstraints.scenarios import Scenario
from vsconstraints.vision.calibration import read_calibration
from vsconstraints.vision.distortion import Distortion

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from checks import calibrations

EXAMPLES = Path(__file__).parent.parent / "examples"

K = np.array([[603.2, 0.0, 322.4], [0.0, 601.8, 236.1], [0.0, 0.0, 1.0]])
D = [-0.2831, 0.1042, 0.0007, -0.0004, -1.68e-7]


def by_opencv(path: Path, **further: Any) -> Path:
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    file.write("calibration_time", "Sun Nov 22 10:00:00 2026")
    for key, value in {
        "image_width": 640,
        "image_height": 480,
        "camera_matrix": K,
        "distortion_coefficients": np.array([D]),
        **further,
    }.items():
        file.write(key, value)
    file.release()
    return path


def ros(**changes: Any) -> dict[str, Any]:
    """A table as camera_calibration_parsers writes it."""
    table: dict[str, Any] = {
        "image_width": 640,
        "image_height": 480,
        "camera_name": "wrist",
        "camera_matrix": {"rows": 3, "cols": 3, "data": K.ravel().tolist()},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": list(D)},
        "rectification_matrix": {"rows": 3, "cols": 3, "data": np.eye(3).ravel().tolist()},
        "projection_matrix": {"rows": 3, "cols": 4, "data": [500.0] * 12},
        **changes,
    }
    return {key: value for key, value in table.items() if value is not None}


def written(path: Path, table: object) -> Path:
    path.write_text(yaml.safe_dump(table), encoding="utf-8")
    return path


def matrix(numbers: list[float]) -> dict[str, Any]:
    return {"rows": 1, "cols": len(numbers), "data": numbers}


def assert_read(eye: Camera, lens: Distortion | None = Distortion("brown-conrady", D)) -> None:  # noqa: B008
    assert eye.focal_px == (603.2, 601.8)
    assert eye.size_px == (640.0, 480.0)
    # OpenCV counts pixels' centres, and this package their edges
    assert eye.principal_point_px == (322.9, 236.6)
    assert eye.distortion == lens


def test_a_file_that_opencv_wrote_is_read_without_it(tmp_path: Path) -> None:
    file = by_opencv(tmp_path / "camera.yaml")
    assert file.read_text().startswith("%YAML:1.0")
    assert "!!opencv-matrix" in file.read_text()
    assert_read(Camera.from_calibration(file))


def test_a_file_of_ros_is_read(tmp_path: Path) -> None:
    file = written(tmp_path / "camera.yaml", ros())
    assert_read(Camera.from_calibration(file))
    # yaml-cpp writes numbers as no other does
    text = file.read_text().replace("-1.68e-07", "-1.68e-7")
    assert "-1.68e-7" in text
    file.write_text(text)
    assert_read(Camera.from_calibration(str(file), size_px=(640, 480)))


def test_a_printed_message_of_ros_is_read(tmp_path: Path) -> None:
    message = {"header": {"frame_id": "wrist"}, "height": 480, "width": 640, "distortion_model": "plumb_bob"}
    file = written(tmp_path / "info.yaml", {**message, "d": D, "k": K.ravel().tolist(), "binning_x": 0})
    file.write_text(file.read_text() + "---\n")
    assert_read(Camera.from_calibration(file))


@pytest.mark.parametrize(
    ("name", "coefficients", "lens"),
    [
        ("plumb_bob", D[:4], Distortion("brown-conrady", D[:4])),
        ("plumb_bob", [0.0] * 5, None),
        (None, D, Distortion("brown-conrady", D)),
        ("rational_polynomial", [0.1] * 8, Distortion("brown-conrady", [0.1] * 8)),
        ("rational_polynomial", [0.1] * 8 + [0.0] * 6, Distortion("brown-conrady", [0.1] * 8)),
        ("equidistant", [0.01, 0.0, 0.0, 0.0], Distortion("fisheye", [0.01, 0.0, 0.0, 0.0])),
        # θ_d = θ is not what a pinhole does
        ("equidistant", [0.0] * 4, Distortion("fisheye", [0.0] * 4)),
    ],
)
def test_models_of_ros_are_lenses(tmp_path: Path, name: str | None, coefficients: list[float], lens: Any) -> None:
    table = ros(distortion_model=name, distortion_coefficients=matrix(coefficients))
    assert_read(Camera.from_calibration(written(tmp_path / "camera.yaml", table)), lens)


def test_which_lens_it_is_can_be_said_where_a_file_does_not(tmp_path: Path) -> None:
    four = np.array([[0.01, 0.02, 0.03, 0.04]])
    silent = by_opencv(tmp_path / "silent.yaml", distortion_coefficients=four)
    fisheye = by_opencv(tmp_path / "fisheye.yaml", distortion_coefficients=four, fisheye_model=1)
    assert_read(Camera.from_calibration(silent), Distortion("brown-conrady", four[0].tolist()))
    assert_read(Camera.from_calibration(silent, distortion_model="fisheye"), Distortion("fisheye", four[0].tolist()))
    assert_read(Camera.from_calibration(fisheye), Distortion("fisheye", four[0].tolist()))
    with pytest.raises(ConfigurationError, match="of the distortion model fisheye, not brown-conrady"):
        Camera.from_calibration(fisheye, distortion_model="brown-conrady")


def test_points_are_where_ros_and_opencv_have_them_from_the_same_file(tmp_path: Path) -> None:
    file = by_opencv(tmp_path / "camera.yaml")
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_READ)
    theirs = [storage.getNode(key).mat() for key in ("camera_matrix", "distortion_coefficients")]
    points = np.random.default_rng(0).uniform((-0.4, -0.3, 1.0), (0.4, 0.3, 1.0), (20, 3))
    pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), *theirs)[0].reshape(-1, 2)
    eye = Camera.from_calibration(file)
    found = eye.to_corner(eye.distort(eye.pixels(points[:, :2])), "centres")
    np.testing.assert_allclose(found, pixels, atol=1e-9)


# --- what cannot be used ---


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"camera_matrix": None}, "the key 'camera_matrix' is missing; K or k would be taken"),
        ({"image_width": None}, "the key 'image_width' is missing"),
        ({"image_width": "wide"}, "image_width must be a positive number of pixels, not 'wide'"),
        ({"image_height": True}, "image_height must be a positive number"),
        ({"image_height": 0}, "image_height must be a positive number"),
        ({"camera_matrix": matrix([1.0] * 9)}, r"camera_matrix must be \[F_u, 0, c_x, 0, F_v"),
        ({"camera_matrix": matrix([0.0] * 9)}, r"camera_matrix must be \[F_u, 0, c_x, 0, F_v"),
        ({"camera_matrix": {"rows": 3, "cols": 3, "data": [1.0] * 8}}, "3 × 3 finite numbers as data; it has 8"),
        ({"camera_matrix": {"data": [1.0] * 9}}, "camera_matrix must have rows, cols and data"),
        ({"camera_matrix": {"rows": 3, "cols": 3, "data": ["a"] * 9}}, "3 × 3 finite numbers as data; it has 0"),
        ({"distortion_model": "thin_prism"}, "unknown distortion_model in .* 'thin_prism'.*plumb_bob"),
        ({"distortion_coefficients": matrix([0.1] * 3)}, "has 4 or 5 or 8 finite coefficients, not 3"),
        ({"distortion_coefficients": matrix([0.1] * 12)}, "has 4 or 5 or 8 finite coefficients, not 12"),
        ({"distortion_coefficients": matrix([float("nan")] * 5)}, "finite numbers"),
        ({"binning_x": 2, "binning_y": 1}, r"fewer pixels \(binning_x = '2'\): calibrate it as it is used"),
        (
            {"roi": {"x_offset": 10, "y_offset": 0, "width": 320, "height": 480, "do_rectify": True}},
            r"\(roi.x_offset = '10', roi.width = '320'\)",
        ),
        # the matrix is one of images twice as large
        (
            {"camera_matrix": {"rows": 3, "cols": 3, "data": [1206.4, 0, 645.0, 0, 1203.6, 472.7, 0, 0, 1]}},
            r"the principal point \(645, 472.7\) lies outside an image of 640 × 480 px",
        ),
    ],
)
def test_a_calibration_that_cannot_be_used_says_why(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    file = written(tmp_path / "camera.yaml", ros(**changes))
    with pytest.raises(ConfigurationError, match=words) as no:
        read_calibration(file)
    assert "camera.yaml" in str(no.value)


@pytest.mark.parametrize("text", ["", "just words", "a: [1", "\x00", "- 1\n- 2\n"])
def test_what_is_no_calibration_at_all_says_so(tmp_path: Path, text: str) -> None:
    (tmp_path / "camera.yaml").write_text(text)
    with pytest.raises(ConfigurationError, match=r"calibration.*camera\.yaml|camera\.yaml is no calibration"):
        read_calibration(tmp_path / "camera.yaml")


def test_a_file_that_runs_code_is_not_obeyed(tmp_path: Path) -> None:
    (tmp_path / "camera.yaml").write_text("image_width: !!python/object/apply:os.getcwd []\n")
    with pytest.raises(ConfigurationError, match="image_width must be a positive number of pixels, not a list"):
        read_calibration(tmp_path / "camera.yaml", size=None)
    with pytest.raises(ConfigurationError, match=r"cannot read the calibration .*No such file"):
        read_calibration(tmp_path / "none.yaml")


def test_mutated_files_are_read_or_refused_by_name(tmp_path: Path) -> None:
    """A sample of ``python -m checks.calibrations``: no raw error, nothing run or opened, no content, in no time."""
    found, outcomes = calibrations.findings(1, range(1000), tmp_path)
    assert found == []
    assert set(outcomes) == {"read", "refused"}
    assert min(outcomes.values()) > 50


def test_the_fuzz_sees_what_it_looks_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def opens(path: Path) -> Exception:
        Path(__file__).read_bytes()
        return ConfigurationError("fine")

    def waits(path: Path) -> Exception:
        time.sleep(0.2)
        return ConfigurationError("fine")

    watch = calibrations.Watch()
    monkeypatch.setattr(calibrations, "LIMIT", 0.1)
    for misbehaves, word in (
        (lambda path: ConfigurationError("fine"), ""),
        (lambda path: ConfigurationError(f"it says {calibrations.SECRET}"), "says too much"),
        (lambda path: ValueError("month must be in 1..12"), "ValueError"),
        (lambda path: eval("ConfigurationError('fine')"), "did more"),
        (opens, "did more"),
        (waits, "took 0.2"),
    ):

        def reads(path: Path, does: Any = misbehaves) -> None:
            raise does(path)

        monkeypatch.setattr(calibrations.Camera, "from_calibration", reads)
        wrong = calibrations.judge(tmp_path, watch)[1]
        assert wrong.startswith(word) if word else wrong == ""


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"image_width": float("inf")}, "image_width must be a positive number of pixels, not '.inf'"),
        ({"image_width": "1e400"}, "image_width must be a positive number of pixels, not '1e400'"),
        ({"image_width": 1e9}, "image_width must be a positive number of pixels, not '1000000000.0'"),
        ({"distortion_model": ["plumb_bob"]}, "distortion_model must be a name, not a list"),
        ({"fisheye_model": "maybe", "distortion_model": None}, "fisheye_model must be 0 or 1, not 'maybe'"),
        ({"image_width": "x" * 300}, "image_width must be a positive number of pixels, not a long text"),
    ],
)
def test_values_that_no_camera_has(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        read_calibration(written(tmp_path / "camera.yaml", ros(**change)))


def test_files_are_bounded(tmp_path: Path) -> None:
    file = written(tmp_path / "camera.yaml", ros())
    sound = file.read_text()
    os.mkfifo(tmp_path / "fifo")
    for text, words in (
        (calibrations.BOMB + sound, "line 2 has an alias"),
        (sound + "more: " + "[" * 11 + "]" * 11, "is nested deeper than 10 levels"),
        (sound + "more: [" + "1, " * 100_000 + "]", "it is larger than 250000 bytes"),
        (sound + "image_width: 1280\n", "line 56 has a key that is there already"),
        (sound + "more: [", r"line \d+, column \d+: it is no YAML"),
    ):
        file.write_text(text)
        begun = time.process_time()
        with pytest.raises(ConfigurationError, match=words):
            read_calibration(file)
        assert time.process_time() - begun < 2.0
    for special in ("/dev/zero", str(tmp_path / "fifo"), str(tmp_path)):
        with pytest.raises(ConfigurationError, match="it is no file"):
            read_calibration(special)
    with pytest.raises(ConfigurationError, match="cannot read the calibration"):
        read_calibration("nul\x00l")


def test_no_content_of_another_file_is_shown(tmp_path: Path) -> None:
    """A scenario that names any file as a calibration learns nothing of it."""
    for text in (
        "the root password is swordfish",
        "- swordfish\n",
        "password: swordfish\n",
        "a: [swordfish",
        "a: 'swordfish",
    ):
        (tmp_path / "shadow").write_text(text)
        with pytest.raises(ConfigurationError) as no:
            read_calibration(tmp_path / "shadow")
        assert "swordfish" not in str(no.value)
        assert "password" not in str(no.value)


def test_a_calibration_for_another_image_size_is_refused(tmp_path: Path) -> None:
    file = by_opencv(tmp_path / "camera.yaml")
    with pytest.raises(
        ConfigurationError, match="of images of 640 × 480 px, not of 1280 × 960 px: calibrate the camera"
    ):
        Camera.from_calibration(file, size_px=(1280, 960))


def test_a_file_without_a_size_is_told_it(tmp_path: Path) -> None:
    file = written(tmp_path / "intrinsics.yml", {"K": K.tolist(), "D": D})
    with pytest.raises(ConfigurationError, match=r"'image_width' is missing; .* Or say size_px"):
        Camera.from_calibration(file)
    assert read_calibration(file, size=(640.0, 480.0)) == read_calibration(by_opencv(tmp_path / "b.yaml"))
    assert Camera.from_calibration(file, size_px=(640, 480)).size_px == (640.0, 480.0)
    half = written(tmp_path / "half.yml", {"K": K.tolist(), "D": D, "image_width": 640})
    with pytest.raises(ConfigurationError, match="'image_height' is missing"):
        Camera.from_calibration(half, size_px=(640, 480))


def test_what_ros_says_of_whole_images_changes_nothing(tmp_path: Path) -> None:
    whole = {"x_offset": 0, "y_offset": 0, "height": 480, "width": 640, "do_rectify": False}
    said = read_calibration(written(tmp_path / "a.yaml", ros(binning_x=1, binning_y=0, roi=whole)))
    assert said == read_calibration(written(tmp_path / "b.yaml", ros()))


# --- in scenarios ---


def scenario(folder: Path, camera: str) -> Scenario:
    (folder / "own.toml").write_text(f'extends = "ur5-fov"\nduration = 0.1\n[camera]\n{camera}\n', encoding="utf-8")
    return Scenario.load(folder / "own.toml")


def test_a_scenario_names_its_calibration(tmp_path: Path) -> None:
    """It takes the place of what the scenario that is extended says of the camera, but for where it is mounted."""
    by_opencv(tmp_path / "camera.yaml")
    there = scenario(tmp_path, 'calibration = "camera.yaml"')
    assert [file.name for file in there.files] == ["camera.yaml"]
    eye = there.setup().scene.camera
    assert_read(eye)
    np.testing.assert_array_equal(eye.mount.t, [0.0, -0.06, -0.04])
    plain = Scenario.load("ur5-fov").setup().scene.camera
    assert plain.focal_px == (600.0, 600.0)
    assert plain.distortion is None


@pytest.mark.parametrize(
    ("camera", "words"),
    [
        ('calibration = "none.yaml"', "cannot read the calibration"),
        ('calibration = "camera.yaml"\nsize_px = [320, 240]', "of 640 × 480 px, not of 320 × 240 px"),
        ('calibration = "camera.yaml"\nfocal_px = [600, 600]', "the calibration says focal_px: give one of the two"),
        ('calibration = "camera.yaml"\nfocus = 1', "key in own.camera 'focus'.*camera_in_tip.*tip_in_camera"),
        ("calibration = 3", "calibration must be a string"),
        (
            'distortion = { model = "plumb_bob", coefficients = [0, 0, 0, 0] }',
            "unknown model .*'plumb_bob'.*brown-conr",
        ),
        ('distortion = { model = "fisheye" }', "key 'coefficients' is missing"),
    ],
)
def test_a_camera_that_is_told_wrongly_is_refused(tmp_path: Path, camera: str, words: str) -> None:
    by_opencv(tmp_path / "camera.yaml")
    with pytest.raises(ConfigurationError, match=words):
        scenario(tmp_path, camera).setup()


@pytest.mark.parametrize(("name", "model"), [("camera_info.yaml", "brown-conrady"), ("opencv_fisheye.yaml", "fisheye")])
def test_the_examples_can_be_read(name: str, model: str) -> None:
    eye = Camera.from_calibration(EXAMPLES / name, size_px=(640, 480))
    assert eye.distortion is not None
    assert eye.distortion.model == model
    assert eye.reach_px > 400.0
