"""Appendix B of the paper for its case study, in plain NumPy, as a reference for step times.

It shares only the scenario's numbers with the package. Kinematics, image, constraints and the two
pseudoinverses of eq. (15) are implemented here a second time, line by line as in the paper, for
clarity and not for speed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

RCOND = 1e-6
"""Fraction of the largest singular value below which singular values count as zero.

The paper has "a tolerance to set [them] to zero".
"""

# Table 2: θ offset, d, a, α
TABLE_2 = [
    (0.0, 0.335, 0.075, -np.pi / 2),
    (0.0, 0.0, 0.27, 0.0),
    (0.0, 0.0, 0.09, np.pi / 2),
    (0.0, -0.295, 0.0, -np.pi / 2),
    (0.0, 0.0, 0.0, np.pi / 2),
    (-np.pi / 2, -0.08, 0.0, np.pi),
]


class AppendixB:
    """Sequence of sampling periods; call :meth:`step` in the order of time.

    Parameters
    ----------
    tables
        Tables of the scenario ``case-study-6r``.
    """

    def __init__(self, tables: dict[str, Any]) -> None:
        self.Ts = float(tables["sampling_time"])
        self.markers = np.array(tables["target"]["markers"])
        self.focal = np.array(tables["camera"]["focal_px"])
        size = np.array(tables["camera"]["size_px"])
        fov, joint_range, joint_speed, sphere = tables["constraints"]
        self.ellipse = 0.5 * size * (1.0 - fov["margin"])
        self.n = fov["n"]
        self.K_V = fov["K"]
        self.K_q = joint_range["K"]
        self.K_o = sphere["K"]
        self.gains = [table["switching_gain"] for table in (fov, joint_range, joint_speed, sphere)]
        low = joint_range["lower"][0]
        high = joint_range["upper"][0]
        self.range_joint = joint_range["joints"][0] - 1
        self.middle = 0.5 * (low + high)
        self.half = 0.5 * (high - low)
        self.speed_joint = joint_speed["joints"][0] - 1
        self.speed = joint_speed["upper"][0]
        self.centre = np.array(sphere["centre"])
        self.radius = sphere["radius"]
        task = tables["task"]
        self.Kp0 = task["Kp0"]
        self.slope = task["Kp_slope"]
        self.goals = [
            (goal.get("from_time", 0.0), kinematics(np.array(goal["camera_at_q"])))
            for goal in task["goals"]
        ]
        self.goal = -1
        self.s_prev: Array = np.zeros(6)
        self.J_prev: Array = np.zeros((6, 6))

    def step(self, t: float, q: Array, qd: Array) -> Array:
        """Return the commanded accelerations (6,) at time ``t`` [s], from ``q`` and ``qd`` (6,)."""
        R, p, J_base = kinematics(q)
        J_camera = np.vstack((R.T @ J_base[:3], R.T @ J_base[3:]))

        goal = max(i for i, (from_time, _) in enumerate(self.goals) if from_time <= t + 1e-9)
        first = goal != self.goal
        self.goal = goal
        R_goal, p_goal, _ = self.goals[goal][1]
        relative = R_goal.T @ R
        u = rotation_vector(relative)
        s = np.concatenate((R_goal.T @ (p - p_goal), u))  # eq. (44); its reference is zero
        J_s = np.vstack((relative @ J_camera[:3], rotation_vector_jacobian(u) @ J_camera[3:]))

        # lines 2 to 5; at the start of a goal there is no previous sample
        s_dot = J_s @ qd if first else (s - self.s_prev) / self.Ts
        J_dot = np.zeros_like(J_s) if first else (J_s - self.J_prev) / self.Ts
        # line 6, eqs. (42) and (43)
        Kp = self.Kp0 * np.exp(-self.slope / self.Kp0 * np.linalg.norm(s))
        s_c = -Kp * s - 3.0 * np.sqrt(Kp) * s_dot

        phi, K_gradient, gain = self.constraints(q, qd, R, p, J_base, J_camera)
        active = phi >= 0.0
        # lines 7 and 8, eq. (40)
        A1 = K_gradient[active]
        b1 = -gain[active]
        # lines 9 and 10, eq. (41)
        A2 = J_s
        b2 = s_c - J_dot @ qd
        if len(A1):  # line 11, eq. (15)
            A1_inverse = np.linalg.pinv(A1, rcond=RCOND)
            level_1 = A1_inverse @ b1
            projected = A2 @ (np.eye(6) - A1_inverse @ A1)
            qdd = level_1 + np.linalg.pinv(projected, rcond=RCOND) @ (b2 - A2 @ level_1)
        else:
            qdd = np.linalg.pinv(A2, rcond=RCOND) @ b2
        # lines 12 and 15
        self.s_prev = s
        self.J_prev = J_s
        return np.asarray(qdd)

    def constraints(
        self, q: Array, qd: Array, R: Array, p: Array, J_base: Array, J_camera: Array
    ) -> tuple[Array, Array, Array]:
        """φ (9,), its gradient with respect to q̇ (9, 6), and u⁺ (9,).

        The rows are markers, joint 6, joint 2, and the sphere.
        """
        P = (self.markers - p) @ R
        x = P[:, 0] / P[:, 2]
        y = P[:, 1] / P[:, 2]
        Z = P[:, 2]
        # eq. (24)
        L = np.zeros((len(Z), 2, 6))
        L[:, 0] = np.column_stack((-1.0 / Z, 0.0 * Z, x / Z, x * y, -1.0 - x * x, y))
        L[:, 1] = np.column_stack((0.0 * Z, -1.0 / Z, y / Z, 1.0 + y * y, -x * y, -x))
        pixels = self.focal * np.column_stack((x, y))
        ratio = np.abs(pixels / self.ellipse)
        sigma_V = (ratio**self.n).sum(axis=1) - 1.0  # eq. (20)
        slope = self.n / self.ellipse * np.sign(pixels) * ratio ** (self.n - 1.0)  # eq. (23)
        gradient_V = np.einsum("ic,icj->ij", slope * self.focal, L) @ J_camera  # eqs. (21) and (22)

        side = np.array([1.0, -1.0])
        sigma_q = side * (q[self.range_joint] - self.middle) / self.half - 1.0  # eq. (25)
        gradient_q = np.zeros((2, 6))
        gradient_q[:, self.range_joint] = side / self.half
        phi_s = side * qd[self.speed_joint] / self.speed - 1.0  # eq. (28)
        gradient_s = np.zeros((2, 6))
        gradient_s[:, self.speed_joint] = side / self.speed

        away = p - self.centre
        distance = np.linalg.norm(away)
        sigma_o = np.array([self.radius - distance])  # eq. (47)
        gradient_o = -(away / distance)[None] @ J_base[:3]  # eq. (48)

        K_gradient = np.vstack(
            (self.K_V * gradient_V, self.K_q * gradient_q, gradient_s, self.K_o * gradient_o)
        )
        phi = np.concatenate((
            sigma_V + self.K_V * gradient_V @ qd,
            sigma_q + self.K_q * gradient_q @ qd,
            phi_s,
            sigma_o + self.K_o * gradient_o @ qd,
        ))  # eq. (19)  # fmt: skip
        return phi, K_gradient, np.repeat(self.gains, (len(Z), 2, 2, 1))


def kinematics(q: Array) -> tuple[Array, Array, Array]:
    """Attitude and position of the camera, and the Jacobian of its twist (6, 6), in the base frame.

    The camera is at the tip.
    """
    T = np.eye(4)
    axes = []
    origins = []
    for angle, (theta, d, a, alpha) in zip(q, TABLE_2, strict=True):
        axes.append(T[:3, 2])
        origins.append(T[:3, 3])
        c = np.cos(angle + theta)
        s = np.sin(angle + theta)
        ca = np.cos(alpha)
        sa = np.sin(alpha)
        T = T @ np.array(
            [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        )
    z = np.array(axes)
    o = np.array(origins)
    return T[:3, :3], T[:3, 3], np.vstack((np.cross(z, T[:3, 3] - o).T, z.T))


def rotation_vector(R: Array) -> Array:
    """Rotation vector θu (3,) of a rotation by less than half a turn."""
    v = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = np.linalg.norm(v)
    angle = np.arctan2(sine, 0.5 * (np.trace(R) - 1.0))
    return v * (angle / sine if sine > 0.0 else 1.0)


def rotation_vector_jacobian(u: Array) -> Array:
    """L_θu (3, 3), which maps the angular velocity in the rotated frame to the rate of θu."""
    U = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
    angle = np.linalg.norm(u)
    if angle < 1e-4:
        factor = 1.0 / 12.0 + angle**2 / 720.0
    else:
        factor = (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    return np.asarray(np.eye(3) + 0.5 * U + factor * (U @ U))
