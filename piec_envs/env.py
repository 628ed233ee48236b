"""The single environments: a batch of one episode behind Gymnasium's `Env`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from piec_envs.episodes.batch import EpisodeBatch, Rollout
from piec_envs.episodes.config import EnvConfig
from piec_envs.episodes.info import batch_info, row_info
from piec_envs.episodes.observation import POSITION_BOUND, observation_bound, observation_layout
from piec_envs.episodes.state import State
from piec_envs.episodes.tasks import GOAL_RADIUS, REWARD_SCALE
from piec_envs.errors import InvalidParameterError, InvalidStateError, as_count, check_name
from piec_envs.native_vector import RENDER_MODES, SEED_BOUND, take_row
from piec_envs.rendering.renderer import Renderer

Configure = Callable[[Mapping[str, Any]], EnvConfig]  # from an environment's keyword arguments


def make_config(task: str, options: Mapping[str, Any], robot: str = "auto", others: Iterable[str] = ()) -> EnvConfig:
    """Validate keyword arguments.

    Args:
        task: row of the table of tasks.
        options: the keyword arguments.
        robot: row of the table of robots; "auto" is the task's.
        others: names of further keyword arguments of the environment, for the message.

    Raises:
        UnknownNameError: for a keyword that does not exist.
    """
    for name in options:
        check_name("keyword argument", name, [*others, *EnvConfig.field_names(), "dtype", "render_mode", "renderer"])
    return EnvConfig(task, robot=robot, **options)


planar_arm_push: Configure = partial(make_config, "planar_arm_push")
planar_arm_track: Configure = partial(make_config, "planar_arm_track")


class Interface:
    """Spaces, observations and rewards, shared by the single env and the VectorEnv.

    Args:
        batch: the episodes.
        dtype: "float64" or "float32", of the observations.
        render_mode: None or "rgb_array".
    """

    def __init__(self, batch: EpisodeBatch, dtype: str, render_mode: str | None):
        check_name("dtype", dtype, ("float64", "float32"))
        check_name("render_mode", render_mode, (None, *RENDER_MODES))
        self.batch = batch
        self.dtype = np.dtype(dtype)
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

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """No episode ends by itself; one whose simulation has diverged is cut short, shape (B,) each.

        Whoever counts steps would count actions, so that one with repeated actions ends here.
        """
        state, cut = self.batch.state, self.batch.state.diverged.copy()
        if self.batch.config.action_repeat > 1:
            cut |= state.step >= self.batch.task.horizon
        return np.zeros(state.rows, dtype=bool), cut

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


class MotionEnv(gym.Env):
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
        super().reset(seed=None if seed is None else as_count("seed", seed, least=0))
        self._batch.reset(np.array([0]), [int(self.np_random.integers(SEED_BOUND))], options)
        return self._begin()

    def step(self, action: np.ndarray):
        """Advance by one control step of 0.1 s."""
        self._batch.step(np.asarray(action, dtype=float)[None])
        observation = self._interface.observe()
        reward = float(self._interface.reward(observation)[0])
        if self.render_mode:
            self._trail.append(self._batch.state.pose[0, :2].copy())
        _, truncated = self._interface.ends()
        return take_row(observation), reward, False, bool(truncated[0]), row_info(self._interface.info())

    def set_params(self, params: Mapping[str, Any]) -> None:
        """Change plant parameters (fields of `PlantParams`) of the episodes to come."""
        self._batch.set_params(params)

    def get_state(self) -> State:
        """Everything that decides how this episode goes on."""
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
        if self.render_mode is None:
            return None
        return self._renderer.frame(self._batch, 0, np.array(self._trail))

    def close(self) -> None:
        """Free what frames were drawn with."""
        self._renderer.close()

    def _begin(self) -> tuple[Any, dict]:
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
    step: the object's centre is within 0.05 m of the goal (-0.3, 0.4).

    **Info.** is_success, goal_distance, d2g, link_distance, contact_links, min_distance,
    mean_distance, penetration, cost_task, cost_command, cost_prior, diverged, params; and, unless
    `escape_field=None`, escape_time (s) and caging (0.02 of it).

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

    **Reward.** The task term is the distance to the reference point of this time (with
    `preset="paper"` to the nearest of 50 points of the reference).

    **Task.** The reference leaves (0.55, 0.25), reaches (-0.3, 0.4) after 900 steps at constant
    angular speed around the base, and rests there.

    **End.** Truncated after 1000 steps. Success: d2g = 0 at the last step and a mean tracking error
    of at most 0.03 m over the episode.

    **Info.** Also tracking_error and mean_tracking_error, m.

    **Version history.** v0: first version.
    """

    def __init__(self, **options: Any):
        super().__init__(planar_arm_track, **options)
