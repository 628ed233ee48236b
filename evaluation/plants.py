"""Which environment a policy is judged in: its own task and model unless told otherwise, and what
is then in force.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym

from evaluation.protocol import Protocol, family, laid_over
from evaluation.protocols import PROTOCOLS
from piec_envs import (
    MOTIONS,
    EnvConfig,
    InvalidParameterError,
    PlantParams,
    check_motion,
    check_name,
    get_task,
    make_config,
)

PLANTS = {
    "own": "the nominal model that it was made for",
    "disturbed": "the same, with what was drawn, displaced or fled while it was made",
    "default": "the environment's default plant, on its own task",
    "given": "the environment's defaults, and nothing but what is given",
}
NOT_IN_SPEC = ("threads", "render_mode", "renderer")  # keyword arguments that change no result
_USUAL = {  # left out of a line about a plant where it is so
    **{
        name: value
        for name, value in vars(PlantParams()).items()
        if name not in ("dynamics", "object", "friction")
    },
    "preset": "default",
    "noise_entry": "qp",
    "start_noise": [0.0, 0.0],
    "randomize": {},
}


def as_policy(policy: Any) -> Any:
    """The policy itself, or that of a plan or an agent.

    Args:
        policy: anything with `predict`, a function, or a `Plan` or an `Agent`.

    Raises:
        InvalidParameterError: for anything else.
    """
    if isinstance(policy, gym.Env | gym.vector.VectorEnv):
        raise InvalidParameterError(
            f"the policy comes first, and then an id: got the environment {policy!r}"
        )
    if not isinstance(policy, type):
        if hasattr(policy, "predict"):
            return policy
        own = getattr(policy, "policy", None)
        if callable(own):
            return own()
        if callable(policy):
            return policy
    raise InvalidParameterError(
        "a policy has a method `predict`, or is a function from observations to actions, or a "
        "plan, or an agent; "
        f"got {policy!r}"
        + (": load it first, by Plan.load or Agent.load" if isinstance(policy, str) else "")
    )


def source_of(policy: Any) -> Any:
    """The plan or the agent that a policy executes; None for one that tells of neither."""
    for name in ("plan", "agent"):
        source = getattr(policy, name, None)
        if hasattr(source, "model_kwargs") and hasattr(source, "check_env"):
            return source
    return None


def chosen_id(source: Any, env_id: Any) -> str:
    """The id given, or else that of the plan or the agent.

    Args:
        source: from `source_of`.
        env_id: id of the environment, or None.

    Returns:
        The id.

    Raises:
        UnknownNameError: for an unknown id.
        InvalidParameterError: if there is none, or an environment instead of its id.
        PlanError: if the plan is for another.
        AgentError: if the agent was trained on another.
    """
    if env_id is None and source is None:
        raise InvalidParameterError(
            f"env_id is needed, since this policy says of no environment that it is for; known: "
            f"{', '.join(MOTIONS)}"
        )
    chosen = source.env_id if env_id is None else env_id
    check_motion(chosen)
    if source is not None:
        source.check_env(chosen)
    return chosen


def base_kwargs(
    source: Any, plant: str = "own", env_kwargs: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Keyword arguments of the environment before any protocol changes them.

    Args:
        source: from `source_of`.
        plant: row of PLANTS: what is taken from the plan or the agent.
        env_kwargs: the user's own, which override that.

    Returns:
        The keyword arguments, a dict of its own.

    Raises:
        UnknownNameError: for an unknown plant.
    """
    check_name("plant", plant, PLANTS)
    if source is None or plant == "given":
        return dict(env_kwargs or {})
    taken = {"own": "model_kwargs", "disturbed": "disturbed_kwargs", "default": "task_kwargs"}[
        plant
    ]
    return laid_over(getattr(source, taken), env_kwargs or {})


def bare_config(env_id: str, env_kwargs: Mapping[str, Any]) -> EnvConfig:
    """The configuration of an environment, without the field and what needs one.

    Args:
        env_id: its id.
        env_kwargs: its keyword arguments.

    Returns:
        The configuration.
    """
    kwargs = {**env_kwargs, "escape_field": None, "prior": None, "adversary": 0.0}
    kwargs["randomize"] = {
        k: v for k, v in (env_kwargs.get("randomize") or {}).items() if k != "adversary"
    }
    return make_config(env_id, **kwargs)


def check_suits(protocol: Protocol, env_id: str, env_kwargs: Mapping[str, Any]) -> None:
    """Refuse a protocol that is about an object of another robot.

    Args:
        protocol: the protocol.
        env_id: id of the environment.
        env_kwargs: its keyword arguments, without those of the protocol.

    Raises:
        InvalidParameterError: with the protocols that are about this environment's objects.
    """
    if not protocol.objects:
        return
    config = bare_config(env_id, env_kwargs)
    here = (config.object, get_task(config.task).object)
    if protocol.suits(here):
        return
    meant = sorted({family(name) for name in protocol.objects})
    fitting = [row.name for row in PROTOCOLS.values() if row.objects and row.suits(here)]
    raise InvalidParameterError(
        f"protocol {protocol.name!r} puts {', '.join(protocol.objects)} in the place of "
        f"{', '.join(meant)}, but the "
        f"object of {env_id!r} is {config.object}; protocols with objects for it: "
        f"{', '.join(fitting) or 'none'}, "
        "and all that name no object"
    )


def plant_in_force(env_id: str, env_kwargs: Mapping[str, Any]) -> dict[str, Any]:
    """What an environment with these keyword arguments is, every default filled in, as JSON values.

    Args:
        env_id: its id.
        env_kwargs: its keyword arguments.

    Returns:
        The id, task, robot, start, goal, plant parameters, and what is drawn.
    """
    config = bare_config(env_id, env_kwargs)
    params = {**vars(config.params), "adversary": float(env_kwargs.get("adversary") or 0.0)}
    start = config.start if isinstance(config.start, str) else [float(q) for q in config.start]
    return {
        "env_id": env_id,
        "task": config.task,
        "robot": config.robot,
        "start": start,
        "goal": [float(x) for x in config.resolve().task.goal],
        **params,
        "preset": config.preset,
        "noise_entry": config.noise_entry,
        "start_noise": list(config.start_noise),
        "randomize": dict(env_kwargs.get("randomize") or {}),
    }


def plant_line(plant: Mapping[str, Any]) -> str:
    """One line for people about what `plant_in_force` found; what is as usual is left out.

    Args:
        plant: from `plant_in_force`.
    """
    x, y = plant["goal"]
    said = [f"{plant['env_id'].rpartition('/')[2]}: {plant['robot']} from {plain(plant['start'])}"]
    said += [f"task {plant['task']}, goal ({x:g}, {y:g}) m", f"object {plant['object']}"]
    said += [f"friction {plant['friction']:g}", f"dynamics {plant['dynamics']}"]
    others = [
        f"{name} {plain(plant[name])}" for name, usual in _USUAL.items() if plant[name] != usual
    ]
    return ", ".join([*said, *others])


def plant_changes(plant: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """What is different in another plant, in a few words.

    Args:
        plant, other: from `plant_in_force`.

    Returns:
        Names with the other plant's values; "" if nothing differs.
    """
    return ", ".join(
        f"{name} {plain(value)}" for name, value in other.items() if value != plant[name]
    )


def plain(value: Any) -> str:
    """A keyword argument's value for people."""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Mapping):
        return "; ".join(f"{name} of {plain(item)}" for name, item in value.items()) or "nothing"
    if isinstance(value, list | tuple):
        return f"({', '.join(map(plain, value))})"
    return str(value)
