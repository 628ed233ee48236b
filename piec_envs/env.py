"""The single environments: a batch of one episode behind Gymnasium's `Env`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np

from piec_envs.episodes.batch import EpisodeBatch, Rollout
from piec_envs.episodes.config import EnvConfig
from piec_envs.episodes.info import batch_params, row_info
from piec_envs.episodes.state import State
from piec_envs.errors import (
    InvalidActionError,
    InvalidStateError,
    ResetNeededError,
    as_count,
    as_floats,
    check_arguments,
)
from piec_envs.interface import Interface, rollout
from piec_envs.native_vector import ENV_ARGUMENTS, RENDER_MODES, SEED_BOUND, keeping_generator, take_row
from piec_envs.rendering.renderer import Renderer
from piec_envs.spec import PlainSpec

Configure = Callable[[Mapping[str, Any]], EnvConfig]  # from an environment's keyword arguments


def make_config(task: str, options: Mapping[str, Any], robot: str = "auto", others: Iterable[str] = ()) -> EnvConfig:
    """Validate keyword arguments.

    Args:
        task: row of the table of tasks.
        options: the keyword arguments.
        robot: row of the table of robots; "auto" is the task's.
        others: names of further keyword arguments of the environment, for the message.

    Raises:
        UnknownArgumentError: for a keyword that does not exist.
    """
    check_arguments(options, [*others, *EnvConfig.field_names(), *ENV_ARGUMENTS])
    return EnvConfig(task, robot=robot, **options)


planar_arm_push: Configure = partial(make_config, "planar_arm_push")
planar_arm_track: Configure = partial(make_config, "planar_arm_track")


class MotionEnv(PlainSpec, gym.Env):
    """Base class of the single environments of motion; see the subclasses.

    If goal-conditioned, it also has `compute_reward(achieved_goal, desired_goal, info)`: the reward of one
    goal, or of a batch of them (for HER).

    Args:
        configure: makes the configuration of the other arguments.
        dtype: "float64" or "float32", of the observations.
        render_mode: None or "rgb_array".
        renderer: "drawing" (the plane, in software) or "mujoco" (in space, through OpenGL).
        options: the other arguments.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  Gymnasium declares it so
        "render_modes": list(RENDER_MODES),
        "render_fps": 10,
    }

    def __init__(
        self,
        configure: Configure,
        /,
        dtype: str = "float64",
        render_mode: str | None = None,
        renderer: str = "drawing",
        **options: Any,
    ):
        self._batch = EpisodeBatch(configure(options), rows=1)
        self._interface = Interface(self._batch, dtype, render_mode)
        self.render_mode, self._renderer = render_mode, Renderer(renderer)
        self.observation_space = self._interface.observation_space
        self.action_space = self._interface.action_space
        if self._interface.mode:  # others have no such attribute, by which HER would take them for goal-conditioned
            self.compute_reward = self._interface.compute_reward
        self._trail: list[np.ndarray] = []
        self._begun = False

    @property
    def episode_actions(self) -> int:
        """Actions of a whole episode."""
        return self._interface.episode_actions

    @property
    def config(self) -> EnvConfig:
        """The validated keyword arguments."""
        return self._batch.config

    @property
    def batch(self) -> EpisodeBatch:
        """The batch of one episode that does the work."""
        return self._batch

    @property
    def observation_layout(self) -> dict[str, slice]:
        """Names and places of the entries of an observation."""
        return self._interface.layout

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Begin an episode; see the class for the options."""
        with keeping_generator(self):
            super().reset(seed=None if seed is None else as_count("seed", seed, least=0))
            self._batch.reset(np.array([0]), [int(self.np_random.integers(SEED_BOUND))], options)
        return self._begin()

    def step(self, action: np.ndarray):
        """Advance by one action, of one control step of 0.1 s or of `action_repeat`."""
        self._check_begun("step")
        action = as_floats("the action", action, (self._batch.robot.dof,), InvalidActionError)
        self._batch.step(action[None])
        observation = self._interface.observe()
        reward = float(self._interface.reward(observation)[0])
        if self.render_mode:
            self._trail.append(self._batch.state.pose[0, :2].copy())
        _, truncated = self._interface.ends()
        return take_row(observation), reward, False, bool(truncated[0]), row_info(self._interface.info())

    def set_params(self, params: Mapping[str, Any]) -> None:
        """Change plant parameters (fields of `PlantParams`) of the episodes to come."""
        self._batch.set_params(params)

    def get_params(self) -> dict[str, Any]:
        """The plant parameters in force in this episode, and "start", the object's pose at its start, shape (3,)."""
        self._check_begun("get_params")
        return row_info(batch_params(self._batch))

    def get_state(self) -> State:
        """Everything that decides how this episode goes on."""
        self._check_begun("get_state")
        return self._batch.state.copy()

    def set_state(self, state: State) -> tuple[Any, dict]:
        """Continue from a state of `get_state`.

        Returns:
            The observation and info of that state.
        """
        if not isinstance(state, State):
            raise InvalidStateError(f"set_state takes a State, got {state!r}")
        self._batch.restore(state)
        return self._begin()

    def rollout(self, state: State, path: np.ndarray | None = None, controls: np.ndarray | None = None) -> Rollout:
        """Simulate a batch of trajectories from a state without touching the running episode.

        Args:
            state: one row, or one row for each trajectory.
            path: absolute joint positions to follow, shape (B, N, n), rad; or
            controls: actions in [-1, 1], shape (B, N, n).

        Returns:
            The trajectories; bit-equal to stepping.

        Raises:
            InvalidParameterError: unless exactly one of path and controls is given.
        """
        return rollout(self._batch, state, path, controls)

    def render(self) -> np.ndarray | None:
        """Draw the present state, shape (height, width, 3), uint8; None without a render mode."""
        self._check_begun("render")
        if self.render_mode is None:
            return None
        return self._renderer.frame(self._batch, 0, np.array(self._trail))

    def close(self) -> None:
        """Free what frames were drawn with."""
        self._renderer.close()

    def _check_begun(self, call: str) -> None:
        if not self._begun:
            raise ResetNeededError(f"{call} needs an episode, and none has begun: call reset or set_state first")

    def _begin(self) -> tuple[Any, dict]:
        self._begun = True
        self._trail = [self._batch.state.pose[0, :2].copy()]
        return take_row(self._interface.observe()), row_info(self._interface.info())


