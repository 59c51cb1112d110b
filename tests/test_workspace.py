"""Workspace constraints: distances, characteristic points, collision geometry, singularities, and
what they do.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

from numpy_form import block, evaluate_rows, manipulability
from scenes import build_constraint, gradient, random_configuration, random_scene, robot, slope
from vsconstraints import Robot, RobotPoint
from vsconstraints.constraints import (
    Body,
    BodyDistance,
    Collision,
    ConstraintSet,
    ForbiddenBox,
    ForbiddenCapsule,
    ForbiddenCylinder,
    ForbiddenHalfSpace,
    ForbiddenRegion,
    Manipulability,
    SelfCollision,
    fixed_body,
    link_bodies,
    link_points,
)
from vsconstraints.constraints.bodies import disabled_pairs, mesh
from vsconstraints.constraints.meshes import mesh_of, surface
from vsconstraints.controllers import Controller, HierarchicalQP, SlidingMode, Tracking
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate
from vsconstraints.simulation.trajectory import Trajectory

GAINS = {"K": 0.1, "switching_gain": 0.2}
START = np.array([0.2, -0.1, 0.3])
END = np.array([0.5, 0.3, 0.1])

BOX = ForbiddenBox(centre=[0.3, 0.2, -0.1], size=[0.4, 0.3, 0.2], rpy=[0.3, -0.5, 1.2], **GAINS)
CYLINDER = ForbiddenCylinder(start=START, end=END, radius=0.12, **GAINS)
DISC = ForbiddenCylinder(start=START, end=START + np.array([0.05, 0.0, 0.02]), radius=0.3, **GAINS)
CAPSULE = ForbiddenCapsule(start=START, end=END, radius=0.12, **GAINS)
TABLE = ForbiddenHalfSpace(point=[0.1, 0.2, 0.3], normal=[1.0, -2.0, 0.5], **GAINS)
LENGTH = float(np.linalg.norm(END - START))

REGIONS: dict[str, tuple[ForbiddenRegion, coal.ShapeBase]] = {
    "box": (BOX, coal.Box(0.4, 0.3, 0.2)),
    "cylinder": (CYLINDER, coal.Cylinder(0.12, LENGTH)),
    "disc": (DISC, coal.Cylinder(0.3, float(np.hypot(0.05, 0.02)))),
    "capsule": (CAPSULE, coal.Capsule(0.12, LENGTH)),
    "half-space": (TABLE, coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)),
}
each_region = pytest.mark.parametrize("name", REGIONS)


def around(region: ForbiddenRegion, rng: np.random.Generator, count: int) -> Array:
    """Points (count, 3) in the base frame, inside, near and far."""
    local = rng.normal(size=(count, 3)) * rng.choice([0.03, 0.1, 0.3, 1.0], size=(count, 1))
    return region.pose.act(local)


def folder_of(name: str) -> Path:
    """Where the files of a ready-made robot are."""
    source = robot(name).source
    assert source is not None
    return source.path.parents[1]


# --- regions ---


@each_region
def test_distances_are_coals(name: str) -> None:
    region, shape = REGIONS[name]
    points = around(region, np.random.default_rng(1), 400)
    request = coal.DistanceRequest()
    request.gjk_tolerance = request.epa_tolerance = 1e-9
    request.gjk_max_iterations = request.epa_max_iterations = 500
    placed = coal.Transform3s(region.pose.R, region.pose.t)

    def distance(probe: coal.ShapeBase, p: Array) -> float:
        """A small body stands for the point: coal's distance to it is less by its radius."""
        result = coal.DistanceResult()
        return 1e-3 + coal.distance(
            shape, placed, probe, coal.Transform3s(np.eye(3), p), request, result
        )

    # inside cylinders coal finds a way out, not always the shortest: with spheres it only looks at
    # the side, with other bodies its iterations may end early
    expected = [
        max(distance(probe, p) for probe in (coal.Sphere(1e-3), coal.Capsule(1e-3, 1e-9)))
        for p in points
    ]
    inside = np.array(expected) < 0.0
    assert 20 < inside.sum() < 380
    np.testing.assert_allclose(-region.sigma(points), expected, rtol=0.0, atol=1e-7)


@each_region
def test_gradients_and_curvatures_of_regions(name: str) -> None:
    region, _ = REGIONS[name]
    rng = np.random.default_rng(2)
    points = around(region, rng, 300)
    velocity = rng.normal(size=(300, 3))
    h = 1e-6
    change = [region.sigma(points + h * e) - region.sigma(points - h * e) for e in np.eye(3)]
    numerical = np.stack(change, axis=-1) / (2 * h)
    np.testing.assert_allclose(region.gradient(points), numerical, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(region.gradient(points), axis=1), 1.0, atol=1e-12)
    ahead = region.gradient(points + h * velocity)
    behind = region.gradient(points - h * velocity)
    bend = ((ahead - behind) * velocity).sum(axis=1) / (2 * h)
    curvature = region.curvature(points, velocity)
    np.testing.assert_allclose(curvature, bend, rtol=1e-5, atol=1e-6)
    assert name == "half-space" or np.abs(curvature).max() > 1.0


