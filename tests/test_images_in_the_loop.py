"""What a controller is told that sees images: when, how it moves on, and what happens without
any.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from vsconstraints.comparisons.suite import require_variety
from vsconstraints.controllers import HierarchicalQP, SlidingMode, Tracking
from vsconstraints.errors import ConfigurationError
from vsconstraints.images.detectors import Pixels
from vsconstraints.images.sensor import ImageSensor, SceneRenderer
from vsconstraints.images.settings import ImageSettings
from vsconstraints.robots.geometry import Pose, distance
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Trajectory, simulate
from vsconstraints.view.commands import frames as command
from vsconstraints.view.frames import EXPECTED, FOREIGN, frames, with_tags, write_frames
from vsconstraints.vision.scene import State


def made(duration: float = 0.2, scene: str = "ur5-images", **settings: Any) -> Setup:
    scenario = Scenario.load(scene).with_override("duration", duration)
    for key, value in settings.items():
        scenario = scenario.with_override(key.replace("__", "."), value)
    return scenario.setup()


def sensor(setup: Setup) -> ImageSensor:
    found = setup.sensor()
    assert isinstance(found, ImageSensor)
    return found


def seen_on_the_way(
    there: Setup, until: float, speed: float = 0.3
) -> tuple[list[float], list[float], list[float]]:
    """Greatest errors of pixels, of the camera [m], and of depths [m], sample after sample, of an
    arm that moves.
    """
    eye = sensor(there)
    control = there.control()
    errors = []
    direction = np.array([1.0, 0.3, -0.2, 0.5, 0.2, 1.0])
    for k in range(round(until / there.Ts)):
        t = k * there.Ts
        q = there.q0 + speed * t * direction
        qd = speed * direction
        true = there.scene.evaluate(t, q, qd)
        told = control.evaluate_measured(t, q, qd, eye.measured(k, q, qd))
        off = np.abs(told.pixels - true.pixels.position).max()
        depth = control.packed.step.seen["depth"]
        place = Pose(told.camera_R, told.camera_t)
        errors.append((off, distance(place, true.camera)[0], np.abs(depth - true.depth).max()))
    return tuple(map(list, zip(*errors, strict=True)))  # type: ignore[return-value]


def test_what_an_image_shows_moves_on_with_the_arm() -> None:
    """300 px/s and more: held images are off by latency and period times that, moved ones by the
    detector's noise.
    """
    moved, places, depths = seen_on_the_way(made(), 0.2)
    assert max(moved) < 0.5
    assert max(places) < 2e-3
    assert max(depths) < 1e-3
    held, _, _ = seen_on_the_way(made(sensor__prediction=False), 0.2)
    late = held[1:]
    assert held[0] < 0.5
    # the first image is held until the second can be used, 0.03 s after it was taken at 0.034 s
    assert int(np.argmax(np.diff(held) < -1.0)) == round(0.064 / 0.002) - 1
    assert max(late) > 10.0
    assert np.mean(late) > 20.0 * np.mean(moved)


def test_images_come_at_their_own_rate_and_late() -> None:
    there = made(sensor__rate_hz=45.0, sensor__latency_s=0.011)
    eye = sensor(there)
    for k in range(60):
        eye.measured(k, there.q0, there.qd0)
        # asked twice in a sample, it says the same
        assert eye.measured(k, there.q0, there.qd0) is eye.measured(k, there.q0, there.qd0)
    taken = [one.taken for one in eye.exposures]
    # the first samples of 2 ms that are not before 0, 1/45, 2/45, …
    np.testing.assert_allclose(taken, [0.0, 0.024, 0.046, 0.068, 0.09, 0.112])
    eye.reset()
    assert not eye.exposures


def test_depth_is_what_is_asked_for() -> None:
    there = made()
    true = there.scene.evaluate(0.0, there.q0, there.qd0).depth
    for depth, wanted in (("model", true), (0.37, np.full(4, 0.37))):
        told = sensor(made(sensor__depth=depth)).measured(0, there.q0, there.qd0).depth
        assert told is not None
        np.testing.assert_allclose(told, wanted, atol=1e-12)
    measured = sensor(there).measured(0, there.q0, there.qd0).depth
    assert measured is not None
    assert 0.0 < np.abs(measured - true).max() < 1e-3


def test_every_law_sees_the_same_noise() -> None:
    there = made()
    again = made()
    other = Scenario.load("ur5-images").setup(seed=1)
    state = there.scene.evaluate(0.0, there.q0, there.qd0)
    first = there.photographer().image(3, state)
    np.testing.assert_array_equal(first, again.photographer().image(3, state))
    assert (first != there.photographer().image(4, state)).mean() > 0.5
    assert (first != other.photographer().image(3, state)).mean() > 0.5


def test_a_run_by_images_is_near_the_one_by_exact_pixels() -> None:
    """Both forms, and both features; what is left is what 0.05 px at 0.5 m make, sample for
    sample.
    """
    for scene in ("ur5-fov", "ur5-image"):
        exact = simulate(made(0.3, scene), HierarchicalQP())
        images = simulate(made(0.3, scene, sensor="images"), HierarchicalQP())
        assert images.compiled
        assert 1e-7 < np.abs(images.q - exact.q).max() < 5e-3
        assert np.abs(images.features_px - exact.features_px).max() < 4.0


@pytest.mark.parametrize(
    ("scene", "most"),
    [
        ("eye-to-hand-pbvs", 0.1),
        ("moving-target", 0.1),
        ("moving-target-unknown", 2.0),
        ("panda-fov", 0.3),
    ],
)
def test_any_scene_with_markers_in_a_plane_can_be_seen(scene: str, most: float) -> None:
    """A motion that is not told leaves what it makes in the time until an image is there."""
    exact = simulate(made(0.15, scene), SlidingMode())
    images = simulate(made(0.15, scene, sensor="images"), SlidingMode())
    assert images.status == exact.status
    assert images.reason.startswith("still moving")
    off = np.abs(images.features_px - exact.features_px).max()
    assert 0.0 < off < most
    assert np.abs(exact.features_px - exact.features_px[0]).max() > 5.0 * off


def test_trials_differ_by_the_noise_of_their_images() -> None:
    scenario = Scenario.load("ur5-image")
    require_variety(scenario.with_override("sensor", "images"), 2, 0)
    with pytest.raises(ConfigurationError, match="2 trials of ur5-image would be identical"):
        require_variety(scenario.with_override("sensor", {"type": "images", "noise": 0.0}), 2, 0)


def test_an_arm_with_mass_and_a_camera_that_is_not_quite_known_see_images_too() -> None:
    there = made(
        0.1,
        plant={"type": "dynamics"},
        disturbances={
            "mount_translation_error": [0.002, 0.0, 0.0],
            "depth_factor": 1.1,
            "focal_factor": [1.01, 1.01],
        },
    )
    run = simulate(there, SlidingMode())
    assert run.status == "unfinished", run.reason
    assert "images" not in run.reason


# --- nothing to see ---


def blinded(
    monkeypatch: pytest.MonkeyPatch, first: int, last: int, duration: float, **settings: Any
) -> Trajectory:
    """A run in which images of those numbers are grey."""
    usual = SceneRenderer.image

    def image(self: SceneRenderer, number: int, state: State) -> Pixels:
        picture = usual(self, number, state)
        return np.full_like(picture, 100) if first <= number <= last else picture

    monkeypatch.setattr(SceneRenderer, "image", image)
    return simulate(made(duration, **settings), Tracking())


@pytest.mark.parametrize("compiled", [True, False])
def test_without_images_the_arm_is_braked_and_goes_on_when_there_are_some(
    compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not compiled:
        monkeypatch.setattr(
            "vsconstraints.control.control_step.ControlStep.bound", lambda step: None
        )
    # the last one is taken at 0.1 s; at 0.1 + 0.03 + 0.034 + 0.05 s patience ends, at 0.434 + 0.03
    # s there is another
    run = blinded(monkeypatch, 4, 12, 0.5, sensor__patience_s=0.05)
    assert run.status == "unfinished"
    assert "9 of 16 images could not be used, the first at 0.134 s" in run.reason
    assert "the arm was braked for 0.25 s" in run.reason
    speed = np.linalg.norm(run.qd, axis=1)
    braked = (run.t > 0.2135) & (run.t < 0.4635)
    np.testing.assert_allclose(run.qdd_command[braked], -10.0 * run.qd[braked], atol=1e-9)
    # e⁻²·⁵ is 0.08
    assert speed[braked][-1] < 0.09 * speed[braked][0]
    assert speed[-1] > 2.0 * speed[braked][-1]


def test_without_a_tag_in_the_first_image_a_run_fails() -> None:
    dark = simulate(made(0.1, sensor__light=0.01), SlidingMode())
    assert dark.status == "failed"
    assert "t = 0 s: none of the expected tags is seen in the first image" in dark.reason
    wrong = simulate(made(0.1, sensor__printed=[5, 6, 7, 8]), SlidingMode())
    assert "is seen in the first image, but tags 5, 6, 7, 8" in wrong.reason
    swapped = simulate(made(0.1, sensor__printed=[1, 0, 2, 3]), SlidingMode())
    assert "the board cannot be where the tags that are seen would put it" in swapped.reason


def test_a_wrong_tag_is_left_out_and_told() -> None:
    run = simulate(made(0.1, sensor__printed=[0, 1, 2, 9]), SlidingMode())
    assert run.status == "unfinished"
    assert run.reason.count("tags were seen that are not the board's: 9") == 1


def test_what_occludes_stands_before_the_tags() -> None:
    """A disc of 60 px that stays on the first marker, and one that leaves it at 2000 px/s."""
    there = made()
    u, v = there.scene.evaluate(0.0, there.q0, there.qd0).pixels.position[0].tolist()
    disc = {
        "type": "occlusion",
        "K": 0.1,
        "switching_gain": 1.0,
        "curve": {"shape": "circle", "radius": 60.0, "centre_px": [u, v]},
    }
    for constraint, at_last in (
        (disc, False),
        ({**disc, "motion": {"velocity": [-2000.0, 0.0]}}, True),
    ):
        covered = made(constraints=[constraint])
        eye = sensor(covered)
        for k in range(60):
            eye.measured(k, there.q0, there.qd0)
        first, last = (eye.exposures[i].tags.seen for i in (0, -1))
        assert first.tolist() == [False, True, True, True]
        assert last[0] == at_last


# --- the images again ---


def test_images_of_a_run_are_those_that_its_control_has_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[Pixels] = []
    usual = SceneRenderer.image
    monkeypatch.setattr(
        SceneRenderer,
        "image",
        lambda self, number, state: seen.append(usual(self, number, state)) or seen[-1],
    )
    there = made(0.1)
    run = simulate(there, SlidingMode())
    first = [image.copy() for image in seen]
    count = len(seen)
    again = list(frames(there, run))
    assert [frame.number for frame in again] == [0, 1, 2, 3]
    np.testing.assert_allclose([frame.taken for frame in again], [0.0, 0.034, 0.068, 0.1])
    assert count == 4
    for frame, image in zip(again, first, strict=True):
        np.testing.assert_array_equal(frame.image, image)
        assert frame.tags.ids.tolist() == [0, 1, 2, 3]
    with pytest.raises(ConfigurationError, match='no images without sensor = "images"'):
        next(frames(made(scene="ur5-fov"), run))


def test_a_setup_without_images_deletes_none(tmp_path: Path) -> None:
    run = simulate(made(0.1), SlidingMode())
    kept = tmp_path / "00001.png"
    kept.touch()
    with pytest.raises(ConfigurationError, match='no images without sensor = "images"'):
        write_frames(made(scene="ur5-fov"), run, tmp_path)
    assert kept.exists()


def test_images_are_written_as_film_and_as_files(tmp_path: Path) -> None:
    there = made(0.1, sensor__printed=[0, 1, 2, 9])
    run = simulate(there, SlidingMode())
    (tmp_path / "folder").mkdir()
    # of an earlier run, which was longer, and what else is there
    for name in ("00004.png", "notes.txt"):
        (tmp_path / "folder" / name).touch()
    counted: list[int] = []
    assert (
        write_frames(there, run, tmp_path / "folder", lambda: counted.append(1))
        == len(counted)
        == 4
    )
    (tmp_path / "folder" / "notes.txt").unlink()
    files = sorted((tmp_path / "folder").iterdir())
    assert [file.name for file in files] == ["00000.png", "00001.png", "00002.png", "00003.png"]
    written = list(frames(there, run))
    np.testing.assert_array_equal(cv2.imread(str(files[2]), cv2.IMREAD_UNCHANGED), written[2].image)
    assert write_frames(there, run, tmp_path / "new" / "film.gif") == 4
    with Image.open(tmp_path / "new" / "film.gif") as film:
        assert (film.n_frames, film.size) == (4, (320, 240))
    write_frames(there, run, tmp_path / "film.mp4")
    read = cv2.VideoCapture(str(tmp_path / "film.mp4"))
    assert (read.get(cv2.CAP_PROP_FRAME_WIDTH), read.get(cv2.CAP_PROP_FRAME_HEIGHT)) == (
        640.0,
        480.0,
    )
    assert read.get(cv2.CAP_PROP_FRAME_COUNT) == 4.0
    # outlines of what is looked for are green, of anything else red
    picture = with_tags(written[0], {0, 1, 2}).astype(int)
    for colour, tags in ((EXPECTED, [0, 1, 2]), (FOREIGN, [3])):
        for corners in written[0].tags.corners[tags]:
            u, v = (0.5 * (corners[0] + corners[1])).round().astype(int)
            assert np.abs(picture[v, u] - colour).max() < 60
    assert sorted(path.name for path in tmp_path.iterdir()) == ["film.mp4", "folder", "new"]
    with pytest.raises(ConfigurationError, match=r"ends in \.gif or \.mp4"):
        write_frames(there, run, tmp_path / "film.avi")
    # and before anything is simulated, or even read
    with pytest.raises(ConfigurationError, match=r"ends in \.gif or \.mp4"):
        command("no-such-scenario", tmp_path / "film.avi")


def test_the_command_makes_images_of_any_scenario(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "short.toml").write_text('extends = "ur5-fov"\nduration = 0.05\n', encoding="utf-8")
    command(str(tmp_path / "short.toml"), tmp_path / "images", "tracking")
    assert len(list((tmp_path / "images").glob("*.png"))) == 2
    said = capsys.readouterr().out
    assert "unfinished: still moving" in said
    assert "2 images: " in said


# --- what cannot be ---


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"sensor": "image"},
            r"unknown type in ur5-images\.sensor 'image'\. Did you mean 'images'",
        ),
        (
            {"sensor": {"type": "images", "rate": 3.0}},
            r"unknown key in ur5-images\.sensor 'rate'\. Did you mean 'rate_hz'",
        ),
        ({"sensor": {"rate_hz": 3.0}}, "the key 'type' is missing; it is one of images"),
        ({"sensor": "images", "sensor.rate": 3.0}, "unknown key in ur5-images.sensor 'rate'"),
        (
            {"disturbances.pixel_noise": 0.1},
            r"disturbances\.pixel_noise applies to markers that are measured without images",
        ),
        ({"disturbances.delay": 1}, r"disturbances\.delay applies to markers"),
        ({"sensor.tag_side_m": 0.2}, "overlap"),
        (
            {"target": {"markers": [[0.5, 0.1, 0.0], [0.6, 0.1, 0.0]]}},
            "needs three markers or more, not 2",
        ),
    ],
)
def test_sensors_that_cannot_be(change: dict[str, Any], message: str) -> None:
    scenario = Scenario.load("ur5-images")
    for key, value in change.items():
        scenario = scenario.with_override(key, value)
    with pytest.raises(ConfigurationError, match=message):
        scenario.setup()


def test_without_the_extra_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vsconstraints.plugins.extras.find_spec", lambda module: None)
    with pytest.raises(
        ConfigurationError,
        match=r"needs cv2, pupil_apriltags: pip install 'vsconstraints\[images\]'",
    ):
        made()
    with pytest.raises(ConfigurationError, match='no images without sensor = "images"'):
        made(scene="ur5-fov").photographer()


def test_a_sensor_that_was_named_alone_takes_settings() -> None:
    named = Scenario.load("ur5-fov").with_override("sensor", "images")
    told = named.with_override("sensor.rate_hz", 20.0).setup().images
    assert told == ImageSettings(rate_hz=20.0)
    assert named.setup().images == ImageSettings()
