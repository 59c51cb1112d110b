"""Formulas that stand once, for NumPy and compiled code: against NumPy, SciPy, differences and
numbers by hand.

What both forms share no comparison of the two can tell to be wrong, so nothing here is computed by
another formula of the package.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenes import second_slope, slope
from vsconstraints.formulas import (
    curves,
    features,
    frames,
    motion,
    polylines,
    regions,
    rotation,
    row,
    vectors,
)
from vsconstraints.formulas.velocity import rate_factor
from vsconstraints.rows import Array

RNG = np.random.default_rng(7)
A, B = RNG.normal(size=(2, 3, 3))
a, b, c, d, e = RNG.normal(size=(5, 3))


def same(found: Any, expected: Any, rtol: float = 1e-13) -> None:
    np.testing.assert_allclose(np.array(found), expected, rtol=rtol, atol=1e-14)


def cross_matrix(x: Array) -> Array:
    """[x]×: its columns are x × eᵢ."""
    return np.cross(x, np.eye(3)).T


# --- vectors and rotations ---


def test_products_are_numpys() -> None:
    same(vectors.vector(a), a)
    same(vectors.matrix(A), A)
    same(vectors.plus(a, b), a + b)
    same(vectors.minus(a, b), a - b)
    same(vectors.times(3.0, a), 3.0 * a)
    same(vectors.add_scaled(a, 3.0, b), a + 3.0 * b)
    same(vectors.cross(a, b), np.cross(a, b))
    same(vectors.dot(a, b), a @ b)
    same(vectors.rotate(A, a), A @ a)
    same(vectors.rotate_inverse(A, a), A.T @ a)
    same(vectors.product(A, B), A @ B)
    same(vectors.transposed_product(A, B), A.T @ B)
    same(rotation.length(a), np.linalg.norm(a))
    same(rotation.with_half_cross(A, a), A + 0.5 * cross_matrix(a))
    same(features.pair(A, a, B, b), A @ a + B @ b)
    same(frames.rotate_in_image(A, a), A[:2, :2] @ a[:2])
    same(frames.rotate_inverse_in_image(A, a), A[:2, :2].T @ a[:2])


@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0, np.pi, 4.0])
def test_turns_are_scipys(angle: float) -> None:
    axis = a / np.linalg.norm(a)
    expected = Rotation.from_rotvec(angle * axis).as_matrix()
    same(rotation.turn_about(axis, np.sin(angle), np.cos(angle)), expected)
    same(
        motion.angle(((expected - np.eye(3)) ** 2).sum()),
        min(angle, 2.0 * np.pi - angle),
        rtol=1e-7,
    )
    assert motion.angle(8.0 + 1e-9) == pytest.approx(np.pi, abs=1e-12)


@pytest.mark.parametrize("theta", [1e-4, 0.03, 0.0999, 0.1, 0.4, 2.0, 3.1, 6.0])
def test_the_cotangents_coefficient_is_its_sum_of_partial_fractions(theta: float) -> None:
    """1 − x/2 cot(x/2) = Σ 2x²/((2πk)² − x²), of which Σ 2/(2πk)² = 1/12 is taken apart."""
    poles = (2.0 * np.pi * np.arange(20000, 0, -1)) ** 2
    value = 1.0 / 12.0 + (2.0 * theta**2 / (poles * (poles - theta**2))).sum()
    found = rotation.cotangent_coefficient(theta)
    same(found[0], value, rtol=1e-12)
    # just above 0.1 the closed form's difference of numbers next to each other leaves some 1e-10
    same(found[1], (4.0 / (poles - theta**2) ** 2).sum(), rtol=1e-9)


def test_whole_turns_are_kept_as_often_as_they_were_made() -> None:
    axis = a / np.linalg.norm(a)
    for turns in (1, 2, 3):
        same(
            rotation.rotation_vector(np.eye(3), (2.0 * np.pi * turns + 0.1) * axis, True),
            2.0 * np.pi * turns * axis,
        )


# --- motion ---


def test_a_displacement_by_hand() -> None:
    """At ωt + ψ = 2π/3, whose sine is √3/2 and whose cosine is −1/2."""
    found = motion.displacement(0.5, 2.0, 3.0, np.pi, np.pi / 6.0)
    half = np.sqrt(3.0) / 2.0
    same(found, [1.0 + 3.0 * (half - 0.5), 2.0 - 1.5 * np.pi, -3.0 * np.pi**2 * half])


@pytest.mark.parametrize("omega", [a, np.zeros(3), np.array([0.2, 0.0, 0.0])])
def test_a_target_turns_about_its_centre(omega: Array) -> None:
    R, position = motion.target_pose(0.7, omega, b, d)
    turn = Rotation.from_rotvec(0.7 * omega)
    same(R, turn.as_matrix())
    for x in (a, b, c):
        same(np.array(R) @ x + position, turn.apply(x - b) + b + d)


def body(t: float) -> tuple[Rotation, Array]:
    """A body's pose, right to second order in time: ω = a + b t, v = c + d t."""
    return Rotation.from_rotvec(t * a + 0.5 * t * t * b), t * c + 0.5 * t * t * d


