"""Images of a scene, as its camera takes them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin

from ..constraints import Constraint, Occlusion
from ..robots.geometry import Pose
from ..rows import Array, BoolArray
from ..vision.images.board import Board
from ..vision.images.detectors import Pixels
from ..vision.images.rendering import Renderer
from ..vision.images.settings import ImageSettings
from ..vision.images.silhouettes import covered
from ..vision.scene import Scene, State
from .opaque import Opaque


class Photographer:
    """Takes images of a scene's markers, which are corners of tags.

    Parameters
    ----------
    scene
        As it is.
    settings
        Of camera and print.
    constraints
        Curves of those that occlude are in front of the target, and bodies and regions as the settings have it.
    q0
        (n,) where the robot starts, from where the print is seen.
    seed
        Of the noise: image number i has the same whatever the controller does.

    Raises
    ------
    ConfigurationError
        if the markers can be no board of tags, or packages are missing.
    """

    def __init__(
        self,
        scene: Scene,
        settings: ImageSettings,
        constraints: Sequence[Constraint],
        q0: Array,
        seed: tuple[int, ...],
    ) -> None:
        self.scene, self.settings, self._constraints, self._seed = scene, settings, constraints, seed
        self.obstacles = [one for one in constraints if isinstance(one, Occlusion)]
        self.eye = scene.camera_pose(q0).t
        ids = settings.tags if settings.printed is None else settings.printed
        board = Board.of_markers(scene.markers, self.eye, settings.tag_side_m, ids)
        self.renderer = Renderer(board, scene.camera, settings)
        self._still: dict[int, BoolArray] = {}

    def image(self, number: int, state: State) -> Pixels:
        """The image (H, W) of that number, of a state in the middle of its exposure."""
        velocity, turning = state.camera_twist[:3], state.camera_twist[3:]

        def where(after: float) -> Pose:
            if after == 0.0:
                return state.camera
            return state.camera @ Pose(np.asarray(pin.exp3(after * turning)), after * velocity)

        return self.renderer.render(where, np.random.default_rng((*self._seed, 3, number)), self._hidden(state))

    @cached_property
    def opaque(self) -> Opaque:
        """What else stands before the tags; made where an image is, since meshes may be read for it."""
        return Opaque(self.scene, self._constraints, self.settings.opaque)

    def _hidden(self, state: State) -> BoolArray | None:
        """(H, W) before which pixels an obstacle stands; None where there is none."""
        t, masks = state.t, []
        solids = self._solids(state)
        if solids:
            masks.append(covered(solids, self._plane(state.camera), self.scene.camera))
        for i, obstacle in enumerate(self.obstacles):
            if obstacle.motion is not None:
                masks.append(self._before(obstacle, t))
            else:
                if i not in self._still:
                    self._still[i] = self._before(obstacle, t)
                masks.append(self._still[i])
        return np.logical_or.reduce(masks) if masks else None

    def _solids(self, state: State) -> list[Array]:
        """Solids in the camera's frame: (V, 3) points of each."""
        q, camera = state.robot.q, self.scene.camera
        here = camera.fixed or self.scene.robot.pose(q) @ camera.mount.inverse
        return [(points - here.t) @ here.R for points in self.opaque.solids(q, state.t)]

    def _plane(self, camera: Pose) -> Array:
        """(4,) the board's plane in the frame of a camera at this pose in the target's frame."""
        seen = self.renderer.board.camera_in_board(camera)
        return np.append(seen.R[2], -seen.t[2])

    def _before(self, obstacle: Occlusion, t: float) -> BoolArray:
        ideal = obstacle.displaced(self._ideal[None], np.array([t]))[0]
        inside: BoolArray = (obstacle.sigma(ideal) > obstacle.margin).reshape(self._shape)
        return inside

    @cached_property
    def _shape(self) -> tuple[int, int]:
        W, H = self.scene.camera.size
        return int(H), int(W)

    @cached_property
    def _ideal(self) -> Array:
        """(H · W, 2) ideal pixels of all pixels of an image, NaN beyond the lens."""
        camera, (H, W) = self.scene.camera, self._shape
        v, u = np.mgrid[:H, :W]
        centred = camera.from_corner(np.stack((u, v), axis=-1).reshape(-1, 2), "centres")
        if camera.distortion is None:
            return centred
        ideal, certain = camera.distortion.remove(camera.normalised(centred))
        ideal[~certain] = np.nan
        return camera.pixels(ideal)
