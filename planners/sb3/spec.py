"""What a training run is, as plain values that JSON brings back unchanged."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from piec_envs import InvalidParameterError, as_count, check_motion, check_name
from planners.sb3.algorithms import ALGORITHMS

# of the first row of an evaluation; trainings have smaller ones, so no start is trained on
EVALUATION_SEED = 2**31


@dataclass(frozen=True)
class TrainSpec:
    """Everything that decides the result of a training run.

    Args:
        env_id: id of an environment of motion.
        algo: row of the table of algorithms.
        timesteps: steps of the environment in all, an action being one; the last rollout may go
            beyond.
        seed: of all randomness; row i has seed + i.
        n_envs: rows of the environment.
        env_kwargs: its keyword arguments.
        hyper: arguments of the algorithm, with "normalize" beside them, as RL Zoo writes them.
        evaluations: how many times the agent is evaluated and a checkpoint written.
        eval_episodes: episodes of one evaluation.

    Raises:
        UnknownNameError: for an unknown id or algorithm.
        InvalidParameterError: for a bad count, or a value that JSON cannot hold.
    """

    env_id: str
    algo: str
    timesteps: int
    seed: int = 0
    n_envs: int = 1
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)
    hyper: Mapping[str, Any] = field(default_factory=dict)
    evaluations: int = 20
    eval_episodes: int = 20

    def __post_init__(self):
        check_motion(self.env_id)
        check_name("algorithm", self.algo, ALGORITHMS)
        for name in ("timesteps", "n_envs", "evaluations", "eval_episodes"):
            as_count(name, getattr(self, name))
        if as_count("seed", self.seed, least=0) + self.n_envs > EVALUATION_SEED:
            raise InvalidParameterError(
                f"seed must leave {self.n_envs} seeds below {EVALUATION_SEED}, got {self.seed}"
            )
        for name in ("env_kwargs", "hyper"):
            try:
                plain = json.loads(json.dumps(dict(getattr(self, name)), allow_nan=False))
            except (TypeError, ValueError) as error:
                raise InvalidParameterError(
                    f"{name} must map names to values of JSON, got {getattr(self, name)!r}"
                ) from error
            object.__setattr__(self, name, plain)

    def as_json(self) -> dict[str, Any]:
        """The fields by name."""
        return asdict(self)

    def difference(self, other: Mapping[str, Any]) -> str:
        """The fields in which another spec, as JSON, departs from this one, with both values."""
        mine = self.as_json()
        names = [name for name in {**mine, **other} if mine.get(name) != other.get(name)]
        return "; ".join(
            f"{name}: {other.get(name)!r} there, {mine.get(name)!r} here" for name in names
        )
