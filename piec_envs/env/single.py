"""The single environment: a batch of one episode behind Gymnasium's `Env`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import gymnasium as gym
import numpy as np

from piec_envs.env.episodes import Episodes
from piec_envs.env.info import row_info
from piec_envs.env.spec import PlainSpec
from piec_envs.errors import (
    InvalidActionError,
    InvalidParameterError,
    ResetNeededError,
    as_count,
    as_floats,
)
from piec_envs.escape.field import EscapeField
from piec_envs.model.model import SEED_BOUND, Model
from piec_envs.model.rollout import Rollout
from piec_envs.model.state import State
from piec_envs.rendering.renderer import Renderer


def take_row(observation: Any, row: int = 0) -> Any:
    """One row of a batch of observations.

    Args:
        observation: an array, or a dict of arrays.
        row: its number.

    Returns:
        A copy, without the axis of rows.
    """
    if isinstance(observation, dict):
        return {name: value[row].copy() for name, value in observation.items()}
    return observation[row].copy()


@contextmanager
def rewinding(generators: Iterable[np.random.Generator | None]) -> Iterator[None]:
    """Take back what was drawn if the block ends with an error, so that a refused reset changes
    nothing.
    """
    before = [
        (generator.bit_generator, generator.bit_generator.state)
        for generator in generators
        if generator
    ]
    try:
        yield
    except BaseException:
        for bits, state in before:
            bits.state = state
        raise


@contextmanager
def _keeping_generator(env: gym.Env) -> Iterator[None]:
    """Give an environment its generator back, as it was, if the block ends with an error."""
    generator = env._np_random
    seed = env._np_random_seed
    with rewinding([generator]):
        try:
            yield
        except BaseException:
            env._np_random = generator
            env._np_random_seed = seed
            raise


class MotionInterface:
    """What environments of motion offer beside Gymnasium's interface; static caging refuses it."""

    _episodes: Any

    @property
    def config(self) -> Any:
        """The validated keyword arguments."""
        return self._episodes.config

    @property
    def episode_actions(self) -> int | None:
        """Actions of a whole episode; None where the task itself ends it."""
        return self._episodes.length

    @property
    def field(self) -> EscapeField | None:
        """The escape field, or None."""
        return self._episodes.field

    @property
    def model(self) -> Model:
        """What simulates: the task, the robot and the nominal plant."""
        return self._of_motion("model").model

    @property
    def observation_layout(self) -> dict[str, slice]:
        """Names and places of the entries of an observation."""
        return self.model.layout.slices

    def set_params(self, params: Mapping[str, Any]) -> None:
        """Change plant parameters (fields of `PlantParams`) of the episodes to come."""
        self._of_motion("set_params").set_params(params)

    def rollout(
        self, state: State, path: np.ndarray | None = None, controls: np.ndarray | None = None
    ) -> Rollout:
        """Simulate a batch of trajectories from a state without touching the running episodes.

        Args:
            state: one row, or one row for each trajectory.
            path: absolute joint positions to follow, shape (B, N, n), rad; or
            controls: actions in [-1, 1], shape (B, N, n).

        Returns:
            The trajectories; bit-equal to stepping.

        Raises:
            InvalidParameterError: unless exactly one of path and controls is given.
            InvalidStateError: if this is no state of such an environment.
            InvalidActionError: if the path or the controls do not fit.
        """
        return self._of_motion("rollout").rollout(state, path, controls)

    def _of_motion(self, name: str) -> Any:
        """The episodes, if an arm moves in them."""
        if not hasattr(self._episodes, "model"):
            raise InvalidParameterError(
                f"{name} belongs to environments of motion; this one is static caging, which has "
                f"no plant and no motion"
            )
        return self._episodes


