"""Calibration files as OpenCV and ROS write them, and what cannot be used of them."""

from __future__ import annotations

import json
import os
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from checks import calibrations

from vsconstraints import Camera
from vsconstraints.errors import CalibrationWarning, ConfigurationError
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.vision.calibration import read_calibration
from vsconstraints.vision.distortion import Distortion

EXAMPLES = Path(__file__).parent.parent / "examples"
CAMERAS = Path(__file__).parent / "data" / "cameras"

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
    message = {
        "header": {"frame_id": "wrist"},
        "height": 480,
        "width": 640,
        "distortion_model": "plumb_bob",
    }
    file = written(
        tmp_path / "info.yaml", {**message, "d": D, "k": K.ravel().tolist(), "binning_x": 0}
    )
    file.write_text(file.read_text() + "---\n")
    assert_read(Camera.from_calibration(file))


@pytest.mark.parametrize(
    ("name", "coefficients", "lens"),
    [
        ("plumb_bob", D[:4], Distortion("brown-conrady", D[:4])),
        ("plumb_bob", [0.0] * 5, None),
        (None, D, Distortion("brown-conrady", D)),
        ("rational_polynomial", [0.01] * 8, Distortion("brown-conrady", [0.01] * 8)),
        ("rational_polynomial", [0.01] * 8 + [0.0] * 6, Distortion("brown-conrady", [0.01] * 8)),
        ("equidistant", [0.01, 0.0, 0.0, 0.0], Distortion("fisheye", [0.01, 0.0, 0.0, 0.0])),
        # θ_d = θ is not what a pinhole does
        ("equidistant", [0.0] * 4, Distortion("fisheye", [0.0] * 4)),
    ],
)
def test_models_of_ros_are_lenses(
    tmp_path: Path, name: str | None, coefficients: list[float], lens: Any
) -> None:
    table = ros(distortion_model=name, distortion_coefficients=matrix(coefficients))
    assert_read(Camera.from_calibration(written(tmp_path / "camera.yaml", table)), lens)


def test_four_coefficients_without_a_model_are_doubted(tmp_path: Path) -> None:
    four = np.array([[0.01, 0.02, 0.001, 0.002]])
    silent = by_opencv(tmp_path / "silent.yaml", distortion_coefficients=four)
    lens = Distortion("brown-conrady", four[0].tolist())
    with pytest.warns(CalibrationWarning, match="four coefficients of distortion and no model"):
        assert_read(Camera.from_calibration(silent), lens)
    assert_read(Camera.from_calibration(silent, distortion_model="brown-conrady"), lens)


