"""The native VectorEnv: all rows in one batch, with seeds, masks, ends and the three autoreset
modes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector import VectorEnv as GymVectorEnv
from gymnasium.vector.utils import batch_space

from piec_envs.env.episodes import Episodes
from piec_envs.env.info import with_masks
from piec_envs.env.single import MotionInterface, rewinding, take_row
from piec_envs.env.spec import PlainSpec
from piec_envs.errors import (
    InvalidActionError,
    InvalidParameterError,
    ResetNeededError,
    as_count,
    as_floats,
    check_name,
)
from piec_envs.model.model import SEED_BOUND
from piec_envs.model.state import State
from piec_envs.rendering.renderer import Renderer


def _limit(max_episode_steps: int | None) -> float:
    """Steps after which a row is truncated, infinite for none, which Gymnasium writes as -1."""
    if max_episode_steps in (None, -1):
        return np.inf
    return as_count("max_episode_steps (None and -1 set no limit)", max_episode_steps)


def _own_generator(seed: Any) -> tuple[np.random.Generator, int]:
    """What the VectorEnv itself draws from, and its seed; Gymnasium's -1 stands for several."""
    if np.ndim(seed) == 0:
        return seeding.np_random(int(seed))
    given = [int(entry) for entry in seed if entry is not None]
    return np.random.default_rng(given or None), -1