@each_region
def test_following_the_gradient_leads_to_the_surface(name: str) -> None:
    """From inside too, and from where several ways out are equally short."""
    region, _ = REGIONS[name]
    axes = np.concatenate((np.eye(3), -np.eye(3), np.zeros((1, 3)))) * 0.02
    points = np.concatenate((around(region, np.random.default_rng(3), 50), region.pose.act(axes)))
    g = region.gradient(points)
    assert np.isfinite(region.curvature(points, np.ones_like(points))).all()
    assert np.isfinite(g).all()
    np.testing.assert_allclose(
        region.sigma(points - region.sigma(points)[:, None] * g), 0.0, atol=1e-12
    )


def test_the_gradient_is_defined_where_ways_out_are_equally_short() -> None:
    assert region_direction(BOX, [0.0, 0.0, 0.0]) == [0.0, 0.0, 1.0]
    cube = ForbiddenBox(centre=[0, 0, 0], size=[1, 1, 1], **GAINS)
    assert region_direction(cube, [0.0, 0.0, 0.0]) == [1.0, 0.0, 0.0]
    assert region_direction(CYLINDER, [0.0, 0.0, 0.0]) == [1.0, 0.0, 0.0]
    assert region_direction(DISC, [0.0, 0.0, 0.0]) == [0.0, 0.0, 1.0]
    pipe = ForbiddenCapsule(start=[0, 0, -1], end=[0, 0, 1], radius=0.1, **GAINS)
    assert np.linalg.norm(region_direction(pipe, [0.0, 0.0, 0.5])) == pytest.approx(1.0)
    assert region_direction(pipe, [0.0, 0.0, 0.5]) == [1.0, 0.0, 0.0]


def region_direction(region: ForbiddenRegion, local: list[float]) -> list[float]:
    outwards = -region.gradient(region.pose.act(np.array([local])))[0] @ region.pose.R
    return np.round(outwards, 12).tolist()


def test_margin_clearance_and_labels_of_regions() -> None:
    arm = robot("viper-s650")
    points = [RobotPoint(name="nose"), RobotPoint("link 3", name="elbow")]
    table = ForbiddenHalfSpace(
        point=[0, 0, 0.1], normal=[0, 0, 3.0], margin=0.02, points=points, name="table", **GAINS
    )
    scene, q, qd = random_scene(arm, np.random.default_rng(4), [table])
    constraints = ConstraintSet([table], scene)
    assert constraints.labels == ("half-space[table, nose]", "half-space[table, elbow]")
    state = scene.evaluate(0.0, q, qd)
    _, sigma = evaluate_rows(constraints, state)
    np.testing.assert_allclose(sigma, 0.12 - state.robot.points[:, 2], atol=1e-14)
    assert constraints.characteristic_length.tolist() == [0.1, 0.1]
    assert BOX.length == pytest.approx(0.1)
    assert CYLINDER.length == CAPSULE.length == 0.12


# --- points along the links ---


def surface_samples(arm: Robot, rng: np.random.Generator) -> dict[str, Array]:
    """Points on the collision geometry of every link that moves, in the link's frame."""
    samples: dict[str, list[Array]] = {}
    for body in arm.collision_geometry().geometryObjects:
        if body.parentJoint == 0:
            continue
        frame = arm.model.frames[body.parentFrame]
        solid = body.geometry
        if isinstance(solid, coal.BVHModelBase):
            mesh = mesh_of(solid)
            corners = mesh.points[mesh.triangles]
            weights = rng.dirichlet(np.ones(3), size=len(corners))
            local = np.concatenate(
                ((weights[:, :, None] * corners).sum(axis=1), corners.reshape(-1, 3))
            )
        else:
            local = primitive_samples(solid, rng)
        placement = frame.placement.inverse() * body.placement
        samples.setdefault(frame.name, []).append(
            local @ placement.rotation.T + placement.translation
        )
    return {link: np.concatenate(parts) for link, parts in samples.items()}


def primitive_samples(solid: coal.ShapeBase, rng: np.random.Generator) -> Array:
    direction = rng.normal(size=(2000, 3))
    if isinstance(solid, coal.Box):
        half = np.asarray(solid.halfSide)
        return direction / np.abs(direction / half).max(axis=1, keepdims=True)
    if isinstance(solid, coal.Sphere):
        return solid.radius * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    if isinstance(solid, coal.Capsule):
        unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        return solid.radius * unit + rng.uniform(-1, 1, (2000, 1)) * [0.0, 0.0, solid.halfLength]
    assert isinstance(solid, coal.Cylinder)
    rho = np.linalg.norm(direction[:, :2], axis=1)
    reach = np.maximum(rho / solid.radius, np.abs(direction[:, 2]) / solid.halfLength)
    return direction / reach[:, None]


URDF_ARMS: dict[str, Callable[[], Robot]] = {
    "ur5": lambda: robot("ur5"),
    "panda": lambda: robot("panda"),
    "panda of spheres and cylinders": lambda: Robot.from_urdf(
        folder_of("panda") / "urdf/panda_collision.urdf", tip="panda_hand"
    ),
}


