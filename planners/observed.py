"""Reading observations: what is not the environment's own is refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from piec_envs import InvalidObservationError, make_model

# entries beside "observation" of a goal-conditioned environment
GOALS = {"achieved_goal": 2, "desired_goal": 2}
# times the bound of the space: noise of a sensor stays below, other units and other entries do not
FAR = 2.0
OFF_STEP = 0.1  # steps; the time of an observation is a whole number of steps, but for its rounding
OFF_CIRCLE = 0.1  # of cosine and sine of a joint from those of its position


class ObservationReader:
    """Takes observations of one environment apart.

    Args:
        env_id: id of the environment.
        env_kwargs: those of its keyword arguments that decide its robot and its task.
        horizon: steps of an episode.

    Raises:
        UnknownNameError: for an unknown environment.
    """

    def __init__(self, env_id: str, env_kwargs: Mapping[str, Any], horizon: int):
        deciding = {
            name: env_kwargs[name]
            for name in ("contact", "geometry", "reference")
            if name in env_kwargs
        }
        model = make_model(env_id, escape_field=None, **deciding)
        self.env_id = env_id
        self.horizon = horizon
        self.layout = model.layout.slices
        self.bound = model.layout.bound  # (entries,)
        robot = model.robot
        lower = robot.joint_array("lower")
        upper = robot.joint_array("upper")
        self.middle = (upper + lower) / 2
        self.half = (upper - lower) / 2
        self._turning = slice(robot.base_dof, robot.dof)

    def flat(self, observation: Any) -> np.ndarray:
        """The array of an observation, or of a batch of them, goal-conditioned ones included.

        Args:
            observation: array (..., entries), or a dict with it.

        Raises:
            InvalidObservationError: if it cannot be one of this environment's.
        """
        if not isinstance(observation, Mapping):
            return self._checked("an observation", observation, len(self.bound))
        if set(observation) != {"observation", *GOALS}:
            names = ", ".join(map(str, observation))
            raise InvalidObservationError(
                f"a goal-conditioned observation of {self.env_id!r} has observation, "
                f"{', '.join(GOALS)}, got {names}"
            )
        for name, size in GOALS.items():
            self._checked(name, observation[name], size)
        return self._checked("an observation", observation["observation"], len(self.bound))

    def step(self, flat: np.ndarray) -> np.ndarray:
        """Steps taken so far, shape (...,).

        Raises:
            InvalidObservationError: if the time is that of no step.
        """
        time = flat[..., self.layout["time"].start] * self.horizon
        step = np.rint(time)
        if (
            (np.abs(time - step) > OFF_STEP).any()
            or (step < 0).any()
            or (step > self.horizon).any()
        ):
            raise InvalidObservationError(
                f"the time of an observation is a step over {self.horizon}, got "
                f"{np.ravel(time / self.horizon)[:3]}; " + self._hint
            )
        return step.astype(int)

    def command(self, flat: np.ndarray) -> np.ndarray:
        """Commanded joint positions, shape (..., n), rad or m.

        Raises:
            InvalidObservationError: if cosines, sines and positions of the joints are not of one
                arm.
        """
        q = (flat[..., self.layout["q_r"]] * self.half + self.middle)[..., self._turning]
        seen = flat[..., self.layout["cos_q"]], flat[..., self.layout["sin_q"]]
        off = np.hypot(seen[0] - np.cos(q), seen[1] - np.sin(q))
        if (off > OFF_CIRCLE).any():
            raise InvalidObservationError(
                f"cosines, sines and positions of the joints do not fit together, by "
                f"{off.max():.2g}; {self._hint}"
            )
        return flat[..., self.layout["q_cmd"]] * self.half + self.middle

    @property
    def _hint(self) -> str:
        return f"policies see what {self.env_id!r} itself returns, without wrappers that change it"

    def _checked(self, what: str, given: Any, size: int) -> np.ndarray:
        try:
            array = np.asarray(given)
        except (TypeError, ValueError, RuntimeError) as error:
            raise InvalidObservationError(
                f"{what} of {self.env_id!r} is an array of floats, got {given!r}"
            ) from error
        if array.dtype not in (np.float32, np.float64):
            raise InvalidObservationError(
                f"{what} of {self.env_id!r} is of float32 or float64, got {array.dtype}; "
                f"{self._hint}"
            )
        if array.ndim == 0 or array.shape[-1] != size:
            got = array.shape[-1] if array.ndim else "a single number"
            raise InvalidObservationError(
                f"{what} of {self.env_id!r} has {size} entries, got {got} (shape {array.shape}); "
                f"{self._hint}"
            )
        bound = self.bound if size == len(self.bound) else np.full(size, self.bound.max())
        strange = ~(np.abs(array) <= FAR * bound)  # NaN as well
        if strange.any():
            entry = int(np.argwhere(strange)[0][-1])
            raise InvalidObservationError(
                f"entry {entry} of {what} of {self.env_id!r} is at most {bound[entry]:g}, got "
                f"{array[strange][0]:g}; {self._hint}"
            )
        return np.asarray(array, dtype=float)