class VectorEnv(MotionInterface, PlainSpec, GymVectorEnv):
    """B rows of one environment; for a whole-number seed, row i is bit-equal to the single env with
    seed + i.

    If goal-conditioned, it also has `compute_reward(achieved_goal, desired_goal, info)`, for any
    number of goals.

    Args:
        make_episodes: makes the episodes, given the other keyword arguments, rows, dtype and render
            mode.
        render_fps: pictures of a second.
        num_envs: B.
        max_episode_steps: actions after which a row is cut short; None and -1 leave it to the task.
        autoreset_mode: "NextStep", "SameStep" or "Disabled", or Gymnasium's `AutoresetMode`.
        dtype: "float64" or "float32", of the observations.
        render_mode: None or "rgb_array".
        renderer: "drawing", or "mujoco" for frames in space.
        options: the other keyword arguments of the single environment.

    Raises:
        UnknownArgumentError: for a keyword that does not exist.
        UnknownNameError: for an unknown name.
        InvalidParameterError: for a value outside its range.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  Gymnasium declares it so
        "render_modes": ["rgb_array"],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        make_episodes: Callable[..., Episodes],
        render_fps: int,
        /,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        dtype: str = "float64",
        render_mode: str | None = None,
        renderer: str = "drawing",
        **options: Any,
    ):
        super().__init__()
        self.num_envs = as_count("num_envs", num_envs)
        self._episodes: Any = make_episodes(options, self.num_envs, dtype, render_mode)
        self.max_episode_steps = _limit(max_episode_steps)
        check_name(
            "autoreset_mode",
            autoreset_mode,
            (*AutoresetMode, *(mode.value for mode in AutoresetMode)),
        )
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {
            **self.metadata,
            "autoreset_mode": self.autoreset_mode,
            "render_fps": render_fps,
        }
        self.render_mode = render_mode
        self._renderer = Renderer(renderer)
        self.single_observation_space = self._episodes.observation_space
        self.single_action_space = self._episodes.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._action_shape: Any = self.action_space.shape
        if hasattr(self._episodes, "compute_reward"):
            self.compute_reward = self._episodes.compute_reward
        self._all = np.ones(num_envs, dtype=bool)
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._elapsed = np.zeros(num_envs, dtype=np.int64)
        self._begun = np.zeros(num_envs, dtype=bool)
        self._ended = np.zeros(num_envs, dtype=bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict]:
        """Begin new episodes.

        Args:
            seed: of all rows, one for each, or a number to which a row's own is added.
            options: "reset_mask", the rows that begin, and those that the id's page names.

        Returns:
            The observations and the info of all rows.
        """
        options = dict(options or {})
        mask = self._check_mask(options.pop("reset_mask", np.ones(self.num_envs, dtype=bool)))
        rows = np.flatnonzero(mask)
        seeds = self._seeds(seed)
        generators = self._generators
        with rewinding(generators[row] for row in rows if seeds[row] is None):
            self._generators = list(generators)
            for row in rows:
                if seeds[row] is not None:
                    self._generators[row] = seeding.np_random(seeds[row])[0]
            try:
                self._begin(rows, options)
            except BaseException:
                self._generators = generators
                raise
        if seed is not None:
            self._np_random, self._np_random_seed = _own_generator(seed)
        return self._episodes.observe(), with_masks(self._episodes.info(), mask)

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict]:
        """Advance all rows by one step; ended rows begin anew as the autoreset mode says."""
        self._check_begun("step")
        if self.autoreset_mode == AutoresetMode.DISABLED and self._ended.any():
            rows = np.flatnonzero(self._ended).tolist()
            raise InvalidActionError(
                f"rows {rows} have ended: reset them with options={{'reset_mask': ...}}"
            )
        begin = self._ended & (self.autoreset_mode == AutoresetMode.NEXT_STEP)
        # these rows ignore their action, even one that is not finite, and begin anew
        if begin.any():
            actions = self._without(actions, begin)
        observation, reward = self._episodes.step(
            as_floats("actions", actions, self._action_shape, InvalidActionError)
        )
        self._elapsed += 1
        if begin.any():
            self._begin(np.flatnonzero(begin), {})
            observation = self._episodes.observe()
            reward = np.where(begin, 0.0, reward)
        terminated, cut = self._episodes.ends()
        truncated = cut | (self._elapsed >= self.max_episode_steps)
        self._ended = ended = terminated | truncated
        final: dict = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and ended.any():
            final = self._final(observation, ended)
            self._begin(np.flatnonzero(ended), {})
            observation = self._episodes.observe()
        info = with_masks(self._episodes.info(), self._all)
        return observation, reward, terminated, truncated, {**info, **final}

    def _begin(self, rows: np.ndarray, options: dict[str, Any]) -> None:
        """Begin new episodes in some rows."""
        seeds = [int(self._generator(row).integers(SEED_BOUND)) for row in rows]
        self._episodes.reset(rows, seeds, options)
        self._begun[rows] = True
        self._elapsed[rows] = 0
        self._ended[rows] = False

    def _generator(self, row: int) -> np.random.Generator:
        """Where the seeds of a row's episodes come from; without a seed of its own, it is drawn
        from the system.
        """
        generator = self._generators[row]
        if generator is None:
            generator = self._generators[row] = seeding.np_random()[0]
        return generator

    def _check_begun(self, call: str) -> None:
        if not self._begun.all():
            rows = np.flatnonzero(~self._begun).tolist()
            raise ResetNeededError(
                f"{call} needs an episode in every row, and none has begun in rows {rows}: reset "
                f"them first"
            )

    def _without(self, actions: Any, rows: np.ndarray) -> Any:
        """Actions with zeros in some rows; what is no batch of actions stays, to be refused."""
        if np.shape(actions) != self.action_space.shape:
            return actions
        actions = np.array(actions)
        if actions.dtype.kind in "biufO":
            actions[rows] = 0
        return actions

    def _final(self, observation: Any, ended: np.ndarray) -> dict:
        """Last observation and info of the rows that begin anew within this step."""
        final_obs = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(ended):
            final_obs[row] = take_row(observation, int(row))
        return {
            "final_obs": final_obs,
            "_final_obs": ended.copy(),
            "final_info": with_masks(self._episodes.info(), ended),
            "_final_info": ended.copy(),
        }

    def _seeds(self, seed: Any) -> list[int | None]:
        """One seed for each row: None, seed + i, or the entries of a sequence."""
        if seed is None or np.ndim(seed) == 0:
            return [
                None if seed is None else as_count("seed", seed, least=0) + i
                for i in range(self.num_envs)
            ]
        if len(seed) != self.num_envs:
            raise InvalidParameterError(
                f"seed must have one entry for each of {self.num_envs} rows, got {len(seed)}"
            )
        return [None if entry is None else as_count("seed", entry, least=0) for entry in seed]

    def _check_mask(self, mask: Any) -> np.ndarray:
        if (
            not isinstance(mask, np.ndarray)
            or mask.shape != (self.num_envs,)
            or mask.dtype != np.bool_
            or not mask.any()
        ):
            raise InvalidParameterError(
                f"options['reset_mask'] must be a boolean array of shape ({self.num_envs},) with "
                f"a True, got {mask!r}"
            )
        return mask

    def get_params(self) -> dict[str, np.ndarray]:
        """The plant parameters in force in the rows, and "start", the object's pose at their start,
        shape (B, 3).
        """
        self._check_begun("get_params")
        return self._of_motion("get_params").get_params()

    def get_state(self) -> State:
        """Everything that decides how the rows go on."""
        self._check_begun("get_state")
        return self._of_motion("get_state").state.copy()

    def set_state(self, state: State) -> tuple[Any, dict]:
        """Continue from a state of `get_state`.

        Args:
            state: of B rows.

        Returns:
            Its observations and info.

        Raises:
            InvalidStateError: if this is no state of such rows.
        """
        self._of_motion("set_state").restore(state)
        self._begun[:] = True
        self._elapsed = state.step // self.config.action_repeat
        self._ended = self._episodes.ends()[1] | (self._elapsed >= self.max_episode_steps)
        return self._episodes.observe(), with_masks(self._episodes.info(), self._all)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """One frame for each row; None without a render mode."""
        self._check_begun("render")
        if self.render_mode is None:
            return None
        return tuple(
            self._episodes.frame(self._renderer, row, None) for row in range(self.num_envs)
        )

    def close_extras(self, **kwargs: Any) -> None:
        """Free what frames were drawn with."""
        self._renderer.close()
