"""The images that a run was controlled by, again: as data, as files, and as a film."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from ..simulation import Setup, Trajectory
from ..vision.images.detectors import DETECTORS, Pixels, Tags
from .replay.film import film_kind, write_pictures

OWN = (40, 180, 60)  #: Colours of tags that are found: those that are looked for, and others.
FOREIGN = (230, 60, 40)
#: Colours of a GIF, and by how much it is smaller than the images: noise does not compress.
COLOURS = 32
SMALLER = 2
Picture = np.ndarray[tuple[int, int, int], np.dtype[np.uint8]]  #: (H, W, 3) red, green and blue.


class Frame(NamedTuple):
    """An image (H, W) of that number, when it was taken [s], and the tags that are found in it."""

    number: int
    taken: float
    image: Pixels
    tags: Tags


def frames(setup: Setup, run: Trajectory) -> Iterator[Frame]:
    """The images of a run, one after the other: rendered anew, they are those that its control has
    seen.

    Raises ConfigurationError if the control of this setup sees no images.
    """
    photographer = setup.photographer()
    last = -1
    settings = photographer.settings
    detector = DETECTORS[settings.detector]()
    for t, q, qd in zip(run.t.tolist(), run.q, run.qd, strict=True):
        number = settings.number(t)
        if number > last:
            last = number
            image = photographer.image(number, setup.scene.evaluate(t, q, qd))
            yield Frame(number, t, image, detector.find(image))


def kind_of(path: Path) -> str:
    """How a path ends: as a film in .gif or .mp4, or not at all as a folder; raises
    ConfigurationError otherwise.
    """
    return film_kind(path, ("",), ", and a folder in neither")


def write_frames(
    setup: Setup, run: Trajectory, path: Path, on_frame: Callable[[], None] = lambda: None
) -> int:
    """Write the images of a run; returns how many there are.

    ``path`` is a film with the tags that are found, as large as the images (``.mp4``) or half as
    large (``.gif``), or a folder of PNGs as the control has seen them; those of an earlier run are
    deleted there. ``on_frame`` is called after each image. Raises ConfigurationError as
    :func:`frames` and :func:`kind_of`, and OSError if it cannot be written.
    """
    kind = kind_of(path)
    settings = setup.photographer().settings
    every = frames(setup, run)
    count = 0
    pictures = []
    if not kind:
        path.mkdir(parents=True, exist_ok=True)
        for old in path.glob("[0-9]" * 5 + ".png"):
            old.unlink()
    tags = {*settings.looked_for(len(setup.scene.markers))}
    for count, frame in enumerate(every, start=1):  # noqa: B007 - it is returned
        if kind:
            pictures.append(marked(frame, tags))
        else:
            Image.fromarray(frame.image).save(path / f"{frame.number:05d}.png")
        on_frame()
    if kind == ".gif":
        pictures = [np.asarray(Image.fromarray(one).reduce(SMALLER)) for one in pictures]
    if kind:
        write_pictures(pictures, path, min(settings.rate_hz, 1.0 / setup.Ts), colours=COLOURS)
    return count


def marked(frame: Frame, own: set[int]) -> Picture:
    """(H, W, 3) an image in colours, with the tags that are found in it: their outlines, numbers,
    and its time.
    """
    import cv2

    picture: Picture = np.repeat(frame.image[..., None], 3, axis=2)
    for number, corners in zip(frame.tags.ids.tolist(), frame.tags.corners, strict=True):
        colour = OWN if number in own else FOREIGN
        outline = corners.round().astype(np.int32)
        cv2.polylines(
            picture, [outline], isClosed=True, color=colour, thickness=2, lineType=cv2.LINE_AA
        )
        cv2.circle(picture, outline[0].tolist(), 5, colour, cv2.FILLED, cv2.LINE_AA)
        at = corners.mean(axis=0).round().astype(int) - (8, -8)
        cv2.putText(
            picture, str(number), at.tolist(), cv2.FONT_HERSHEY_SIMPLEX, 0.8, colour, 2, cv2.LINE_AA
        )
    white = (255, 255, 255)
    cv2.putText(
        picture,
        f"{frame.taken:.3f} s",
        (8, 20),
        cv2.FONT_HERSHEY_SIMPLEX,
        0.6,
        white,
        1,
        cv2.LINE_AA,
    )
    return picture