def test_which_lens_it_is_can_be_said_where_a_file_does_not(tmp_path: Path) -> None:
    four = np.array([[0.01, 0.02, 0.03, 0.04]])
    silent = by_opencv(tmp_path / "silent.yaml", distortion_coefficients=four)
    fisheye = by_opencv(tmp_path / "fisheye.yaml", distortion_coefficients=four, fisheye_model=1)
    with pytest.warns(CalibrationWarning, match="tangential"):
        assert_read(Camera.from_calibration(silent), Distortion("brown-conrady", four[0].tolist()))
    assert_read(
        Camera.from_calibration(silent, distortion_model="fisheye"),
        Distortion("fisheye", four[0].tolist()),
    )
    assert_read(Camera.from_calibration(fisheye), Distortion("fisheye", four[0].tolist()))
    # what the caller says overrides the file's label, which may be wrong
    with pytest.warns(
        CalibrationWarning, match="tangential coefficients p₁ = 0.03, p₂ = 0.04 are larger"
    ):
        read = Camera.from_calibration(fisheye, distortion_model="brown-conrady")
    assert_read(read, Distortion("brown-conrady", four[0].tolist()))


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
        ({"camera_matrix": None}, "the key 'camera_matrix' is missing; K or k or M would be taken"),
        ({"image_width": None}, "the key 'image_width' is missing"),
        ({"image_width": "wide"}, "image_width must be a positive number of pixels, not 'wide'"),
        ({"image_height": True}, "image_height must be a positive number"),
        ({"image_height": 0}, "image_height must be a positive number"),
        ({"camera_matrix": matrix([1.0] * 9)}, r"camera_matrix must be \[F_u, 0, c_x, 0, F_v"),
        ({"camera_matrix": matrix([0.0] * 9)}, r"camera_matrix must be \[F_u, 0, c_x, 0, F_v"),
        (
            {"camera_matrix": {"rows": 3, "cols": 3, "data": [1.0] * 8}},
            "3 × 3 finite numbers as data; it has 8",
        ),
        (
            {"camera_matrix": {"rows": 3, "data": [1.0] * 9}},
            "camera_matrix must have rows, cols and data",
        ),
        ({"camera_matrix": {"rows": 3, "cols": 3}}, "camera_matrix must have rows, cols and data"),
        (
            {"camera_matrix": {"data": [1.0] * 8}},
            r"camera_matrix must be \[F_u, 0, c_x, 0, F_v, .* not 8 numbers",
        ),
        (
            {"calibration_model": "double_sphere"},
            "unknown calibration_model .*'double_sphere'.*distortion_model says",
        ),
        ({"distortion_model": None, "model": "omni"}, "unknown model .*'omni'"),
        ({"distortion_model": None, "lens": "omni"}, "unknown lens .*'omni'"),
        ({"Distortion-Type": "fov"}, "unknown Distortion-Type .*'fov'"),
        (
            {"camera_model": "fisheye"},
            "contradicts itself about the lens: camera_model = 'fisheye' and distortion_model = 'plumb_bob'",
        ),
        (
            {"distortion_model": "none"},
            "says that the lens has no distortion, but distortion_coefficients is not zero",
        ),
        (
            {"camera_matrix": {"rows": 3, "cols": 3, "data": ["a"] * 9}},
            "3 × 3 finite numbers as data; it has 0",
        ),
        (
            {"distortion_model": "thin_prism"},
            "unknown distortion_model in .* 'thin_prism'.*plumb_bob",
        ),
        (
            {"distortion_coefficients": matrix([0.1] * 3)},
            "has 4 or 5 or 8 finite coefficients, not 3",
        ),
        (
            {"distortion_coefficients": matrix([0.1] * 12)},
            "has 4 or 5 or 8 finite coefficients, not 12",
        ),
        ({"distortion_coefficients": matrix([float("nan")] * 5)}, "finite numbers"),
        (
            {"binning_x": 2, "binning_y": 1},
            r"fewer pixels \(binning_x = '2'\): calibrate it as it is used",
        ),
        (
            {
                "roi": {
                    "x_offset": 10,
                    "y_offset": 0,
                    "width": 320,
                    "height": 480,
                    "do_rectify": True,
                }
            },
            r"\(roi.x_offset = '10', roi.width = '320'\)",
        ),
        # the matrix is one of images twice as large
        (
            {
                "camera_matrix": {
                    "rows": 3,
                    "cols": 3,
                    "data": [1206.4, 0, 645.0, 0, 1203.6, 472.7, 0, 0, 1],
                }
            },
            r"the principal point \(645, 472.7\) lies outside an image of 640 × 480 px",
        ),
    ],
)
def test_a_calibration_that_cannot_be_used_says_why(
    tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    file = written(tmp_path / "camera.yaml", ros(**changes))
    with pytest.raises(ConfigurationError, match=words) as no:
        read_calibration(file)
    assert "camera.yaml" in str(no.value)


@pytest.mark.parametrize("text", ["", "just words", "a: [1", "\x00", "- 1\n- 2\n"])
def test_what_is_no_calibration_at_all_says_so(tmp_path: Path, text: str) -> None:
    (tmp_path / "camera.yaml").write_text(text)
    with pytest.raises(
        ConfigurationError, match=r"calibration.*camera\.yaml|camera\.yaml is not a calibration"
    ):
        read_calibration(tmp_path / "camera.yaml")


def test_a_file_that_runs_code_is_not_obeyed(tmp_path: Path) -> None:
    (tmp_path / "camera.yaml").write_text("image_width: !!python/object/apply:os.getcwd []\n")
    with pytest.raises(
        ConfigurationError, match="image_width must be a positive number of pixels, not a list"
    ):
        read_calibration(tmp_path / "camera.yaml", size=None)
    with pytest.raises(ConfigurationError, match=r"cannot read the calibration .*No such file"):
        read_calibration(tmp_path / "none.yaml")


def test_mutated_files_are_read_or_refused_by_name(tmp_path: Path) -> None:
    """A sample of ``python -m checks.calibrations``: no raw error, nothing run or opened, no
    content, in no time.
    """
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
        (
            {"image_width": float("inf")},
            "image_width must be a positive number of pixels, not '.inf'",
        ),
        ({"image_width": "1e400"}, "image_width must be a positive number of pixels, not '1e400'"),
        (
            {"image_width": 1e9},
            "image_width must be a positive number of pixels, not '1000000000.0'",
        ),
        ({"distortion_model": ["plumb_bob"]}, "distortion_model must be a name, not a list"),
        (
            {"fisheye_model": "maybe", "distortion_model": None},
            "fisheye_model must be 0 or 1, not 'maybe'",
        ),
        (
            {"image_width": "x" * 300},
            "image_width must be a positive number of pixels, not a long text",
        ),
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
        (sound + "image_width: 1280\n", "line 56 repeats a key"),
        (sound + "more: [", r"line \d+, column \d+: it is not valid YAML"),
    ):
        file.write_text(text)
        begun = time.process_time()
        with pytest.raises(ConfigurationError, match=words):
            read_calibration(file)
        assert time.process_time() - begun < 2.0
    for special in ("/dev/zero", str(tmp_path / "fifo"), str(tmp_path)):
        with pytest.raises(ConfigurationError, match="it is not a file"):
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
        ConfigurationError,
        match="for images of 640 × 480 px, not of 1280 × 960 px: calibrate the camera",
    ):
        Camera.from_calibration(file, size_px=(1280, 960))


