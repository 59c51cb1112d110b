"""Pixels of a recording in another origin, unit or order are refused; errors of a camera are not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from vsconstraints.errors import ConfigurationError
from vsconstraints.rows import Array
from vsconstraints.score.pixels import remark_on_deviation, require_pixels
from vsconstraints.vision.camera import Camera
from vsconstraints.vision.distortion import Distortion

FOCAL = 600.0
SIZE = np.array([640.0, 480.0])
CAMERA = Camera(focal_px=(FOCAL, FOCAL), size_px=(640.0, 480.0))
FIRST = np.array([319.5, 239.5])
"""Centre of the image from the centre of its first pixel, as OpenCV counts [px]."""


def image() -> Array:
    """Return pixels (300, 4, 2) of a square that turns by 1 rad, approaches and moves aside."""
    share = np.linspace(0.0, 1.0, 300)[:, None]
    angle = 0.3 + share + 0.5 * np.pi * np.arange(4)
    depth = 1.0 - 0.4 * share
    across = 0.1 * np.cos(angle) + 0.15 - 0.1 * share
    down = 0.1 * np.sin(angle) - 0.05
    return FOCAL * np.stack((across, down), axis=2) / depth[:, :, None]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda uv: uv + FIRST, r"first pixel, .*: subtract \(319\.5, 239\.5\) px from \(u, v\)$"),
        (lambda uv: (uv + FIRST)[..., ::-1], "exchanged and .*: exchange u and v, then subtract"),
        (lambda uv: FIRST + uv * (1.0, -1.0), r"lower left corner.* from u, and v from 239\.5 px$"),
        (lambda uv: uv[..., ::-1], "if u and v were exchanged.*: exchange u and v$"),
        (lambda uv: uv[:, [1, 0, 2, 3]], "columns 1, 2, 3, 4 were markers 2, 1, 3, 4"),
        (lambda uv: uv[:, ::-1] + FIRST, "OpenCV does and columns 1, 2, 3, 4 were markers 4, 3"),
        (lambda uv: uv * (1.0, -1.0), "if v were upwards.*: change the sign of v$"),
        (lambda uv: uv / FOCAL, r"normalised coordinates.*multiply \(u, v\) by \(600, 600\) px$"),
        (lambda uv: uv / SIZE + 0.5, "shares of the image's size from its corner"),
        (lambda uv: 2.0 * uv / SIZE, "shares of half the image's size from its centre"),
    ],
)
def test_another_origin_unit_or_order_is_named(
    change: Callable[[Array], Array], words: str
) -> None:
    """So it is with noise of 1 px, a marker that is never seen, and one that is seen at times."""
    model = image()
    seen = model + np.random.default_rng(2).normal(0.0, 1.0, model.shape)
    seen[10:200, 1] = np.nan
    with pytest.raises(ConfigurationError, match=f"^it: measured pixels deviate.*{words}"):
        require_pixels("it", CAMERA, change(seen), model)
    if "columns" not in words:
        seen[:, 2] = np.nan
        with pytest.raises(ConfigurationError, match=words):
            require_pixels("it", CAMERA, change(seen), model)


def test_pixels_from_the_principal_point_of_a_lens_are_named() -> None:
    """Normalised coordinates of an ideal camera are those without the distortion of the lens."""
    lens = Distortion("brown-conrady", (-0.1, 0.02, 0.0, 0.0))
    camera = Camera((FOCAL, FOCAL), (640.0, 480.0), (350.0, 230.0), distortion=lens)
    ideal = camera.pixels(image() / FOCAL)
    model = camera.distort(ideal)
    with pytest.raises(ConfigurationError, match=r"principal point.*: add \(30, -10\) px"):
        require_pixels("it", camera, model - (30.0, -10.0), model)
    with pytest.raises(ConfigurationError, match="and distort them by the lens"):
        require_pixels("it", camera, image() / FOCAL, model)


@pytest.mark.parametrize(
    "change",
    [
        lambda uv: uv + 0.5,
        lambda uv: uv + np.random.default_rng(3).normal(0.0, 5.0, uv.shape),
        lambda uv: 1.03 * uv + (8.0, -4.0),
        lambda uv: np.concatenate((np.repeat(uv[:1], 25, axis=0), uv[:-25])),
        lambda uv: np.full_like(uv, np.nan),
        lambda uv: uv[:0],
    ],
)
def test_errors_of_a_camera_are_no_other_origin(change: Callable[[Array], Array]) -> None:
    """Edges as origin, noise, a wrong calibration, a delay, a target that is never seen."""
    model = image()
    measured = change(model)
    require_pixels("it", CAMERA, measured, model[: len(measured)])
    if len(measured):
        deviation = np.linalg.norm(measured - model, axis=2)
        assert "in half of the samples" not in remark_on_deviation(deviation, CAMERA)


def test_a_deviation_that_nothing_explains_is_told() -> None:
    """A camera that is turned by 10° about two of its axes."""
    turned = image() + FOCAL * np.tan(np.radians(10.0))
    turned[:, 2] = np.nan
    require_pixels("it", CAMERA, turned, image())
    remark = remark_on_deviation(np.linalg.norm(turned - image(), axis=2), CAMERA)
    assert "by up to 150 px from those of the model, which replace 300 of a marker" in remark
    assert "more than 150 px in half of the samples" in remark
    assert "wrong if these have another origin, unit or order" in remark


def test_an_offset_of_one_marker_that_rests_is_no_other_sign() -> None:
    """A camera turned by 0.7° moves it by 7.7 px, as another sign of v would."""
    model = np.full((50, 1, 2), (0.0, 4.0))
    require_pixels("it", CAMERA, model * (1.0, -0.925), model)
    far = np.full((50, 1, 2), (0.0, 40.0))
    with pytest.raises(ConfigurationError, match="if v were upwards"):
        require_pixels("it", CAMERA, far * (1.0, -0.925), far)


def test_a_marker_without_pixels_in_the_model_is_not_preferred() -> None:
    """The camera is turned by 2°: columns keep their two markers, of which the last has no model."""
    model = image()[:, :2]
    measured = model + FOCAL * np.tan(np.radians(2.0))
    model[:, 1] = np.nan
    require_pixels("it", CAMERA, measured, model)
