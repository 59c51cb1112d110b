"""Images that controlled a run, rendered again: as data, as files and as a film."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from ..errors import ConfigurationError
from ..images.detectors import DETECTORS, Pixels, Tags
from ..simulation import Setup, Trajectory
from .replay.film import FILMS, film_kind, write_pictures

EXPECTED = (40, 180, 60)  #: Colours of the task's tags, of all others, and of the time.
FOREIGN = (230, 60, 40)
WHITE = (255, 255, 255)
#: Number of colours of a GIF, and its reduction in size: noise does not compress.
COLOURS = 32
SMALLER = 2
Picture = np.ndarray[tuple[int, int, int], np.dtype[np.uint8]]  #: (H, W, 3) red, green and blue.


class Frame(NamedTuple):
    """Image (H, W) with its number, the time at which it was taken [s] and the detected tags."""

    number: int
    taken: float
    image: Pixels
    tags: Tags


def frames(setup: Setup, run: Trajectory) -> Iterator[Frame]:
    """Yield the images of a run in order.

    They are rendered again and equal those that the control has used. Raises ConfigurationError
    if the control of this setup uses no images.
    """
    photographer = setup.photographer()
    settings = photographer.settings
    detector = DETECTORS[settings.detector]()
    last = -1
    for t, q, qd in zip(run.t.tolist(), run.q, run.qd, strict=True):
        number = settings.number(t)
        if number > last:
            state = setup.scene.evaluate(t, q, qd)
            image = photographer.image(number, state)
            yield Frame(number, t, image, detector.find(image))
        last = number


def kind_of(path: Path) -> str:
    """Return the suffix of a film, .gif or .mp4, or an empty string for a folder.

    Raises ConfigurationError for any other suffix.
    """
    if path.suffix and path.suffix.lower() not in FILMS:
        raise ConfigurationError(
            f"a film ends in {' or '.join(FILMS)}, and a folder in neither, not {path.name!r}"
        )
    return film_kind(path) if path.suffix else ""


def write_frames(
    setup: Setup, run: Trajectory, path: Path, on_frame: Callable[[], None] = lambda: None
) -> int:
    """Write the images of a run and return their number.

    ``path`` is a film that shows the detected tags, at the size of the images (``.mp4``) or half
    that size (``.gif``), or a folder of PNGs as the control has seen them. The images of an
    earlier run are deleted from that folder. ``on_frame`` is called after each image. Raises
    ConfigurationError as :func:`frames` and :func:`kind_of`, and OSError if writing fails.
    """
    kind = kind_of(path)
    # A setup without images is refused here, before files of an earlier run are deleted.
    settings = setup.photographer().settings
    if not kind:
        return _write_folder(frames(setup, run), path, on_frame)
    expected = {*settings.expected_tags(len(setup.scene.markers))}
    pictures = []
    for frame in frames(setup, run):
        picture = with_tags(frame, expected)
        if kind == ".gif":
            picture = np.asarray(Image.fromarray(picture).reduce(SMALLER))
        pictures.append(picture)
        on_frame()
    rate = min(settings.rate_hz, 1.0 / setup.Ts)
    write_pictures(pictures, path, rate, colours=COLOURS)
    return len(pictures)


def _write_folder(images: Iterator[Frame], folder: Path, on_frame: Callable[[], None]) -> int:
    """Write images as PNGs into a folder and return their number."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("[0-9][0-9][0-9][0-9][0-9].png"):
        old.unlink()
    count = 0
    for frame in images:
        path = folder / f"{frame.number:05d}.png"
        Image.fromarray(frame.image).save(path)
        count += 1
        on_frame()
    return count


def with_tags(frame: Frame, expected: set[int]) -> Picture:
    """Return an image in colour (H, W, 3) with its time and the detected tags.

    Each tag is shown by its outline and its number, tags that are not ``expected`` in another
    colour.
    """
    import cv2

    grey = frame.image[..., None]
    picture: Picture = np.repeat(grey, 3, axis=2)
    font: dict[str, Any] = {"fontFace": cv2.FONT_HERSHEY_SIMPLEX, "lineType": cv2.LINE_AA}
    tags = frame.tags
    for number, corners in zip(tags.ids.tolist(), tags.corners, strict=True):
        colour = EXPECTED if number in expected else FOREIGN
        outline = corners.round().astype(np.int32)
        cv2.polylines(picture, [outline], True, colour, 2, cv2.LINE_AA)
        first_corner = outline[0].tolist()
        cv2.circle(picture, first_corner, 5, colour, cv2.FILLED, cv2.LINE_AA)
        middle = corners.mean(axis=0).round()
        x, y = middle.astype(int).tolist()
        below_middle = (x - 8, y + 8)
        look = {"fontScale": 0.8, "color": colour, "thickness": 2, **font}
        cv2.putText(picture, str(number), below_middle, **look)
    time = f"{frame.taken:.3f} s"
    look = {"fontScale": 0.6, "color": WHITE, "thickness": 1, **font}
    cv2.putText(picture, time, (8, 20), **look)
    return picture