@pytest.mark.parametrize("spacing", [0.03, 0.1, 1.0])
@pytest.mark.parametrize("name", URDF_ARMS)
def test_points_along_the_links_of_a_urdf_cover_their_surface(name: str, spacing: float) -> None:
    arm = URDF_ARMS[name]()
    found = link_points(arm, spacing=spacing)
    by_link: dict[str, list[tuple[float, float, float]]] = {}
    for point in found.points:
        by_link.setdefault(point.link, []).append(point.offset)
    farthest = 0.0
    for link, samples in surface_samples(arm, np.random.default_rng(5)).items():
        if link not in by_link:
            # every point of it is on the first axis
            assert link == "panda_link1"
            continue
        away = np.linalg.norm(samples[:, None] - np.array(by_link[link]), axis=2).min(axis=1)
        farthest = max(farthest, float(away.max()))
    assert farthest <= found.enlargement + 1e-12
    # and the bound is not much more than needed
    assert found.enlargement <= 1.25 * farthest + 0.01
    assert len({point.label for point in found.points}) == len(found.points)


def test_finer_spacing_needs_less_enlargement() -> None:
    arm = robot("ur5")
    found = [link_points(arm, spacing=spacing) for spacing in (0.3, 0.1, 0.05)]
    assert found[0].enlargement > found[1].enlargement > found[2].enlargement
    assert len(found[0].points) < len(found[1].points) < len(found[2].points)


@pytest.mark.parametrize("name", ["viper-s650", "kuka-kr6", "planar-3r", "mixed-arm", "ur5"])
def test_points_along_the_lines_between_joints_cover_capsules(name: str) -> None:
    arm = robot(name)
    rng = np.random.default_rng(6)
    radius = 0.07
    found = link_points(arm, spacing=0.08, link_radius=radius)
    for _ in range(3):
        q = random_configuration(arm, rng)
        placed = arm.kinematics(q, q, found.points).points
        pin.forwardKinematics(arm.model, data := arm.model.createData(), q)
        origins = [np.array(data.oMi[i].translation) for i in range(1, arm.model.njoints)] + [
            arm.pose(q).t
        ]
        for i, (a, b) in enumerate(pairwise(origins), start=1):
            if np.linalg.norm(b - a) < 1e-9 or (
                arm.model.joints[i].shortname() == "JointModelRZ" and i == 1
            ):
                # the first link turns about the line through its own middle, if that is the axis
                continue
            if i < arm.n and arm.model.joints[i + 1].shortname() == "JointModelPZ":
                # the next joint's origin slides away from this link's end
                b = np.array(data.oMi[i].act(arm.model.jointPlacements[i + 1].translation))
            sides = rng.normal(size=(500, 3))
            sides *= radius / np.linalg.norm(sides, axis=1, keepdims=True)
            samples = a + rng.uniform(size=(500, 1)) * (b - a) + sides
            away = np.linalg.norm(samples[:, None] - placed, axis=2).min(axis=1)
            assert away.max() <= found.enlargement + 1e-12
    assert found.enlargement <= np.hypot(radius, 0.04) + 1e-12


def test_a_link_chosen_alone_has_points_at_both_of_its_ends() -> None:
    arm = robot("kuka-kr6")
    alone = link_points(arm, link_radius=0.05, links=["link 2"])
    behind_another = [p for p in link_points(arm, link_radius=0.05).points if p.link == "link 2"]
    assert len(alone.points) == len(behind_another) + 1
    # the first joint's end slides away from the second link's start
    sliding = Robot.from_dh(
        [[0, 0, 0.3, 0], [0, 0, 0, 0], [0, 0, 0.3, 0]], prismatic=[2], name="sliding"
    )
    assert [p.link for p in link_points(sliding, spacing=0.3, link_radius=0.05).points] == [
        "link 1",
        "link 3",
        "link 3",
    ]


def test_a_spacing_far_beyond_a_link_leaves_a_point_at_each_of_its_ends() -> None:
    arm = robot("kuka-kr6")
    found = link_points(arm, spacing=1e12, link_radius=0.05, links=["link 2"])
    assert len(found.points) == 2
    assert found == link_points(arm, spacing=10.0, link_radius=0.05, links=["link 2"])


def test_no_two_points_coincide_and_every_point_moves() -> None:
    for name in ("viper-s650", "kuka-kr6", "planar-3r", "ur5"):
        arm = robot(name)
        points = link_points(arm, link_radius=0.05).points
        now = arm.kinematics(q := np.full(arm.n, 0.3), q, points)
        gaps = np.linalg.norm(now.points[:, None] - now.points, axis=2) + np.eye(len(points))
        assert gaps.min() > 1e-3
        assert np.abs(now.point_J).max(axis=(1, 2)).min() > 1e-6


def test_surfaces_of_other_solids_are_covered_by_the_boxes_around_them() -> None:
    rng = np.random.default_rng(7)
    solid = coal.Ellipsoid(0.3, 0.2, 0.1)
    cells, slack = surface(solid, 0.1)
    assert slack == 0.0
    direction = rng.normal(size=(200, 3))
    points = direction / np.linalg.norm(direction, axis=1, keepdims=True) * [0.3, 0.2, 0.1]
    low = cells.min(axis=1)
    high = cells.max(axis=1)
    held = ((points[:, None] >= low - 1e-12) & (points[:, None] <= high + 1e-12)).all(axis=2)
    assert held.any(axis=1).all()
    line, radius = surface(coal.Capsule(0.1, 0.5), 0.1)
    assert radius == 0.1
    assert np.abs(line).max() == pytest.approx(0.25)


