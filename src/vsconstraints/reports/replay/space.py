"""Arms, cameras, target and regions in space, as a page of viser's that plays them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ...robots.geometry import Pose
from ...rows import Array
from ..plots import INK
from ..plots.mesh import PLATE, Mesh
from ..preview.obstacles import add_obstacle
from ..preview.space import REACH, Viewpoint
from .frames import ACTS, OUTSIDE, Frames
from .lamps import Lamp, lamps_of
from .nodes import Mover, add_solid, of_mesh, pale, rgb
from .run import ReplayRun, looks_of
from .solids import Links, Solid, ball, bar, links_of, together
from .viewpoint import FIELD_OF_VIEW, common_viewpoint, standpoint

LIT = {ACTS: "#F0A202", OUTSIDE: "#D1102A"}
"""Colours of lamps."""

GLASS = "#8FA3BF"
"""What stands in the way and is not lit."""

FIRST, OTHERS = 1.0, 0.45
"""Opacity of the first arm, and of those that stand in the same place."""

THINNER = 1.5e-3
"""By how much an arm's surface is within that of the arm before it, for an arm of :data:`.REACH` [m].

Two surfaces in one place would flicker into each other; so where arms agree, the first one is seen.
"""


class Space(NamedTuple):
    """Viser's page, and what is different from what one would expect in it."""

    html: str
    remarks: list[str]


class Arm:
    """One robot in the scene, whose joints are moved frame by frame.

    Attributes
    ----------
    tip
        Name of the node that moves with the tip.
    """

    def __init__(self, scene: Any, name: str, run: ReplayRun, links: Links, colour: str, opacity: float) -> None:
        self.robot = run.setup.scene.robot
        self.data = self.robot.model.createData()
        self.joints: list[Mover] = []
        self.slides: dict[int, Mover] = {}
        at = name
        look: dict[str, Any] = {"color": rgb(colour), "opacity": None if opacity == 1.0 else opacity}
        scene.add_frame(at, show_axes=False)
        for i, solid in enumerate(links.solids):
            if i > 0:
                if self.robot.prismatic[i - 1]:
                    self.slides[i] = Mover(_slide(scene, f"{at}/slide", self.robot, i, look))
                at = f"{at}/{i}"
                self.joints.append(Mover(scene.add_frame(at, show_axes=False)))
            if len(solid.triangles):
                add_solid(scene, f"{at}/solid", solid, **look)
        placement = self.robot.model.frames[self.robot.frame_id("tip")].placement
        self.tip = f"{at}/tip"
        handle = scene.add_frame(self.tip, show_axes=False)
        Mover(handle).place(Pose(np.array(placement.rotation), np.array(placement.translation)))

    def joint(self, number: int) -> str:
        """Name of the node that a joint moves, counted from 1."""
        return f"{self.tip.split('/1/')[0]}/" + "/".join(str(i) for i in range(1, number + 1))

    def pose(self, q: Array) -> None:
        """Move it to joint coordinates (n,)."""
        pin.forwardKinematics(self.robot.model, self.data, q)
        for i, joint in enumerate(self.joints, start=1):
            M = self.data.liMi[i]
            joint.place(Pose(np.array(M.rotation), np.array(M.translation)))
            if i in self.slides:
                self.slides[i].set("scale", np.array([1.0, 1.0, q[self.robot.model.joints[i].idx_q] or 1e-6]))


