"""Scene in space of several runs, as a viser page that plays them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

import numpy as np
import pinocchio as pin

from ...constraints.meshes import Mesh
from ...reports.plots.style import paler, rgb
from ...rows import Array, BoolArray, IntArray
from ..arm import REACH, joint_poses, visuals
from ..scene3d import Part, Placement, Scene3D, Viewpoint
from ..setup_scene import (
    EDGE_RADIUS,
    add_robot,
    add_surroundings,
    obstacle_meshes,
    points_in_view,
    setup_frames,
    view_axes,
    viewpoint_of,
)
from ..solids import ball, bar
from .runs import HIGHLIGHTS, Frames, ReplayRun, ThingOfRun, coloured, highlights_of

#: Colour of obstacles that are not highlighted; opacity of the arms after the first.
NOT_HIGHLIGHTED = "#8FA3BF"
OTHERS = 0.45
#: Radius of the markers of the targets after the first, for an arm of :data:`.REACH` [m].
OTHER_MARKER_RADIUS = 0.013
#: Distance between the surfaces of successive arms, for an arm of :data:`.REACH` [m]. Coinciding
#: surfaces would flicker. With this inset the first arm is visible where arms coincide.
INSET = 1.5e-3
#: Most triangles of an arm; an arm with more is simplified: points closer than MERGED [m], or
#: more if needed, become one.
MAX_TRIANGLES = 36_000
MERGED = 1e-3
INSTANTS = 9  # of each run at which everything is in view
#: Width over height of pictures; vertical field of view [rad] and least width over height of the
#: view on the page; margin around the scene, relative to half the side of its cube.
ASPECT = 1.25
FIELD_OF_VIEW = 0.7
NARROWEST = 0.72
ROOM = 0.15


def space_of(runs: Sequence[ReplayRun], frames: Frames) -> tuple[str, str]:
    """Return the viser page of all runs in one space, and a remark on simplifications."""
    import viser

    with redirect_stdout(StringIO()):  # the server prints its address
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            viewpoint = common_viewpoint(runs)
            _place_camera(server, standpoint(runs, viewpoint), viewpoint.centre)
            scene, remark = scene_of(runs, viewpoint.half / REACH)
            html = _recorded(server, scene, runs, frames, viewpoint.half)
        finally:
            server.stop()
    return html, remark


def _place_camera(server: Any, eye: Array, centre: Array) -> None:
    """Let a viser server begin with a camera at ``eye`` (3,) that looks at ``centre`` (3,)."""
    away = float(np.linalg.norm(eye - centre))
    camera = server.initial_camera
    camera.position = tuple(eye)
    camera.look_at = tuple(centre)
    camera.up = (0.0, 0.0, 1.0)
    camera.fov = FIELD_OF_VIEW
    camera.near = 0.01 * away
    camera.far = 100.0 * away
    server.scene.set_up_direction("+z")


def scene_of(runs: Sequence[ReplayRun], scale: float) -> tuple[Scene3D, str]:
    """Return arms, cameras, target and obstacles of runs, and a remark.

    They are fixed to the frames of :func:`frames_of`.
    """
    scene = Scene3D()
    setup = runs[0].setup
    camera_is_fixed = setup.scene.camera.fixed is not None
    arm, remark = visuals(setup.scene.robot, scale)
    meshes = coarse([part.mesh for part in arm])
    for k, (_, colour) in enumerate(coloured(runs)):
        is_first = k == 0
        prefix = f"{k} "
        opacity = 1.0 if is_first else OTHERS
        arm_look: dict[str, Any] = {"colour": paler(colour), "opacity": opacity}
        parts = []
        for part, mesh in zip(arm, meshes, strict=True):
            smaller = inset(mesh, k * INSET * scale)
            parts.append(part._replace(mesh=smaller, **arm_look))
        # a fixed camera is the same for all runs, and each arm carries a target
        camera_colour = colour if is_first or not camera_is_fixed else ""
        thickness = (1.0 - 0.03 * k) * scale
        add_robot(scene, setup, parts, thickness, camera_colour, prefix)
        if camera_is_fixed and not is_first:
            # smaller markers: coinciding surfaces would flicker
            edge_radius = EDGE_RADIUS * scale
            marker_radius = OTHER_MARKER_RADIUS * scale
            scene.target(setup.scene.markers, edge_radius, marker_radius, f"{prefix}target")
    add_surroundings(scene, setup, scale * REACH, NOT_HIGHLIGHTED)
    return scene, remark


def frames_of(runs: Sequence[ReplayRun], q: Sequence[Array], t: float) -> dict[str, Placement]:
    """Return the frames of :func:`.setup_frames` for all runs.

    The frames of run k have ``k`` before their names; shared frames have no prefix.
    """
    frames = {}
    for k, run in enumerate(runs):
        for name, placement in setup_frames(run.setup, q[k], t).items():
            frames[f"{k} {name}"] = placement
            if k == 0 and name.startswith(("target", "obstacle")):
                frames[name] = placement
    return frames


def _recorded(
    server: Any, scene: Scene3D, runs: Sequence[ReplayRun], frames: Frames, half: float
) -> str:
    """Return the page that plays the runs, recorded frame by frame on a viser server."""
    nodes = Nodes(server.scene)
    for part in scene.parts:
        nodes.add(part)
    covers = _add_covers(nodes, runs, frames, half)
    shown_q = []  # joint coordinates (F, n) of each run
    for k, (run, colour) in enumerate(coloured(runs)):
        samples = frames.samples(run)
        shown_q.append(run.trajectory.q[samples])
        path = _path(run, np.unique(samples))
        if len(path) > 1:
            segments = np.stack((path[:-1], path[1:]), axis=1)
            server.scene.add_line_segments(
                f"/{k} path",
                segments,
                rgb(colour),
                thickness=2.0,
                thickness_units="screen",
            )
    serializer = server.get_scene_serializer()
    for k, t in enumerate(frames.t.tolist()):
        q = [coordinates[k] for coordinates in shown_q]
        nodes.place(frames_of(runs, q, t))
        for is_visible, handle in covers:
            handle.visible = bool(is_visible[k])
        serializer.insert_sleep(frames.period)
    html: str = serializer.as_html()
    return html


def _add_covers(
    nodes: Nodes, runs: Sequence[ReplayRun], frames: Frames, half: float
) -> list[tuple[BoolArray, Any]]:
    """Add covers of all highlighted objects; return when each is visible (F,), and its handle."""
    covers = []
    for highlighted, states in highlights_of(runs, frames).items():
        mesh, frame = _cover(highlighted, runs, half)
        opacity = 0.85 if highlighted.thing.kind == "marker" else 0.6
        for state, colour in HIGHLIGHTS.items():
            handle = nodes.add(Part(mesh, colour, frame, opacity))
            covers.append((states == state, handle))
    return covers


def _path(run: ReplayRun, samples: IntArray) -> list[Array]:
    """Return the positions (3,) of the camera at these samples, or of the tip if it is fixed."""
    name = "camera" if run.setup.scene.camera.fixed is None else "tip"
    path = []
    for q in run.trajectory.q[samples]:
        placement = setup_frames(run.setup, q, 0.0)[name]
        path.append(placement.pose.t)
    return path


class Nodes:
    """Nodes of viser's scene: one for each frame, with the parts fixed to it below."""

    def __init__(self, scene: Any) -> None:
        self.scene = scene
        self.frames: dict[str, Any] = {}
        self.rails: dict[str, Any] = {}
        self.count = 0

    def add(self, part: Part) -> Any:
        """Add a part and return its handle."""
        if part.frame not in self.frames:
            self.frames[part.frame] = self.scene.add_frame(f"/{part.frame}", show_axes=False)
        # Rounding to a quarter of a millimetre is invisible and makes the file much smaller.
        points = np.round(part.mesh.points * 4096.0) / 4096.0
        self.count += 1
        handle = self.scene.add_mesh_simple(
            f"/{part.frame}/{self.count}",
            points,
            part.mesh.triangles,
            color=rgb(part.colour),
            opacity=None if part.opacity == 1.0 else part.opacity,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )
        if "slide" in part.frame:
            self.rails[part.frame] = handle
        return handle

    def place(self, placements: dict[str, Placement]) -> None:
        """Set the poses of the frames; viser sends only those that have changed."""
        for name, frame in self.frames.items():
            pose, stretch = placements[name]
            xyzw = pin.Quaternion(pose.R).coeffs()
            frame.position = pose.t
            frame.wxyz = np.round(np.roll(xyzw, 1), 6)
            if name in self.rails:
                self.rails[name].scale = (1.0, 1.0, stretch)


