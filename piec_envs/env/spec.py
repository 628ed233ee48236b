"""The spec that Gymnasium gives an environment, readable by JSON and true of the length of an
episode.
"""

from __future__ import annotations

import copy

from gymnasium.envs.registration import EnvSpec

from piec_envs.plain import plain


class PlainSpec:
    """Mixed into the environments: `spec` holds keyword arguments as JSON has them.

    Arrays, NumPy scalars, members of enumerations and paths among them, which `EnvSpec.to_json`
    refuses, stand there as lists, numbers and text. An environment that ends its episodes itself
    writes their length in, too: Gymnasium knows only the limit that it sets from outside.
    """

    _spec: EnvSpec | None = None

    @property
    def episode_actions(self) -> int | None:
        """Actions of a whole episode; None where the task itself ends it."""
        return None

    @property
    def spec(self) -> EnvSpec | None:
        """What `gym.make` made this environment of; None without it."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        """Gymnasium sets it once the environment is made."""
        spec = copy.copy(spec)
        if spec is not None:
            spec.kwargs = plain(spec.kwargs)
            if spec.max_episode_steps is None:
                spec.max_episode_steps = self.episode_actions
        self._spec = spec
