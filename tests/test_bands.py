"""What laws hold φ in while a marker slides, against the sampling time: two periods of what
`checks.bands` asks.
"""

from __future__ import annotations

import pytest
from checks.bands import LAWS, bands, order

from vsconstraints.compiled import available


@pytest.mark.skipif(not available(), reason="there is no compiler: this would take minutes")
@pytest.mark.parametrize(
    "name", ["implicit-switch", "implicit-switch-with-drift", "super-twisting"]
)
def test_bands_shrink_as_theory_says(name: str) -> None:
    periods = (0.01, 0.0025)
    assert order(bands(name, periods), periods) == pytest.approx(LAWS[name][1], abs=0.1)
