"""Film of runs with image and arm of each, for web pages, talks and papers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ...comparisons.runs.files import replaced
from ...errors import ConfigurationError
from ...reports.plots.image import Plane, tracks
from ...reports.plots.sheet import WIDTH, Sheet
from ...reports.plots.style import INK, darker, shortened, symbol
from ...rows import Array
from ..scene3d import Viewpoint
from ..setup_scene import draw_setup
from .runs import (
    ACTIVE,
    HIGHLIGHTS,
    INACTIVE,
    VIOLATED,
    Frames,
    ReplayRun,
    Thing,
    check_same_scene,
    coloured,
    things_of,
)
from .space import common_viewpoint

FILMS = (".gif", ".mp4")
#: Frames per second, longest duration of a film (longer runs are shown faster), and additional
#: time of its last frame [s].
RATE = 12.0
MAX_TIME = 8.0
REST = 1.0
# Dots per inch of a film, and colours of a GIF.
DPI = 100
COLOURS = 96
BITS = 5  # of each channel that are compared when the colours of a GIF are chosen
#: Space between columns, place of the images from above, and height of the text below them [in].
SPACE = 0.1
TOP = 0.7
CAPTION = 0.3
LETTERS = 12.0  # of the text below an image, per inch of its width
FIRST = symbol("o", "white", "#888888", 6.0, zorder=4)
GOAL = symbol("*", INK, "white", 8.0, zorder=5)
STATE_NAMES = {ACTIVE: "active", VIOLATED: "violated"}


def write_film(runs: Sequence[ReplayRun], path: Path | str, title: str = "") -> list[str]:
    """Write a film of up to four runs of one scene; return remarks for the reader.

    ``path`` ends in ``.gif`` or ``.mp4``. The title is that of the scenario if none is given.
    Raises ConfigurationError if the runs cannot be shown together, if the suffix is another one, or
    if an MP4 is requested without the extra ``replay``; and OSError.
    """
    path = Path(path)
    film_kind(path)
    check_same_scene(runs)
    most_frames = int(RATE * MAX_TIME)
    frames = Frames.of(runs, RATE, most_frames)
    title = title or runs[0].title
    film = list(pictures(runs, frames, title))
    write_pictures(film, path, RATE, REST)
    remark = frames.remark(runs)
    return [remark] if remark else []


def pictures(runs: Sequence[ReplayRun], frames: Frames, title: str) -> Iterator[Array]:
    """Yield each frame (height, width, 3) as bytes.

    Each run has a column with the image above and the arm below.
    """
    plane = Plane.of(runs[0].setup)
    viewpoint = common_viewpoint(runs)
    is_alone = len(runs) == 1
    width = (WIDTH - SPACE) / max(len(runs), 2) - SPACE
    image_height = width * plane.half[1] / plane.half[0]
    arm_height = 0.0 if is_alone else 0.78 * width
    sheet = Sheet(left=SPACE)
    speed = frames.period * RATE
    if speed > 1.05:
        title += f"   ({speed:.1f} times as fast)"
    heading = {"fontsize": 10.5, "va": "center"}
    sheet.text(SPACE, 0.2, title, fontweight="bold", **heading)
    clock = sheet.text(WIDTH - SPACE, 0.2, "", ha="right", **heading)
    columns = []
    for k, (run, colour) in enumerate(coloured(runs)):
        left = SPACE + k * (width + SPACE)
        image = sheet.axes(left, TOP, width, image_height)
        if is_alone:
            beside = left + width + SPACE
            space = sheet.axes_3d(beside, TOP, width, image_height + CAPTION)
        else:
            below = TOP + CAPTION + image_height
            space = sheet.axes_3d(left, below, width, arm_height)
        columns.append(_Column(run, colour, image, space, frames))
    # films need even numbers of pixels
    height = 1.05 + image_height + arm_height
    sheet.bottom = 2.0 * round(0.5 * DPI * height) / DPI
    sheet.figure.set_dpi(DPI)
    sheet.placed()
    for k, t in enumerate(frames.t.tolist()):
        clock.set_text(f"{t:.2f} s")
        plane.times = (t,)
        for column in columns:
            column.draw(k, t, plane, viewpoint)
        sheet.canvas.draw()
        pixels = np.asarray(sheet.canvas.buffer_rgba())
        yield pixels[..., :3].copy()


class _Column:
    """Run with its axes: the image plane above, the arm below or beside it."""

    def __init__(self, run: ReplayRun, colour: str, image: Any, space: Any, frames: Frames) -> None:
        self.run = run
        self.colour = colour
        self.image = image
        self.space = space
        self.samples = frames.samples(run)
        self.states = frames.states(run)
        self.things = things_of(run)

    def draw(self, k: int, t: float, plane: Plane, viewpoint: Viewpoint) -> None:
        """Draw the run in frame k, at t [s]."""
        image = self.image
        space = self.space
        trajectory = self.run.trajectory
        sample = int(self.samples[k])
        image.clear()
        plane.draw(image, labels=False)
        self._draw_image(sample, self.states[k].tolist())
        is_last_frame = k == len(self.samples) - 1
        if is_last_frame or t > trajectory.t[-1] + 1e-9:
            image.set_title(trajectory.status, loc="right", fontsize=9, pad=4)
        for old in list(space.collections):
            old.remove()
        q = trajectory.q[sample]
        draw_setup(space, self.run.setup, q, t, viewpoint)

    def _draw_image(self, sample: int, states: Sequence[int]) -> None:
        """Draw the run in the image plane up to a sample, with the states (m,) of its rows."""
        ax = self.image
        trajectory = self.run.trajectory
        pixels = trajectory.features_px
        ax.set_xticks([])
        ax.set_yticks([])
        letters = int(LETTERS * ax.get_position().width * WIDTH)
        ax.set_title(
            shortened(self.run.law, letters),
            loc="left",
            color=darker(self.colour),
            fontweight="bold",
            fontsize=10,
            pad=4,
        )
        ax.plot(*pixels[0].T, **FIRST)
        task = self.run.setup.task
        goal = task.goals[task.goal_at(float(trajectory.t[sample]))]
        ax.plot(*goal.pixels.T, **GOAL)
        step = max(sample // 300, 1)
        until_now = pixels[: sample + 1 : step]
        tracks(ax, until_now, color=self.colour, linewidth=2.0, zorder=4.5)
        for number, marker in enumerate(pixels[sample], start=1):
            state = self._worst_state(Thing("marker", number), states)
            edge = HIGHLIGHTS.get(state, "white")
            width = 0.9 if state == INACTIVE else 2.5
            disc = symbol("o", self.colour, edge, 8.5, zorder=6, markeredgewidth=width)
            ax.plot(*marker, **disc)
        self._write_rows(states, letters)

    def _worst_state(self, thing: Thing, states: Sequence[int]) -> int:
        """Return the worst of the states (m,) of the rows that apply to an object."""
        worst = INACTIVE
        for state, other in zip(states, self.things, strict=True):
            if other == thing:
                worst = max(worst, state)
        return worst

    def _write_rows(self, states: Sequence[int], letters: int) -> None:
        """Write the labels of the rows with the worst state below the image."""
        worst = max(states, default=INACTIVE)
        text = ""
        if worst != INACTIVE:
            labels = []
            for label, state in zip(self.run.trajectory.labels, states, strict=True):
                if state == worst:
                    labels.append(label)
            text = f"{STATE_NAMES[worst]}: {', '.join(labels)}"
        self.image.text(
            0.0,
            -0.02,
            shortened(text, letters),
            color=darker(HIGHLIGHTS.get(worst, INK)),
            transform=self.image.transAxes,
            fontsize=9,
            va="top",
            fontweight="bold",
            zorder=7,
        )


def film_kind(path: Path) -> str:
    """Return the suffix of a film, .gif or .mp4.

    Raises ConfigurationError for any other suffix, or if a package for .mp4 is missing.
    """
    kind = path.suffix.lower()
    if kind not in FILMS:
        raise ConfigurationError(f"a film ends in {' or '.join(FILMS)}, not {path.name!r}")
    if kind == ".mp4" and find_spec("imageio_ffmpeg") is None:
        raise ConfigurationError(
            "a film as MP4 needs imageio_ffmpeg: pip install 'vsconstraints[replay]'"
        )
    return kind


def write_pictures(
    frames: Sequence[Any], path: Path, rate: float, rest: float = 0.0, colours: int = COLOURS
) -> None:
    """Write pictures (height, width, 3) as a film at ``rate`` frames per second.

    The last picture is shown longer by ``rest`` [s].
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced(path) as part:
        if film_kind(path) == ".gif":
            _write_gif(frames, part, rate, rest, colours)
        else:
            _write_mp4(frames, part, rate, rest)


