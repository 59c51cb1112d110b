"""What the rows of funnels share."""

from __future__ import annotations

from ..formulas.funnel import funnel
from ..formulas.tracking import goal_at
from ..rows import Array
from .compiler import in_place


@in_place
def funnel_now(numbers: Array, t: float, size: int) -> tuple[int, float, float, float]:
    """Where the goal that holds at time t [s] begins among the parameters of a funnel; its width and two derivatives.

    ``numbers`` are final, decay, the number of goals, when each begins, and ``size`` numbers of each.
    """
    goals = int(numbers[2])
    begins = numbers[3 : 3 + goals]
    goal = goal_at(begins, t)
    width, rate, bend = funnel(t - begins[goal], numbers[0], numbers[1])
    return 3 + goals + goal * size, width, rate, bend