def test_a_scenario_says_links_and_the_obstacle_is_enlarged() -> None:
    arm = robot("ur5")
    box = {
        "centre": [0.5, 0, 0.3],
        "size": [0.1, 0.1, 0.1],
        "margin": 0.01,
        "points": "links",
        **GAINS,
    }
    constraint = build_constraint(
        "forbidden-box", {**box, "spacing": 0.05, "links": ["forearm_link"]}, arm
    )
    assert isinstance(constraint, ForbiddenBox)
    found = link_points(arm, spacing=0.05, links=["forearm_link"])
    assert constraint.points == found.points
    assert constraint.margin == 0.01 + found.enlargement
    for type_name, table in {
        "forbidden-sphere": {"centre": [0.5, 0, 0.3], "radius": 0.1},
        "forbidden-half-space": {"point": [0, 0, 0], "normal": [0, 0, 1]},
    }.items():
        on_dh = build_constraint(
            type_name, {**table, "points": "links", "link_radius": 0.05, **GAINS}, robot("kuka-kr6")
        )
        assert len(on_dh.points) > 5


# --- collision geometry ---


def clear_states(
    constraint: BodyDistance, arm: Robot, rng: np.random.Generator, count: int
) -> list[Array]:
    """Configurations at which the nearest points are not about to change: gradients to both sides
    agree.
    """
    found: list[Array] = []
    while len(found) < count:
        q = random_configuration(arm, rng)
        g = constraint.gradient(q)
        if all(
            np.abs(constraint.gradient(q + 2e-5 * s * e) - g).max() < 2e-3
            for e in np.eye(arm.n)
            for s in (1, -1)
        ):
            found.append(q)
    return found


OBSTACLES = {
    "sphere": (coal.Sphere(0.1), 1e-6),
    "box": (coal.Box(0.3, 0.2, 0.4), 1e-6),
    "capsule": (coal.Capsule(0.1, 0.5), 1e-6),
    "cylinder": (coal.Cylinder(0.1, 0.5), 1e-6),
    "half-space": (coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), 1e-6),
}


@pytest.mark.parametrize("obstacle", OBSTACLES)
@pytest.mark.parametrize("name", ["ur5", "panda", "viper-s650"])
def test_gradients_of_distances_to_obstacles(name: str, obstacle: str) -> None:
    arm = robot(name)
    solid, tolerance = OBSTACLES[obstacle]
    bodies = link_bodies(arm, 0.05 if name == "viper-s650" else None)
    pose = Pose.from_xyz_rpy((0.3, 0.1, 0.4), (0.3, -0.5, 0.2))
    constraint = Collision(arm, bodies, fixed_body(obstacle, solid, pose), **GAINS)
    inside = outside = 0
    for q in clear_states(constraint, arm, np.random.default_rng(8), 8):
        distance = constraint.distances(q)
        inside = inside + int((distance < 0).sum())
        outside = outside + int((distance > 0).sum())
        h = 1e-5
        numerical = np.stack(
            [
                (constraint.distances(q + h * e) - constraint.distances(q - h * e)) / (2 * h)
                for e in np.eye(arm.n)
            ],
            -1,
        )
        np.testing.assert_allclose(-constraint.gradient(q), numerical, rtol=0.0, atol=tolerance)
    assert inside > 0
    assert outside > 0


@pytest.mark.parametrize("name", ["ur5", "panda", "viper-s650"])
def test_gradients_of_distances_between_links(name: str) -> None:
    arm = robot(name)
    constraint = SelfCollision(
        arm, link_bodies(arm, 0.05 if name == "viper-s650" else None), **GAINS
    )
    for q in clear_states(constraint, arm, np.random.default_rng(9), 4):
        numerical = gradient(constraint.distances, q, 1e-5)
        np.testing.assert_allclose(-constraint.gradient(q), numerical, rtol=0.0, atol=1e-5)


def test_pairs_for_self_collision() -> None:
    arm = robot("ur5")
    everything = SelfCollision(arm, link_bodies(arm), **GAINS)
    scene, _, _ = random_scene(arm, np.random.default_rng(10))
    labels = everything.labels(scene)
    assert "self-collision[forearm_link, base_link]" in labels
    assert "self-collision[forearm_link, upper_arm_link]" not in labels
    assert "self-collision[ee_link, wrist_3_link]" not in labels
    srdf = folder_of("ur5") / "srdf/ur5.srdf"
    fewer = SelfCollision(arm, link_bodies(arm), srdf=srdf, **GAINS).labels(scene)
    assert set(fewer) < set(labels)
    for label in set(labels) - set(fewer):
        assert frozenset(label.removeprefix("self-collision[")[:-1].split(", ")) in disabled_pairs(
            srdf
        )
    chosen = SelfCollision(arm, link_bodies(arm), pairs=[["wrist_1_link", "base_link"]], **GAINS)
    assert chosen.labels(scene) == ("self-collision[wrist_1_link, base_link]",)