def _write_gif(frames: Sequence[Any], path: Path, rate: float, rest: float, colours: int) -> None:
    from PIL import Image

    # one palette for all frames, without dithering: unchanged pixels then take no space
    palette = common_palette(frames, colours)
    images = []
    for pixels in frames:
        image = Image.fromarray(pixels)
        images.append(image.quantize(palette=palette, dither=Image.Dither.NONE))
    first, *others = images
    step = round(100.0 / rate) * 10  # [ms]
    durations = [step] * len(images)
    durations[-1] += int(1000.0 * rest)
    first.save(
        path,
        format="GIF",
        save_all=True,
        append_images=others,
        optimize=True,
        duration=durations,
        loop=0,
    )


def _write_mp4(frames: Sequence[Any], path: Path, rate: float, rest: float) -> None:
    import imageio_ffmpeg

    options: dict[str, Any] = {
        "fps": rate,
        "macro_block_size": 2,
        "quality": 7,
        "output_params": ["-f", "mp4"],
    }
    height, width, _ = frames[0].shape
    writer = imageio_ffmpeg.write_frames(str(path), (width, height), **options)
    writer.send(None)
    repeated = [frames[-1]] * int(rate * rest)
    try:
        for pixels in [*frames, *repeated]:
            writer.send(np.ascontiguousarray(pixels))
    finally:
        writer.close()


