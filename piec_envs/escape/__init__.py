"""The escape time: how long an object that flees as fast as it can needs to leave the workspace."""

from piec_envs.escape.field import (
    CAGING_SCALE,
    FIELDS,
    EscapeField,
    key_points_world,
    make_field,
    object_escape_time,
)
from piec_envs.escape.grid import GridField
from piec_envs.escape.obstacle import ObstacleField
from piec_envs.escape.speed import SpeedModel

__all__ = [
    "CAGING_SCALE",
    "FIELDS",
    "EscapeField",
    "GridField",
    "ObstacleField",
    "SpeedModel",
    "key_points_world",
    "make_field",
    "object_escape_time",
]
