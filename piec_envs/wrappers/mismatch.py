"""Plant parameters changed under a policy, for the single env and the VectorEnv alike."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium as gym
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorEnv, VectorWrapper

from piec_envs.errors import InvalidParameterError, check_name
from piec_envs.plain import plain


def _inject(env: Any, names: tuple[str, ...], params: dict[str, Any]) -> None:
    for name in params:
        if names:  # the general wrappers take every plant parameter
            check_name("parameter of this wrapper", name, names)
    if not hasattr(env.unwrapped, "set_params"):
        raise InvalidParameterError(
            f"{env.unwrapped!r} has no plant that could differ; environments of motion have one"
        )
    env.unwrapped.set_params(params)


class Mismatch(gym.Wrapper, RecordConstructorArgs):
    """From the next reset on, the plant has other parameters than the nominal ones.

    Args:
        env: an environment of this suite.
        params: fields of `PlantParams`.

    Raises:
        UnknownNameError: for an unknown parameter or name.
        InvalidParameterError: for a value outside its range, or an env without a plant.
    """

    names: ClassVar[tuple[str, ...]] = ()

    def __init__(self, env: gym.Env, **params: Any):
        RecordConstructorArgs.__init__(self, **plain(params))  # a spec is kept as JSON
        gym.Wrapper.__init__(self, env)
        _inject(env, self.names, params)


class VectorMismatch(VectorWrapper):
    """The same for a VectorEnv; rows that begin anew by themselves keep the change.

    Args:
        env: a VectorEnv of this suite.
        params: fields of `PlantParams`.
    """

    names: ClassVar[tuple[str, ...]] = ()

    def __init__(self, env: VectorEnv, **params: Any):
        super().__init__(env)
        _inject(env, self.names, params)


class RandomDisturbance(Mismatch):
    """The object is displaced at random in each step: `disturbance` (m) and `disturbance_kind`."""

    names = ("disturbance", "disturbance_kind")


class AdversarialEscape(Mismatch):
    """The object flees down the escape time: `adversary`, as a fraction of the field's u_bar, from
    `adversary_after` (s) on.
    """

    names = ("adversary", "adversary_after")


class FrictionMismatch(Mismatch):
    """Another `friction` between arm and object."""

    names = ("friction",)


class ShapeMismatch(Mismatch):
    """Another `object` than the planned one."""

    names = ("object",)


class DynamicsMismatch(Mismatch):
    """Another `dynamics` than the planner's model."""

    names = ("dynamics",)


class VectorRandomDisturbance(VectorMismatch):
    """The twin of `RandomDisturbance`."""

    names = RandomDisturbance.names


class VectorAdversarialEscape(VectorMismatch):
    """The twin of `AdversarialEscape`."""

    names = AdversarialEscape.names


class VectorFrictionMismatch(VectorMismatch):
    """The twin of `FrictionMismatch`."""

    names = FrictionMismatch.names


class VectorShapeMismatch(VectorMismatch):
    """The twin of `ShapeMismatch`."""

    names = ShapeMismatch.names


class VectorDynamicsMismatch(VectorMismatch):
    """The twin of `DynamicsMismatch`."""

    names = DynamicsMismatch.names


# Each wrapper beside its vector twin.
MISMATCHES: dict[type[Mismatch], type[VectorMismatch]] = {
    RandomDisturbance: VectorRandomDisturbance,
    AdversarialEscape: VectorAdversarialEscape,
    FrictionMismatch: VectorFrictionMismatch,
    ShapeMismatch: VectorShapeMismatch,
    DynamicsMismatch: VectorDynamicsMismatch,
}
