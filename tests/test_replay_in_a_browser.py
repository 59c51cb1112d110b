"""A replay in a real browser: it opens without network, plays, goes to a time, and shows what the
run says.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from browser import NAMES, Page, browser, program
from vsconstraints.controllers import SlidingMode, Tracking
from vsconstraints.reports.plots.image import Plane
from vsconstraints.reports.plots.style import LOOKS
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.view.replay import ReplayRun, write_replay
from vsconstraints.view.replay.runs import ACTIVE, VIOLATED, Frames

NAME = "example-2d-fov"
COLOURS = {0: (255, 255, 255), ACTIVE: (0xF0, 0xA2, 0x02), VIOLATED: (0xD1, 0x10, 0x2A)}
NO_WEBGL = """
const get = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return String(kind).startsWith("webgl") ? null : get.call(this, kind, ...rest);
};
"""
LOADED = "document.documentElement !== null && document.readyState === 'complete'"


WIDTHS = {390: 700, 1000: 800}
"""Of windows, with their heights: a phone's, and a small laptop's."""


def press(page: Page, key: str) -> None:
    page.ask("Input.dispatchKeyEvent", type="keyDown", key=key)
    page.ask("Input.dispatchKeyEvent", type="keyUp", key=key)


def require_whole(page: Page) -> None:
    """Nothing is wider than the window, and what rows are called is not cut; whatever the window
    is.
    """
    for width, height in WIDTHS.items():
        page.ask(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        page.wait(f"innerWidth === {width}")
        assert page.value("document.documentElement.scrollWidth") <= width
        assert page.value(
            "[...document.querySelectorAll('code, figcaption')].every(e => e.scrollWidth <= "
            "e.clientWidth)"
        )
        assert all(one["right"] <= width and one["width"] > 60.0 for one in box(page, "li svg"))


def colour(text: str) -> tuple[int, ...]:
    return tuple(int(text[i : i + 2], 16) for i in (1, 3, 5))


def box(page: Page, selector: str) -> list[dict[str, float]]:
    """Where elements are on the screen."""
    return page.value(
        f"[...document.querySelectorAll('{selector}')].map(e => e.getBoundingClientRect().toJSON())"
    )


def near(picture: Any, x: float, y: float, wanted: tuple[int, ...]) -> bool:
    """Whether a colour is within two pixels of a place."""
    there = picture[int(y) - 2 : int(y) + 3, int(x) - 2 : int(x) + 3].reshape(-1, 3).astype(int)
    return bool((np.abs(there - np.array(wanted)).max(axis=1) < 12).any())


def around(picture: Any, x: float, y: float, radius: float, wanted: tuple[int, ...]) -> bool:
    """Whether a colour is beside a place, on one side at least: other sides may be cut off or
    covered.
    """
    return any(
        near(picture, x + a * radius, y + b * radius, wanted)
        for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))
    )


def assert_shows(page: Page, runs: list[ReplayRun], frames: Frames, k: int) -> None:
    """Markers, their lamps and those of rows are on the screen as the run has them in a frame."""
    picture = page.screenshot()
    planes = box(page, "svg.plane")
    half = Plane.of(runs[0].setup).half
    for run, plane in zip(runs, planes, strict=True):
        sample = int(frames.samples(run)[k])
        lights = frames.states(run)[k]
        labels = run.trajectory.labels
        scale = plane["width"] / (2.0 * half[0])
        for i, (u, v) in enumerate(run.trajectory.features_px[sample]):
            x = plane["x"] + scale * (u + half[0])
            y = plane["y"] + scale * (v + half[1])
            # beside the marker's number, and in the ring around it
            assert around(picture, x, y, 6.0, colour(LOOKS[run.law].colour)), (run.law, i)
            state = int(lights[labels.index(f"fov[marker {i + 1}]")])
            if state:
                assert around(picture, x, y, 11.3, COLOURS[state]), (run.law, i)
    shown = page.value(
        "[...document.querySelectorAll('article')].map(a => [...a.querySelectorAll('code')].map(c "
        "=> c.title))"
    )
    lamps = iter(box(page, "li .state"))
    for run, rows in zip(runs, shown, strict=True):
        assert rows
        for label in rows:
            lamp = next(lamps)
            state = int(frames.states(run)[k, run.trajectory.labels.index(label)])
            x = lamp["x"] + 0.5 * lamp["width"]
            y = lamp["y"] + 0.5 * lamp["height"]
            assert near(picture, x, y, COLOURS[state]), (run.law, label)


@pytest.mark.skipif(
    program() is None, reason=f"no browser: none of {', '.join(NAMES)} is installed"
)
def test_a_replay_opens_plays_and_shows_what_the_run_says(tmp_path: Path) -> None:
    setup = Scenario.load(NAME).setup()
    runs = [ReplayRun(law.name, setup, simulate(setup, law)) for law in (Tracking(), SlidingMode())]
    frames = Frames.of(runs)
    write_replay(runs, tmp_path / "page.html")
    outside = (
        frames.states(runs[0])[:, runs[0].trajectory.labels.index("fov[marker 2]")] == VIOLATED
    )
    k = int(np.flatnonzero(outside)[outside.sum() // 2])
    address = (tmp_path / "page.html").as_uri()
    with browser(tmp_path / "browser") as page:
        page.open(f"{address}#t={frames.t[k] + 0.5 * frames.period:.3f}")
        page.wait(f"{LOADED} && document.documentElement.dataset.frame === '{k}'")
        page.wait("inViewer('[role=slider]') !== null && inViewer('canvas') !== null")
        assert_shows(page, runs, frames, k)
        press(page, "ArrowRight")
        page.wait(f"document.documentElement.dataset.frame === '{k + 1}'")
        press(page, " ")
        page.wait(f"Number(document.documentElement.dataset.frame) > {k + 1}")
        assert page.complaints == []
        assert all(
            url.startswith(("file:", "data:", "blob:", "about:")) for url in page.requests
        ), page.requests
        # and without WebGL
        page.ask("Page.addScriptToEvaluateOnNewDocument", source=NO_WEBGL)
        page.open(f"{address}?again#t={frames.t[k] + 0.5 * frames.period:.3f}")
        page.wait(
            f"{LOADED} && location.search !== '' && document.documentElement.dataset.frame === "
            f"'{k}'"
        )
        assert page.value(
            "viewer === null && !at('picture').hidden && "
            "at('picture').querySelector('img').naturalWidth > 0"
        )
        assert "no WebGL" in page.value("at('picture').innerText")
        assert_shows(page, runs, frames, k)
        caption = "at('picture').querySelector('figcaption').getBoundingClientRect().bottom"
        for one in (
            press,
            lambda page, key: page.value("at('bar').querySelector('button').click()"),
        ):
            one(page, " ")
            page.wait(f"document.documentElement.dataset.frame !== '{k}'")
            one(page, " ")
            k = int(page.wait("!playing && document.documentElement.dataset.frame"))
        require_whole(page)
        # a long name goes on in the next line before its bracket
        names = (
            "[...document.querySelectorAll('code')].map(e => [...e.childNodes].map(n => "
            "n.data || n.nodeName))"
        )
        assert page.value(names) == 2 * [["fov", "WBR", "[marker 2]"]]
        rests = page.value("[...document.querySelectorAll('li.rest')].map(e => e.innerText)")
        assert rests == 2 * ["and 1 row that is never active"]
        assert page.value(f"{caption} <= at('bar').getBoundingClientRect().top")
        assert page.complaints == []
