"""Laws that studies compare, with the options that are usual where a study does not vary them."""

from __future__ import annotations

from typing import Any

from ...comparisons.runs.spec import ControllerSpec

#: Options of each law, by the name in the studies.
OPTIONS: dict[str, dict[str, Any]] = {
    "sliding-mode": {},
    "potential-field": {"blend": "additive", "region": 0.2, "strength": 1.0},
    "potential-field-priority": {
        "type": "potential-field",
        "blend": "priority",
        "region": 0.2,
        "strength": 1.0,
    },
    "hierarchical-qp": {"rows": "barrier", "alpha": 20.0},
    "hierarchical-qp-active": {"type": "hierarchical-qp", "rows": "active"},
}
LAWS = {name: ControllerSpec.from_table(name, options) for name, options in OPTIONS.items()}
