"""The table of robots: a new robot is one file here and one row."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from piec_envs.errors import check_name
from piec_envs.world.robots.franka import FRANKAS
from piec_envs.world.robots.planar_arm import planar_arm
from piec_envs.world.robots.robot import Joint, Link, Robot

ROBOTS: dict[str, Callable[[], Robot]] = {"planar_arm": planar_arm, **FRANKAS}


@cache
def get_robot(name: str) -> Robot:
    """The robot of that name.

    Raises:
        UnknownNameError: if the table has no such row.
    """
    check_name("robot", name, ROBOTS)
    return ROBOTS[name]()


__all__ = ["ROBOTS", "Joint", "Link", "Robot", "get_robot"]