def test_a_collision_rows_distance_is_that_of_the_hulls_corners_to_a_plane() -> None:
    """Independent of coal: the lowest corner of each mesh."""
    arm = robot("ur5")
    table = fixed_body("table", coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), Pose.identity())
    constraint = Collision(arm, link_bodies(arm), table, margin=0.02, **GAINS)
    scene, q, qd = random_scene(arm, np.random.default_rng(11), [constraint])
    constraints = ConstraintSet([constraint], scene)
    assert constraints.labels[0] == "collision[table, shoulder_link]"
    _, sigma = evaluate_rows(constraints, scene.evaluate(0.0, q, qd))
    data = arm.model.createData()
    pin.forwardKinematics(arm.model, data, q)
    lowest = [
        min(
            (corner @ placed.rotation.T + placed.translation)[2]
            for placed in [data.oMi[body.parentJoint] * body.placement]
            for corner in np.asarray(body.geometry.vertices())
        )
        for body in arm.collision_geometry().geometryObjects
        if body.parentJoint > 0 and isinstance(body.geometry, coal.BVHModelBase)
    ]
    np.testing.assert_allclose(0.02 - sigma[: len(lowest)], lowest, atol=1e-12)


def test_a_body_around_the_obstacles_centre_has_finite_rows() -> None:
    arm = robot("viper-s650")
    q = np.full(arm.n, 0.2)
    table = {
        "obstacle": {"shape": "sphere", "radius": 0.2, "xyz": arm.pose(q).t.tolist()},
        "bodies": [{"shape": "sphere", "radius": 0.1, "name": "ball"}],
        **GAINS,
    }
    constraint = build_constraint("collision", table, arm)
    assert isinstance(constraint, Collision)
    np.testing.assert_allclose(constraint.distances(q), -0.3, atol=1e-9)
    assert np.isfinite(constraint.gradient(q)).all()
    assert np.abs(constraint.gradient(q)).max() > 1e-3


@pytest.mark.parametrize("region", [CYLINDER, DISC])
def test_the_prism_that_stands_for_a_cylinder_holds_it_closely(region: ForbiddenCylinder) -> None:
    """Also inside, where coal's own distances to cylinders are not the shortest ways out."""
    arm = robot("viper-s650")
    length = float(np.linalg.norm(region.end - region.start))
    prism = fixed_body("prism", coal.Cylinder(region.radius, length), region.pose)
    rng = np.random.default_rng(16)
    for p in around(region, rng, 150):
        probe = Body("probe", 1, ((pin.SE3(np.eye(3), p), coal.Sphere(1e-3)),))
        distance = Collision(arm, [probe], prism, **GAINS).distances(np.zeros(arm.n))[0] + 1e-3
        # the first joint's frame is the base frame at q = 0
        assert -0.005 * region.radius - 1e-9 <= distance + region.sigma(p) <= 1e-7


def test_a_flat_mesh_has_no_hull() -> None:
    flat = coal.BVHModelOBBRSS()
    flat.beginModel(1, 3)
    flat.addTriangle(np.zeros(3), np.eye(3)[0], np.eye(3)[1])
    flat.endModel()
    with pytest.raises(ConfigurationError, match="plate has no convex hull"):
        fixed_body("plate", flat, Pose.identity())


def test_meshes_as_obstacles(tmp_path: Path) -> None:
    path = folder_of("ur5") / "meshes/ur5/collision/base.stl"
    solid = mesh(path, (2.0, 2.0, 2.0))
    solid.computeLocalAABB()
    single = mesh(path)
    single.computeLocalAABB()
    assert solid.aabb_radius == pytest.approx(2.0 * single.aabb_radius)
    table = {"obstacle": {"shape": "mesh", "file": str(path)}, "link_radius": 0.05, **GAINS}
    assert len(build_constraint("collision", table, robot("kuka-kr6")).labels(None)) == 5  # type: ignore[arg-type]
    empty = tmp_path / "empty.stl"
    empty.write_text("nothing")
    with pytest.raises(ConfigurationError, match=r"empty\.stl"):
        mesh(empty)


# --- singularities ---


@pytest.mark.parametrize("name", ["planar-3r", "viper-s650", "panda", "mixed-arm"])
@pytest.mark.parametrize("part", ["pose", "position"])
def test_manipulability_is_yoshikawas_and_its_gradient_exact(name: str, part: Any) -> None:
    arm = robot(name)
    if (name, part) == ("planar-3r", "position"):
        return
    constraint = Manipulability(arm, minimum=0.05, part=part, **GAINS)
    rows = slice(0, 6) if part == "pose" else slice(0, 3)

    def w(q: Array) -> float:
        J = arm.jacobian(q)[rows]
        G = J @ J.T if J.shape[0] <= J.shape[1] else J.T @ J
        return float(np.sqrt(max(np.linalg.det(G), 0.0)))

    rng = np.random.default_rng(12)
    for _ in range(5):
        scene, q, qd = random_scene(arm, rng)
        rows_now = block(constraint, scene.evaluate(0.0, q, qd), slice(0))
        assert rows_now.sigma[0] == pytest.approx(1.0 - w(q) / 0.05, abs=1e-9)
        numerical = gradient(lambda x: np.array(w(x)), q, 1e-4)
        np.testing.assert_allclose(rows_now.Lg[0], -0.1 / 0.05 * numerical, rtol=1e-6, atol=1e-7)
        rate = slope(lambda t, q=q, qd=qd: np.array(w(q + t * qd)), 1e-4)
        assert rows_now.phi[0] == pytest.approx(rows_now.sigma[0] - 0.1 / 0.05 * rate, abs=1e-7)


