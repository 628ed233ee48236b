"""Where the arm of a task can bring its object."""

from __future__ import annotations

from functools import cache

import numpy as np

from piec_envs.model.task import GOAL_RADIUS
from piec_envs.world.objects import depth_inside, get_object
from piec_envs.world.packed import pack_robot
from piec_envs.world.robots import get_robot


@cache
def goal_ring(robot_name: str, object_name: str) -> tuple[float, float]:
    """Distances from the origin outside of which no goal can be reached.

    A fixed arm pushes an object no farther than it reaches itself, nor out of its workspace; nor
    can the object enter the part of the arm that turns about the base. A base that slides goes
    everywhere within its limits.

    Args:
        robot_name: row of the table of robots.
        object_name: row of the table of objects.

    Returns:
        The least and the largest distance of a goal from the origin, m.

    Raises:
        UnknownNameError: if a table has no such row.
    """
    robot = get_robot(robot_name)
    item = get_object(object_name)
    if robot.base_dof:
        return 0.0, float(robot.joint_array("upper")[: robot.base_dof].min())
    turning = [shape for link in robot.links if link.frame == 1 for shape in link.shapes]
    base = max((depth_inside(shape, np.zeros(2)) for shape in turning), default=0.0)
    core = max(0.0, *(depth_inside(shape, np.zeros(2)) for shape in item.shapes))
    least = base + core - GOAL_RADIUS if base > 0 else 0.0
    reach = float(pack_robot(robot_name).reach[0]) + item.bounding_radius + GOAL_RADIUS
    return max(0.0, least), min(robot.workspace_radius, reach)
