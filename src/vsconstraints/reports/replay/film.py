"""A film of runs: image and arm of each, for pages that show pictures, talks and papers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...comparisons.runs.files import replaced
from ...constraints import ImageConstraint
from ...errors import ConfigurationError
from ...plugins.extras import demand
from ...rows import Array
from ..plots import INK, darker, shortened, symbol
from ..plots.image import Plane
from ..scene3d import Viewpoint, draw_setup
from .constraint_highlights import ACTIVE, HIGHLIGHTS, VIOLATED, Frames, things_of
from .runs import ReplayRun, check_same_scene, looks_of
from .space import common_viewpoint

RATE, MAX_TIME = 12.0, 8.0
"""Frames a second, and how long a film lasts at most [s]: what takes longer is seen faster."""

REST = 1.0
"""How long the last frame stands [s]."""

WIDTH, DPI = 8.0, 100
"""Of a film [in], and dots per inch."""

COLOURS = 96
"""Of a GIF."""

MAX_LABELS = 3
"""Active or violated constraints that are named at most."""

LETTERS = 12.0
"""Of the text below an image, on an inch of it."""


def write_film(runs: Sequence[ReplayRun], path: Path | str, title: str = "") -> list[str]:
    """Write a film of runs of one scene; returns what a reader should know, sentence by sentence.

    Parameters
    ----------
    runs
        Up to :data:`~vsconstraints.reports.replay.runs.MAX_RUNS`, of one robot, camera and target.
    path
        Ends in ``.gif`` or ``.mp4``.
    title
        Above the film; that of the scenario if not given.

    Raises
    ------
    ConfigurationError
        if the runs cannot be shown together, the ending is another one, or an MP4 is asked for without the extra
        ``replay``.
    OSError
        if the file cannot be written.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in WRITERS:
        raise ConfigurationError(f"a film ends in {' or '.join(WRITERS)}, not {path.name!r}")
    if kind == ".mp4":
        demand("replay")
    check_same_scene(runs)
    frames = Frames.of(runs, RATE, int(RATE * MAX_TIME))
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced(path) as part:
        WRITERS[kind](Film(runs, frames, title or runs[0].title), part)
    return [text for text in [frames.remark(runs)] if text]


class Film:
    """Draws frame after frame: for each run a column with the image above and the arm below."""

    def __init__(self, runs: Sequence[ReplayRun], frames: Frames, title: str) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.runs, self.frames, self.viewpoint = runs, frames, common_viewpoint(runs)
        self.figure: Any = Figure(dpi=DPI, facecolor="white")
        self.canvas: Any = FigureCanvasAgg(self.figure)
        plane = Plane.of(runs[0].setup)
        columns = max(len(runs), 2)
        width = (WIDTH - 0.1 * (columns + 1)) / columns
        tall, arm = width * plane.half[1] / plane.half[0], 0.78 * width
        height = 0.75 + tall + 0.3 + (arm if len(runs) > 1 else 0.0)
        # sides of films are even numbers of pixels
        self.figure.set_size_inches(WIDTH, 2.0 * round(0.5 * DPI * height) / DPI)
        high = float(self.figure.get_size_inches()[1])
        speed = frames.period * RATE
        faster = f"   ({speed:.1f} times as fast)" if speed > 1.05 else ""
        self.figure.text(0.0125, 1.0 - 0.2 / high, title + faster, fontsize=10.5, fontweight="bold", va="center")
        self.clock = self.figure.text(0.9875, 1.0 - 0.2 / high, "", fontsize=10.5, ha="right", va="center")
        self.columns = []
        for k, run in enumerate(runs):
            left = 0.1 + k * (width + 0.1)
            below = (left, 0.0) if len(runs) > 1 else (left + width + 0.1, 0.0)
            bottom = high - 0.7 - tall
            image = self.figure.add_axes((left / WIDTH, bottom / high, width / WIDTH, tall / high))
            room = arm if len(runs) > 1 else tall + 0.3
            at = (below[0] / WIDTH, below[1] / high, width / WIDTH, room / high)
            space = self.figure.add_axes(at, projection="3d", computed_zorder=False)
            self.columns.append(Column(run, frames, image, space, looks_of(runs)[run.law].colour))

    @property
    def pixels(self) -> Iterator[Array]:
        """Each frame (height, width, 3) as bytes."""
        for k, t in enumerate(self.frames.t):
            self.clock.set_text(f"{t:.2f} s")
            for column in self.columns:
                column.show(k, float(t), self.viewpoint)
            self.canvas.draw()
            yield np.asarray(self.canvas.buffer_rgba())[..., :3].copy()


