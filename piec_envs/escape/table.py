"""An escape field read from a table of exact ones, for robots with few joints."""

from __future__ import annotations

import math

import numpy as np

from piec_envs.errors import InvalidParameterError, as_count, as_floats
from piec_envs.escape.base import BatchedField
from piec_envs.escape.between import Field
from piec_envs.escape.disc import MIN_RESOLUTION
from piec_envs.escape.grid import GridField
from piec_envs.escape.network import PICTURE_RESOLUTION
from piec_envs.escape.speed import SpeedModel
from piec_envs.escape.table_file import kept_table
from piec_envs.escape.table_key import table_key
from piec_envs.escape.tabulation import STRIDE, PackedTable, fine_disc, interpolate_rows, tabulate
from piec_envs.held import Keeper
from piec_envs.parallel import notice, run_rows
from piec_envs.world.packed import pack_robot
from piec_envs.world.robots import Robot, get_robot

INNER_JOINTS = 2  # that turn, after the first one
SPACINGS = (0.01, 0.5)  # rad
MAX_BYTES = 1e9
POINT_WORK = 0.15  # us of a point, about


class TableField(BatchedField):
    """Escape time from a table over the point and two inner joints, read multi-linearly.

    The table is solved at second order when a field is first asked for, on all cores, and kept in
    the user's cache. Inside the wall the field continues the free one; beyond a joint's limits it
    keeps the value that it has there.

    Args:
        robot_name: a row of the table of robots, with three turning joints, the first at the base.
        resolution: nodes a side of the square grid over the disc.
        spacing: largest distance between nodes along a joint, rad.
        speed: largest speed as a function of the distance to the robot, with a leaky wall.
        threads: threads over the rows of a batch; None takes all cores.

    Raises:
        UnknownNameError: if the robot is not known.
        InvalidParameterError: if the robot has other joints, the wall is hard, or the table would
            be too coarse or too large.
    """

    name = "table"

    def __init__(
        self,
        robot_name: str = "franka",
        resolution: int = 101,
        spacing: float = 0.07,
        speed: SpeedModel | None = None,
        threads: int | None = None,
    ):
        robot = get_robot(robot_name)
        super().__init__(robot_name, robot.dof, speed or SpeedModel())
        _check_robot(robot)
        if self.leak == 0.0:
            raise InvalidParameterError(
                "a hard wall (leak 0) has infinite times, which no table holds; use 'grid'"
            )
        self.resolution = as_count("resolution", resolution, MIN_RESOLUTION)
        self.threads = threads
        self.spacing = _checked_spacing(spacing)
        self._robot = pack_robot(robot_name)
        self._table = self._make(robot)
        self._packed = Keeper((self._robot, self._table))
        self._grid = GridField(robot_name, PICTURE_RESOLUTION, speed=self.speed, threads=threads)

    @property
    def nbytes(self) -> int:
        """Size of the table, bytes."""
        return self._table.excess.nbytes

    def spec(self) -> dict:
        """What makes this field again through `make_field(**spec)`, as JSON-able values."""
        return {
            "name": self.name,
            "robot_name": self.robot_name,
            "resolution": self.resolution,
            "spacing": self.spacing,
            "speed": {key: float(number) for key, number in self.speed.packed()._asdict().items()},
        }

    def sample(self, q: np.ndarray) -> tuple[Field, np.ndarray]:
        """The table's values on a grid, and the exact ones in the wall; see `BatchedField`."""
        field, base = self._grid.sample(q)
        axis = field.start + field.h * np.arange(len(field.time))  # (N,)
        nodes = np.stack(np.meshgrid(axis, axis), axis=-1)  # (N, N, 2)
        free = (np.hypot(*nodes.transpose(2, 0, 1)) < field.radius) & (
            field.distance > self.speed.d0
        )
        field.time[free] = self.query(nodes[free] + base, q)
        return field, base

    def _make(self, robot: Robot) -> PackedTable:
        """The table, from the cache or solved."""
        limits = [(joint.lower, joint.upper) for joint in robot.joints[-INNER_JOINTS:]]
        axes = tuple(np.linspace(a, b, math.ceil((b - a) / self.spacing) + 1) for a, b in limits)
        shape = (*map(len, axes), self.resolution, self.resolution)
        if 4 * math.prod(shape) > MAX_BYTES:
            raise InvalidParameterError(
                f"a table of {' x '.join(map(str, shape))} numbers is larger than "
                f"{MAX_BYTES / 1e9:g} GB; "
                f"take a larger spacing than {self.spacing:g} or a lower resolution than "
                f"{self.resolution}"
            )
        disc = fine_disc(robot.workspace_radius, self.u_bar, self.resolution)

        def solve() -> np.ndarray:
            """Make the table, and say so if it takes long."""
            with notice(f"solving the escape table of {self.robot_name} (first use only)"):
                return tabulate(self._robot, self.speed, disc, axes, self.threads)

        return PackedTable(
            excess=kept_table("escape", self._key(robot, axes), shape, solve),
            start=float(disc.axis[0]),
            h=STRIDE * disc.h,
            lower=np.array([axis[0] for axis in axes]),
            step=np.array([axis[1] - axis[0] for axis in axes]),
            base=robot.base_dof,
            radius=disc.radius,
            u_bar=self.u_bar,
        )

    def _key(self, robot: Robot, axes: tuple) -> str:
        """What the file of the table is found by; a base that slides has no part in it."""
        base = robot.base_dof
        packed = self._robot
        joints = packed.joint_origin[base:], packed.joint_axis[base:]
        shapes = packed.shapes._replace(frame=packed.shapes.frame - base)
        grid = robot.workspace_radius, self.resolution
        return table_key(joints, shapes, self.speed.packed(), grid, axes)

    def _answer_rows(self, level, q, points, out):
        work = POINT_WORK * points.shape[0] * points.shape[1]
        run_rows(
            interpolate_rows,
            len(q),
            self.threads,
            self._packed.held,
            level,
            q,
            points,
            out,
            work=work,
        )


def can_tabulate(robot: Robot) -> bool:
    """Whether the robot's field depends on the turned point and two joints alone."""
    try:
        _check_robot(robot)
    except InvalidParameterError:
        return False
    return True


def _check_robot(robot: Robot) -> None:
    """Raise InvalidParameterError unless the field depends on the turned point and two joints
    alone.
    """
    turning = robot.joints[robot.base_dof :]
    inner = len(turning) - 1
    if inner != INNER_JOINTS:
        raise InvalidParameterError(
            f"the table holds every posture of {INNER_JOINTS} turning joints after the first, "
            f"but {robot.name!r} has "
            f"{inner}: each one more multiplies its size by about 50; use 'network' or 'grid'"
        )
    if any(joint.axis[:2] != (0.0, 0.0) for joint in turning) or any(turning[0].origin[:2]):
        raise InvalidParameterError(
            f"the table needs joints that only turn, the first at the centre of the disc; those "
            f"of {robot.name!r} "
            "do not: use 'network' or 'grid'"
        )


def _checked_spacing(spacing: float) -> float:
    """The spacing, within SPACINGS."""
    spacing = float(as_floats("spacing", spacing, (), InvalidParameterError))
    if not SPACINGS[0] <= spacing <= SPACINGS[1]:
        raise InvalidParameterError(
            f"spacing must be within {SPACINGS[0]} and {SPACINGS[1]} rad, got {spacing}"
        )
    return spacing
