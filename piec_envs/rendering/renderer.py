"""The choice of what draws the frames of the environments."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from piec_envs.errors import check_name
from piec_envs.world.objects import get_object
from piec_envs.world.robots import get_robot

if TYPE_CHECKING:
    from piec_envs.model.caging_problem import Caged
    from piec_envs.model.model import Model
    from piec_envs.model.rollout import Measured
    from piec_envs.model.state import State
    from piec_envs.rendering.space import SpaceFrames

RENDERERS = ("drawing", "mujoco")


class Renderer:
    """Draws frames; what that needs is loaded with the first of them.

    Args:
        name: "drawing", the plane drawn in software, or "mujoco", the scene in space through
            OpenGL.

    Raises:
        UnknownNameError: for another name.
    """

    def __init__(self, name: str):
        check_name("renderer", name, RENDERERS)
        self.name = name
        self._space: SpaceFrames | None = None

    def frame(
        self,
        model: Model,
        state: State,
        measured: Measured,
        row: int,
        trail: np.ndarray | None = None,
    ) -> np.ndarray:
        """Draw one of several states.

        Args:
            model: what simulates them.
            state: the states.
            measured: what is measured of them.
            row: which of them.
            trail: where its object has been, shape (m, 2), m.

        Returns:
            The picture, shape (720, 720, 3), uint8.

        Raises:
            RenderingError: where "mujoco" finds no OpenGL, or in a process forked after OpenGL was
                in use.
        """
        if self.name == "drawing":
            from piec_envs.rendering.frame import render_frame

            return render_frame(model, state, measured, row, trail)
        return self._frames().frame(model, state, row, trail)

    def posture(self, caged: Caged) -> np.ndarray:
        """Draw a posture of static caging; see `frame`."""
        if self.name == "drawing":
            from piec_envs.rendering.frame import render_posture

            return render_posture(caged)
        from piec_envs.rendering.view import close_view

        robot = get_robot(caged.robot)
        view = close_view(robot, caged.q_r, get_object(caged.object), caged.pose)
        return self._frames().scene(robot, caged.object, caged.q_r, caged.pose, view=view)

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
