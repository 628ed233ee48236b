"""What every native VectorEnv does: seeds, masks, ends and the three autoreset modes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from piec_envs.episodes.info import with_masks
from piec_envs.errors import (
    InvalidActionError,
    InvalidParameterError,
    ResetNeededError,
    as_count,
    as_floats,
    check_name,
)
from piec_envs.spec import PlainSpec

SEED_BOUND = 2**63 - 1  # of the episode seeds drawn from a generator
RENDER_MODES = ("rgb_array",)
ENV_ARGUMENTS = ("dtype", "render_mode", "renderer")  # keyword arguments of every environment
NO_LIMIT = -1  # as Gymnasium writes it


class Episodes(Protocol):
    """A batch of episodes."""

    def reset(self, rows: np.ndarray, seeds: list[int], options: dict[str, Any] | None = None) -> None:
        """Begin new episodes in some rows."""
        ...

    def step(self, actions: np.ndarray) -> None:
        """Advance all rows by one step; the actions (B, n) have been checked."""
        ...


class Face(Protocol):
    """What a batch of episodes shows of itself, all rows at a time."""

    observation_space: Any
    action_space: Any

    def observe(self) -> Any:
        """Observations, as an array or a dict of arrays."""
        ...

    def reward(self, observation: Any) -> np.ndarray:
        """Rewards of the step that led to `observation`, shape (B,)."""
        ...

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Which episodes have ended by themselves, and which are cut short whatever their length, shape (B,) each."""
        ...

    def info(self) -> dict:
        """Fresh arrays with one entry for each row."""
        ...


def checked_dtype(dtype: str, render_mode: str | None) -> np.dtype:
    """The type of the observations, of keyword arguments that every environment has.

    Args:
        dtype: "float64" or "float32".
        render_mode: None or "rgb_array".

    Raises:
        UnknownNameError: if one of them is something else.
    """
    check_name("dtype", dtype, ("float64", "float32"))
    check_name("render_mode", render_mode, (None, *RENDER_MODES))
    return np.dtype(dtype)


def take_row(observation: Any, row: int = 0) -> Any:
    """One row of a batch of observations, an array or a dict of arrays."""
    if isinstance(observation, dict):
        return {name: value[row].copy() for name, value in observation.items()}
    return observation[row].copy()


@contextmanager
def rewinding(generators: Iterable[np.random.Generator | None]) -> Iterator[None]:
    """Take back what was drawn if the block ends with an error, so that a refused reset changes nothing."""
    before = [(generator.bit_generator, generator.bit_generator.state) for generator in generators if generator]
    try:
        yield
    except BaseException:
        for bits, state in before:
            bits.state = state
        raise


@contextmanager
def keeping_generator(env: gym.Env) -> Iterator[None]:
    """Give a single environment its generator back, as it was, if the block ends with an error."""
    generator = env._np_random
    seed = env._np_random_seed
    with rewinding([generator]):
        try:
            yield
        except BaseException:
            env._np_random = generator
            env._np_random_seed = seed
            raise


def _limit(max_episode_steps: int | None) -> float:
    """Steps after which a row is truncated, infinite for none."""
    if max_episode_steps is None or max_episode_steps == NO_LIMIT:
        return np.inf
    return as_count("max_episode_steps (None and -1 set no limit)", max_episode_steps)


def _own_generator(seed: Any) -> tuple[np.random.Generator, int]:
    """What the VectorEnv itself may draw from, and its seed: -1, as Gymnasium has it, where it is not one number."""
    if np.ndim(seed) == 0:
        return seeding.np_random(int(seed))
    given = [int(entry) for entry in seed if entry is not None]
    return np.random.default_rng(given or None), -1


class NativeVectorEnv(PlainSpec, VectorEnv):
    """Base class of the VectorEnvs; for a whole-number seed, row i is bit-equal to the single env with seed + i.

    Args:
        episodes: the batch that does the work.
        interface: what it shows.
        num_envs: B.
        max_episode_steps: steps after which a row is truncated; None and -1 leave that to the episodes.
        autoreset_mode: "NextStep", "SameStep" or "Disabled", or Gymnasium's `AutoresetMode`.
        render_mode: None or "rgb_array".
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  Gymnasium declares it so
        "render_modes": list(RENDER_MODES),
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        episodes: Episodes,
        interface: Face,
        num_envs: int,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ):
        super().__init__()
        self.num_envs = num_envs
        self.max_episode_steps = _limit(max_episode_steps)
        check_name("autoreset_mode", autoreset_mode, (*AutoresetMode, *(mode.value for mode in AutoresetMode)))
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self._episodes, self._interface = episodes, interface
        self.single_observation_space = interface.observation_space
        self.single_action_space = interface.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._elapsed = np.zeros(num_envs, dtype=np.int64)
        self._begun = np.zeros(num_envs, dtype=bool)
        self._ended = np.zeros(num_envs, dtype=bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict]:
        """Begin new episodes in all rows, or in those of options["reset_mask"]."""
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
        return self._interface.observe(), with_masks(self._interface.info(), mask)

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict]:
        """Advance all rows by one step; ended rows begin anew as the autoreset mode says."""
        self._check_begun("step")
        if self.autoreset_mode == AutoresetMode.DISABLED and self._ended.any():
            rows = np.flatnonzero(self._ended).tolist()
            raise InvalidActionError(f"rows {rows} have ended: reset them with options={{'reset_mask': ...}}")
        begin = self._ended & (self.autoreset_mode == AutoresetMode.NEXT_STEP)
        if begin.any():  # these rows ignore their action, even one that is not finite, and begin anew
            actions = self._without(actions, begin)
        shape = (self.num_envs, *self._interface.action_space.shape)
        self._episodes.step(as_floats("actions", actions, shape, InvalidActionError))
        self._elapsed += 1
        if begin.any():
            self._begin(np.flatnonzero(begin), {})
        observation = self._interface.observe()
        reward = np.where(begin, 0.0, self._interface.reward(observation))
        terminated, cut = self._interface.ends()
        truncated = cut | (self._elapsed >= self.max_episode_steps)
        self._ended = ended = terminated | truncated
        final: dict = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and ended.any():
            final = self._final(observation, ended)
            self._begin(np.flatnonzero(ended), {})
            observation = self._interface.observe()
        info = with_masks(self._interface.info(), np.ones(self.num_envs, dtype=bool))
        return observation, reward, terminated, truncated, {**info, **final}

    def _begin(self, rows: np.ndarray, options: dict[str, Any]) -> None:
        """Begin new episodes in some rows."""
        seeds = [int(self._generator(row).integers(SEED_BOUND)) for row in rows]
        self._episodes.reset(rows, seeds, options)
        self._begun[rows] = True
        self._elapsed[rows] = 0
        self._ended[rows] = False

    def _generator(self, row: int) -> np.random.Generator:
        """Where the seeds of a row's episodes come from; without a seed of its own, it is drawn from the system."""
        generator = self._generators[row]
        if generator is None:
            generator = self._generators[row] = seeding.np_random()[0]
        return generator

    def _check_begun(self, call: str) -> None:
        if not self._begun.all():
            rows = np.flatnonzero(~self._begun).tolist()
            raise ResetNeededError(
                f"{call} needs an episode in every row, and none has begun in rows {rows}: reset them first"
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
            "final_info": with_masks(self._interface.info(), ended),
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
