"""A preview in words and numbers."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import zip_longest

from .nearness import NEAR, Row
from .preview import Preview

MOST = 15
"""Rows that are listed, unless more are near."""


def lines(preview: Preview) -> Iterator[str]:
    """What a terminal shows, line by line, without the warnings."""
    setup = preview.setup
    robot, moments = setup.scene.robot, preview.moments
    yield f"{preview.name}: {robot.name}, {robot.n} joints, {len(setup.scene.markers)} markers"
    for moment in moments:
        where = "not known" if moment.q is None else " ".join(f"{x:.4g}" for x in moment.q)
        yield f"  {moment.name:8s} t = {moment.t:g} s, q = {where}"
    if not preview.rows:
        yield "  no rows, and no limits of joints"
        return
    shown = preview.rows[: max(MOST, len(preview.near))]
    yield "  rows nearest to their boundary: distance (φ); ! outside, * near"
    head = ["", "", *(moment.name for moment in moments)]
    table = [head, *(_cells(row) for row in shown)]
    widths = [max(map(len, column)) for column in zip_longest(*table, fillvalue="")]
    for cells in table:
        first, *others = (cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
        yield f"  {first} {'  '.join(others)}".rstrip()
    if len(shown) < len(preview.rows):
        yield f"  … and {len(preview.rows) - len(shown)} that are farther away"


def _cells(row: Row) -> list[str]:
    mark = "!" if row.greatest > 1.0 else "*" if row.greatest >= NEAR else ""
    return [mark, row.label, *(row.said(k) for k in range(len(row.usage)))]
