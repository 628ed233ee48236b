"""A learned escape field, answered by a compiled network without torch."""

from __future__ import annotations

import os
from functools import partial
from typing import Any

import numpy as np

from piec_envs.errors import WeightsError
from piec_envs.escape.base import BatchedField
from piec_envs.escape.between import Field
from piec_envs.escape.grid import GridField
from piec_envs.escape.inference import answer_rows, describe_rows, make_answerer
from piec_envs.escape.packed_network import pack_network
from piec_envs.escape.weights import FieldWeights, find_weights, shipped_file
from piec_envs.held import PerThread
from piec_envs.parallel import run_rows
from piec_envs.world.packed import pack_robot

POINT_WORK = 0.5  # us of a point, about
PICTURE_RESOLUTION = 100  # nodes a side where the whole field is asked


class NetworkField(BatchedField):
    """Escape time from a trained network (paper, section 4.3).

    `FieldWeights` says what the network sees and how its output becomes a time.

    Args:
        robot_name: a row of the table of robots.
        weights: the name of weights that ship with the package, the path of a weight file, or the
            weights.
        threads: threads over the rows of a batch; None takes all cores.

    Raises:
        UnknownNameError: if the robot is not known.
        WeightsError: if there are no such weights, or they are broken or another robot's.
    """

    name = "network"

    def __init__(
        self,
        robot_name: str = "planar_arm",
        weights: str | os.PathLike | FieldWeights = "network",
        threads: int | None = None,
    ):
        self._robot = pack_robot(robot_name)
        self.weights = find_weights(robot_name, weights)
        self.threads = threads
        self._source = None if isinstance(weights, FieldWeights) else str(weights)
        super().__init__(robot_name, self._robot.joint_axis.shape[0], self.weights.speed)
        self._network = pack_network(self.weights)
        self._answerers = PerThread(partial(make_answerer, self._robot, self._network))
        self._grid = GridField(
            robot_name, PICTURE_RESOLUTION, speed=self.weights.speed, threads=threads
        )

    def __reduce__(self) -> tuple:
        if self._source is not None and shipped_file(self.robot_name, self._source).is_file():
            return super().__reduce__()
        # A file may be elsewhere, or another one, where the copy is made: its weights go along.
        return (
            NetworkField,
            (self.robot_name, self.weights, self.threads),
            {"_source": self._source},
        )

    def spec(self) -> dict:
        """What makes this field again through `make_field(**spec)`, as JSON-able values."""
        if self._source is None:
            raise WeightsError(
                "weights that are in no file cannot be named in a spec; save them first"
            )
        return {"name": self.name, "robot_name": self.robot_name, "weights": self._source}

    def describe(self, points: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """What the network is told before normalisation, for training.

        Args:
            points: shape (B, k, 2), m.
            q_r: joint positions, shape (B, n), rad or m.

        Returns:
            Shape (B, k, F), float32.
        """
        points, q, _ = self._rows(points, q_r)
        out = np.empty((*points.shape[:2], len(self.weights.arrays["mean"])), dtype=np.float32)
        run_rows(describe_rows, len(q), self.threads, self._robot, self._network, q, points, out)
        return out

    def sample(self, q: np.ndarray) -> tuple[Field, np.ndarray]:
        """The network's values on a grid; see `BatchedField`."""
        field, base = self._grid.sample(q)
        axis = field.start + field.h * np.arange(len(field.time))  # (N,)
        nodes = np.stack(np.meshgrid(axis, axis), axis=-1)  # (N, N, 2)
        inside = np.hypot(*nodes.transpose(2, 0, 1)) < field.radius
        field.time[inside] = self.query(nodes[inside] + base, q)
        return field, base

    def _answer_rows(self, level, q, points, out):
        work = POINT_WORK * points.shape[0] * points.shape[1]
        run_rows(
            _answer_rows, len(q), self.threads, self._answerers, level, q, points, out, work=work
        )


def _answer_rows(lo: int, hi: int, answerers: PerThread, *arrays: Any) -> None:
    """`answer_rows` with this thread's scratch."""
    answer_rows(lo, hi, answerers.held, *arrays)
