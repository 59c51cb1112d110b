"""Poses and rotation vectors against scipy and Pinocchio, with special care at small angles and at
π.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from scenes import rotation_matrix, slope
from vsconstraints.errors import InvalidInput
from vsconstraints.formulas import rotation
from vsconstraints.formulas.rotation import turn_by
from vsconstraints.robots.geometry import Pose, distance, skew, vector
from vsconstraints.rows import Array

PI = np.pi

numbers = st.floats(-1.0, 1.0, allow_subnormal=False)
vectors = arrays(np.float64, 3, elements=numbers)
axes = vectors.filter(lambda a: np.linalg.norm(a) > 0.1).map(lambda a: a / np.linalg.norm(a))
translations = vectors.map(lambda a: 3.0 * a)
quaternions = arrays(np.float64, 4, elements=numbers).filter(lambda a: np.linalg.norm(a) > 0.1)
rotations = quaternions.map(lambda a: Rotation.from_quat(a).as_matrix())
poses = st.builds(Pose, rotations, translations)
angles = st.one_of(
    st.floats(0.0, PI - 1e-3),
    st.sampled_from(
        [0.0, 1e-300, 1e-15, 1e-12, 1e-9, 1e-6, 1e-4, 0.0999999, 0.1, 0.1000001, PI - 1e-4]
    ),
)


def rotation_vector(R: Array, near: Array | None = None) -> Array:
    """θu (3,) with exp([θu]×) = R, the one closest to ``near`` (3,)."""
    return np.array(
        rotation.rotation_vector(
            R.tolist(), (0.0, 0.0, 0.0) if near is None else near, near is not None
        )
    )


def rotation_vector_rate(w: Array, omega: Array) -> tuple[Array, Array]:
    """L_θu and L̇_θu (3, 3)."""
    _, L, L_dot = rotation.rotation_vector_rate(w.tolist(), omega.tolist())
    return np.array(L), np.array(L_dot)


# --- rotation vectors ---


@given(rotations)
def test_rotation_vector_is_scipys(R: Array) -> None:
    expected = Rotation.from_matrix(R).as_rotvec()
    w = rotation_vector(R)
    # next to π, the logarithm is accurate to the square root of rounding
    np.testing.assert_allclose(
        rotation_matrix(w), R, atol=1e-12 if np.linalg.norm(expected) < 3.14 else 1e-7
    )
    if np.linalg.norm(expected) < PI - 1e-6:
        # next to π the axis is the more uncertain the closer: rounding divided by the distance to π
        np.testing.assert_allclose(w, expected, atol=1e-9)


@given(axes, angles)
def test_rotation_vector_of_a_known_angle(axis: Array, angle: float) -> None:
    w = rotation_vector(Rotation.from_rotvec(angle * axis).as_matrix())
    # relative accuracy where a matrix has it; absolute to rounding below
    np.testing.assert_allclose(
        w, angle * axis, rtol=1e-11, atol=2e-15 / max(PI - angle, 1e-3) + 1e-15
    )


@given(axes)
def test_at_pi_the_axis_is_the_one_with_a_positive_largest_component(axis: Array) -> None:
    R = 2.0 * np.outer(axis, axis) - np.eye(3)
    w = rotation_vector(R)
    assert np.linalg.norm(w) == pytest.approx(PI, abs=1e-7)
    largest = np.argmax(np.abs(axis))
    # two components of almost the same size may change places by rounding
    if np.sort(np.abs(axis))[-2] < np.abs(axis[largest]) - 1e-6:
        assert w[largest] > 0.0
    np.testing.assert_allclose(rotation_matrix(w), R, atol=1e-7)


@pytest.mark.parametrize("axis", np.vstack((np.eye(3), -np.eye(3))))
def test_half_turns_about_the_axes_point_along_plus(axis: Array) -> None:
    """The planar example starts with a half turn about z, which is read as +z."""
    for angle in (PI, -PI):
        R = np.round(rotation_matrix(angle * axis))
        np.testing.assert_allclose(rotation_vector(R), PI * np.abs(axis), atol=1e-7)


@pytest.mark.parametrize("short", [3e-7, 3e-6])
def test_next_to_half_a_turn_the_axis_is_positive(short: float) -> None:
    """Within 1e-6 rad of it, where rounding could turn the sign from one sample to the next."""
    R = Rotation.from_rotvec([(short - PI), 0.0, 0.0]).as_matrix()
    turned = PI + short if short < 1e-6 else short - PI
    np.testing.assert_allclose(rotation_vector(R), [turned, 0.0, 0.0], atol=1e-12)


@settings(max_examples=20)
@given(axes, st.floats(0.03, 0.3), st.floats(0.0, 1.0))
def test_continuous_through_pi(axis: Array, step: float, start: float) -> None:
    angle = 2.0 + start
    w = angle * axis
    while angle < 2.0 * PI - 0.5:
        angle += step
        w = rotation_vector(Rotation.from_rotvec(angle * axis).as_matrix(), near=w)
        np.testing.assert_allclose(w, angle * axis, atol=1e-6)
    while angle > -5.5:
        angle -= step
        # at zero angle there is no axis to count turns about; the path does not stop there
        angle = angle if abs(angle) > 1e-3 else angle - 0.01
        w = rotation_vector(Rotation.from_rotvec(angle * axis).as_matrix(), near=w)
        np.testing.assert_allclose(w, angle * axis, atol=1e-6)


def test_continuous_where_the_axis_turns_while_the_angle_passes_pi() -> None:
    def path(t: float) -> Array:
        return (PI + 0.8 * np.sin(t)) * np.array([np.cos(t), np.sin(t), 0.0])

    times = np.linspace(0.0, 2.0 * PI, 2001)
    w = path(0.0)
    for t in times:
        before = w
        w = rotation_vector(rotation_matrix(path(t)), near=w)
        np.testing.assert_allclose(w, path(t), atol=1e-6)
        assert np.linalg.norm(w - before) < 0.02


def test_a_whole_turn_is_kept() -> None:
    """Where the rotation is none but the path has come by a whole turn, the vector stays near."""
    near = np.array([0.0, 0.0, 2.0 * PI - 1e-9])
    np.testing.assert_allclose(
        rotation_vector(np.eye(3), near=near), [0.0, 0.0, 2.0 * PI], atol=1e-6
    )
    np.testing.assert_array_equal(
        rotation_vector(np.eye(3), near=np.array([0.1, 0.0, 0.0])), np.zeros(3)
    )


@given(rotations, vectors)
def test_the_nearest_of_all_equal_rotation_vectors_is_taken(R: Array, direction: Array) -> None:
    near = 9.0 * direction
    w = rotation_vector(R, near=near)
    np.testing.assert_allclose(rotation_matrix(w), R, atol=1e-7)
    theta = np.linalg.norm(w)
    if theta > 1e-6:
        for turns in (-1, 1):
            other = w + 2.0 * PI * turns * w / theta
            assert np.linalg.norm(w - near) <= np.linalg.norm(other - near) + 1e-6


# --- its rate ---


def pinocchios_rate(w: Array) -> Array:
    """ẇ = Jlog3(R) ω for ω in the rotating frame."""
    return pin.Jlog3(rotation_matrix(w))


@given(axes, angles)
def test_rate_is_pinocchios(axis: Array, angle: float) -> None:
    w = angle * axis
    L, _ = rotation_vector_rate(w, np.zeros(3))
    # Pinocchio takes the angle from the matrix: its own error near π is rounding over the distance
    # to π
    np.testing.assert_allclose(L, pinocchios_rate(w), atol=1e-9 + 1e-14 / max(PI - angle, 1e-6))


@given(axes, st.one_of(angles, st.floats(PI, 5.5)), axes)
def test_rate_is_the_derivative_of_the_vector(axis: Array, angle: float, omega: Array) -> None:
    """R(t) = R(0) exp([ω]× t), also beyond π: along a path that stays continuous."""
    w = angle * axis
    R = Rotation.from_rotvec(w).as_matrix()

    def at(t: float) -> Array:
        return rotation_vector(R @ Rotation.from_rotvec(t * omega).as_matrix(), near=w)

    L, _ = rotation_vector_rate(w, omega)
    # log3 next to π, and the divided differences: 1e-8 of rounding over the step
    tolerance = 1e-5 if angle < PI - 1e-2 or angle > PI + 1e-2 else 1e-3
    np.testing.assert_allclose(L @ omega, slope(at, 1e-3), atol=tolerance)


@given(axes, st.one_of(angles, st.floats(PI, 5.5)), axes)
def test_rate_of_the_rate(axis: Array, angle: float, omega: Array) -> None:
    """L̇ along a constant ω, by differences of L along ẇ = L ω."""
    w = angle * axis
    _, L_dot = rotation_vector_rate(w, omega)
    h = 1e-3

    def moved(t: float) -> Array:
        # third order in t is enough for a fourth-order difference quotient: w + t ẇ + t²/2 ẅ + t³/6
        # w⃛ ≈ RK4
        k1 = rotation_vector_rate(w, omega)[0] @ omega
        k2 = rotation_vector_rate(w + 0.5 * t * k1, omega)[0] @ omega
        k3 = rotation_vector_rate(w + 0.5 * t * k2, omega)[0] @ omega
        k4 = rotation_vector_rate(w + t * k3, omega)[0] @ omega
        return w + t / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    numerical = slope(lambda t: rotation_vector_rate(moved(t), omega)[0], h)
    np.testing.assert_allclose(L_dot, numerical, atol=1e-8 * max(1.0, np.abs(L_dot).max()))
    assert np.abs(L_dot).max() > 1e-3


@pytest.mark.parametrize("theta", [0.0999, 0.09999999, 0.1, 0.10000001, 0.1001])
def test_the_series_meets_the_closed_form(theta: float) -> None:
    """Reference values from the series of (1 − x/2 cot(x/2))/x² to x¹⁰, whose coefficients are
    Bernoulli numbers.
    """
    coefficients = [1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160, 691 / 1307674368000]
    expected = sum(a * theta ** (2 * i) for i, a in enumerate(coefficients))
    slope_over_theta = sum(
        2 * i * a * theta ** (2 * i - 2) for i, a in enumerate(coefficients) if i
    )
    x = np.array([theta, 0.0, 0.0])
    y = np.array([0.0, 1.0, 0.0])
    L, _ = rotation_vector_rate(x, y)
    assert 1.0 - L[1, 1] == pytest.approx(expected * theta**2, rel=1e-11)
    # ω along the axis: w grows as ω, so that d/dt of c θ² is (c'/θ θ² + 2c) θ
    _, L_dot = rotation_vector_rate(x, np.array([1.0, 0.0, 0.0]))
    assert -L_dot[1, 1] == pytest.approx(
        (slope_over_theta * theta**2 + 2 * expected) * theta, rel=3e-12
    )


def test_rate_at_zero_angle() -> None:
    omega = np.array([0.3, -0.5, 0.7])
    L, L_dot = rotation_vector_rate(np.zeros(3), omega)
    np.testing.assert_array_equal(L, np.eye(3))
    np.testing.assert_allclose(L_dot, 0.5 * skew(omega), atol=1e-16)


# --- poses ---


def matrix(pose: Pose) -> Array:
    T = np.eye(4)
    T[:3, :3] = pose.R
    T[:3, 3] = pose.t
    return T


@given(poses, poses)
def test_composition_and_inverse_are_those_of_homogeneous_matrices(a: Pose, b: Pose) -> None:
    np.testing.assert_allclose(matrix(a @ b), matrix(a) @ matrix(b), atol=1e-12)
    np.testing.assert_allclose(matrix(a.inverse), np.linalg.inv(matrix(a)), atol=1e-12)
    np.testing.assert_allclose(matrix((a @ b).inverse), matrix(b.inverse @ a.inverse), atol=1e-12)


@given(poses, arrays(np.float64, (4, 3), elements=numbers))
def test_acting_on_points(pose: Pose, points: Array) -> None:
    homogeneous = np.column_stack((points, np.ones(4)))
    np.testing.assert_allclose(pose.act(points), (homogeneous @ matrix(pose).T)[:, :3], atol=1e-12)
    np.testing.assert_allclose(pose.act(points[0]), pose.act(points)[0], atol=1e-15)
    np.testing.assert_allclose(pose.inverse.act(pose.act(points)), points, atol=1e-12)
    np.testing.assert_array_equal(Pose.identity().act(points), points)


@given(poses)
def test_twist_matrix_is_pinocchios_action(pose: Pose) -> None:
    np.testing.assert_allclose(
        pose.twist_matrix, pin.SE3(pose.R, pose.t).toActionMatrix(), atol=1e-13
    )


@given(vectors, arrays(np.float64, 3, elements=st.floats(-PI, PI)))
def test_roll_pitch_yaw_are_urdfs(xyz: Array, rpy: Array) -> None:
    pose = Pose.from_xyz_rpy(tuple(xyz), tuple(rpy))
    np.testing.assert_allclose(pose.R, Rotation.from_euler("xyz", rpy).as_matrix(), atol=1e-14)
    np.testing.assert_array_equal(pose.t, xyz)


@given(vectors, vectors)
def test_skew_is_the_cross_product(a: Array, b: Array) -> None:
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-15)


@given(poses, translations, axes, st.one_of(angles, st.just(PI), st.floats(PI - 1e-3, PI)))
def test_distance_is_the_translation_and_the_angle(
    pose: Pose, shift: Array, axis: Array, angle: float
) -> None:
    other = Pose(pose.R @ Rotation.from_rotvec(angle * axis).as_matrix(), pose.t + shift)
    for there in (distance(pose, other), distance(other, pose)):
        assert there[0] == pytest.approx(np.linalg.norm(shift), abs=1e-12)
        # small angles to rounding, where an arc cosine would give 1e-8; at π the sine is flat
        assert there[1] == pytest.approx(
            angle, abs=3e-15 if angle < 1.0 else 1e-14 if angle < 3.0 else 1e-7
        )
    assert distance(pose, pose) == (0.0, 0.0)


@pytest.mark.parametrize("angle", [0.0, 1e-200, 1e-9, 1e-4, 1.0, np.pi, 6.0])
def test_the_turn_by_a_vector_is_scipys(angle: float) -> None:
    w = angle * np.array([0.48, -0.6, 0.64])
    np.testing.assert_allclose(turn_by(w.tolist()), Rotation.from_rotvec(w).as_matrix(), atol=4e-16)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ([1.0, 2.0], r"\(2,\)"),
        ([[1.0, 2.0, 3.0]], r"\(1, 3\)"),
        (1.0, r"\(\)"),
        (["a", "b", "c"], "must be 3 numbers"),
        (None, "must be 3 numbers|finite|shape"),
        ([1.0, np.nan, 2.0], "finite"),
        ([1.0, np.inf, 2.0], "finite"),
    ],
)
def test_vector_says_what_was_wrong(value: object, words: str) -> None:
    with pytest.raises(InvalidInput, match=words) as error:
        vector(value, 3, "thing")
    assert "thing" in str(error.value)


def test_vector_copies() -> None:
    original = np.array([1.0, 2.0, 3.0])
    taken = vector(original, 3, "thing")
    original[0] = 9.0
    np.testing.assert_array_equal(taken, [1.0, 2.0, 3.0])
    with pytest.raises(InvalidInput, match="rpy"):
        Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0))
    with pytest.raises(InvalidInput, match="xyz"):
        Pose.from_xyz_rpy((0.0, 0.0, float("nan")), (0.0, 0.0, 0.0))