def test_the_gradient_of_manipulability_agrees_with_pinocchios_hessian() -> None:
    arm = robot("panda")
    q = random_configuration(arm, np.random.default_rng(13))
    data = arm.model.createData()
    pin.computeJointJacobians(arm.model, data, q)
    pin.computeJointKinematicHessians(arm.model, data)
    local = pin.ReferenceFrame.LOCAL
    H = np.array(pin.getJointKinematicHessian(arm.model, data, arm.n, local))
    # a column-major tensor (6, n, n) that Python sees as row-major: k, j, row
    H = H.ravel().reshape(arm.n, arm.n, 6)
    J = np.array(pin.getJointJacobian(arm.model, data, arm.n, local))
    # in the last joint's frame: w does not depend on where the tip is fixed to it
    w = np.sqrt(np.linalg.det(J @ J.T))
    expected = [w * np.trace(np.linalg.pinv(J) @ H[k].T) for k in range(arm.n)]
    now = arm.kinematics(q, np.zeros(arm.n))
    slope = manipulability(now.J, np.zeros(arm.n), 0, 6)[1]
    np.testing.assert_allclose(slope, expected, atol=1e-10)


def test_rows_are_finite_in_a_singular_configuration() -> None:
    arm = robot("viper-s650")
    constraint = Manipulability(arm, minimum=0.01, **GAINS)
    scene, q, qd = random_scene(arm, np.random.default_rng(14), [constraint])
    q[4] = 0.0  # the wrist's axes are in one line
    scene = type(scene)(arm, scene.camera, scene.camera_pose(q).act(np.array([[0.0, 0.0, 1.0]])))
    rows, sigma = evaluate_rows(ConstraintSet([constraint], scene), scene.evaluate(0.0, q, qd))
    assert sigma[0] == pytest.approx(1.0, abs=1e-9)
    for values in (rows.phi, rows.Lg, rows.Lf):
        assert np.isfinite(values).all()
    assert np.abs(rows.Lg).max() > 1e-3


def test_labels_of_manipulability() -> None:
    arm = robot("ur5")
    scene, _, _ = random_scene(arm, np.random.default_rng(15))
    both = [
        Manipulability(arm, minimum=0.05, **GAINS),
        Manipulability(arm, minimum=0.05, part="position", **GAINS),
    ]
    assert ConstraintSet(both, scene).labels == ("manipulability", "manipulability[position]")


# --- what cannot be used is said ---