def test_a_point_is_carried_as_differences_say() -> None:
    def there(t: float) -> Array:
        turn, moved = body(t)
        return turn.apply(e) + moved

    velocity, acceleration = motion.carried(e, c, a, d, b)
    same(velocity, slope(there, 1e-3), rtol=1e-8)
    # the pose is wrong by t³, of which a symmetric difference sees nothing
    same(acceleration, second_slope(there, 1e-3), rtol=1e-6)


def test_a_camera_seen_from_a_target_moves_as_differences_say() -> None:
    """The target turns with e about the origin; what is seen is expressed in the camera's axes, at
    t = 0 the base's.
    """

    def seen(t: float) -> tuple[Rotation, Array]:
        turn, moved = body(t)
        target = Rotation.from_rotvec(t * e).inv()
        return target * turn, target.apply(A[0] + moved)

    def speed(t: float) -> Array:
        """In the camera's axes, which turn as it does."""
        turn, _ = seen(t)
        return turn.inv().apply(slope(lambda s: seen(t + s)[1], 1e-3))

    def turning(t: float) -> Array:
        return slope(lambda s: (seen(t)[0].inv() * seen(t + s)[0]).as_rotvec(), 1e-3)

    v, omega, v_dot, omega_dot = motion.relative_twist(c, d, a, b, e, A[0])
    same(v, speed(0.0), rtol=1e-8)
    same(omega, turning(0.0), rtol=1e-8)
    same(v_dot, slope(speed, 1e-3), rtol=1e-5)
    same(omega_dot, slope(turning, 1e-3), rtol=1e-5)


# --- images and features ---


def test_rows_of_the_interaction_matrix_are_the_textbooks() -> None:
    """Chaumette and Hutchinson (2006), eq. (11), at x = 0.5, y = −0.25 and Z = 2."""
    expected = np.array(
        [[-0.5, 0.0, 0.25, -0.125, -1.25, -0.25], [0.0, -0.5, -0.125, 1.0625, 0.125, -0.5]]
    )
    for coordinate in (0, 1):
        same(features.image_row(coordinate, 0.5, -0.25, 2.0), expected[coordinate])
    linear, angular = features.interaction(3.0, -2.0, 0.5, -0.25, 2.0)
    same([*linear, *angular], 3.0 * expected[0] - 2.0 * expected[1])


def test_a_point_in_the_image_moves_as_differences_say() -> None:
    """The camera of :func:`body`, its acceleration in its own axes: d − a × c."""
    P = np.array([0.3, -0.2, 1.5])

    def seen(t: float) -> Array:
        turn, moved = body(t)
        X, Y, Z = turn.inv().apply(P - moved)
        return np.array([X / Z, Y / Z])

    found = features.image_motion(P, c, a, d - np.cross(a, c), b)
    same(found[:2], [0.2, -0.2 / 1.5])
    same(found[2:4], slope(seen, 1e-3), rtol=1e-8)
    same(found[4:], second_slope(seen, 1e-3), rtol=1e-6)


def test_a_row_on_speeds_is_not_divided_by_its_gain_of_zero() -> None:
    np.testing.assert_array_equal(rate_factor(np.array([0.0, 0.5, 2.0])), [1.0, 0.5, 2.0])


def test_the_error_of_a_pose_is_that_of_homogeneous_matrices() -> None:
    goal = np.eye(4)
    now = np.eye(4)
    goal[:3, :3] = Rotation.from_rotvec(0.5 * a).as_matrix()
    goal[:3, 3] = b
    now[:3, :3] = Rotation.from_rotvec(0.3 * c).as_matrix()
    now[:3, 3] = d
    between = np.linalg.inv(goal) @ now
    E, t, turn = features.pose_error(goal[:3, :3], b, now[:3, :3], d, np.zeros(3), False)
    same(E, between[:3, :3])
    same(t, between[:3, 3])
    same(turn, Rotation.from_matrix(between[:3, :3]).as_rotvec())