def test_a_file_without_a_size_is_told_it(tmp_path: Path) -> None:
    file = written(tmp_path / "intrinsics.yml", {"K": K.tolist(), "D": D})
    with pytest.raises(ConfigurationError, match=r"'image_width' is missing; .* Or say size_px"):
        Camera.from_calibration(file)
    assert read_calibration(file, size=(640.0, 480.0)) == read_calibration(
        by_opencv(tmp_path / "b.yaml")
    )
    assert Camera.from_calibration(file, size_px=(640, 480)).size_px == (640.0, 480.0)
    half = written(tmp_path / "half.yml", {"K": K.tolist(), "D": D, "image_width": 640})
    with pytest.raises(ConfigurationError, match="'image_height' is missing"):
        Camera.from_calibration(half, size_px=(640, 480))


def test_what_ros_says_of_whole_images_changes_nothing(tmp_path: Path) -> None:
    whole = {"x_offset": 0, "y_offset": 0, "height": 480, "width": 640, "do_rectify": False}
    said = read_calibration(written(tmp_path / "a.yaml", ros(binning_x=1, binning_y=0, roi=whole)))
    assert said == read_calibration(written(tmp_path / "b.yaml", ros()))


# --- files as cameras' drivers and tools write them ---


def by_opencv_projected(points: Array, case: dict[str, Any]) -> Array:
    """(N, 2) pixels of points (N, 3) by OpenCV, from the numbers that a case expects."""
    fx, fy, cx, cy = case["K"]
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    coefficients = np.array(case["D"], dtype=float)
    still = np.zeros(3)
    if case["model"] == "fisheye":
        pixels = cv2.fisheye.projectPoints(points[:, None], still, still, matrix, coefficients)[0]
    else:
        pixels = cv2.projectPoints(
            points, still, still, matrix, coefficients if len(coefficients) else None
        )[0]
    projected: Array = pixels.reshape(-1, 2)
    return projected