def space_of(runs: Sequence[ReplayRun], frames: Frames) -> Space:
    """Viser's page of runs, all of them in one space: what is not the first arm is glass."""
    import viser

    # it tells where it serves, which nobody needs to know
    with redirect_stdout(StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            return _recorded(server, runs, frames)
        finally:
            server.stop()


def _recorded(server: Any, runs: Sequence[ReplayRun], frames: Frames) -> Space:
    scene, setup, colours = server.scene, runs[0].setup, looks_of(runs)
    viewpoint = common_viewpoint(runs)
    _stand(server, runs, viewpoint)
    size = viewpoint.half / REACH
    links = links_of(setup.scene.robot, size)
    arms = []
    for k, run in enumerate(runs):
        colour = pale(colours[run.law].colour)
        own = links.within(k * THINNER * size)
        arms.append(Arm(scene, f"/{k + 1} {_name(run.law)}", run, own, colour, FIRST if k == 0 else OTHERS))
        _carried(scene, arms[-1], run, (1.0 - 0.03 * k) * size, colours[run.law].colour)
        _path(scene, f"/{k + 1} path", run, frames, colours[run.law].colour)
    target = _target(scene, runs[0], arms, size)
    moving = _obstacles(scene, runs[0], viewpoint.half)
    lamps = [Bulbs(scene, lamp, runs, arms, viewpoint.half) for lamp in lamps_of(runs, frames)]
    samples = [frames.samples(run) for run in runs]
    serializer = server.get_scene_serializer()
    for k, t in enumerate(frames.t):
        for arm, run, at in zip(arms, runs, samples, strict=True):
            arm.pose(run.trajectory.q[at[k]])
        if target is not None and setup.scene.motion is not None:
            target.place(setup.scene.motion.pose(float(t)))
        for thing, motion in moving:
            thing.set("position", np.array(motion.displacement(float(t))))
        for lamp in lamps:
            lamp.show(k)
        serializer.insert_sleep(frames.period)
    return Space(serializer.as_html(), [links.remark] if links.remark else [])


class Bulbs:
    """A lamp in space: nothing, or a coloured cover around what it is about."""

    def __init__(self, scene: Any, lamp: Lamp, runs: Sequence[ReplayRun], arms: Sequence[Arm], half: float) -> None:
        self.lamp, self.shown = lamp, 0
        solid, parent = _cover(lamp, runs, arms, half)
        glass = {"opacity": 0.85 if lamp.what == "marker" else 0.6}
        self.covers = {
            state: add_solid(scene, f"{parent}/lamp {lamp.what} {lamp.number} {state}", solid, rgb(colour), **glass)
            for state, colour in LIT.items()
        }
        for cover in self.covers.values():
            cover.visible = False

    def show(self, frame: int) -> None:
        """Light it as in a frame."""
        state = int(self.lamp.lights[frame])
        if state != self.shown:
            for one, cover in self.covers.items():
                if one in (state, self.shown):
                    cover.visible = one == state
            self.shown = state


def _cover(lamp: Lamp, runs: Sequence[ReplayRun], arms: Sequence[Arm], half: float) -> tuple[Solid, str]:
    """The cover of a lamp, and the node it is fixed to."""
    setup, scale = runs[lamp.run].setup, half / REACH
    if lamp.what == "marker":
        parent = arms[lamp.run].tip if setup.scene.camera.fixed is not None else "/target"
        return ball(setup.scene.markers[lamp.number - 1], 0.021 * scale, 1), parent
    if lamp.what == "joint":
        robot = setup.scene.robot
        along = _axis(robot, lamp.number) * 0.05 * scale
        return bar(-along, along, (0.062 - 0.002 * lamp.run) * scale), arms[lamp.run].joint(lamp.number)
    mesh = Mesh()
    add_obstacle(mesh, setup.constraints.constraints[lamp.number], 0.0, 1.01 * half)
    return of_mesh(mesh), f"/obstacle {lamp.number}"


def _stand(server: Any, runs: Sequence[ReplayRun], viewpoint: Viewpoint) -> None:
    """Where who opens the page stands, and the light."""
    eye = standpoint(runs, viewpoint)
    away = float(np.linalg.norm(eye - viewpoint.centre))
    camera = server.initial_camera
    camera.position, camera.look_at = tuple(eye), tuple(viewpoint.centre)
    camera.up, camera.fov = (0.0, 0.0, 1.0), FIELD_OF_VIEW
    camera.near, camera.far = 0.01 * away, 100.0 * away
    server.scene.set_up_direction("+z")


def _carried(scene: Any, arm: Arm, run: ReplayRun, size: float, colour: str) -> None:
    """The camera at the tip, or the one that is fixed, and the bar to what the tip carries."""
    camera = run.setup.scene.camera
    width, height = camera.size
    eye = {
        "fov": float(2.0 * np.arctan(0.5 * height / camera.focal[1])),
        "aspect": float(width / camera.focal[0] / (height / camera.focal[1])),
        "scale": 0.16 * size,
        "color": rgb(colour),
        "thickness": 0.006 * size,
        "variant": "filled",
    }
    if camera.fixed is None:
        at = camera.mount.inverse
        Mover(scene.add_camera_frustum(f"{arm.tip}/camera", **eye)).place(at)
    else:
        Mover(scene.add_camera_frustum("/camera", **eye)).place(camera.fixed)
        at = Pose(np.eye(3), run.setup.scene.markers.mean(axis=0))
    if np.linalg.norm(at.t) > 1e-6:
        add_solid(scene, f"{arm.tip}/carrier", bar(np.zeros(3), at.t, 0.007 * size), rgb("#4A5568"))


def _path(scene: Any, name: str, run: ReplayRun, frames: Frames, colour: str) -> None:
    """Where the camera, or the tip before a fixed one, goes."""
    world, samples = run.setup.scene, frames.samples(run)
    to = Pose.identity() if world.camera.fixed is not None else world.camera.mount.inverse
    places = np.array([(world.robot.pose(run.trajectory.q[k]) @ to).t for k in np.unique(samples)])
    if len(places) > 1:
        pieces = np.stack((places[:-1], places[1:]), axis=1)
        scene.add_line_segments(name, pieces, rgb(colour), thickness=2.0, thickness_units="screen")


def _target(scene: Any, run: ReplayRun, arms: Sequence[Arm], size: float) -> Mover | None:
    """The plate with its markers, which moves, stands still, or is carried by each arm."""
    markers = run.setup.scene.markers
    spots = together([ball(marker, 0.013 * size, 2) for marker in markers])
    fixed = run.setup.scene.camera.fixed is not None
    for parent in [arm.tip for arm in arms] if fixed else ["/target"]:
        handle = None if fixed else scene.add_frame(parent, show_axes=False)
        add_solid(scene, f"{parent}/markers", spots, rgb(INK))
        if len(markers) > 2:
            corners = markers.mean(axis=0) + 1.25 * (markers - markers.mean(axis=0))
            fan = np.array([[0, i, i + 1] for i in range(1, len(corners) - 1)])
            add_solid(scene, f"{parent}/plate", Solid(corners, fan), rgb(PLATE), flat_shading=True)
    return None if fixed else Mover(handle)


def _obstacles(scene: Any, run: ReplayRun, half: float) -> list[tuple[Mover, Any]]:
    """What stands in the way, as glass; those of them that move, with their motions."""
    moving = []
    for k, constraint in enumerate(run.setup.constraints.constraints):
        mesh = Mesh()
        add_obstacle(mesh, constraint, 0.0, half)
        if mesh.polygons:
            handle = scene.add_frame(f"/obstacle {k}", show_axes=False)
            add_solid(scene, f"/obstacle {k}/glass", of_mesh(mesh), rgb(GLASS), opacity=0.45)
            motion = getattr(constraint, "motion", None)
            if motion is not None:
                moving.append((Mover(handle), motion))
    return moving


def _slide(scene: Any, name: str, robot: Any, joint: int, look: dict[str, Any]) -> Any:
    """A bar of length 1 along what a joint slides on, in the frame before it."""
    placement, axis = robot.model.jointPlacements[joint], _axis(robot, joint)
    z_to_axis = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix()
    thin = bar(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.004)
    handle = add_solid(scene, name, thin, look["color"], opacity=look["opacity"])
    Mover(handle).place(Pose(np.array(placement.rotation) @ z_to_axis, np.array(placement.translation)))
    return handle


def _axis(robot: Any, joint: int) -> Array:
    """(3,) direction of a joint's axis, in its own frame."""
    data = robot.model.joints[joint].createData()
    robot.model.joints[joint].calc(data, np.zeros(robot.n), np.zeros(robot.n))
    S = np.asarray(data.S).reshape(6)
    axis: Array = S[:3] if robot.prismatic[joint - 1] else S[3:]
    return axis


def _name(law: str) -> str:
    return law.replace("/", "-")