class Column:
    """Image and arm of one run."""

    def __init__(self, run: ReplayRun, frames: Frames, image: Any, space: Any, colour: str) -> None:
        self.run, self.space = run, space
        self.letters = int(LETTERS * image.get_position().width * WIDTH)
        self.samples, self.states, self.things = frames.samples(run), frames.states(run), things_of(run)
        plane = replace(Plane.of(run.setup), times=())
        plane.draw(image, labels=False)
        image.set_xticks([])
        image.set_yticks([])
        image.set_title(shortened(run.law), loc="left", color=darker(colour), fontweight="bold", fontsize=10, pad=4)
        self.status = image.set_title("", loc="right", fontsize=9, pad=4)
        pixels = run.trajectory.features_px
        self.goal = image.plot([], [], **symbol("*", INK, "white", 8.0), zorder=5)[0]
        image.plot(*pixels[0].T, **symbol("o", "white", "#888888", 6.0), zorder=4)
        self.tracks = [image.plot([], [], color=colour, linewidth=2.0, zorder=4.5)[0] for _ in range(pixels.shape[1])]
        self.spots = [image.plot([], [], **symbol("o", colour, "white", 8.5), zorder=6)[0] for _ in self.tracks]
        self.text = image.text(
            0.0, -0.02, "", transform=image.transAxes, fontsize=9, va="top", fontweight="bold", zorder=7
        )
        self.moving = [
            (image.plot([], [], color=INK, linewidth=1.2, zorder=3)[0], line, constraint.motion)
            for constraint in run.setup.constraints.constraints
            if isinstance(constraint, ImageConstraint) and constraint.motion is not None
            for line in constraint.boundary(plane.size, frames.t)
        ]

    def show(self, frame: int, t: float, viewpoint: Viewpoint) -> None:
        """Put everything where it is in a frame."""
        k, trajectory = int(self.samples[frame]), self.run.trajectory
        states = self.states[frame]
        goal = [one for one in self.run.setup.task.goals if one.from_time <= t + 1e-9][-1]
        self.goal.set_data(*goal.pixels.T)
        for i, (track, spot) in enumerate(zip(self.tracks, self.spots, strict=True)):
            path = trajectory.features_px[: k + 1, i]
            track.set_data(*path[:: max(len(path) // 300, 1)].T)
            spot.set_data(*trajectory.features_px[k : k + 1, i].T)
            own = [int(states[r]) for r, thing in enumerate(self.things) if thing == ("marker", i + 1)]
            state = max(own, default=0)
            spot.set_markeredgecolor(HIGHLIGHTS.get(state, "white"))
            spot.set_markeredgewidth(2.5 if state else 0.9)
        for line, points, motion in self.moving:
            line.set_data(*(points + motion.displacement(t)).T)
        state = int(states.max(initial=0))
        labels = [trajectory.labels[r] for r in np.flatnonzero(states == state)] if state else []
        self.text.set_text(
            truncated_labels({ACTIVE: "active: ", VIOLATED: "violated: "}.get(state, ""), labels, self.letters)
        )
        self.text.set_color(darker(HIGHLIGHTS.get(state, INK), 0.8))
        over = t > trajectory.t[-1] + 1e-9 or frame == len(self.samples) - 1
        self.status.set_text(trajectory.status if over else "")
        for old in list(self.space.collections):
            old.remove()
        draw_setup(self.space, self.run.setup, trajectory.q[k], t, viewpoint)


def truncated_labels(word: str, labels: Sequence[str], letters: int) -> str:
    """A word and as many of the labels as there is room for, and how many more there are."""
    texts = []
    for count in range(min(len(labels), MAX_LABELS), 0, -1):
        more = f" and {len(labels) - count} more" if len(labels) > count else ""
        texts.append(f"{word}{', '.join(labels[:count])}{more}")
    fitting = [text for text in texts if len(text) <= letters]
    return fitting[0] if fitting else shortened(texts[-1], letters) if texts else ""


def _gif(film: Film, path: Path) -> None:
    from PIL import Image

    pictures = [Image.fromarray(pixels) for pixels in film.pixels]
    # one palette for all, without dithering: what stands still is the same from frame to frame, and takes no room
    middle = pictures[len(pictures) // 2].quantize(COLOURS, dither=Image.Dither.NONE)
    reduced = [picture.quantize(palette=middle, dither=Image.Dither.NONE) for picture in pictures]
    step = round(1000.0 / RATE / 10.0) * 10
    durations = [step] * (len(reduced) - 1) + [step + int(1000.0 * REST)]
    reduced[0].save(
        path, format="GIF", save_all=True, append_images=reduced[1:], duration=durations, loop=0, optimize=True
    )


def _mp4(film: Film, path: Path) -> None:
    import imageio_ffmpeg

    height, width = (round(DPI * side) for side in film.figure.get_size_inches()[::-1])
    writer = imageio_ffmpeg.write_frames(
        str(path), (width, height), fps=RATE, macro_block_size=2, quality=7, output_params=["-f", "mp4"]
    )
    writer.send(None)
    try:
        for pixels in film.pixels:
            writer.send(np.ascontiguousarray(pixels))
        for _ in range(int(RATE * REST)):
            writer.send(np.ascontiguousarray(pixels))
    finally:
        writer.close()


WRITERS = {".gif": _gif, ".mp4": _mp4}
"""By the ending of the file."""
