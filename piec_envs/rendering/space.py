"""Frames in space: the scene as MuJoCo draws it through OpenGL, seen obliquely from above."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from piec_envs.dynamics.free_bodies import poses_at_start, upright
from piec_envs.model.task import GOAL_RADIUS
from piec_envs.rendering.opengl import Offscreen
from piec_envs.rendering.outlines import base_position
from piec_envs.rendering.space_model import COLUMN, lit_model
from piec_envs.rendering.view import View, episode_view
from piec_envs.world.objects import get_object

if TYPE_CHECKING:
    from piec_envs.model.model import Model
    from piec_envs.model.state import State
    from piec_envs.world.robots import Robot

SIZE = 720  # height and width of a frame, pixels
# of the camera's line of sight, degrees; x points right in the picture
ELEVATION = -60.0
AZIMUTH = 90.0
# of the camera from what it looks at, and of that from the base, over the radius
DISTANCE = 2.68
BEFORE = 0.09
TABLE = (0.93, 0.93, 0.91, 1.0)
# of the floor where the base slides, and of the rim of its workspace
FLOOR = (0.85, 0.86, 0.87, 1.0)
RIM = (0.84, 0.27, 0.24, 1.0)
# over the view's half; m; m, of what marks the base
FLOOR_RADIUS = 4.0
RIM_WIDTH = 0.012
PLATE_RADIUS = 0.11
GOAL = (0.12, 0.65, 0.47, 1.0)
TRAIL = (0.96, 0.70, 0.20, 1.0)
# of the table top, and of flat discs on it, m
TABLE_HEIGHT = 0.05
MARK_HEIGHT = 1e-3
# at most
TRAIL_MARKS = 200
REFERENCE_MARKS = 40
# of a mark, m
TRAIL_RADIUS = 0.012
REFERENCE_RADIUS = 0.008


class Mark(NamedTuple):
    """A disc on the table, or the table itself."""

    centre: np.ndarray  # (2,) m
    radius: float  # m
    top: float  # m
    colour: tuple[float, ...]  # red, green, blue and opacity, in [0, 1]
    thickness: float = MARK_HEIGHT  # m


def task_marks(
    goal: np.ndarray, reference: np.ndarray | None = None, trail: np.ndarray | None = None
) -> list[Mark]:
    """The goal region, a reference and the way of an object as discs on the table.

    Args:
        goal: centre of the goal region, shape (2,), m.
        reference: path to be tracked, shape (m, 2), m.
        trail: where the object has been, shape (m, 2), m.

    Returns:
        One disc for the goal, some along the reference and some along the way.
    """
    marks = [Mark(goal, GOAL_RADIUS, MARK_HEIGHT, GOAL)]
    if reference is not None and len(reference):
        points = _thinned(reference, REFERENCE_MARKS)
        marks += [Mark(point, REFERENCE_RADIUS, 0.5 * MARK_HEIGHT, GOAL) for point in points]
    if trail is not None and len(trail) > 1:
        marks += [
            Mark(point, TRAIL_RADIUS, 1.5 * MARK_HEIGHT, TRAIL)
            for point in _thinned(trail, TRAIL_MARKS)
        ]
    return marks


class SpaceFrames:
    """Draws frames through OpenGL and keeps one renderer for each scene until it is closed; copies
    open their own.
    """

    def __init__(self):
        self._opened: dict[tuple[str, str], Offscreen] = {}

    def __reduce__(self) -> tuple:
        return SpaceFrames, ()

    def frame(
        self, model: Model, state: State, row: int, trail: np.ndarray | None = None
    ) -> np.ndarray:
        """Draw one of several states.

        Args:
            model: what simulates them.
            state: the states.
            row: which of them.
            trail: where its object has been, shape (m, 2), m.

        Returns:
            The picture, shape (720, 720, 3), uint8.

        Raises:
            RenderingError: where there is no OpenGL, or after a fork.
        """
        marks = task_marks(model.task.goal, model.task.reference, trail)
        name = state.params[row].object
        view = episode_view(model.robot, state.q_r[row], model.task)
        return self.scene(
            model.robot, name, state.q_r[row], state.pose[row], marks, view, state.loose_places(row)
        )

    def scene(
        self,
        robot: Robot,
        object_name: str,
        q: np.ndarray,
        pose: np.ndarray,
        marks: Sequence[Mark] = (),
        view: View | None = None,
        loose: np.ndarray | None = None,
    ) -> np.ndarray:
        """Draw a robot and an object.

        Args:
            robot: the robot.
            object_name: row of the table of objects.
            q: joint positions, shape (n,), rad or m.
            pose: the object's x, y, angle, shape (3,), m, rad.
            marks: discs on the table.
            view: what is to be seen; None is the workspace.
            loose: position and quaternion of each of the object's loose bodies, shape (k, 7); None
                stands them where episodes begin.

        Returns:
            The picture, shape (720, 720, 3), uint8.

        Raises:
            RenderingError: where there is no OpenGL, or after a fork.
        """
        offscreen = self._offscreen(robot, object_name)
        renderer = offscreen.renderer
        data = offscreen.data
        import mujoco

        item = get_object(object_name)
        places = upright(item, poses_at_start(item, pose))
        places[1:] = places[1:] if loose is None else loose
        data.qpos[:] = (*q, *places.ravel())
        mujoco.mj_kinematics(renderer.model, data)
        mujoco.mj_comPos(renderer.model, data)
        mujoco.mj_camlight(renderer.model, data)
        view = view or View(base_position(robot, q), robot.workspace_radius)
        data.light_xpos[:, :2] += view.centre  # what they light and where shadows fall goes along
        renderer.update_scene(data, _camera(view))
        for geom in renderer.scene.geoms[: renderer.scene.ngeom]:
            if 0 < geom.rgba[3] < 1:
                geom.category = mujoco.mjtCatBit.mjCAT_DECOR  # pale parts without shadow
        for mark in (*_ground(robot, q, view), *marks):
            _add_disc(renderer.scene, mark)
        return offscreen.draw()

    def close(self) -> None:
        """Free the renderers and their OpenGL contexts."""
        while self._opened:
            self._opened.popitem()[1].close()

    def __del__(self):
        self.close()

    def _offscreen(self, robot: Robot, object_name: str) -> Offscreen:
        """What draws a scene, opened with its first frame."""
        key = (robot.name, object_name)
        if key not in self._opened:
            self._opened[key] = Offscreen(partial(lit_model, robot, object_name, SIZE), SIZE)
        return self._opened[key]


def _camera(view: View) -> Any:
    """A free camera that sees a whole view."""
    import mujoco

    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:] = (view.centre[0], view.centre[1] - BEFORE * view.half, 0.0)
    camera.elevation = ELEVATION
    camera.azimuth = AZIMUTH
    camera.distance = DISTANCE * view.half
    return camera


def _ground(robot: Robot, q: np.ndarray, view: View) -> list[Mark]:
    """The workspace as a round table, or, where the base slides, as a disc on a floor that goes
    along with it.
    """
    base = base_position(robot, q)
    radius = robot.workspace_radius
    if not robot.base_dof:
        return [Mark(base, radius, 0.0, TABLE, TABLE_HEIGHT)]
    return [
        Mark(view.centre, FLOOR_RADIUS * view.half, -2 * MARK_HEIGHT, FLOOR),
        Mark(base, radius, -MARK_HEIGHT, RIM),
        Mark(base, radius - RIM_WIDTH, 0.0, TABLE),
        Mark(base, PLATE_RADIUS, 0.25 * MARK_HEIGHT, COLUMN),
    ]


def _add_disc(scene: Any, mark: Mark) -> None:
    """Add a mark to what is drawn."""
    import mujoco

    position = np.array([*mark.centre, mark.top - mark.thickness / 2])
    size = np.array([mark.radius, mark.thickness / 2, 0.0])
    cylinder = mujoco.mjtGeom.mjGEOM_CYLINDER
    colours = np.array(mark.colour, dtype=np.float32)
    mujoco.mjv_initGeom(
        scene.geoms[scene.ngeom], cylinder, size, position, np.eye(3).ravel(), colours
    )
    scene.ngeom += 1


def _thinned(points: np.ndarray, most: int) -> np.ndarray:
    """At most so many of the points, evenly chosen, the first and the last among them."""
    return points[np.linspace(0, len(points) - 1, min(len(points), most)).round().astype(int)]
