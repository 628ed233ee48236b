"""The native VectorEnv as Stable-Baselines3 wants its environments."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

from piec_envs import ENVS, InvalidParameterError, as_count, check_name, row_info

FIXED = ("dtype", "autoreset_mode", "num_envs")  # keyword arguments that this adapter decides
ROWLESS = ("compute_reward",)  # methods that read and change no row


class NativeVecEnv(VecEnv):
    """All rows of one environment in one batch and one process; equal, step for step, to a
    `DummyVecEnv`.

    Observations and the action space are float32, as SB3's networks. Rows that do not end in a step
    have an empty info there, since filling a dict for each row takes longer than the step; rows
    that end have the final info of their episode with `terminal_observation` and
    `TimeLimit.truncated`.

    Args:
        env_id: id of the environment.
        num_envs: rows.
        env_kwargs: keyword arguments of the environment, `max_episode_steps` among them.

    Raises:
        UnknownNameError: for an unknown id or keyword argument.
        InvalidParameterError: for a keyword argument that this adapter decides, or a bad value.
    """

    def __init__(self, env_id: str, num_envs: int = 1, **env_kwargs: Any):
        check_name("environment", env_id, ENVS)
        for name in FIXED:
            if name in env_kwargs:
                raise InvalidParameterError(
                    f"{name!r} is decided by NativeVecEnv, got {env_kwargs[name]!r}"
                )
        self.native: Any = gym.make_vec(
            env_id,
            num_envs=as_count("num_envs", num_envs),
            vectorization_mode="vector_entry_point",
            autoreset_mode=AutoresetMode.SAME_STEP,
            dtype="float32",
            **env_kwargs,
        )
        action: Any = self.native.single_action_space
        super().__init__(
            num_envs,
            self.native.single_observation_space,
            spaces.Box(
                action.low.astype(np.float32), action.high.astype(np.float32), dtype=np.float32
            ),
        )
        self._actions = np.zeros((num_envs, *action.shape))

    def reset(self) -> Any:
        """Begin new episodes in all rows, with the seeds and options given since the last reset."""
        if any(options != self._options[0] for options in self._options):
            raise InvalidParameterError(
                "the rows of a native VectorEnv share their options: give one dict for all"
            )
        observation, _ = self.native.reset(seed=self._seeds, options=self._options[0] or None)
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions of the next step, shape (B, n)."""
        self._actions = np.asarray(actions, dtype=float)

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Advance all rows by one step; rows that end begin anew within it."""
        observation, reward, terminated, truncated, info = self.native.step(self._actions)
        ended = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        # Names with a leading "_" are Gymnasium's masks.
        final = {
            name: values
            for name, values in info.get("final_info", {}).items()
            if not name.startswith("_")
        }
        for row in np.flatnonzero(ended).tolist():
            infos[row] = {
                **row_info(final, row),
                "terminal_observation": info["final_obs"][row],
                "TimeLimit.truncated": bool(truncated[row] and not terminated[row]),
            }
        return observation, reward.astype(np.float32), ended, infos

    def close(self) -> None:
        """Free what frames were drawn with."""
        self.native.close()

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """An attribute of the batch.

        Args:
            attr_name: its name.
            indices: of the rows asked for; None is all.

        Returns:
            Its value, once for each of these rows.
        """
        value = getattr(self.native, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(
        self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None
    ) -> None:
        """Set an attribute of the batch.

        Args:
            attr_name: its name.
            value: the new one.
            indices: of the rows; None, or all of them.

        Raises:
            InvalidParameterError: if it is meant for some of the rows only.
        """
        self._check_whole(attr_name, list(self._get_indices(indices)))
        setattr(self.native, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: int | Iterable[int] | None = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Call a method of the batch once.

        Args:
            method_name: its name.
            method_args, method_kwargs: its arguments.
            indices: of the rows asked for; None is all.

        Returns:
            Its result, once for each of these rows.

        Raises:
            InvalidParameterError: if it is meant for some of the rows only, and could change them.
        """
        rows = list(self._get_indices(indices))
        if method_name not in ROWLESS:
            self._check_whole(method_name, rows)
        result = getattr(self.native, method_name)(*method_args, **method_kwargs)
        return [result for _ in rows]

    def env_is_wrapped(
        self, wrapper_class: type, indices: int | Iterable[int] | None = None
    ) -> list[bool]:
        """No row is wrapped: there are no single environments.

        Args:
            wrapper_class: not needed.
            indices: of the rows asked for; None is all.

        Returns:
            False, once for each of these rows.
        """
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[np.ndarray | None]:
        """One frame for each row; None without a render mode."""
        return (
            [None] * self.num_envs
            if self.native.render_mode is None
            else list(self.native.render())
        )

    def _check_whole(self, name: str, rows: list[int]) -> None:
        if sorted(rows) != list(range(self.num_envs)):
            raise InvalidParameterError(
                f"the rows of a native VectorEnv share {name!r}: give no indices, or all "
                f"{self.num_envs}, not {rows}"
            )
