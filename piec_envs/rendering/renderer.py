"""The choice of what draws the frames of the environments."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from piec_envs.errors import check_name
from piec_envs.world.objects import get_object

if TYPE_CHECKING:
    from piec_envs.episodes.batch import EpisodeBatch
    from piec_envs.episodes.cage import CageBatch
    from piec_envs.rendering.space import SpaceFrames

RENDERERS = ("drawing", "mujoco")


class Renderer:
    """Draws frames; what that needs is loaded with the first of them.

    Args:
        name: "drawing", the plane drawn in software, or "mujoco", the scene in space through OpenGL.

    Raises:
        UnknownNameError: for another name.
    """

    def __init__(self, name: str):
        check_name("renderer", name, RENDERERS)
        self.name = name
        self._space: SpaceFrames | None = None

    def frame(self, batch: EpisodeBatch, row: int, trail: np.ndarray | None = None) -> np.ndarray:
        """Draw the present state of one episode.

        Args:
            batch: the episodes.
            row: which of them.
            trail: where its object has been, shape (m, 2), m.

        Returns:
            The picture, shape (720, 720, 3), uint8.

        Raises:
            RenderingError: where "mujoco" finds no OpenGL, or in a process forked after OpenGL was in use.
        """
        if self.name == "drawing":
            from piec_envs.rendering.frame import render_frame

            return render_frame(batch, row, trail)
        return self._frames().frame(batch, row, trail)

    def posture(self, batch: CageBatch, row: int) -> np.ndarray:
        """Draw the posture of one static caging episode; see `frame`."""
        if self.name == "drawing":
            from piec_envs.rendering.frame import render_posture

            return render_posture(batch, row)
        from piec_envs.rendering.view import close_view

        name, q, pose = batch.config.object, batch.q_r[row], batch.pose[row]
        return self._frames().scene(batch.robot, name, q, pose, view=close_view(batch.robot, q, get_object(name), pose))

    def _frames(self) -> SpaceFrames:
        """What draws in space, opened with the first frame."""
        if self._space is None:
            from piec_envs.rendering.space import SpaceFrames

            self._space = SpaceFrames()
        return self._space

    def close(self) -> None:
        """Free what the frames were drawn with; another frame opens it anew."""
        if self._space is not None:
            self._space.close()
            self._space = None
