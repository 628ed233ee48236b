"""The native VectorEnvs of the motion tasks: all rows in one batch, without processes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from piec_envs.env import Configure, planar_arm_push, planar_arm_track
from piec_envs.episodes.batch import EpisodeBatch, Rollout
from piec_envs.episodes.info import batch_params, with_masks
from piec_envs.episodes.state import State
from piec_envs.errors import InvalidStateError, as_count
from piec_envs.interface import Interface, rollout
from piec_envs.native_vector import NativeVectorEnv
from piec_envs.rendering.renderer import Renderer


class MotionVectorEnv(NativeVectorEnv):
    """B rows of one environment; for a whole-number seed, row i is bit-equal to the single env with seed + i.

    If goal-conditioned, it also has `compute_reward(achieved_goal, desired_goal, info)`, for any number of goals.

    Args:
        configure: makes the configuration of the other arguments.
        num_envs: B.
        max_episode_steps: actions after which a row is cut short; None and -1 leave it to the horizon, after which
            it is truncated whatever this is.
        autoreset_mode: "NextStep", "SameStep" or "Disabled", or Gymnasium's `AutoresetMode`.
        dtype: "float64" or "float32", of the observations.
        render_mode: None or "rgb_array".
        renderer: "drawing", or "mujoco" for frames in space.
        options: the other arguments of the single environment.
    """

    def __init__(
        self,
        configure: Configure,
        /,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        dtype: str = "float64",
        render_mode: str | None = None,
        renderer: str = "drawing",
        **options: Any,
    ):
        rows = as_count("num_envs", num_envs)
        self._batch = EpisodeBatch(configure(options), rows)
        self._renderer = Renderer(renderer)
        interface = Interface(self._batch, dtype, render_mode)
        self._episode_actions = interface.episode_actions
        super().__init__(self._batch, interface, rows, max_episode_steps, autoreset_mode, render_mode)
        if interface.mode:
            self.compute_reward = interface.compute_reward

    @property
    def episode_actions(self) -> int:
        """Actions of a whole episode."""
        return self._episode_actions

    @property
    def batch(self) -> EpisodeBatch:
        """The batch of episodes that does the work."""
        return self._batch

    def set_params(self, params: Mapping[str, Any]) -> None:
        """Change plant parameters (fields of `PlantParams`) of the episodes to come."""
        self._batch.set_params(params)

    def get_params(self) -> dict[str, np.ndarray]:
        """The plant parameters in force in the rows, and "start", the object's pose at their start, shape (B, 3)."""
        self._check_begun("get_params")
        return batch_params(self._batch)

    def get_state(self) -> State:
        """Everything that decides how the rows go on."""
        self._check_begun("get_state")
        return self._batch.state.copy()

    def set_state(self, state: State) -> tuple[Any, dict]:
        """Continue from a state of `get_state`; returns its observations and info."""
        if not isinstance(state, State):
            raise InvalidStateError(f"set_state takes a State, got {state!r}")
        self._batch.restore(state)
        self._begun[:] = True
        self._elapsed = state.step // self._batch.config.action_repeat
        self._ended = self._interface.ends()[1] | (self._elapsed >= self.max_episode_steps)
        return self._interface.observe(), with_masks(self._interface.info(), np.ones(self.num_envs, dtype=bool))

    def rollout(self, state: State, path: np.ndarray | None = None, controls: np.ndarray | None = None) -> Rollout:
        """Simulate trajectories from a state; as `MotionEnv.rollout`."""
        return rollout(self._batch, state, path, controls)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """One frame for each row; None without a render mode."""
        self._check_begun("render")
        if self.render_mode is None:
            return None
        return tuple(self._renderer.frame(self._batch, row) for row in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Free what frames were drawn with."""
        self._renderer.close()


class PlanarArmPushVectorEnv(MotionVectorEnv):
    """The VectorEnv of `PlanarArmPushEnv`.

    Args:
        num_envs: B.
        options: the other arguments of `MotionVectorEnv`.
    """

    def __init__(self, num_envs: int = 1, **options: Any):
        super().__init__(planar_arm_push, num_envs, **options)


class PlanarArmTrackVectorEnv(MotionVectorEnv):
    """The VectorEnv of `PlanarArmTrackEnv`.

    Args:
        num_envs: B.
        options: the other arguments of `MotionVectorEnv`.
    """

    def __init__(self, num_envs: int = 1, **options: Any):
        super().__init__(planar_arm_track, num_envs, **options)