def _cover(highlighted: ThingOfRun, runs: Sequence[ReplayRun], half: float) -> tuple[Mesh, str]:
    """Return the mesh that covers a highlighted object, and the frame to which it is fixed."""
    k = highlighted.run
    kind, number = highlighted.thing
    scene = runs[k].setup.scene
    scale = half / REACH
    if kind == "marker":
        place = scene.markers[number - 1]
        frame = f"{k} target" if k else "target"
        return ball(place, 0.021 * scale, 12), frame
    if kind == "obstacle":
        meshes = obstacle_meshes(runs[k].setup, 1.01 * half)
        return meshes[number], f"obstacle {number}"
    zero = np.zeros(scene.robot.n)
    poses, axes = joint_poses(scene.robot, zero)
    half_axis = 0.05 * scale * poses[number].R.T @ axes[number - 1]
    radius = (0.062 - 0.002 * k) * scale
    return bar(-half_axis, half_axis, radius, 20), f"{k} joint {number}"


def inset(mesh: Mesh, depth: float) -> Mesh:
    """Return a mesh whose surface is moved inwards by ``depth`` [m]."""
    if depth == 0.0 or not len(mesh.triangles):
        return mesh
    import trimesh

    # Merge corners of several faces at one place.
    merged = trimesh.Trimesh(mesh.points, mesh.triangles)
    outwards = float(np.sign(merged.volume)) or 1.0
    points = np.asarray(merged.vertices) - outwards * depth * merged.vertex_normals
    return Mesh(points, np.asarray(merged.faces))


