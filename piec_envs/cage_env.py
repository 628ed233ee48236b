"""Static caging environments: one step, whose action is the posture."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from piec_envs.episodes.cage import CageBatch, CageConfig
from piec_envs.episodes.info import row_info
from piec_envs.errors import InvalidActionError, ResetNeededError, as_count, as_floats, check_arguments
from piec_envs.escape.field import CAGING_SCALE
from piec_envs.native_vector import (
    ENV_ARGUMENTS,
    RENDER_MODES,
    SEED_BOUND,
    NativeVectorEnv,
    checked_dtype,
    keeping_generator,
    take_row,
)
from piec_envs.rendering.renderer import Renderer
from piec_envs.spec import PlainSpec


def make_cage_config(robot: str, options: Mapping[str, Any], others: Iterable[str] = ()) -> CageConfig:
    """Validate keyword arguments.

    Args:
        robot: row of the table of robots.
        options: the keyword arguments.
        others: names of further keyword arguments of the environment, for the message.

    Raises:
        UnknownArgumentError: for a keyword that does not exist.
    """
    check_arguments(options, [*others, *CageConfig.field_names(), *ENV_ARGUMENTS])
    return CageConfig(robot, **options)


class CageInterface:
    """Spaces, observations and rewards, shared by the single env and the VectorEnv.

    Args:
        batch: the episodes.
        dtype: "float64" or "float32", of the observations.
        render_mode: None or "rgb_array".
    """

    def __init__(self, batch: CageBatch, dtype: str, render_mode: str | None):
        self.batch = batch
        self.dtype = checked_dtype(dtype, render_mode)
        radius = batch.robot.workspace_radius
        bound = np.array([radius, radius, 1.0, 1.0], dtype=self.dtype)
        self.observation_space: spaces.Space = spaces.Box(-bound, bound, dtype=self.dtype)
        self.action_space = spaces.Box(-1.0, 1.0, (batch.robot.dof,), dtype=np.dtype("float64"))

    def observe(self) -> np.ndarray:
        """Observations of all rows, shape (B, 4)."""
        return self.batch.observe().astype(self.dtype, copy=False)

    def reward(self, observation: np.ndarray) -> np.ndarray:
        """0.02 times the value that planners maximise, shape (B,)."""
        return CAGING_SCALE * self.batch.value

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Which rows have taken their posture, and that none is cut short, shape (B,) each."""
        return self.batch.done.copy(), np.zeros(self.batch.rows, dtype=bool)

    def info(self) -> dict:
        """Info of all rows at present."""
        return self.batch.info()


class CageEnv(PlainSpec, gym.Env):
    """Base class of the single static caging environments; see the subclasses.

    Args:
        robot: row of the table of robots.
        dtype: "float64" or "float32", of the observations.
        render_mode: None or "rgb_array".
        renderer: "drawing" (the plane, in software) or "mujoco" (in space, through OpenGL).
        options: the other arguments of `CageConfig`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  Gymnasium declares it so
        "render_modes": list(RENDER_MODES),
        "render_fps": 1,
    }
    own_arguments: tuple[str, ...] = ()  # keyword arguments of a subclass, beside those of `CageConfig`

    def __init__(
        self,
        robot: str,
        /,
        dtype: str = "float64",
        render_mode: str | None = None,
        renderer: str = "drawing",
        **options: Any,
    ):
        self._batch = CageBatch(make_cage_config(robot, options, self.own_arguments), rows=1)
        self._interface = CageInterface(self._batch, dtype, render_mode)
        self.render_mode, self._renderer = render_mode, Renderer(renderer)
        self.observation_space = self._interface.observation_space
        self.action_space = self._interface.action_space
        self._begun = False

    @property
    def config(self) -> CageConfig:
        """The validated keyword arguments."""
        return self._batch.config

    @property
    def batch(self) -> CageBatch:
        """The batch of one episode that does the work."""
        return self._batch

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Begin an episode; see the class for the options."""
        with keeping_generator(self):
            super().reset(seed=None if seed is None else as_count("seed", seed, least=0))
            self._batch.reset(np.array([0]), [int(self.np_random.integers(SEED_BOUND))], options)
        self._begun = True
        return take_row(self._interface.observe()), row_info(self._interface.info())

    def step(self, action: np.ndarray):
        """Take a posture, which ends the episode."""
        self._check_begun("step")
        if self._batch.done[0]:
            raise InvalidActionError("the episode ended with its first step: call reset")
        action = as_floats("the action", action, (self._batch.robot.dof,), InvalidActionError)
        self._batch.step(action[None])
        observation = self._interface.observe()
        reward = float(self._interface.reward(observation)[0])
        return take_row(observation), reward, True, False, row_info(self._interface.info())

    def render(self) -> np.ndarray | None:
        """Draw the posture and its field, shape (height, width, 3), uint8; None without a render mode."""
        self._check_begun("render")
        if self.render_mode is None:
            return None
        return self._renderer.posture(self._batch, 0)

    def close(self) -> None:
        """Free what frames were drawn with."""
        self._renderer.close()

    def _check_begun(self, call: str) -> None:
        if not self._begun:
            raise ResetNeededError(f"{call} needs an episode, and none has begun: call reset first")