class PlanarArmPushEnv(MotionEnv):
    """Push an object into a goal region with the whole planar 4-DOF arm (paper section 5.4).

    **Action.** Box(-1, 1, (4,)): commanded joint velocities over 0.05 rad/s. The command moves by
    at most 0.005 rad in a step of 0.1 s, stays within the joint limits (+-pi, +-2.6 rad) and leads
    the joint by at most 0.01 rad.

    **Observation.** Box(23,), in this order: cos q, sin q, q_r and q_cmd over the limits (4 each);
    object x, y (m), cos and sin of its angle; goal minus object (m); step over 1000. With
    `goal_conditioned`, a dict with "achieved_goal" and "desired_goal" (2 each) beside it.

    **Reward.** Minus 0.001 times the planner's stage cost w_task |goal - object|^2 + w_command |u|^2
    + w_prior c_prior, to which the last step adds w_miss d2g; with `goal_conditioned`, -(d2g > 0), or
    minus the task term alone for "dense".

    **Start.** Arm straight along x, object at (0.55, 0.25) m, drawn with `start_noise`. Options of
    `reset`: "params" (plant parameters) and "state" (a `State`, or a dict of q_r, q_cmd, pose, step).

    **End.** Never terminated; truncated after 1000 steps, or when the simulation has become unstable
    (info["diverged"]; the last good state stays). An episode succeeds if d2g = 0 at its last
    step: the object's centre is within 0.05 m of the goal (-0.3, 0.4). No `max_episode_steps` makes it
    longer; one below 1000 (over `action_repeat`) cuts it short, before w_miss d2g is due.

    **Info.** Numbers: is_success, goal_distance, d2g, link_distance, contact_links, min_distance,
    mean_distance, penetration, cost_task, cost_command, cost_prior, diverged; and, unless
    `escape_field=None`, escape_time (s) and caging (0.02 of it). What stays the same through an episode,
    the plant parameters in force and where the object started, is told by `get_params()`.

    **Arguments.** Those of `EnvConfig`, `dtype` ("float64" or "float32"), `render_mode` (None or
    "rgb_array") and `renderer` ("drawing", or "mujoco" for frames in space; see docs/rendering.md).

    **Version history.** v0: first version.
    """

    def __init__(self, **options: Any):
        super().__init__(planar_arm_push, **options)


class PlanarArmTrackEnv(MotionEnv):
    """Move an object along an arc around the base, in time, with the whole planar 4-DOF arm.

    Everything is as in `PlanarArmPushEnv` but the following.

    **Observation.** Box(25,): before the time stands the reference of the next step minus the object.

    **Reward.** The task term is the distance to the reference point of this time (with the paper's
    presets to the nearest of 50 points of the reference).

    **Task.** The reference leaves (0.55, 0.25), reaches (-0.3, 0.4) after 900 steps at constant
    angular speed around the base, and rests there.

    **End.** As in `PlanarArmPushEnv`. Success: d2g = 0 at the last step and a mean tracking error
    of at most 0.03 m over the episode.

    **Info.** Also tracking_error and mean_tracking_error, m.

    **Version history.** v0: first version.
    """

    def __init__(self, **options: Any):
        super().__init__(planar_arm_track, **options)
