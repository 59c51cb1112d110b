"""The controllers that studies compare, with every option that they vary written out."""

from __future__ import annotations

from ...comparisons.runs.spec import SLIDING_MODE, ControllerSpec
from ...scenarios import Scenario

REGION = 0.2
"""Region of a potential field where a study does not vary it."""

ALPHA = 20.0
"""Rate α of the hierarchical QP's barrier where a study does not vary it [1/s]."""


def potential_field(blend: str, region: float = REGION, strength: float = 1.0) -> ControllerSpec:
    """A potential field of a blend, a region and a strength."""
    name = "potential-field" if blend == "additive" else f"potential-field-{blend}"
    options = {"blend": blend, "region": region} | ({"strength": strength} if strength != 1.0 else {})
    return ControllerSpec(name, "potential-field", options)


def hierarchical_qp(alpha: float = ALPHA) -> ControllerSpec:
    """The hierarchical QP with barrier rows."""
    return ControllerSpec("hierarchical-qp", options={"rows": "barrier", "alpha": alpha})


ACTIVE_QP = ControllerSpec("hierarchical-qp-active", "hierarchical-qp", {"rows": "active"})

LAWS = (SLIDING_MODE, potential_field("additive"), potential_field("priority"), hierarchical_qp(), ACTIVE_QP)
"""Every controller with its usual options."""


def scaled_gains(scenario: str, factor: float) -> dict[str, float]:
    """Overrides that multiply every u⁺ of a shipped scenario; none for the factor 1."""
    constraints = Scenario.load(scenario).tables["constraints"]
    if factor == 1.0:
        return {}
    return {f"constraints.{i}.switching_gain": factor * table["switching_gain"] for i, table in enumerate(constraints)}
