"""Arrays of an arm with mass: its bodies, its drive and their memory; see :mod:`.substeps`."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ...compiled.memory import zeros
from ...compiled.records import V3, Records, record
from ...rows import Array, BoolArray, IntArray

#: Joint controllers: computed torque; a speed loop inside a position loop; the speed loop alone.
TORQUE, POSITION, SPEED = range(3)


class BodyArrays(NamedTuple):
    """Moving bodies of an arm, one per joint, and the placement of each on the previous body.

    ``R`` and ``t`` are the placement at q = 0, ``axis`` is the joint axis in it, and ``prismatic``
    is true if the joint moves along that axis. ``mass`` [kg], the centre of mass ``centre`` [m] and
    the ``inertia`` about it [kg m²] are expressed in the body's frame. ``rotor`` is the inertia of
    the motors as seen by the joints [kg m²], ``gravity`` is expressed in the base frame [m/s²].
    """

    R: Annotated[Array, "n 3 3"]
    t: Annotated[Array, "n 3"]
    axis: Annotated[Array, "n 3"]
    prismatic: Annotated[BoolArray, "n"]
    mass: Annotated[Array, "n"]
    centre: Annotated[Array, "n 3"]
    inertia: Annotated[Array, "n 3 3"]
    rotor: Annotated[Array, "n"]
    gravity: Annotated[Array, "3"]


#: Body while inertia and bias are computed, in the axes of the base: velocity at the base's origin,
#: and angular velocity, of a motion of its joint with speed 1; force and moment about the base's
#: origin that accelerate it; mass, first moment, and inertia (xx, xy, xz, yy, yz, zz) about the
#: base's origin. The last five are then those of the body together with all bodies behind it.
LINK = record(
    ("velocity", V3),
    ("turn", V3),
    ("force", V3),
    ("moment", V3),
    "mass",
    ("first_moment", V3),
    ("inertia", (6,)),
)


class Motion(NamedTuple):
    """Inertia M(q), its Cholesky factor and the bias h(q, q̇), with M q̈ + h = τ.

    Only the lower half of ``M`` is used.
    """

    M: Annotated[Array, "n n"]
    L: Annotated[Array, "n n"]
    bias: Annotated[Array, "n"]
    links: Annotated[Records, LINK, "n"]


class Drive(NamedTuple):
    """Drive of the joints; flags are 0 or 1."""

    kind: int
    exact: int  # 1 if the controller's model is the true one
    rate: float  # ω of the critically damped loops
    outer: float  # κ of the position loop around the speed loop [1/s]
    # inertia of each joint assumed by the speed loop [kg m²]
    weight: Annotated[Array, "n"]
    effort: Annotated[Array, "n"]  # torque limit; inf if there is none
    speed: Annotated[Array, "n"]  # speed limit of the reference
    # friction: viscous, Coulomb and static, and the speed at which 63 % of the difference between
    # the last two has vanished
    viscous: Annotated[Array, "n"]
    coulomb: Annotated[Array, "n"]
    static: Annotated[Array, "n"]
    stribeck: Annotated[Array, "n"]
    has_friction: int
    # fraction of the step to the commanded torque that the lag covers in a substep: 1 − exp(−h/τ)
    share: float
    # 1 if the commanded torque acts without dead time and lag, and changes within a substep
    at_once: int
    fourth_order: int  # 1 for integration by the fourth-order Runge-Kutta method


class Memory(NamedTuple):
    """Memory of a driven arm.

    ``q_c`` and ``qd_c`` are the integrated command, which is the controller's reference.
    ``integral`` is the integral of the speed loop's error, ``gravity`` the weight that the
    controller compensates, and ``torque`` the torque of the gears. ``under_way`` is a ring buffer
    of the torques commanded in the last substeps, and ``at`` the place of the next one.
    ``at_limit`` counts the substeps in which the torque limit was exceeded.
    """

    q_c: Annotated[Array, "n"]
    qd_c: Annotated[Array, "n"]
    integral: Annotated[Array, "n"]
    gravity: Annotated[Array, "n"]
    torque: Annotated[Array, "n"]
    under_way: Annotated[Array, "slots n"]
    at: Annotated[IntArray, "1"]
    at_limit: Annotated[IntArray, "n"]


class Arm(NamedTuple):
    """Arm, its model in the controller, inertia and bias of both, and integration in substeps.

    A substep lasts ``h`` [s]. ``motion`` is that of the ``true`` bodies, ``expected`` that of the
    ``believed`` ones. The last six fields are scratch; ``commanded`` contains the torques that the
    controller commands.
    """

    true: BodyArrays
    believed: BodyArrays
    motion: Motion
    expected: Motion
    drive: Drive
    memory: Memory
    substeps: int
    h: float
    commanded: Annotated[Array, "n"]
    acceleration: Annotated[Array, "n"]
    after: Annotated[Array, "n"]
    friction: Annotated[Array, "n"]
    speed: Annotated[Array, "n"]
    stages: Annotated[Array, "4 n"]


def blank(
    bodies: tuple[BodyArrays, BodyArrays], drive: Drive, slots: int, substeps: int, h: float
) -> Arm:
    """Return an arm with empty memory and room for ``slots`` torques under way."""
    known = {"true": bodies[0], "believed": bodies[1], "drive": drive, "substeps": substeps, "h": h}
    arm: Arm = zeros(Arm, {"n": len(drive.effort), "slots": slots}, known)
    return arm