BAD: list[tuple[str, str, dict[str, Any], list[str]]] = [
    (
        "ur5",
        "forbidden-box",
        {"centre": [0, 0, 0], "size": [1, 0, 1]},
        ["size of a box", "positive"],
    ),
    ("ur5", "forbidden-box", {"centre": [0, 0, 0], "size": [1, 1]}, ["size must be 3 numbers"]),
    (
        "ur5",
        "forbidden-box",
        {"centre": [0, 0, 0], "size": [1, 1, 1], "margin": -1.0},
        ["margin of a box"],
    ),
    (
        "ur5",
        "forbidden-cylinder",
        {"start": [0, 0, 0], "end": [0, 0, 0], "radius": 1},
        ["start and end", "cylinder"],
    ),
    (
        "ur5",
        "forbidden-capsule",
        {"start": [0, 0, 0], "end": [0, 0, 1], "radius": -1},
        ["radius of a capsule"],
    ),
    (
        "ur5",
        "forbidden-half-space",
        {"point": [0, 0, 0], "normal": [0, 0, 0]},
        ["normal of a half-space"],
    ),
    (
        "ur5",
        "forbidden-half-space",
        {"point": [0, 0, 0], "normal": [0, 0, 1], "points": "all"},
        ["points", "links"],
    ),
    (
        "ur5",
        "forbidden-half-space",
        {"point": [0, 0, 0], "normal": [0, 0, 1], "points": "links", "links": ["elbow"]},
        ["'elbow'", "forearm_link"],
    ),
    (
        "kuka-kr6",
        "forbidden-half-space",
        {"point": [0, 0, 0], "normal": [0, 0, 1], "points": "links"},
        ["KUKA", "no collision geometry", "radius"],
    ),
    (
        "ur5",
        "forbidden-half-space",
        {"point": [0, 0, 0], "normal": [0, 0, 1], "points": "links", "spacing": 0.0},
        ["spacing"],
    ),
    (
        "ur5",
        "forbidden-half-space",
        {"point": [0, 0, 0], "normal": [0, 0, 1], "spacing": 0.1},
        ["'spacing'"],
    ),
    (
        "planar-3r",
        "manipulability",
        {"minimum": 0.1, "part": "position"},
        ["planar 3R", "zero in every"],
    ),
    ("ur5", "manipulability", {"minimum": 0.0}, ["minimum"]),
    (
        "ur5",
        "manipulability",
        {"minimum": 0.1, "part": "elbow"},
        ["'elbow'", "position", "orientation"],
    ),
    ("ur5", "collision", {"obstacle": {"shape": "cone"}}, ["'cone'", "capsule", "half-space"]),
    (
        "ur5",
        "collision",
        {"obstacle": {"shape": "sphere", "radius": 0.0}},
        ["radius must be a positive number"],
    ),
    (
        "ur5",
        "collision",
        {"obstacle": {"shape": "mesh", "file": "no.stl"}},
        ["no mesh file", "no.stl"],
    ),
    (
        "ur5",
        "collision",
        {"obstacle": {"shape": "half-space"}, "links": ["elbow"]},
        ["'elbow'", "forearm_link"],
    ),
    (
        "ur5",
        "collision",
        {"obstacle": {"shape": "half-space"}, "margin": -0.1},
        ["margin of collision"],
    ),
    (
        "kuka-kr6",
        "collision",
        {"obstacle": {"shape": "half-space"}},
        ["KUKA", "no collision geometry", "radius"],
    ),
    ("ur5", "self-collision", {"pairs": [["elbow", "base_link"]]}, ["'elbow'", "forearm_link"]),
    (
        "ur5",
        "self-collision",
        {"pairs": ["base_link"]},
        ["pairs must be a list of lists of strings"],
    ),
    (
        "ur5",
        "self-collision",
        {"pairs": [["ee_link", "wrist_3_link"]]},
        ["no joint moves ee_link and wrist_3_link"],
    ),
    ("ur5", "self-collision", {"srdf": "no.srdf"}, ["no.srdf"]),
    (
        "ur5",
        "self-collision",
        {"bodies": [{"name": "ball", "shape": "sphere", "radius": 0.1}] * 2},
        ["different names", "ball"],
    ),
]


@pytest.mark.parametrize(("name", "type_name", "table", "words"), BAD)
def test_bad_input_is_refused_by_name(
    name: str, type_name: str, table: dict[str, Any], words: list[str]
) -> None:
    with pytest.raises((ConfigurationError, InvalidInput)) as refused:
        build_constraint(type_name, {**GAINS, **table}, robot(name))
    for word in words:
        assert word in str(refused.value)


def test_a_missing_mesh_is_named() -> None:
    arm = robot("ur5")
    assert arm.source is not None
    elsewhere = Robot.from_urdf(arm.source.path, "tool0", package_dirs=["/nowhere"])
    with pytest.raises(ConfigurationError, match=r"base\.stl"):
        link_bodies(elsewhere)
    with pytest.raises(ConfigurationError, match=r"base\.stl"):
        link_points(elsewhere)


# --- closed loops ---

LOOP: dict[str, Any] = {
    "robot": "viper-s650",
    "q0": [0.3179, -1.5414, 1.2426, -1.826, 0.4289, 0.0633],
    "sampling_time": 0.005,
    "duration": 2.5,
    "on_rank_loss": "continue",
    "camera": {"focal_px": [402.5, 402.5], "size_px": [512, 512]},
    "target": {
        "markers": [[0.564, 0.3095, 0.0108], [0.4666, 0.1403, 0.0541], [0.2919, 0.2348, 0.0302]]
    },
    "task": {
        "feature": "camera-pose",
        "Kp0": 20.0,
        "goals": [{"camera_at_q": [-0.0286, -0.3201, -0.3757, -0.9874, 1.2498, 0.0279]}],
    },
}
MARKS = {"K": 0.1, "switching_gain": 0.5}
BLOCKS: dict[str, dict[str, Any]] = {
    "box": {
        "type": "forbidden-box",
        "centre": [0.45, 0.1, 0.22],
        "size": [0.08, 0.1, 0.12],
        "rpy": [0.0, 0.0, 0.3],
        **MARKS,
    },
    "capsule": {
        "type": "forbidden-capsule",
        "start": [0.45, 0.1, 0.0],
        "end": [0.45, 0.1, 0.25],
        "radius": 0.05,
        **MARKS,
    },
    "cylinder": {
        "type": "forbidden-cylinder",
        "start": [0.45, 0.12, 0.0],
        "end": [0.45, 0.12, 0.25],
        "radius": 0.06,
        **MARKS,
    },
    "wall": {"type": "forbidden-half-space", "point": [0.5, 0, 0], "normal": [-1, 0, 0.2], **MARKS},
    "collision": {
        "type": "collision",
        "obstacle": {"shape": "box", "size": [0.08, 0.1, 0.12], "xyz": [0.45, 0.1, 0.16]},
        "bodies": [{"shape": "capsule", "radius": 0.03, "length": 0.1}],
        **MARKS,
    },
}
LAWS: dict[str, Callable[[], Controller]] = {
    "sliding-mode": SlidingMode,
    "hierarchical-qp": HierarchicalQP,
}