def test_the_rates_of_a_pose_are_those_of_its_matrix() -> None:
    """Camera's velocity c in axes that turn with a: the pose's is E c, its second derivative E (d +
    a × c).
    """
    E = Rotation.from_rotvec(b).as_matrix()

    def velocity(t: float) -> Array:
        return E @ body(t)[0].apply(c + t * d)

    rate, second, turning = features.pose_rates(E, A, B, c, a, d, b)
    same(rate, velocity(0.0))
    same(second, slope(velocity, 1e-3), rtol=1e-8)
    same(turning, A @ b + B @ a)


def test_a_goal_is_reached_at_its_tolerances_and_not_beyond() -> None:
    tolerance = (0.01, 0.02, 0.5, 0.1)
    assert motion.reached(0.01, 0.02, 9.0, 0.1, tolerance, True)
    assert not motion.reached(0.011, 0.02, 0.0, 0.0, tolerance, True)
    assert not motion.reached(0.01, 0.021, 0.0, 0.0, tolerance, True)
    assert not motion.reached(0.0, 0.0, 0.0, 0.11, tolerance, True)
    assert motion.reached(9.0, 9.0, 0.5, 0.1, tolerance, False)
    assert not motion.reached(0.0, 0.0, 0.51, 0.0, tolerance, False)
    assert not motion.reached(0.0, 0.0, 0.0, 0.11, tolerance, False)


# --- what rows ask for ---


@pytest.mark.parametrize(
    ("purpose", "relative", "everywhere", "expected"),
    [
        (row.BOUND, 0, 0, [-1.0, -4.0, -2.0, 3.0]),
        (row.BOUND, 1, 1, [-3.0, -6.0, -4.0, 1.0]),
        (row.PUSH, 0, 1, [np.inf, -2.0, 0.0, np.inf]),
        (row.PUSH, 1, 1, [-1.0, -4.0, -2.0, np.inf]),
        (row.EQUAL, 0, 0, [np.inf, -4.0, -2.0, np.inf]),
        (row.EQUAL, 1, 0, [-3.0, -6.0, -4.0, np.inf]),
        (row.EQUAL, 0, 1, [-1.0, -4.0, -2.0, 3.0]),
    ],
)
def test_what_is_asked_for(
    purpose: int, relative: int, everywhere: int, expected: list[float]
) -> None:
    """Of demands −1, −4, −2 and 3, where tracking gives −2."""
    value = np.array([-1.0, -4.0, -2.0, 3.0])
    tracked = np.full(4, -2.0)
    assert row.asked_for(value, tracked, purpose, relative, everywhere).tolist() == expected


# --- curves ---


@pytest.mark.parametrize("n", [0.0, 1.0, 2.0, 3.0, 7.0, 16.0, 63.0, 64.0, 65.0, 2.5, 0.5, -1.0])
def test_powers_are_pythons(n: float) -> None:
    for x in (0.3, 1.0, 1.7):
        assert curves.power(x, n) == pytest.approx(x**n, rel=1e-14)
    same(curves.power(np.array([0.3, 1.7]), n), [0.3**n, 1.7**n])
    if n >= 0.0:
        assert curves.power(0.0, n) == 0.0**n


BY_HAND = [
    # name, (u, v), parameters: value, derivatives, and (u̇, v̇) H (u̇, v̇)ᵀ along (3, 2)
    ("superellipse", (-1.0, 3.0), (2.0, 6.0, 4.0), -7 / 8, (-1 / 4, 1 / 12), 3 * (9 / 4 + 1 / 9)),
    (
        "superellipse",
        (4.0, -3.0),
        (2.0, 6.0, 3.0),
        8 + 1 / 8 - 1,
        (6.0, -1 / 8),
        6 * (2 * 9 / 4 + 1 / 2 / 9),
    ),
    ("superellipse", (-4.0, 0.0), (2.0, 6.0, 3.0), 7.0, (-6.0, 0.0), 6 * 2 * 9 / 4),
    ("superellipse", (0.0, -3.0), (2.0, 6.0, 3.0), -7 / 8, (0.0, -1 / 8), 6 / 2 / 9),
    ("hyperellipse", (-1.0, 3.0), (2.0, 6.0, 4.0), 7 / 8, (1 / 4, -1 / 12), -3 * (9 / 4 + 1 / 9)),
    ("circle", (-3.0, 2.0), (4.0,), 3 / 16, (6 / 16, -4 / 16), -26 / 16),
    # d = v − u² = 3 and ∂d²/∂u = −4 u d; ḋ = 2 − 12 and d̈ = −18
    (
        "bowl",
        (2.0, 7.0),
        (4.0, 3.0),
        -29 / 16,
        (-(36 - 24) / 16, -6 / 16),
        -2 * (81 + 100 - 54) / 16,
    ),
    # d = v − |u| = 3, ḋ = 5, −1 and, where |u| is bent, 2
    ("heart", (-2.0, 5.0), (4.0, 3.0), -29 / 16, (-(-36 + 6) / 16, -6 / 16), -2 * (81 + 25) / 16),
    ("heart", (2.0, 5.0), (4.0, 3.0), -29 / 16, (-(36 - 6) / 16, -6 / 16), -2 * (81 + 1) / 16),
    ("heart", (0.0, 5.0), (4.0, 3.0), -9 / 16, (0.0, -10 / 16), -2 * (81 + 4) / 16),
]


