"""Visual servoing that the adapters share: poses, image Jacobians, and the rows of the image.

NumPy alone; nothing of vsconstraints. Poses are homogeneous matrices (4, 4), twists are (v, ω) in
the camera's frame, pixels are those of OpenCV.
"""

import numpy as np


def camera_pose(view):
    """Return the camera's pose (4, 4) in a period or at a goal; end an adapter without one."""
    if view["camera_in_target"] is None:
        raise SystemExit("this adapter needs goals with a pose of the camera")
    return np.array(view["camera_in_target"])


def inverse(M):
    """Return the inverse of a pose (4, 4)."""
    R = M[:3, :3].T
    t = M[:3, 3]
    return pose(R, -R @ t)


def pose(R, t):
    """Return the pose (4, 4) with a rotation (3, 3) and a translation (3,)."""
    M = np.eye(4)
    M[:3, :3] = R
    M[:3, 3] = t
    return M


class Scene:
    """Camera, target and goals of a setup message, for a camera that the arm carries.

    ``features`` are the names of the features by which the adapter servos. An adapter ends, with
    these names, if the scenario has another one.
    """

    #: What stacks with a scene declare as used.
    uses = ("camera", "target", "goals", "constraints", "pose")

    def __init__(self, setup, features):
        self.feature = setup["feature"]
        if self.feature not in features:
            raise SystemExit(
                f"this adapter does not servo by the feature {self.feature}, only by "
                f"{' or '.join(features)}"
            )
        camera = setup["camera"]
        lens = camera["distortion"]["model"]
        if "camera_in_tip" not in camera:
            raise SystemExit("this adapter is for cameras that the arm carries")
        if lens != "none":
            raise SystemExit(f"this adapter is for cameras without distortion, not {lens}")
        self.camera_in_tip = np.array(camera["camera_in_tip"])
        self.tip_in_camera = inverse(self.camera_in_tip)
        f_u, f_v, c_u, c_v = camera["intrinsics"]
        self.focal = np.array([f_u, f_v])
        self.centre = np.array([c_u, c_v])
        self.markers = np.array(setup["target"]["markers"])
        self.goals = setup["goals"]
        #: Half sizes (2,) of the part of the image in which markers must stay [px]; None if free.
        self.half_size = None
        for constraint in setup["constraints"]:
            if constraint["kind"] == "fov":
                self.half_size = np.array(constraint["half_size"])
                break
        # the image's centre, with the first pixel's centre at (0, 0)
        self.middle = 0.5 * np.array(camera["size"]) - 0.5

    def tip_goal(self, now, tip):
        """Return the tip's pose at the goal, from its present pose; both in the base frame.

        The target is where the image shows it.
        """
        camera_in_target = np.array(now["camera_in_target"])
        target = tip @ self.camera_in_tip @ inverse(camera_in_target)
        goal = self.goals[now["goal"]]
        return target @ camera_pose(goal) @ self.tip_in_camera

    def depth(self, view):
        """Return the depth Z (m,) of each marker [m], in a period or at a goal."""
        M = camera_pose(view)
        R = M[:3, :3]
        t = M[:3, 3]
        in_camera = (self.markers - t) @ R
        return in_camera[:, 2]

    def normalised(self, pixels):
        """Return normalised coordinates (m, 2) of pixels (m, 2)."""
        return (np.asarray(pixels) - self.centre) / self.focal

    def image_error(self, now):
        """Return x − x* (2m,) in normalised coordinates, and its interaction matrix (2m, 6)."""
        goal = self.goals[now["goal"]]
        x = self.normalised(now["pixels"])
        wanted = self.normalised(goal["pixels"])
        error = x - wanted
        return error.ravel(), interaction_matrix(x, self.depth(now))

    def view_rows(self, now):
        """Return σ (4m,) ≤ 0 of the markers in the image [px], and dσ/dt = A v_camera, A (4m, 6).

        σ is the distance beyond the right, lower, left and upper edge of the allowed part. Both are
        empty without a constraint on the field of view.
        """
        if self.half_size is None:
            return np.zeros(0), np.zeros((0, 6))
        pixels = np.asarray(now["pixels"])
        x = self.normalised(pixels)
        L = interaction_matrix(x, self.depth(now))
        # of pixels, by marker and axis
        rate = L.reshape(-1, 2, 6) * self.focal[:, None]
        away = pixels - self.middle
        beyond_upper = away - self.half_size
        beyond_lower = -away - self.half_size
        sigma = np.concatenate((beyond_upper, beyond_lower))
        A = np.concatenate((rate, -rate))
        return sigma.ravel(), A.reshape(-1, 6)


def interaction_matrix(x, Z):
    """Return the interaction matrix (2m, 6) of normalised points (m, 2) at depths (m,)."""
    rows = []
    for (u, v), z in zip(x, Z, strict=True):
        rows.append([-1.0 / z, 0.0, u / z, u * v, -(1.0 + u * u), v])
        rows.append([0.0, -1.0 / z, v / z, 1.0 + v * v, -u * v, -u])
    return np.array(rows)


def axis_and_angle(R):
    """Return an axis (3,) of the length 2 sin θ, and the angle θ from 0 to π, of a rotation."""
    # the skew-symmetric part
    S = R - R.T
    axis = np.array([S[2, 1], S[0, 2], S[1, 0]])
    sine = np.linalg.norm(axis)
    cosine = np.trace(R) - 1.0
    return axis, np.arctan2(sine, cosine)


def settings_of(setup, defaults):
    """Return the settings of a setup message with their defaults; end an adapter without one."""
    given = setup["settings"]
    for name in given:
        if name not in defaults:
            raise SystemExit(f"unknown setting {name!r}: there are {', '.join(defaults)}")
    return {**defaults, **given}


def from_limits(values, none):
    """Return limits (n,) of a setup message, with ``none`` where there is no limit."""
    return np.array([none if value is None else value for value in values])


def acceleration_limits(setup):
    """Return the limits (n,) of acceleration of a setup message; end an adapter without them."""
    most = setup["limits"]["acceleration"]
    if most is None:
        raise SystemExit("acceleration_limit needs limits of acceleration in the scenario")
    return from_limits(most, 1e6)
