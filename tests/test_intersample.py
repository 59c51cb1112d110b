"""Clearance between samples, in scenes made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vsconstraints.rows import Array, IntArray
from vsconstraints.simulation.intersample import intersample_clearance


@pytest.mark.parametrize("seen_from", [0.0, 0.4])
def test_a_violation_is_found_in_the_part_of_a_period_that_is_seen(seen_from: float) -> None:
    """One joint moves from 0 to 1 in a period; the row is violated from 0.59 to 0.65."""

    def within(states: Array, samples: IntArray, share: float) -> tuple[Array, Array]:
        begin = states[samples, 0]
        move = states[samples + 1, 0] - begin
        return begin + share * move, move

    def clearance(t: Array, q: Array, *_: Any) -> Array:
        return np.abs(q - 0.62) - 0.03

    def views(t: Array, q: Array) -> tuple[Array, Array, Array]:
        return np.zeros((len(q), 1, 2)), np.zeros((len(q), 1, 3)), q[:, 0] >= seen_from

    setup: Any = SimpleNamespace(
        Ts=1.0,
        constraints=SimpleNamespace(characteristic_length=np.ones(1)),
        clearance=clearance,
    )
    control: Any = SimpleNamespace(views=views)
    plant: Any = SimpleNamespace(within=within, reversals=())
    states = np.array([[[0.0], [1.0]], [[1.0], [1.0]]])
    at_samples = clearance(np.zeros(2), states[:, 0])
    found = intersample_clearance(setup, control, plant, states, at_samples)
    assert found[0, 0] == pytest.approx(-0.03, abs=0.005)
    assert np.isinf(found[1, 0])
