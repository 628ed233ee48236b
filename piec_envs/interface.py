"""What the environments of motion show of themselves, shared by the single env and the VectorEnv."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from piec_envs.episodes.batch import EpisodeBatch, Rollout
from piec_envs.episodes.info import batch_info
from piec_envs.episodes.observation import POSITION_BOUND, observation_bound, observation_layout
from piec_envs.episodes.state import State
from piec_envs.episodes.tasks import GOAL_RADIUS, REWARD_SCALE
from piec_envs.errors import InvalidParameterError
from piec_envs.native_vector import checked_dtype


class Interface:
    """Spaces, observations and rewards, shared by the single env and the VectorEnv.

    Args:
        batch: the episodes.
        dtype: "float64" or "float32", of the observations.
        render_mode: None or "rgb_array".
    """

    def __init__(self, batch: EpisodeBatch, dtype: str, render_mode: str | None):
        self.batch = batch
        self.dtype = checked_dtype(dtype, render_mode)
        self.mode = batch.config.goal_conditioned
        self.layout = observation_layout(batch.robot, batch.tracking)
        bound = observation_bound(batch.robot, batch.tracking).astype(self.dtype)
        self.observation_space: spaces.Space = spaces.Box(-bound, bound, dtype=self.dtype)
        if self.mode:
            where = np.full(2, POSITION_BOUND, dtype=self.dtype)
            goal = spaces.Box(-where, where, dtype=self.dtype)
            self.observation_space = spaces.Dict(
                observation=self.observation_space, achieved_goal=goal, desired_goal=goal
            )
        self.action_space = spaces.Box(-1.0, 1.0, (batch.robot.dof,), dtype=np.dtype("float64"))

    def observe(self) -> Any:
        """Observations of all rows, as an array or a dict of arrays."""
        flat = self.batch.observe().astype(self.dtype, copy=False)
        if not self.mode:
            return flat
        place = self.batch.state.pose[:, :2].clip(-POSITION_BOUND, POSITION_BOUND)
        achieved = place.astype(self.dtype)
        desired = np.repeat(self.batch.task.goal[None].astype(self.dtype), len(flat), axis=0)
        return {"observation": flat, "achieved_goal": achieved, "desired_goal": desired}

    def reward(self, observation: Any) -> np.ndarray:
        """Rewards of all rows for the step that led to `observation`, shape (B,)."""
        if self.mode:
            return self.compute_reward(observation["achieved_goal"], observation["desired_goal"])
        return -REWARD_SCALE * self.batch.stage_cost

    @property
    def episode_actions(self) -> int:
        """Actions of an episode: the task's horizon is where time runs out and the cost of its end is due."""
        return self.batch.task.horizon // self.batch.config.action_repeat

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """None has reached an end of its task; at the horizon, or once diverged, one is truncated, shape (B,) each."""
        state = self.batch.state
        return np.zeros(state.rows, dtype=bool), state.diverged | (state.step >= self.batch.task.horizon)

    def info(self) -> dict:
        """Info of all rows at present."""
        return batch_info(self.batch)

    def compute_reward(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any = None) -> Any:
        """Reward of reaching `achieved_goal` (..., 2) when `desired_goal` (..., 2) was asked for."""
        offset = np.asarray(achieved_goal, dtype=float) - np.asarray(desired_goal, dtype=float)
        square = offset[..., 0] * offset[..., 0] + offset[..., 1] * offset[..., 1]
        if self.mode == "dense":
            reward = -REWARD_SCALE * self.batch.weights.task * square
        else:
            reward = -(np.sqrt(square) > GOAL_RADIUS).astype(float)
        return float(reward) if np.ndim(reward) == 0 else reward


def rollout(batch: EpisodeBatch, state: State, path: np.ndarray | None, controls: np.ndarray | None) -> Rollout:
    """Roll out joint paths or controls; see `MotionEnv.rollout`."""
    values = path if controls is None else controls
    if values is None or (path is not None and controls is not None):
        raise InvalidParameterError("rollout takes either path or controls")
    return batch.rollout(state, values, absolute=controls is None)