class PlanarArmCageEnv(CageEnv):
    """Enclose an object near the base with the whole planar 4-DOF arm, as a static problem (paper section 4.5).

    **Action.** Box(-1, 1, (4,)): the posture, each joint from its lower (-1) to its upper (1) limit
    (+-pi, +-2.6 rad). It is taken at once; nothing moves on the way.

    **Observation.** Box(4,): object x, y (m), cos and sin of its angle.

    **Reward.** 0.02 (T_hat - 1e3 overlap): the caging less 20 for each metre of overlap, added up over
    each link with each shape of the object and each two links that could collide. It is 0.02 times
    the value of `planners.CagingProblem`, so that planners and RL maximise one thing. A free object has
    0.4 to 0.5, an enclosed one about 1.0 to 1.8.

    **Start.** Arm straight along x, which may overlap the object; the object drawn evenly from the ring
    around the base, within 0.4 m and clear of the base, at any angle. Option of `reset`: "pose" (x, y,
    angle).

    **End.** Terminated after one step. Success: the object is enclosed and nothing overlaps by more than
    1e-6 m. Enclosed means that a key point cannot leave the workspace under a hard wall (leak = 0: no way
    through gaps under 0.06 m), by fast marching with 100 nodes a side, whatever `escape_field` is.

    **Info.** is_success, enclosed, escape_time (s), caging (0.02 of it), min_distance, penetration,
    self_distance (m), q_r, pose. At reset they describe the straight arm, which counts as not enclosing.

    **Arguments.** Those of `CageConfig` but the robot, `dtype` ("float64" or "float32"), `render_mode` and
    `renderer` ("drawing" or "mujoco").

    **Version history.** v0: first version.
    """

    def __init__(self, **options: Any):
        super().__init__("planar_arm", **options)


class CageVectorEnv(NativeVectorEnv):
    """Base class of the static caging VectorEnvs.

    Args:
        robot: row of the table of robots.
        num_envs: B.
        max_episode_steps: steps after which a row is truncated; None and -1 leave ends to the task.
        autoreset_mode: "NextStep", "SameStep" or "Disabled", or Gymnasium's `AutoresetMode`.
        dtype: "float64" or "float32", of the observations.
        render_mode: None or "rgb_array".
        renderer: "drawing" or "mujoco".
        options: the arguments of `CageConfig` but the robot.
    """

    own_arguments: tuple[str, ...] = ()

    def __init__(
        self,
        robot: str,
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
        self._batch = CageBatch(make_cage_config(robot, options, self.own_arguments), rows)
        self._renderer = Renderer(renderer)
        interface = CageInterface(self._batch, dtype, render_mode)
        super().__init__(self._batch, interface, rows, max_episode_steps, autoreset_mode, render_mode)

    @property
    def batch(self) -> CageBatch:
        """The batch of episodes that does the work."""
        return self._batch

    def render(self) -> tuple[np.ndarray, ...] | None:
        """One frame for each row; None without a render mode."""
        self._check_begun("render")
        if self.render_mode is None:
            return None
        return tuple(self._renderer.posture(self._batch, row) for row in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Free what frames were drawn with."""
        self._renderer.close()


class PlanarArmCageVectorEnv(CageVectorEnv):
    """The VectorEnv of `PlanarArmCageEnv`.

    Args:
        num_envs: B.
        options: the other arguments of `CageVectorEnv`.
    """

    def __init__(self, num_envs: int = 1, **options: Any):
        super().__init__("planar_arm", num_envs, **options)
