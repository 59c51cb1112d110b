"""Arms from tables of Denavit–Hartenberg parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ..errors import InvalidInput, shown
from ..rows import Array

DhRow = Annotated[Sequence[float], msgspec.Meta(min_length=4, max_length=4)]
"""θ offset [rad], d [m], a [m], α [rad] of a link."""


def read_dh(dh: Sequence[DhRow], prismatic: Sequence[int], name: str) -> tuple[pin.Model, int]:
    """The model of a table, and the number of its tip's frame; see :meth:`vsconstraints.robots.robot.Robot.from_dh`.

    Raises
    ------
    InvalidInput
        if the table has a wrong shape or is not of numbers.
    """
    try:
        rows = np.array(dh, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"the DH table must be rows of four numbers (θ offset, d, a, α): {error}") from error
    if rows.ndim != 2 or rows.shape[1] != 4 or len(rows) == 0:
        raise InvalidInput(f"the DH table must be (n, 4): θ offset, d, a, α; it has the shape {rows.shape}")
    if not np.isfinite(rows).all():
        raise InvalidInput("the DH table must be finite")
    numbers = list(prismatic) if isinstance(prismatic, Sequence) else [prismatic]
    unknown = [number for number in numbers if number not in range(1, len(rows) + 1)]
    if unknown:
        raise InvalidInput(f"prismatic joints are numbers from 1 to {len(rows)}, not {unknown}")
    model = pin.Model()
    model.name = name
    after = pin.SE3.Identity()
    for i, (theta, d, a, alpha) in enumerate(rows, start=1):
        turn = pin.SE3(np.asarray(pin.rpy.rpyToMatrix(0.0, 0.0, theta)), np.zeros(3))
        joint = pin.JointModelPZ() if i in prismatic else pin.JointModelRZ()
        joint_id = model.addJoint(i - 1, joint, after * turn, f"joint {i}")
        after = pin.SE3(np.asarray(pin.rpy.rpyToMatrix(alpha, 0.0, 0.0)), np.array([a, 0.0, d]))
        frame = model.addFrame(pin.Frame(f"link {i}", joint_id, after, pin.FrameType.BODY))
    return model, int(frame)


def dh_limits(value: ArrayLike, n: int, what: str) -> Array:
    """(n,) limits of joints, which may be infinite; raises InvalidInput that names ``what``."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (n,) or np.isnan(array).any():
        raise InvalidInput(f"{what} must be {n} numbers (infinite where there is no limit), not {shown(value)}")
    return array