def assert_as_opencv(eye: Camera, case: dict[str, Any]) -> None:
    """Each pixel is where OpenCV has it, to 1e-9 px."""
    assert eye.size_px == tuple(case["size"])
    points = np.random.default_rng(0).uniform((-0.4, -0.3, 1.0), (0.4, 0.3, 1.0), (200, 3))
    found = eye.to_corner(eye.distort(eye.pixels(points[:, :2])), "centres")
    np.testing.assert_allclose(found, by_opencv_projected(points, case), rtol=0.0, atol=1e-9)


CASES = json.loads((CAMERAS / "expected.json").read_text(encoding="utf-8"))["files"]
#: What is expected of files that the list of cases leaves open, or says in words.
EXPECTED = {
    "c10_oakd_rational14.yaml": {
        "K": [402.0, 402.0, 322.0, 198.0],
        "model": "brown-conrady",
        "D": [5.2, -12.1, 0.0004, -0.0002, 6.5, 5.1, -11.9, 6.3],
        "size": [640, 400],
    },
    "c13_list_D.yaml": {
        "K": [1158.6, 1156.0, 765.5, 588.7],
        "model": "brown-conrady",
        "D": [-0.17, 0.107, 0.0042, -0.0027, 0.0],
        "size": [1600, 1200],
    },
    "c16_opencv_json.json": CASES["c14_opencv_xml.xml"],
    "c19_windows_exponents_crlf.yaml": {
        "K": [537.65, 537.9, 340.0, 236.9],
        "model": "brown-conrady",
        "D": [-0.2776, 0.054, 0.0021, -0.00039, 0.0487],
        "size": [640, 480],
    },
    "c27_narrow_no_rows.yaml": {**CASES["c27_narrow_no_rows.yaml"], "size": [640, 480]},
    "c29_cxcy_at_edge_1080_to_720.yaml": {
        "K": [1380.0, 1380.0, 960.0, 540.0],
        "model": "none",
        "D": [],
        "size": [1280, 720],
        "warning": r"principal point \(960.5, 540.5\) px is at 75% of .* and 75% .* of another resolution\?",
    },
    "c30_plumb_bob_fisheye_T265.yaml": {
        "K": [285.6, 286.7, 424.6, 408.2],
        "model": "brown-conrady",
        "D": [-0.0022, 0.0376, -0.0364, 0.0059, 0.0],
        "size": [848, 800],
        "warning": r"tangential coefficients p₁ = -0.0364, .* fisheye \(distortion_model = \"fisheye\"\)\?",
    },
}
REFUSED = {
    "c08_typo_key.yaml": "'distortion_coefficients' is missing.*Is 'distortion_coefficents' "
    "misspelt",
    "c11_thinprism12.yaml": "has 4 or 5 or 8 finite coefficients, not 12",
    "c18_gbk_comment.yaml": "line 1 is in another encoding than UTF-8",
    "c20_skew.yaml": r"skew of 1.7 px as its second number, which moves pixels by up to 0.68 px",
    "c22_fxfy_autoware.yaml": r"this is a file with a key for each number \(fx, fy, .*write the numbers of one",
    "c23_orbslam.yaml": "this is a settings file of ORB-SLAM",
    "c25_stereo_opencv.yml": "this is OpenCV's file of a stereo pair",
    "c26_binning2.yaml": "binning_x = '2', binning_y = '2'",
    "c32_fisheye_skew.yaml": r"skew of 0.0586 px.*up to 0.072 px.*CALIB_FIX_SKEW.*or write 0",
}


def test_every_case_says_what_is_expected() -> None:
    files = {path.name for path in CAMERAS.iterdir()} - {"expected.json"}
    assert files == set(CASES)
    read = {name for name, case in CASES.items() if "K" in case} | set(EXPECTED)
    assert read.isdisjoint(REFUSED)
    assert read | set(REFUSED) == files
    assert all(name in REFUSED for name, case in CASES.items() if case["read"] is False)
    assert all(name in read for name, case in CASES.items() if case["read"] is True)


@pytest.mark.parametrize(
    "name", sorted({name for name, case in CASES.items() if "K" in case} | set(EXPECTED))
)
def test_files_are_read_as_opencv_has_their_numbers(name: str) -> None:
    case = EXPECTED.get(name, CASES[name])
    expects = (
        pytest.warns(CalibrationWarning, match=case["warning"])
        if "warning" in case
        else nullcontext()
    )
    with expects:
        eye = Camera.from_calibration(CAMERAS / name)
    assert_as_opencv(eye, case)


