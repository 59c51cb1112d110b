"""The scene in space: what hides what, and that a constraint of a user's own is drawn and hides
markers everywhere.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from vsconstraints.constraints import ConstraintSet, ForbiddenRegion, robot_points
from vsconstraints.images.silhouettes import covered
from vsconstraints.reports.plots import INK
from vsconstraints.robots.geometry import Pose
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation.occluders import Occluders
from vsconstraints.view.replay import ReplayRun
from vsconstraints.view.replay.runs import things_of
from vsconstraints.view.replay.space import scene_of
from vsconstraints.view.scene3d import Scene3D, Viewpoint
from vsconstraints.view.setup_scene import obstacle_meshes, setup_frames, viewpoint_of
from vsconstraints.view.solids import ball
from vsconstraints.vision.motion import Motion
from vsconstraints.vision.scene import Scene


def picture(scene: Scene3D, elevation: float = 20.0, azimuth: float = 30.0) -> Any:
    figure = Figure(figsize=(2.0, 2.0), dpi=60)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_subplot(projection="3d", computed_zorder=False)
    scene.draw(ax, Viewpoint(np.zeros(3), 1.0, elevation, azimuth), whole=False)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba()).copy()


def test_nothing_is_drawn_of_nothing() -> None:
    assert (picture(Scene3D()) == 255).all()


@pytest.mark.parametrize("azimuth", [-60.0, 30.0, 120.0, 210.0])
def test_a_plate_hides_none_of_its_markers(azimuth: float) -> None:
    """Polygons are ordered by their mean distance: a plate in one piece is drawn over the markers
    behind its middle.
    """
    markers = 0.5 * np.array(
        [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]
    )
    seen = []
    for number in range(4):
        with_all = Scene3D()
        without_one = Scene3D()
        with_all.target(markers, 0.01, 0.08)
        without_one.target(markers, 0.01, 0.08)
        without_one.parts = with_all.parts[:-1]  # without the markers
        for other in np.delete(markers, number, axis=0):
            without_one.add(ball(other, 0.08, 10), INK)
        differs = (picture(with_all, 45.0, azimuth) != picture(without_one, 45.0, azimuth)).any(
            axis=-1
        )
        seen.append(int(differs.sum()))
    assert min(seen) > 0.6 * max(seen), seen


class RoundedBox(ForbiddenRegion):
    """A region of a user's own, which says nothing of its mesh: a cube with round edges."""

    kind = "rounded-box"
    half = 0.05
    radius = 0.02

    def sigma(self, y: Any) -> Any:
        d = np.abs(self.pose.inverse.act(y)) - self.half
        outside = np.linalg.norm(np.maximum(d, 0.0), axis=-1) + np.minimum(d.max(axis=-1), 0.0)
        return self.radius - outside + self.margin

    def gradient(self, y: Any) -> Any:
        steps = 1e-6 * np.eye(3)
        return np.stack(
            [(self.sigma(y + step) - self.sigma(y - step)) / 2e-6 for step in steps], axis=-1
        )


def with_own_region(motion: Motion | None = None) -> Any:
    setup = Scenario.load("ur5-fov").setup()
    markers = setup.scene.markers
    camera = setup.scene.camera_pose(setup.q0).t
    pose = Pose(np.eye(3), 0.6 * markers[0] + 0.4 * camera)
    own = RoundedBox(pose, length=0.05, K=0.1, switching_gain=1.0)
    if motion is not None:
        own.moving(motion)
    constraints = (*setup.constraints.constraints, own)
    world = setup.scene
    scene = Scene(world.robot, world.camera, world.markers, robot_points(constraints))
    return replace(setup, scene=scene, constraints=ConstraintSet(constraints, scene)), own


def test_a_region_of_a_users_own_is_drawn_highlighted_and_hides_markers() -> None:
    setup, own = with_own_region()
    number = len(setup.constraints.constraints) - 1
    (mesh,) = own.meshes(0.0)
    # it is as large as it says, and where it is
    np.testing.assert_allclose(
        np.ptp(mesh.points, axis=0), 2.0 * (own.half + own.radius), rtol=0.02
    )
    np.testing.assert_allclose(own.sigma(mesh.points), 0.0, atol=1e-6)
    # previews and films
    size = viewpoint_of(setup, [(setup.q0, 0.0)], 1.0).half
    assert number in obstacle_meshes(setup, size)
    # replays: in space, and highlighted
    run: Any = ReplayRun("any", setup, None)  # type: ignore[arg-type]
    assert f"obstacle {number}" in {part.frame for part in scene_of([run], 1.0)[0].parts}
    assert things_of(run)[-1] == ("obstacle", number)
    # rendered images: it stands before the first marker
    camera = setup.scene.camera_pose(setup.q0)
    board = camera.inverse.act(setup.scene.markers)
    normal = np.cross(board[1] - board[0], board[2] - board[0])
    normal *= np.sign(normal @ board[0]) / np.linalg.norm(normal)
    solids = [
        camera.inverse.act(points)
        for points in Occluders(setup.scene, [own], ["regions"]).solids(setup.q0, 0.0)
    ]
    hidden = covered(solids, np.append(normal, normal @ board[0]), setup.scene.camera)
    pixels = setup.scene.camera.to_corner(
        setup.scene.camera.pixels(board[:, :2] / board[:, 2:]), "centres"
    )
    u, v = pixels[0]
    assert hidden[int(v), int(u)]
    assert 0.0 < hidden.mean() < 0.5
    assert not list(Occluders(setup.scene, [own], ["bodies"]).solids(setup.q0, 0.0))


def test_a_region_that_moves_is_drawn_where_it_is_then() -> None:
    setup, own = with_own_region(Motion([0.1, 0.0, 0.0]))
    before = own.meshes(0.0)[0].points
    after = own.meshes(2.0)[0].points
    np.testing.assert_allclose(after - before, [[0.2, 0.0, 0.0]] * len(before), atol=1e-12)
    number = len(setup.constraints.constraints) - 1
    np.testing.assert_allclose(
        setup_frames(setup, setup.q0, 2.0)[f"obstacle {number}"].pose.t, [0.2, 0.0, 0.0]
    )
    (seen,) = Occluders(setup.scene, [own], ["regions"]).solids(setup.q0, 2.0)
    np.testing.assert_allclose(seen, after)