def run(blocks: list[dict[str, Any]], law: Controller, **changes: Any) -> tuple[Array, Array]:
    """Clearances and commands of a run."""
    trajectory = simulate(
        Scenario("loop", {**copy.deepcopy(LOOP), "constraints": blocks, **changes}, Path()).setup(),
        law,
    )
    assert trajectory.status not in ("failed", "aborted"), trajectory.reason
    return trajectory.clearance, trajectory.qdd_command


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("block", BLOCKS)
def test_an_obstacle_that_blocks_the_way_is_kept_clear_of(block: str, law: str) -> None:
    unaware, _ = run([BLOCKS[block]], Tracking())
    assert unaware.min() < -0.01
    clearance, qdd = run([BLOCKS[block]], LAWS[law]())
    # within a band of one switching per period: φ ≤ T_s u⁺
    assert clearance.min() > -0.005 * MARKS["switching_gain"]
    assert np.isfinite(qdd).all()


@pytest.mark.parametrize("law", LAWS)
def test_points_along_the_links_keep_the_arm_above_a_table(law: str) -> None:
    table = {
        "type": "forbidden-half-space",
        "point": [0, 0, 0.19],
        "normal": [0, 0, 1],
        "points": "links",
        "link_radius": 0.02,
        "links": ["link 6"],
        "spacing": 0.04,
        **MARKS,
    }
    unaware, _ = run([table], Tracking())
    assert unaware.min() < -0.003
    clearance, _ = run([table], LAWS[law]())
    assert clearance.min() > -0.0025


@pytest.mark.parametrize("law", LAWS)
def test_an_arm_that_starts_inside_is_led_out(law: str) -> None:
    inside = {
        "type": "forbidden-box",
        "centre": [0.261, 0.12, 0.28],
        "size": [0.1, 0.1, 0.1],
        **MARKS,
    }
    clearance, qdd = run([inside], LAWS[law](), duration=1.5)
    assert clearance[0, 0] < -0.04
    assert clearance[-1, 0] > -0.0025
    assert np.isfinite(qdd).all()


@pytest.mark.parametrize("law", LAWS)
def test_an_arm_is_kept_away_from_singularities(law: str) -> None:
    """The way back from the goal leads towards a singular wrist."""
    singular = {"type": "manipulability", "minimum": 0.02, "K": 0.1, "switching_gain": 2.0}
    way = {
        "q0": [-0.0286, -0.3201, -0.3757, -0.9874, 1.2498, 0.0279],
        "task": {
            **LOOP["task"],
            "goals": [{"camera_at_q": [0.3179, -1.5414, 1.2426, -1.826, 0.4289, 0.0633]}],
        },
    }
    unaware, _ = run([singular], Tracking(), **way)
    assert unaware.min() < -0.1
    clearance, _ = run([singular], LAWS[law](), **way)
    assert clearance.min() > -0.02


def wrists_of_a_ur5(blocks: list[dict[str, Any]], law: Controller) -> Trajectory:
    tables = Scenario.load("ur5-fov").tables
    changes = {
        "constraints": blocks,
        "duration": 1.5,
        "sampling_time": 0.005,
        "on_rank_loss": "continue",
    }
    trajectory = simulate(Scenario("wrists", {**tables, **changes}, Path()).setup(), law)
    assert trajectory.status not in ("failed", "aborted"), trajectory.reason
    return trajectory


WRISTS = ["wrist_1_link", "wrist_2_link", "wrist_3_link"]
BALE = {"xyz": [0.36, 0.16, 0.55], "rpy": [0.2, 0.1, 0.4], "size": [0.1, 0.1, 0.1]}
HULLS = {
    "type": "collision",
    "name": "bale",
    "obstacle": {"shape": "box", **BALE},
    "links": WRISTS,
    **MARKS,
}


@pytest.mark.parametrize("law", LAWS)
def test_the_hulls_of_a_urdf_keep_clear_of_a_box(law: str) -> None:
    assert wrists_of_a_ur5([HULLS], Tracking()).clearance.min() < -0.05
    trajectory = wrists_of_a_ur5([HULLS], LAWS[law]())
    assert trajectory.labels == tuple(f"collision[bale, {link}]" for link in WRISTS)
    assert trajectory.clearance.min() > -0.0025


@pytest.mark.parametrize("law", LAWS)
def test_points_along_the_links_keep_the_links_hulls_clear(law: str) -> None:
    """What section 4.3.6 promises, judged by what has no characteristic points: coal's distance to
    every body.
    """
    box = {
        "type": "forbidden-box",
        "centre": BALE["xyz"],
        "rpy": BALE["rpy"],
        "size": BALE["size"],
        **MARKS,
    }
    trajectory = wrists_of_a_ur5(
        [{**box, "points": "links", "links": WRISTS, "spacing": 0.04}], LAWS[law]()
    )
    judge = build_constraint(
        "collision", {key: HULLS[key] for key in HULLS if key != "type"}, robot("ur5")
    )
    assert isinstance(judge, Collision)
    assert min(judge.distances(q).min() for q in trajectory.q) > 0.0
