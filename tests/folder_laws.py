"""Laws of the repository's folder controllers, loaded by their file as users load them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from vsconstraints.controllers import CONTROLLERS, Controller, controller_class, make_controller

FOLDER = Path(__file__).parents[1] / "controllers"
#: File and class of each law, by its name.
FOLDER_LAWS = {
    "cautious": f"{FOLDER}/cautious.py:Cautious",
    "gradual": f"{FOLDER}/gradual.py:Gradual",
    "careful": f"{FOLDER}/careful.py:Careful",
    "goal-governor": f"{FOLDER}/goal_governor.py:GoalGovernor",
    "barrier-governor": f"{FOLDER}/goal_governor.py:BarrierGovernor",
    "mppi": f"{FOLDER}/mppi.py:PathIntegralControl",
}
EVERY_LAW = (*CONTROLLERS, *FOLDER_LAWS)

GoalGovernor: Any = controller_class(FOLDER_LAWS["goal-governor"])
BarrierGovernor: Any = controller_class(FOLDER_LAWS["barrier-governor"])
PathIntegralControl: Any = controller_class(FOLDER_LAWS["mppi"])
#: Module of the governors, as it was loaded.
goal_governor: Any = sys.modules[GoalGovernor.__module__]


def make(name: str, options: dict[str, Any] | None = None) -> Controller:
    """A registered law or one of the folder."""
    return make_controller(FOLDER_LAWS.get(name, name), options)
