"""The native VectorEnvs: all rows in one batch, without processes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from piec_envs.env import RENDER_MODES, SEED_BOUND, Interface, make_config, rollout, take_row
from piec_envs.episodes.batch import EpisodeBatch, Rollout
from piec_envs.episodes.info import batch_info, with_masks
from piec_envs.episodes.state import State
from piec_envs.errors import InvalidActionError, InvalidParameterError, InvalidStateError, as_count, check_name


class PlanarArmVectorEnv(VectorEnv):
    """B rows of one environment; for a whole-number seed, row i is bit-equal to the single env with seed + i.

    Args:
        num_envs: B.
        max_episode_steps: steps after which a row is truncated.
        autoreset_mode: "NextStep", "SameStep" or "Disabled", or Gymnasium's `AutoresetMode`.
        dtype: "float64" or "float32", of the observations.
        render_mode: None or "rgb_array".
        options: the arguments of `EnvConfig`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  Gymnasium declares it so
        "render_modes": list(RENDER_MODES),
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    task_name: ClassVar[str]

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = 1000,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        dtype: str = "float64",
        render_mode: str | None = None,
        **options: Any,
    ):
        super().__init__()
        self.num_envs = as_count("num_envs", num_envs)
        self.max_episode_steps = as_count("max_episode_steps", max_episode_steps)
        check_name("autoreset_mode", autoreset_mode, (*AutoresetMode, *(mode.value for mode in AutoresetMode)))
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self._batch = EpisodeBatch(make_config(self.task_name, options), num_envs)
        self._interface = Interface(self._batch, dtype, render_mode)
        self.single_observation_space = self._interface.observation_space
        self.single_action_space = self._interface.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._elapsed = np.zeros(num_envs, dtype=np.int64)
        self._ended = np.zeros(num_envs, dtype=bool)

    @property
    def batch(self) -> EpisodeBatch:
        """The batch of episodes that does the work."""
        return self._batch

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict]:
        """Begin new episodes in all rows, or in those of options["reset_mask"]."""
        options = dict(options or {})
        mask = self._check_mask(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)))
        rows = np.flatnonzero(mask)
        seeds = self._seeds(seed)
        for row in rows:
            if seeds[row] is not None or self._generators[row] is None:
                self._generators[row] = seeding.np_random(seeds[row])[0]
        self._begin(rows, options)
        return self._interface.observe(), with_masks(batch_info(self._batch), mask)

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict]:
        """Advance all rows by one control step; ended rows begin anew as the autoreset mode says."""
        if self.autoreset_mode == AutoresetMode.DISABLED and self._ended.any():
            rows = np.flatnonzero(self._ended).tolist()
            raise InvalidActionError(f"rows {rows} have ended: reset them with options={{'reset_mask': ...}}")
        begin = self._ended & (self.autoreset_mode == AutoresetMode.NEXT_STEP)
        if begin.any():  # these rows ignore their action, whatever it is, and begin anew
            actions = np.array(actions)
            actions[begin] = 0.0
        self._batch.step(actions)
        self._elapsed += 1
        if begin.any():
            self._begin(np.flatnonzero(begin), {})
        observation = self._interface.observe()
        reward = np.where(begin, 0.0, self._interface.reward(observation))
        truncated = self._elapsed >= self.max_episode_steps
        self._ended = truncated.copy()
        final: dict = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and truncated.any():
            final = self._final(observation, truncated)
            self._begin(np.flatnonzero(truncated), {})
            observation = self._interface.observe()
        info = with_masks(batch_info(self._batch), np.ones(self.num_envs, dtype=bool))
        return observation, reward, np.zeros(self.num_envs, dtype=bool), truncated, {**info, **final}

    def _begin(self, rows: np.ndarray, options: dict[str, Any]) -> None:
        """Begin new episodes in some rows."""
        seeds = [int(self._generators[row].integers(SEED_BOUND)) for row in rows]
        self._batch.reset(rows, seeds, options)
        self._elapsed[rows] = 0
        self._ended[rows] = False

    def _final(self, observation: Any, ended: np.ndarray) -> dict:
        """Last observation and info of the rows that begin anew within this step."""
        final_obs = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(ended):
            final_obs[row] = take_row(observation, int(row))
        return {
            "final_obs": final_obs,
            "_final_obs": ended.copy(),
            "final_info": with_masks(batch_info(self._batch), ended),
            "_final_info": ended.copy(),
        }

    def _seeds(self, seed: Any) -> list[int | None]:
        """One seed for each row: None, seed + i, or the entries of a sequence."""
        if seed is None or np.ndim(seed) == 0:
            return [None if seed is None else as_count("seed", seed, least=0) + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise InvalidParameterError(f"seed must have one entry for each of {self.num_envs} rows, got {len(seed)}")
        return [None if entry is None else as_count("seed", entry, least=0) for entry in seed]

    def _check_mask(self, mask: Any) -> np.ndarray:
        if (
            not isinstance(mask, np.ndarray)
            or mask.shape != (self.num_envs,)
            or mask.dtype != np.bool_
            or not mask.any()
        ):
            raise InvalidParameterError(
                f"options['reset_mask'] must be a boolean array of shape ({self.num_envs},) with a True, got {mask!r}"
            )
        return mask

    def set_params(self, params: Mapping[str, Any]) -> None:
        """Change plant parameters (fields of `PlantParams`) of the episodes to come."""
        self._batch.set_params(params)

    def get_state(self) -> State:
        """Everything that decides how the rows go on."""
        return self._batch.state.copy()

    def set_state(self, state: State) -> tuple[Any, dict]:
        """Continue from a state of `get_state`; returns its observations and info."""
        if not isinstance(state, State):
            raise InvalidStateError(f"set_state takes a State, got {state!r}")
        self._batch.restore(state)
        self._elapsed = state.step.copy()
        self._ended = self._elapsed >= self.max_episode_steps
        return self._interface.observe(), with_masks(batch_info(self._batch), np.ones(self.num_envs, dtype=bool))

    def rollout(self, state: State, path: np.ndarray | None = None, controls: np.ndarray | None = None) -> Rollout:
        """Simulate trajectories from a state; as `PlanarArmEnv.rollout`."""
        return rollout(self._batch, state, path, controls)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """One frame for each row; None without a render mode."""
        if self.render_mode is None:
            return None
        from piec_envs.rendering.frame import render_frame

        return tuple(render_frame(self._batch, row) for row in range(self.num_envs))


class PlanarArmPushVectorEnv(PlanarArmVectorEnv):
    """The VectorEnv of `PlanarArmPushEnv`."""

    task_name = "push"


class PlanarArmTrackVectorEnv(PlanarArmVectorEnv):
    """The VectorEnv of `PlanarArmTrackEnv`."""

    task_name = "track"