def common_palette(frames: Sequence[Array], colours: int) -> Any:
    """Return an image whose palette has ``colours`` colours for all frames (height, width, 3).

    The first quarter are the colours that cover most in any one frame. Each further one is the
    colour that the chosen ones represent worst: its squared distance to the nearest of them, times
    the square root of its covered area, is the largest. A colour that is visible for a moment on a
    thin line is therefore included if no other is similar to it.
    """
    from PIL import Image

    means, largest = _similar_colours(frames)
    weight = np.sqrt(largest)
    chosen: list[int] = []
    distance = np.full(len(means), np.inf)
    largest_first = np.argsort(-weight, kind="stable")
    for k in range(min(colours, len(means))):
        colour = int(largest_first[k])
        if k >= colours // 4:
            colour = int(np.argmax(distance * weight))
        chosen.append(colour)
        to_colour = ((means - means[colour]) ** 2).sum(axis=1)
        distance = np.minimum(distance, to_colour)
    palette = Image.new("P", (1, 1))
    channels = np.rint(means[chosen]).astype(np.uint8)
    palette.putpalette(channels.ravel().tolist())
    return palette


def _similar_colours(frames: Sequence[Array]) -> tuple[Array, Array]:
    """Return the mean (k, 3) of each group of similar colours, and its greatest area (k,).

    Colours are similar if the first :data:`BITS` bits of each channel are equal. The area is the
    greatest number of pixels in any one frame.
    """
    levels = 1 << BITS
    cells = levels**3
    largest = np.zeros(cells)
    pixel_count = np.zeros(cells)
    sums = np.zeros((3, cells))
    for frame in frames:
        pixels = np.asarray(frame, dtype=np.int64)
        channels = pixels.reshape(-1, 3).T
        red, green, blue = channels >> (8 - BITS)
        cell = (red * levels + green) * levels + blue
        count = np.bincount(cell, minlength=cells)
        largest = np.maximum(largest, count)
        pixel_count += count
        for total, channel in zip(sums, channels, strict=True):
            total += np.bincount(cell, channel, cells)
    present = np.flatnonzero(pixel_count)
    means = sums[:, present] / pixel_count[present]
    return means.T, largest[present]