@pytest.mark.parametrize("name", sorted(REFUSED))
def test_files_that_cannot_be_used_are_refused_by_name(name: str) -> None:
    with pytest.raises(ConfigurationError, match=REFUSED[name]) as refused:
        Camera.from_calibration(
            CAMERAS / name, size_px=(640, 480) if name.startswith("c25") else None
        )
    assert name in str(refused.value)
    assert all(word in str(refused.value) for word in CASES[name].get("names", ()))


def test_a_wrong_label_is_overridden_by_the_caller() -> None:
    name = "c30_plumb_bob_fisheye_T265.yaml"
    eye = Camera.from_calibration(CAMERAS / name, distortion_model="fisheye")
    case = {**EXPECTED[name], "model": "fisheye", "D": EXPECTED[name]["D"][:4]}  # type: ignore[index]
    assert_as_opencv(eye, case)


@pytest.mark.parametrize(
    "key", ["distortion_model", "camera_model", "calibration_model", "lens_model", "model", "lens"]
)
@pytest.mark.parametrize(
    "name", ["fisheye", "opencv_fisheye", "equidistant", "Kannala Brandt4", "FISHEYE"]
)
def test_whatever_key_says_that_it_is_a_fisheye_is_heard(
    tmp_path: Path, key: str, name: str
) -> None:
    table = ros(distortion_model=None, distortion_coefficients=matrix([0.02, 0.01, 0.0, 0.0]))
    table[key] = name
    assert_read(
        Camera.from_calibration(written(tmp_path / "camera.yaml", table)),
        Distortion("fisheye", (0.02, 0.01, 0, 0)),
    )


@pytest.mark.parametrize("name", ["", None, "~", "none", "None"])
def test_a_lens_without_distortion_may_be_called_so(tmp_path: Path, name: str | None) -> None:
    table = {**ros(distortion_coefficients=[]), "distortion_model": name}
    assert_read(Camera.from_calibration(written(tmp_path / "camera.yaml", table)), None)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-32"])
def test_byte_order_marks_are_understood(tmp_path: Path, encoding: str) -> None:
    file = by_opencv(tmp_path / "camera.yaml")
    file.write_text(file.read_text(), encoding=encoding)
    assert_read(Camera.from_calibration(file))


def camchain(**changes: Any) -> dict[str, Any]:
    camera = {
        "camera_model": "pinhole",
        "intrinsics": [603.2, 601.8, 322.4, 236.1],
        "resolution": [640, 480],
    }
    return {
        **camera,
        "distortion_model": "equidistant",
        "distortion_coeffs": [0.02, 0.01, 0.0, 0.0],
        **changes,
    }