@pytest.mark.parametrize(("name", "at", "parameters", "value", "slopes", "bend"), BY_HAND)
def test_curves_by_hand(
    name: str, at: Any, parameters: Any, value: float, slopes: Any, bend: float
) -> None:
    same(getattr(curves, name)(*at, *parameters), [value, *slopes])
    same(getattr(curves, f"{name}_curvature")(*at, *parameters, 3.0, 2.0), bend)


@pytest.mark.parametrize(
    ("differences", "size", "far"),
    [(frames.differences_in_image, 2, 1e-4), (frames.differences_in_space, 3, 1e-6)],
)
def test_differences_of_a_gradient(differences: Any, size: int, far: float) -> None:
    """Of ½ s xᵀ H x they are s vᵀ H v, however fast v is; they look so far along v, to either
    side.
    """
    H = (A + A.T)[:size, :size]
    x = b[:size]
    v = c[:size]
    looked: list[Array] = []

    def gradient(*given: float) -> tuple[float, ...]:
        *there, s = given
        looked.append(np.array(there))
        return 0.0, *(s * H @ there)

    for speed in (1e-3, 1.0, 1e3):
        found = differences(gradient, (3.0,), x, speed * v)
        assert found == pytest.approx(3.0 * speed**2 * (v @ H @ v), rel=1e-7)
    assert differences(gradient, (3.0,), x, 0.0 * v) == 0.0
    ahead, behind = looked[:2]
    same(ahead - x, far * v / np.linalg.norm(v), rtol=1e-8)
    same(behind - x, -far * v / np.linalg.norm(v), rtol=1e-8)


# --- regions ---


def test_spheres_by_hand() -> None:
    """At (2, −3, 6), 7 from the centre; along (4, 2, −2), of which −10/7 lead out."""
    same(regions.sphere(2.0, -3.0, 6.0, 2.5), [-4.5, -2 / 7, 3 / 7, -6 / 7])
    same(regions.sphere_curvature(2.0, -3.0, 6.0, 2.5, 4.0, 2.0, -2.0), -(24 - (10 / 7) ** 2) / 7)
    # at the centre the way out is up, and the curvature that at 1e-9 m
    assert np.array_equal(regions.sphere(0.0, 0.0, 0.0, 2.5), [2.5, 0.0, 0.0, -1.0])
    same(regions.sphere_curvature(0.0, 0.0, 0.0, 2.5, 1.0, 2.0, 2.0), -9e9)
    same(regions.sphere(0.0, 0.5, 0.0, 2.5), [2.0, 0.0, -1.0, 0.0])


def test_in_the_middle_the_way_out_of_a_box_leads_through_the_first_of_the_nearest_sides() -> None:
    for half, out in (
        ((1.0, 1.0, 1.0), (1.0, 0.0, 0.0)),
        ((2.0, 1.0, 1.0), (0.0, 1.0, 0.0)),
        ((2, 3, 1), (0, 0, 1)),
    ):
        depth, *inwards = regions.box(0.0, 0.0, 0.0, *half)
        assert depth == 1.0
        assert np.array_equal(inwards, -np.array(out))
    # out of a cylinder through its side, where its end is as near
    assert regions.rectangle(0.5, -2.5, 1.0, 3.0) == (-0.5, 1.0, 0.0)
    assert regions.half_space_curvature(1.0, 1.0, 1.0, 1.0, 1.0, 0.0) == 0.0


