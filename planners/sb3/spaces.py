"""Spaces as JSON, to tell whether an agent fits an environment."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from piec_envs import AgentError


def described(space: Any) -> dict[str, dict[str, list[float]]]:
    """The bounds of a `Box`, or of each part of a `Dict`, in single precision; "" names that of a
    `Box`.
    """
    parts = dict(space.spaces) if isinstance(space, spaces.Dict) else {"": space}
    return {
        name: {
            bound: np.asarray(getattr(box, bound), dtype=np.float32).tolist()
            for bound in ("low", "high")
        }
        for name, box in sorted(parts.items())
    }


def check_spaces(what: str, stored: dict[str, Any], space: Any, kind: str) -> None:
    """Refuse an environment with another space.

    Args:
        what: whose stored space it is, such as "this agent".
        stored: from `described`.
        space: of the environment.
        kind: "observation" or "action".

    Raises:
        AgentError: if they differ, with both.
    """
    given = described(space)
    if given != stored:
        raise AgentError(
            f"{what} has {kind}s {_summary(stored)}, but the environment {_summary(given)}; "
            "keyword arguments such as goal_conditioned decide them"
        )


def _summary(parts: dict[str, Any]) -> str:
    """Sizes and bounds in a few words."""
    texts = []
    for name, bounds in parts.items():
        low, high = (f"{value:g}" for value in (min(bounds["low"]), max(bounds["high"])))
        texts.append(f"{name} of {len(bounds['low'])} entries from {low} to {high}".strip())
    return ", ".join(texts)
