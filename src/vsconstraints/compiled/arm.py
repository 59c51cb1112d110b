"""The arrays of an arm with mass: its bodies, its drive, and what both remember; see
:mod:`.drives`.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..rows import Array, BoolArray, IntArray
from .workspace import BOOL, F8, I8, zeros

#: Controllers of the joints: computed torque; a speed loop with a position loop around it; the
#: speed loop alone.
TORQUE, POSITION, SPEED = range(3)


class BodyArrays(NamedTuple):
    """The moving bodies of an arm, one per joint, and how each is placed on the one before.

    Placement at q = 0, the joint's axis in it, whether it moves along the axis; mass [kg], centre
    of mass [m] and inertia about it [kg m²] in the body's frame; inertia of the motors as the
    joints feel it [kg m²]; gravity in the base frame [m/s²].
    """

    R: Annotated[Array, F8, "n", 3, 3]
    t: Annotated[Array, F8, "n", 3]
    axis: Annotated[Array, F8, "n", 3]
    prismatic: Annotated[BoolArray, BOOL, "n"]
    mass: Annotated[Array, F8, "n"]
    centre: Annotated[Array, F8, "n", 3]
    inertia: Annotated[Array, F8, "n", 3, 3]
    rotor: Annotated[Array, F8, "n"]
    gravity: Annotated[Array, F8, 3]


class Motion(NamedTuple):
    """M(q), of which the lower half counts, its Cholesky factor, and the bias h(q, q̇): M q̈ + h =
    τ.
    """

    M: Annotated[Array, F8, "n", "n"]
    L: Annotated[Array, F8, "n", "n"]
    bias: Annotated[Array, F8, "n"]
    work: Annotated[Array, F8, "n", 32]


class Drive(NamedTuple):
    """How the joints are driven; flags are 0 or 1."""

    kind: int
    exact: int  # whether the controller believes in the true model
    rate: float  # ω of its critically damped loops
    outer: float  # κ of the position loop around the speed loop [1/s]
    # inertia that the speed loop takes each joint to have [kg m²]
    weight: Annotated[Array, F8, "n"]
    effort: Annotated[Array, F8, "n"]  # greatest torque; infinite where there is none
    speed: Annotated[Array, F8, "n"]  # greatest speed that a reference may have
    # friction: per speed, at speed, at rest, and the speed at which the last two have met by 63 %
    viscous: Annotated[Array, F8, "n"]
    coulomb: Annotated[Array, F8, "n"]
    static: Annotated[Array, F8, "n"]
    stribeck: Annotated[Array, F8, "n"]
    has_friction: int
    # fraction of the way to the commanded torque that is covered in a substep: 1 − exp(−h/τ)
    share: float
    # whether the commanded torque acts without dead time and lag, and changes within a substep
    at_once: int
    fourth_order: int  # whether the motion is integrated by Runge and Kutta's method of that order


class Memory(NamedTuple):
    """The memory of a driven arm.

    The command integrated, which is the controller's reference; the integral of the speed loop's
    error; the weight that the controller compensates; the torque of the gears; torques commanded in
    the last substeps, a ring buffer, and the place of the next one; substeps in which the torque
    limit was exceeded.
    """

    q_c: Annotated[Array, F8, "n"]
    qd_c: Annotated[Array, F8, "n"]
    integral: Annotated[Array, F8, "n"]
    gravity: Annotated[Array, F8, "n"]
    torque: Annotated[Array, F8, "n"]
    under_way: Annotated[Array, F8, "slots", "n"]
    at: Annotated[IntArray, I8, 1]
    at_limit: Annotated[IntArray, I8, "n"]


class Arm(NamedTuple):
    """An arm, its controller's belief of it, inertia and bias of both, and its integration in
    substeps of h [s].

    The last six are scratch, ``commanded`` the torques that the controller commands.
    """

    true: BodyArrays
    believed: BodyArrays
    motion: Motion
    expected: Motion
    drive: Drive
    memory: Memory
    substeps: int
    h: float
    commanded: Annotated[Array, F8, "n"]
    acceleration: Annotated[Array, F8, "n"]
    after: Annotated[Array, F8, "n"]
    friction: Annotated[Array, F8, "n"]
    speed: Annotated[Array, F8, "n"]
    stages: Annotated[Array, F8, 4, "n"]


def blank(
    bodies: tuple[BodyArrays, BodyArrays], drive: Drive, slots: int, substeps: int, h: float
) -> Arm:
    """An arm of which nothing has been computed yet; its gears remember so many ``slots``."""
    known = {"true": bodies[0], "believed": bodies[1], "drive": drive, "substeps": substeps, "h": h}
    arm: Arm = zeros(Arm, {"n": len(drive.effort), "slots": slots}, known)
    return arm
