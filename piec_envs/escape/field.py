"""The table of escape fields, and the escape time of an object."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from piec_envs.errors import InvalidParameterError, PiecError, check_name
from piec_envs.escape.grid import GridField
from piec_envs.escape.network import NetworkField
from piec_envs.escape.protocol import EscapeField
from piec_envs.escape.speed import SpeedModel
from piec_envs.escape.table import TableField, can_tabulate
from piec_envs.escape.weights import has_weights
from piec_envs.kernels import batch_kernel
from piec_envs.world.robots import get_robot

CAGING_SCALE = 0.02  # 1/s: caging = 0.02 T, the scale of the paper's plots
HARD_WALL = {"resolution": 100, "method": "marching"}  # of the field that decides what is enclosed


def _mean(times: np.ndarray, axis: int) -> np.ndarray:
    """`np.mean`, in a third of its time on few numbers."""
    return np.add.reduce(times, axis=axis) / times.shape[axis]


REDUCTIONS: dict[str, Callable[..., Any]] = {"mean": _mean, "max": np.max}


FIELDS: dict[str, Callable[..., EscapeField]] = {
    "grid": GridField,
    "network": NetworkField,
    "table": TableField,
    "pinn": partial(NetworkField, weights="pinn"),
}


def make_field(name: str = "grid", robot_name: str = "planar_arm", **options) -> EscapeField:
    """The escape field of that name; equal arguments give the same instance.

    Args:
        name: a row of the table of fields.
        robot_name: a row of the table of robots.
        options: the field's other arguments; `speed` may be a `SpeedModel` or a dict of its
            numbers.

    Returns:
        A field, to be treated as read-only.

    Raises:
        UnknownNameError: if a table has no such row.
        InvalidParameterError: if an option is not one of the field's.
    """
    check_name("escape field", name, FIELDS)
    try:
        if isinstance(options.get("speed"), dict):
            options["speed"] = SpeedModel(**options["speed"])
        return _cached_field(name, robot_name, **options)
    except PiecError:
        raise
    except (TypeError, ValueError, AttributeError) as error:
        raise InvalidParameterError(f"escape field {name!r}: {error}") from error


def resolve_field(choice: str | Mapping[str, Any], robot_name: str) -> str | Mapping[str, Any]:
    """The choice itself, or what "auto" stands for.

    That is `table` for robots whose field can be tabulated, since nothing is more exact or quicker,
    else `network` where weights ship for the robot, else `grid`.

    Args:
        choice: a name, "auto", or a mapping of the field's arguments.
        robot_name: a row of the table of robots.

    Returns:
        The choice; "auto" is replaced by a row of the table of fields.

    Raises:
        UnknownNameError: for "auto", if there is no such robot.
    """
    if choice != "auto":
        return choice
    if can_tabulate(get_robot(robot_name)):
        return "table"
    return "network" if has_weights(robot_name) else "grid"


def choose_field(choice: str | Mapping[str, Any], robot_name: str, **options) -> EscapeField:
    """The escape field that a keyword argument asks for.

    Args:
        choice: a name, "auto", or a mapping of the field's arguments with a "name", by default
            "grid".
        robot_name: a row of the table of robots.
        options: further arguments of the field.

    Returns:
        A field, to be treated as read-only.

    Raises:
        PiecError: as `make_field` does.
    """
    choice = resolve_field(choice, robot_name)
    given = {"name": choice} if isinstance(choice, str) else {"name": "grid", **choice}
    return make_field(robot_name=robot_name, **{**options, **given})


@lru_cache(maxsize=32)
def _cached_field(name, robot_name, **options):
    return FIELDS[name](robot_name, **options)


@batch_kernel
def _place(key_points, pose, out):
    """out[b, i] = key point i of the object at pose b, shapes (k, 2), (B, 3), (B, k, 2)."""
    for b in range(pose.shape[0]):
        c, s = np.cos(pose[b, 2]), np.sin(pose[b, 2])
        for i in range(key_points.shape[0]):
            out[b, i, 0] = pose[b, 0] + c * key_points[i, 0] - s * key_points[i, 1]
            out[b, i, 1] = pose[b, 1] + s * key_points[i, 0] + c * key_points[i, 1]


def key_points_world(key_points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Key points of an object in the world, the same bits in every batch size.

    Args:
        key_points: in the object's frame, shape (k, 2), m.
        pose: x, y, angle, shape (..., 3), m, rad.

    Returns:
        Points, shape (..., k, 2), m.
    """
    key_points = np.ascontiguousarray(key_points, dtype=float)
    pose = np.ascontiguousarray(pose, dtype=float)
    out = np.empty((*pose.shape[:-1], *key_points.shape))
    _place(key_points, pose.reshape(-1, 3), out.reshape(-1, *key_points.shape))
    return out


def object_escape_time(
    field: EscapeField,
    key_points: np.ndarray,
    pose: np.ndarray,
    q_r: np.ndarray,
    reduce: str = "mean",
) -> np.ndarray:
    """Escape time of an object, a lower bound from its key points (paper, section 4.3, eq. 6).

    Args:
        field: an `EscapeField`.
        key_points: in the object's frame, shape (k, 2), m.
        pose: x, y, angle of the object, shape (B, 3) or (3,).
        q_r: joint positions, shape (B, n) or (n,).
        reduce: "mean" over the key points (the paper's choice) or "max" (the tighter bound).

    Returns:
        T_hat in s, shape (B,) or ().

    Raises:
        UnknownNameError: if the reduction is not known.
    """
    check_name("reduction", reduce, REDUCTIONS)
    return REDUCTIONS[reduce](field.query(key_points_world(key_points, pose), q_r), axis=-1)


def enclosed_points(
    robot_name: str, points: np.ndarray, q_r: np.ndarray, speed: SpeedModel | None = None
) -> np.ndarray:
    """Whether nothing leads out of points under a hard wall, as static caging decides it.

    One enclosed key point holds the whole object.

    Args:
        robot_name: row of the table of robots.
        points: in the world, shape (B, k, 2) or (k, 2), m.
        q_r: joint positions, shape (B, n) or (n,), rad or m.
        speed: whose wall is closed for that; None takes the default.

    Returns:
        Shape (B, k) or (k,).

    Raises:
        UnknownNameError: if the table has no such robot.
        InvalidStateError: for shapes that do not fit, or numbers that are not finite.
    """
    closed = replace(speed or SpeedModel(), leak=0.0)
    field = make_field("grid", robot_name, speed=closed, threads=1, **HARD_WALL)
    return np.isinf(field.query(points, q_r))
