"""A trained agent, its file, and the policies that execute it."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from piec_envs import AgentError, InvalidObservationError, PiecError, files, provenance
from planners.made_for import disturbed_kwargs, model_kwargs, task_kwargs
from planners.observed import ObservationReader
from planners.sb3.algorithms import get_algorithm
from planners.sb3.normalisation import normalise
from planners.sb3.spaces import check_spaces
from planners.sb3.spec import TrainSpec

FORMAT = "piec-agent-1"
LEARNERS = ("stable-baselines3", "sb3-contrib", "torch")
# Only learning needs these; schedules are functions, and buffers are large.
UNNEEDED: dict[str, Any] = {
    "learning_rate": 0.0,
    "lr_schedule": None,
    "clip_range": 0.0,
    "buffer_size": 1,
    "replay_buffer_class": None,
    "replay_buffer_kwargs": {},
    "_last_obs": None,
    "_last_original_obs": None,
    "ep_info_buffer": None,
}
_META = ("horizon", "spaces", "normalisation", "steps", "seconds", "evaluation", "versions")


def learner_versions() -> dict[str, str]:
    """Versions of the engine and of what learns."""
    return {**provenance.versions(), **{name: metadata.version(name) for name in LEARNERS}}


def file_hash(path: Path) -> str:
    """SHA-256 of a file's content."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True, eq=False)
class Agent:
    """A trained agent.

    Args:
        spec: the training it comes from.
        model: of Stable-Baselines3.
        horizon: steps of the task's episode.
        spaces: "observation" and "action" space, as `spaces.described` gives them.
        normalisation: statistics by which observations were normalised; None if they were not.
        steps: of the environment that it was trained for.
        seconds: of training.
        evaluation: of this very agent, as training measured it.
        versions: of the engine and of what learns.
        source: commit and digest of the suite's sources; None in files from before it was noted.
    """

    spec: TrainSpec
    model: Any
    horizon: int
    spaces: dict[str, Any]
    normalisation: dict[str, Any] | None
    steps: int
    seconds: float
    evaluation: dict[str, Any]
    versions: dict[str, str] = field(default_factory=learner_versions)
    source: dict[str, Any] | None = field(default_factory=provenance.source)

    @property
    def env_id(self) -> str:
        """Id of the environment it was trained on."""
        return self.spec.env_id

    @property
    def action_repeat(self) -> int:
        """Control steps that one of its actions lasts."""
        return int(self.spec.env_kwargs.get("action_repeat", 1))

    @property
    def task_kwargs(self) -> dict[str, Any]:
        """Keyword arguments of its robot, its start, its task, goal included, and what is
        observed.
        """
        return task_kwargs(self.spec.env_kwargs)

    @property
    def model_kwargs(self) -> dict[str, Any]:
        """Keyword arguments of its task and its nominal model, of which nothing is drawn and
        nothing flees.
        """
        return model_kwargs(self.spec.env_kwargs)

    @property
    def disturbed_kwargs(self) -> dict[str, Any]:
        """The same, and whatever was drawn, displaced or fled in its training."""
        return disturbed_kwargs(self.spec.env_kwargs)

    def policy(self) -> AgentPolicy:
        """The policy that executes it, closed loop."""
        return AgentPolicy(self)

    def save(self, path: str | os.PathLike) -> Path:
        """Write SB3's zip file, and beside it the JSON file that describes it, each under a
        temporary name first.

        Raises:
            AgentError: unless the name ends with .zip.
        """
        target = Path(path)
        if target.suffix != ".zip":
            raise AgentError(f"an agent's file ends with .zip, got {path}")
        target.parent.mkdir(parents=True, exist_ok=True)
        with files.replacing(target) as file:
            self.model.save(file)
        about = {name: getattr(self, name) for name in _META}
        about |= {
            "format": FORMAT,
            "spec": self.spec.as_json(),
            "sha256": file_hash(target),
            "source": self.source,
        }
        with files.replacing(target.with_suffix(".json")) as file:
            file.write((json.dumps(about, indent=1) + "\n").encode())
        return target

    @classmethod
    def load(cls, path: str | os.PathLike) -> Agent:
        """Read an agent. SB3's file holds pickled objects: load only agents of people you trust.

        Raises:
            AgentError: if a file is missing, broken or foreign, or the two do not belong together.
            MissingDependencyError: if a package of the extra `rl` is missing.
        """
        target = Path(path)
        try:
            about = json.loads(target.with_suffix(".json").read_text(encoding="utf-8"))
            if about["format"] != FORMAT:
                raise AgentError(
                    f"{target} has format {about['format']!r}, but {FORMAT!r} is needed"
                )
            spec = TrainSpec(**about["spec"])
            found = file_hash(target)
            if found != about["sha256"]:
                raise AgentError(
                    f"{target} is not the file that its description was written for, or is broken: "
                    f"SHA-256 {found[:16]}..., not {about['sha256'][:16]}..."
                )
            # Only now, since this unpickles.
            model = get_algorithm(spec.algo).load(target, device="cpu", custom_objects=UNNEEDED)
            return cls(
                spec=spec,
                model=model,
                source=about.get("source"),
                **{name: about[name] for name in _META},
            )
        except PiecError:
            raise
        except (*files.BROKEN_FILE, AttributeError, AssertionError) as error:
            raise AgentError(
                files.why_unreadable(target, "agent with its description (.json)", error)
            ) from error

    def check_env(self, env_id: str) -> None:
        """Refuse the id of an environment that this agent was not trained on.

        Raises:
            AgentError: with both ids.
        """
        if env_id != self.env_id:
            raise AgentError(f"this agent was trained on {self.env_id!r}, not on {env_id!r}")

    def check_fits(self, env_id: str, observation_space: Any, action_space: Any) -> None:
        """Refuse an environment that this agent was not trained for.

        Args:
            env_id: its id.
            observation_space: of one row.
            action_space: of one row.

        Raises:
            AgentError: if the id or a space differs.
        """
        self.check_env(env_id)
        check_spaces("this agent", self.spaces["observation"], observation_space, "observation")
        check_spaces("this agent", self.spaces["action"], action_space, "action")