class Env(MotionInterface, PlainSpec, gym.Env):
    """One episode at a time; docs/envs describes each id.

    If goal-conditioned, it also has `compute_reward(achieved_goal, desired_goal, info)`: the reward
    of one goal, or of a batch of them (for HER).

    Args:
        make_episodes: makes the episodes, given the other keyword arguments, rows, dtype and render
            mode.
        render_fps: pictures of a second.
        dtype: "float64" or "float32", of the observations.
        render_mode: None or "rgb_array".
        renderer: "drawing" (the plane, in software) or "mujoco" (in space, through OpenGL).
        options: the other keyword arguments of the id.

    Raises:
        UnknownArgumentError: for a keyword that does not exist.
        UnknownNameError: for an unknown name.
        InvalidParameterError: for a value outside its range.
    """

    # A plain dictionary of the class, as Gymnasium declares it.
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        make_episodes: Callable[..., Episodes],
        render_fps: int,
        /,
        dtype: str = "float64",
        render_mode: str | None = None,
        renderer: str = "drawing",
        **options: Any,
    ):
        self._episodes: Any = make_episodes(options, 1, dtype, render_mode)
        self.metadata = {**self.metadata, "render_fps": render_fps}
        self.render_mode = render_mode
        self._renderer = Renderer(renderer)
        self.observation_space = self._episodes.observation_space
        self.action_space = self._episodes.action_space
        self._action_shape: Any = self.action_space.shape
        if hasattr(self._episodes, "compute_reward"):
            self.compute_reward = self._episodes.compute_reward
        self._trail: list[np.ndarray] = []
        self._begun = self._terminated = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict]:
        """Begin an episode.

        Args:
            seed: of all randomness of this and the next episodes.
            options: those that the id's page names.

        Returns:
            The observation and the info.
        """
        with _keeping_generator(self):
            super().reset(seed=None if seed is None else as_count("seed", seed, least=0))
            self._episodes.reset(np.array([0]), [int(self.np_random.integers(SEED_BOUND))], options)
        return self._begin()

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict]:
        """Advance by one action.

        Args:
            action: shape (n,), in [-1, 1].

        Returns:
            Observation, reward, terminated, truncated and info.

        Raises:
            InvalidActionError: for an action of another shape, or one that is not finite; or after
                the end.
            ResetNeededError: before the first reset.
        """
        if not self._begun:
            self._check_begun("step")
        if self._terminated:
            raise InvalidActionError("the episode has ended: call reset")
        action = as_floats("the action", action, self._action_shape, InvalidActionError)
        observation, reward = self._episodes.step(action[None])
        if self.render_mode is not None:
            self._note_place()
        terminated, truncated = self._episodes.ends()
        self._terminated = bool(terminated[0])
        info = self._episodes.single_info()
        return take_row(observation), float(reward[0]), self._terminated, bool(truncated[0]), info

    def get_params(self) -> dict[str, Any]:
        """The plant parameters in force in this episode, and "start", the object's pose at its
        start, shape (3,).
        """
        self._check_begun("get_params")
        return row_info(self._of_motion("get_params").get_params())

    def get_state(self) -> State:
        """Everything that decides how this episode goes on."""
        self._check_begun("get_state")
        return self._of_motion("get_state").state.copy()

    def set_state(self, state: State) -> tuple[Any, dict]:
        """Continue from a state of `get_state`.

        Args:
            state: of one row.

        Returns:
            The observation and info of that state.

        Raises:
            InvalidStateError: if this is no state of such an environment.
        """
        self._of_motion("set_state").restore(state)
        return self._begin()

    def render(self) -> np.ndarray | None:
        """Draw the present state, shape (height, width, 3), uint8; None without a render mode."""
        self._check_begun("render")
        if self.render_mode is None:
            return None
        return self._episodes.frame(
            self._renderer, 0, np.array(self._trail) if self._trail else None
        )

    def close(self) -> None:
        """Free what frames were drawn with."""
        self._renderer.close()

    def _check_begun(self, call: str) -> None:
        if not self._begun:
            raise ResetNeededError(
                f"{call} needs an episode, and none has begun: call reset or set_state first"
            )

    def _begin(self) -> tuple[Any, dict]:
        self._begun = True
        self._terminated = False
        self._trail = []
        self._note_place()
        return take_row(self._episodes.observe()), self._episodes.single_info()

    def _note_place(self) -> None:
        """Where the object is, for the trail in a picture."""
        if hasattr(self._episodes, "state"):
            self._trail.append(self._episodes.state.pose[0, :2].copy())