def test_what_is_exactly_beside_a_side_is_not_beyond_it() -> None:
    """Along a side of a box, and of a cylinder, nothing bends: motions along x, y and z in turn."""
    for at, along in (
        ((1.0, 4.0, 0.5), (5.0, 7.0, 0.0)),
        ((0.5, 2.0, 5.0), (0.0, 5.0, 7.0)),
        ((3.0, 0.5, 3.0), (7.0, 0.0, 5.0)),
    ):
        assert regions.box_curvature(*at, 1.0, 2.0, 3.0, *along) == 0.0
    assert regions.cylinder_curvature(4.0, 0.0, 3.0, 1.0, 3.0, 5.0, 0.0, 7.0) == 0.0
    assert regions.cylinder_curvature(1.0, 0.0, 4.0, 1.0, 3.0, 5.0, 0.0, 7.0) == 0.0
    same(regions.capsule_curvature(4.0, 0.0, 3.0, 1.0, 3.0, 5.0, 6.0, 7.0), -36 / 4)


# --- polylines ---


def nearest(points: Array, line: Array) -> Array:
    """Distance of each point to a line, from every segment."""
    first = line[:-1]
    along = np.diff(line, axis=0)
    away = points[:, None] - first
    share = np.clip((away * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(away - share[..., None] * along, axis=2).min(axis=1)


def test_distances_to_polylines_are_those_to_the_nearest_of_all_segments() -> None:
    """Long, short, coarse and fine lines; the first vertex of one does not follow the last of the
    other.
    """
    rng = np.random.default_rng(3)
    turn = np.linspace(0.0, 2.0 * np.pi, 900)
    fine = 200.0 * np.column_stack((np.cos(turn), np.sin(3.0 * turn)))
    coarse = rng.uniform(-300.0, 300.0, (30, 2))
    for lines in (
        [fine],
        [coarse],
        [coarse[:2]],
        [fine, coarse[:5] + 900.0],
        [coarse[:25], fine - 700.0],
    ):
        low = np.concatenate(lines).min(axis=0)
        high = np.concatenate(lines).max(axis=0)
        points = rng.uniform(low - 100.0, high + 100.0, (40, 2))
        found = np.empty(len(points))
        vertex = np.zeros(len(points), dtype=np.int64)
        polylines.search(points, polylines.prepared(lines), 2, vertex, found)
        same(found, np.minimum.reduce([nearest(points, line) for line in lines]), rtol=1e-10)


def test_chords_are_those_of_blocks_of_vertices() -> None:
    """Of two lines with 30 and 25 vertices: blocks of 8, the fourth across both lines, the last of
    7.
    """
    rng = np.random.default_rng(5)
    lines = [rng.uniform(-9.0, 9.0, (30, 2)), rng.uniform(-9.0, 9.0, (25, 2))]
    vertices, blocks, groups, spans, before, after, longest = polylines.prepared(lines)
    same(vertices, np.concatenate(lines))
    same(longest, max((np.diff(line, axis=0) ** 2).sum(axis=1).max() for line in lines) / 4.0)
    assert before.tolist() == [0, *range(29), 30, *range(30, 54)]
    assert after.tolist() == [*range(1, 30), 29, *range(31, 55), 54]
    for chords, size in ((blocks, 8), (groups, 8**2), (spans, 8**3)):
        assert len(chords) == -(-55 // size)
        for i, chord in enumerate(chords):
            block = vertices[i * size : (i + 1) * size]
            first = block[0]
            last = block[-1]
            far = nearest(block, np.array([first, last])).max()
            same(chord, [*first, *(last - first), 1.0 / ((last - first) ** 2).sum(), far])


@pytest.mark.parametrize(
    ("at", "away"), [((6.5, 0.0), 5.0), ((-2.0, -3.0), 5.0), ((7.0, 9.0), 5.0), ((-1.5, 6.0), 5.0)]
)
def test_a_block_may_hold_what_is_within_the_bound_of_its_chord(
    at: tuple[float, float], away: float
) -> None:
    """The chord leads from (1, 1) by (3, 4), and its vertices are up to 0.5 beside it."""
    chords = np.array([[9.0] * 6, [1.0, 1.0, 3.0, 4.0, 1.0 / 25.0, 0.5]])
    assert polylines.may_hold(chords, 1, *at, away - 0.5 + 1e-6)
    assert polylines.may_hold(chords, 1, *at, away - 0.5)  # whatever rounding says
    assert not polylines.may_hold(chords, 1, *at, away - 0.5 - 1e-6)