class AgentPolicy:
    """Executes an agent closed loop, one control step at a time.

    An agent that was trained with `action_repeat` decides on every k-th step alone, and its action
    is held between; `state` is the action held.

    Args:
        agent: the agent.

    Raises:
        AgentError: if this is no agent.
    """

    def __init__(self, agent: Agent):
        if not isinstance(agent, Agent):
            raise AgentError(
                f"AgentPolicy executes an Agent, of a training or of Agent.load(file), got "
                f"{agent!r}"
            )
        self.agent = agent
        self._reader = ObservationReader(agent.env_id, agent.spec.env_kwargs, agent.horizon)

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[np.ndarray, Any]:
        """Actions for one observation or a batch, with Stable-Baselines3's signature.

        Args:
            observation: array or dict of arrays from an environment without `action_repeat`.
            state: the actions held, None at first.
            episode_start: which rows begin an episode, and so hold nothing.
            deterministic: whether to take the mode of the agent's distribution.

        Returns:
            Actions in [-1, 1], shape (..., n), and the state for the next call.

        Raises:
            InvalidObservationError: if this cannot be an observation of the agent's environment.
        """
        self._check_kind(observation)
        now = self._reader.step(self._reader.flat(observation))
        fresh = now % self.agent.action_repeat == 0  # (...,)
        if episode_start is not None:
            fresh = fresh | np.reshape(episode_start, fresh.shape)
        if state is None:
            fresh = np.ones_like(fresh)
        if not fresh.any():
            return state, state
        action, _ = self.agent.model.predict(
            normalise(observation, self.agent.normalisation), deterministic=deterministic
        )
        if state is not None:
            action = np.where(fresh[..., None], action, state)
        return action, action

    def _check_kind(self, observation: Any) -> None:
        """A goal-conditioned agent sees dicts, and no other does."""
        wanted = "" not in self.agent.spaces["observation"]
        given = isinstance(observation, Mapping)
        if wanted != given:
            kinds = {True: "a dict with goals", False: "an array"}
            raise InvalidObservationError(
                f"this agent observes {kinds[wanted]}, got {kinds[given]}"
            )
