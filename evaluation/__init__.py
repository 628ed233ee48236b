"""Evaluation of policies and plans: rollouts, protocols, metrics, records, tables, figures and
studies.

The names below load what they need at their first use, so that `piec --help` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from piec_envs import check_not_shadowed

if TYPE_CHECKING:
    from evaluation.metrics import summarise
    from evaluation.protocol import Protocol
    from evaluation.protocols import PROTOCOLS, get_protocol
    from evaluation.rollout import Evaluation, evaluate

_WHERE = {
    "Evaluation": "rollout",
    "PROTOCOLS": "protocols",
    "Protocol": "protocol",
    "evaluate": "rollout",
    "get_protocol": "protocols",
    "summarise": "metrics",
}
__all__ = ["PROTOCOLS", "Evaluation", "Protocol", "evaluate", "get_protocol", "summarise"]

check_not_shadowed("planners")


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_WHERE[name]}"), name)