def coarse(meshes: list[Mesh]) -> list[Mesh]:
    """Return the meshes with at most :data:`MAX_TRIANGLES` triangles in all.

    If they have more, points close to each other are merged.
    """
    cell = MERGED
    fewer = meshes
    while sum(len(mesh.triangles) for mesh in fewer) > MAX_TRIANGLES:
        fewer = []
        for mesh in meshes:
            cells = np.round(mesh.points / cell)
            # the first point in each cell represents all others
            _, first, cell_of_point = np.unique(
                cells, axis=0, return_index=True, return_inverse=True
            )
            triangles = np.ravel(cell_of_point)[mesh.triangles]
            a, b, c = triangles.T
            has_area = (a != b) & (b != c) & (c != a)
            fewer.append(Mesh(mesh.points[first], triangles[has_area]))
        cell *= 1.4
    return fewer


def _instants(runs: Sequence[ReplayRun]) -> list[tuple[Array, float]]:
    """Return joint coordinates (n,) and times [s] from the starts of runs to their ends."""
    instants = []
    for run in runs:
        q = run.trajectory.q
        t = run.trajectory.t.tolist()
        for sample in np.linspace(0, len(t) - 1, INSTANTS).astype(int):
            instants.append((q[sample], t[sample]))
    return instants


def common_viewpoint(runs: Sequence[ReplayRun]) -> Viewpoint:
    """Return a viewpoint from which the motions of all runs are in view."""
    return viewpoint_of(runs[0].setup, _instants(runs), ASPECT)


def standpoint(runs: Sequence[ReplayRun], viewpoint: Viewpoint) -> Array:
    """Return the position (3,) of a camera that has the motions of all runs in view.

    The camera has the field of view ``FIELD_OF_VIEW``. From a distance d it sees a point x to
    the right of the centre, y above it and z nearer than it if |x| ≤ w (d − z) and |y| ≤ h (d − z).
    The distance is the least such d.
    """
    axes = view_axes(viewpoint.elevation, viewpoint.azimuth)
    setup = runs[0].setup
    points = np.concatenate([points_in_view(setup, q, t) for q, t in _instants(runs)])
    seen = (points - viewpoint.centre) @ axes
    across, up, towards = seen.T
    half_width = np.abs(across)
    half_height = np.maximum(half_width / NARROWEST, np.abs(up))
    needed = half_height + ROOM * viewpoint.half
    h = np.tan(0.5 * FIELD_OF_VIEW)
    distance = np.max(towards + needed / h)
    direction = axes[:, 2]
    eye: Array = viewpoint.centre + distance * direction
    return eye