def test_camchains_of_kalibr_are_read_or_named(tmp_path: Path) -> None:
    lens = Distortion("fisheye", (0.02, 0.01, 0.0, 0.0))
    file = tmp_path / "camchain.yaml"
    assert_read(Camera.from_calibration(written(file, {"cam0": camchain()})), lens)
    # EuRoC's sensor.yaml
    euroc = camchain(
        distortion_model="radial-tangential", distortion_coefficients=D[:4], distortion_coeffs=None
    )
    euroc.pop("distortion_coeffs")
    assert_read(Camera.from_calibration(written(file, euroc)), Distortion("brown-conrady", D[:4]))
    for table, words in (
        (
            {"cam0": camchain(), "cam1": camchain()},
            r"this is a Kalibr camchain of 2 cameras \(cam0, cam1\): copy",
        ),
        (
            {"cam0": camchain(camera_model="omni")},
            r"this is a Kalibr camchain of a camera that is not a pinhole .*'omni'",
        ),
        ({"cam0": camchain(distortion_model="fov")}, "unknown distortion_model .*'fov'"),
        ({"cam0": camchain(intrinsics=[1.0, 2.0])}, "must be the four numbers f_u, f_v, c_u, c_v"),
        ({"cam0": camchain(resolution=None)}, "'image_width' is missing"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            Camera.from_calibration(written(file, table))


def test_xml_of_opencv_is_read_as_it_is_in_yaml(tmp_path: Path) -> None:
    assert read_calibration(by_opencv(tmp_path / "a.xml")) == read_calibration(
        by_opencv(tmp_path / "a.yaml")
    )
    file = by_opencv(
        tmp_path / "fisheye.xml",
        distortion_coefficients=np.array([[0.01, 0.02, 0.0, 0.0]]),
        fisheye_model=1,
    )
    assert_read(Camera.from_calibration(file), Distortion("fisheye", (0.01, 0.02, 0.0, 0.0)))


def test_xml_defines_no_entities_and_is_bounded(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    file = by_opencv(tmp_path / "camera.xml")
    secret.write_text("640")
    sound = file.read_text()
    entity = f'<!DOCTYPE opencv_storage [<!ENTITY width SYSTEM "file://{secret}">]>'
    for text, words in (
        (
            sound.replace("<opencv_storage>", f"{entity}<opencv_storage>").replace(
                ">640<", ">&width;<"
            ),
            "a document type",
        ),
        (sound.replace(">640<", ">&width;<"), "it is not valid XML"),
        (
            sound.replace("<opencv_storage>", "<opencv_storage>" + "<a>" * 20 + "</a>" * 20),
            "nested deeper than 10 levels",
        ),
        (
            sound.replace("</opencv_storage>", "<image_width>1</image_width></opencv_storage>"),
            "repeats a key",
        ),
        (
            sound.replace("</opencv_storage>", "<a>" + "1 " * 150_000 + "</a></opencv_storage>"),
            "larger than 250000 bytes",
        ),
        (sound.replace("opencv_storage", "root"), "its root is not OpenCV's <opencv_storage>"),
        ("<opencv_storage/>", "is not a calibration: it must be a table"),
    ):
        file.write_text(text)
        with pytest.raises(ConfigurationError, match=words):
            read_calibration(file)


# --- in scenarios ---


def test_a_scenario_says_at_the_start_what_of_a_calibration_seems_wrong(tmp_path: Path) -> None:
    three_quarters = np.array([[603.2, 0.0, 480.0], [0.0, 601.8, 236.1], [0.0, 0.0, 1.0]])
    by_opencv(tmp_path / "camera.yaml", camera_matrix=three_quarters)
    setup = scenario(tmp_path, 'calibration = "camera.yaml"').setup()
    (doubt,) = [doubt for doubt in setup.doubts if "principal point" in doubt]
    assert "75% of the image's width and 49% of its height" in doubt
    assert "are these intrinsics of another resolution?" in doubt


def scenario(folder: Path, camera: str) -> Scenario:
    (folder / "own.toml").write_text(
        f'extends = "ur5-fov"\nduration = 0.1\n[camera]\n{camera}\n', encoding="utf-8"
    )
    return Scenario.load(folder / "own.toml")


def test_a_scenario_names_its_calibration(tmp_path: Path) -> None:
    """It takes the place of what the scenario that is extended says of the camera, but for where it
    is mounted.
    """
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
        (
            'calibration = "camera.yaml"\nsize_px = [320, 240]',
            "of 640 × 480 px, not of 320 × 240 px",
        ),
        (
            'calibration = "camera.yaml"\nfocal_px = [600, 600]',
            "the calibration already states focal_px: give it in one place",
        ),
        (
            'calibration = "camera.yaml"\nfocus = 1',
            "key in own.camera 'focus'.*camera_in_tip.*tip_in_camera",
        ),
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


@pytest.mark.parametrize(
    ("name", "model"), [("camera_info.yaml", "brown-conrady"), ("opencv_fisheye.yaml", "fisheye")]
)
def test_the_examples_can_be_read(name: str, model: str) -> None:
    eye = Camera.from_calibration(EXAMPLES / name, size_px=(640, 480))
    assert eye.distortion is not None
    assert eye.distortion.model == model
    assert eye.reach_px > 400.0
