"""What a plan or an agent was made for, told apart from how it was found.

Its keyword arguments say both. The task and the nominal model are what it is to be judged by. What
was drawn, displaced or fled while it was made is how it became robust, and the escape field and the
prior are what it was steered by: whoever judges it decides on these anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# what there is to do, and to see
TASK = ("contact", "geometry", "start", "reference", "goal", "goal_conditioned")
DISTURBING = (
    "start_noise",
    "randomize",
    "disturbance",
    "disturbance_kind",
    "adversary",
    "adversary_after",
)
STEERING = ("prior", "escape_field", "escape_every")
INTERFACE = (
    "action_repeat",
    "max_episode_steps",
    "threads",
    "num_envs",
    "autoreset_mode",
    "render_mode",
    "renderer",
)


def task_kwargs(env_kwargs: Mapping[str, Any]) -> dict[str, Any]:
    """Those keyword arguments that say which robot, which start and which task it was made for.

    Args:
        env_kwargs: all that it was made with.
    """
    return {name: value for name, value in env_kwargs.items() if name in TASK}


def model_kwargs(env_kwargs: Mapping[str, Any]) -> dict[str, Any]:
    """The task and the nominal model: nothing is drawn, displaced or flees.

    Args:
        env_kwargs: all that it was made with.
    """
    other = (*DISTURBING, *STEERING, *INTERFACE)
    return {name: value for name, value in env_kwargs.items() if name not in other}


def disturbed_kwargs(env_kwargs: Mapping[str, Any]) -> dict[str, Any]:
    """The same, and whatever was drawn, displaced or fled while it was made.

    An object that flees does so down the field that it fled down then.

    Args:
        env_kwargs: all that it was made with.
    """
    kept = {name: value for name, value in env_kwargs.items() if name in DISTURBING}
    if kept.get("adversary") or "adversary" in (kept.get("randomize") or {}):
        kept |= {
            name: env_kwargs[name]
            for name in ("escape_field", "escape_every")
            if name in env_kwargs
        }
    return {**model_kwargs(env_kwargs), **kept}
