"""Static caging as episodes of one step: draw an object pose, take a posture, judge it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from piec_envs.env.info import row_info
from piec_envs.errors import InvalidParameterError, as_count, as_floats, check_name
from piec_envs.escape.field import (
    CAGING_SCALE,
    HARD_WALL,
    EscapeField,
    choose_field,
    make_field,
    object_escape_time,
    resolve_field,
)
from piec_envs.escape.speed import SpeedModel
from piec_envs.model.caging_problem import FEASIBLE, Caged, CagingProblem
from piec_envs.plain import make_plain
from piec_envs.world.objects import get_object
from piec_envs.world.robots import get_robot

REACH = 0.4  # m; farther from the base few postures enclose anything
# m between the first axis and a drawn object: half the width of a slim first link and a little more
BASE_ROOM = 0.06


@dataclass(frozen=True)
class CageConfig:
    """All keyword arguments of a static caging environment except those that Gymnasium itself
    takes.

    Args:
        robot: row of the table of robots; the environment's id decides it.
        object: row of the table of objects.
        pose: the object's x, y, angle in every episode; None draws it.
        escape_field: name of the escape field, or its options with a "name"; "auto" is the robot's
            best. Its wall must leak.
        reduce: "mean" or "max" over the key points.
        threads: threads of a batch; None takes all cores.

    Raises:
        UnknownNameError: for a name in no table.
        InvalidParameterError: for a value outside its range.
    """

    robot: str
    object: str = "three_discs"
    pose: tuple[float, float, float] | None = None
    escape_field: str | Mapping[str, Any] = "auto"
    reduce: str = "mean"
    threads: int | None = None

    def __post_init__(self):
        make_plain(self)
        get_object(self.object)
        if self.threads is not None:
            as_count("threads", self.threads)
        if not isinstance(self.escape_field, str | Mapping):
            raise InvalidParameterError(
                f"escape_field must be a name or a mapping of options with a name, got "
                f"{self.escape_field!r}"
            )
        object.__setattr__(self, "escape_field", resolve_field(self.escape_field, self.robot))
        pose = (REACH, 0.0, 0.0) if self.pose is None else self.checked_pose(self.pose)
        # refuses what no problem can be made of
        self.make_problem(np.array(pose), self.make_field())
        object.__setattr__(self, "pose", None if self.pose is None else pose)

    @classmethod
    def field_names(cls) -> list[str]:
        """Names of all keyword arguments but the robot."""
        return [item.name for item in dataclasses.fields(cls) if item.name != "robot"]

    def checked_pose(self, pose: Any) -> tuple[float, ...]:
        """An object pose as three floats."""
        return tuple(
            as_floats(
                "pose (x and y in m, angle in rad)", pose, (3,), InvalidParameterError
            ).tolist()
        )

    def make_field(self) -> EscapeField:
        """The escape field."""
        return choose_field(self.escape_field, self.robot, threads=self.threads)

    def make_hard_field(self) -> EscapeField:
        """The exact field under a hard wall, which decides what is enclosed."""
        speed = dataclasses.replace(getattr(self.make_field(), "speed", SpeedModel()), leak=0.0)
        return make_field("grid", self.robot, speed=speed, threads=self.threads, **HARD_WALL)

    def make_problem(self, pose: np.ndarray, field: EscapeField) -> CagingProblem:
        """The problem of enclosing the object.

        Args:
            pose: the object's x, y, angle, shape (3,), or one in each row, shape (B, 3), m and rad.
            field: the escape field.

        Returns:
            The problem.
        """
        return CagingProblem(
            self.robot, self.object, pose, field, self.reduce, threads=self.threads
        )


class CageEpisodes:
    """B episodes of static caging.

    Its present: `pose` (B, 3), `q_r` (B, n), `done` (B,), `escape_time` (B,) s, `value` (B,) s,
    `phi` (B, m) m, and `enclosed` (B,).

    Args:
        config: the environment's keyword arguments.
        rows: B.
        dtype: of the observations.
    """

    length = None  # the first step ends an episode

    def __init__(self, config: CageConfig, rows: int, dtype: np.dtype):
        self.config = config
        self.rows = rows
        self._dtype = dtype
        self.robot = get_robot(config.robot)
        self.field = config.make_field()
        self._hard = config.make_hard_field()
        self._item = get_object(config.object)
        self.lower = self.robot.joint_array("lower")
        self.upper = self.robot.joint_array("upper")
        self.pose = np.tile([REACH, 0.0, 0.0], (rows, 1))
        self.q_r = np.tile(self.robot.home, (rows, 1))
        self.done = np.zeros(rows, dtype=bool)
        self.enclosed = np.zeros(rows, dtype=bool)
        problem = config.make_problem(self.pose[0], self.field)
        self.object_rows = problem.object_rows
        count = problem.object_rows + len(problem.pairs)
        self.escape_time = np.zeros(rows)
        self.value = np.zeros(rows)
        self.phi = np.zeros((rows, count))
        radius = self.robot.workspace_radius
        bound = np.array([radius, radius, 1.0, 1.0], dtype=dtype)
        self.observation_space: spaces.Space = spaces.Box(-bound, bound, dtype=dtype)
        self.action_space: spaces.Space = spaces.Box(
            -1.0, 1.0, (self.robot.dof,), dtype=np.dtype("float64")
        )

    def reset(
        self, rows: np.ndarray, seeds: list[int], options: Mapping[str, Any] | None = None
    ) -> None:
        """Begin new episodes in some rows, with the arm at home.

        Args:
            rows: row numbers.
            seeds: one episode seed for each of these rows.
            options: "pose", the object's x, y, angle.

        Raises:
            UnknownNameError: for an option that does not exist.
            InvalidParameterError: for a pose that is not finite or outside the workspace.
        """
        for name in options or {}:
            check_name("reset option", name, ("pose",))
        given = (options or {}).get("pose")
        fixed = self.config.pose if given is None else self.config.checked_pose(given)
        pose = np.array([self._draw_pose(seed) if fixed is None else fixed for seed in seeds])
        self.config.make_problem(pose, self.field)  # refuses before anything is written
        self.pose[rows] = pose
        self.q_r[rows] = self.robot.home
        self.done[rows] = self.enclosed[rows] = False
        self._judge(rows)

    def _draw_pose(self, seed: int) -> np.ndarray:
        """A pose drawn evenly from the ring around the base, at any angle."""
        rng = np.random.default_rng(seed)
        least = self._item.bounding_radius + BASE_ROOM
        radius = np.sqrt(rng.uniform(least**2, REACH**2))
        bearing = rng.uniform(-np.pi, np.pi)
        return np.array(
            [radius * np.cos(bearing), radius * np.sin(bearing), rng.uniform(-np.pi, np.pi)]
        )

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Take the posture that each action stands for; rows that have ended stay as they are.

        Args:
            actions: finite, shape (B, n), in [-1, 1] from the lower to the upper joint limits; who
                takes them from the user checks them.

        Returns:
            Observations, and rewards of shape (B,): 0.02 times the value that planners maximise.
        """
        rows = np.flatnonzero(~self.done)
        if len(rows) == 0:
            return self.observe(), CAGING_SCALE * self.value
        share = (np.clip(actions[rows], -1.0, 1.0) + 1.0) / 2.0
        self.q_r[rows] = (1.0 - share) * self.lower + share * self.upper
        self._judge(rows)
        # One enclosed key point holds the whole object.
        times = object_escape_time(
            self._hard, self._item.key_points, self.pose[rows], self.q_r[rows], "max"
        )
        self.enclosed[rows] = np.isinf(times)
        self.done[rows] = True
        return self.observe(), CAGING_SCALE * self.value

    def _judge(self, rows: np.ndarray) -> None:
        judged = self.config.make_problem(self.pose[rows], self.field).measure(self.q_r[rows])
        self.escape_time[rows] = judged.escape_time
        self.value[rows] = judged.value
        self.phi[rows] = judged.phi

    def observe(self) -> np.ndarray:
        """Object x, y (m), cos and sin of its angle, shape (B, 4)."""
        angle = self.pose[:, 2]
        seen = np.column_stack([self.pose[:, :2], np.cos(angle), np.sin(angle)])
        return seen.astype(self._dtype, copy=False)

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Which rows have taken their posture, and that none is cut short, shape (B,) each."""
        return self.done.copy(), np.zeros(self.rows, dtype=bool)

    def info(self) -> dict[str, np.ndarray]:
        """Info of all rows at present, fresh arrays."""
        distance = self.phi[:, : self.object_rows].min(axis=1)
        # m; 10 where no links can meet
        own = self.phi[:, self.object_rows :].min(axis=1, initial=10.0)
        return {
            "is_success": self.enclosed & (self.phi.min(axis=1) >= -FEASIBLE),
            "enclosed": self.enclosed.copy(),
            "escape_time": self.escape_time.copy(),
            "caging": CAGING_SCALE * self.escape_time,
            "min_distance": distance,
            "penetration": np.maximum(0.0, -distance),
            "self_distance": own,
            "q_r": self.q_r.copy(),
            "pose": self.pose.copy(),
        }

    def single_info(self) -> dict[str, Any]:
        """Info of the only row, without the axis of rows."""
        return row_info(self.info())

    def frame(self, renderer: Any, row: int, trail: np.ndarray | None) -> np.ndarray:
        """A picture of one row's posture and its field; see `Episodes.frame`."""
        enclosed = bool(self.enclosed[row]) if self.done[row] else None
        speed = getattr(self.field, "speed", SpeedModel())
        time = float(self.escape_time[row])
        return renderer.posture(
            Caged(
                self.config.robot,
                self.config.object,
                self.q_r[row],
                self.pose[row],
                speed,
                time,
                enclosed,
            )
        )
