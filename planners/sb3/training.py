"""Training of agents: one run in one folder, with checkpoints from which it goes on."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize
from tqdm import tqdm

from piec_envs import AgentError, InvalidParameterError, console, files
from planners.sb3.agent import Agent
from planners.sb3.algorithms import check_installed, get_algorithm
from planners.sb3.checkpoint import (
    BUFFER,
    MODEL,
    check_folder,
    claim_folder,
    clear_checkpoints,
    read_checkpoint,
    write_checkpoint,
)
from planners.sb3.hyperparameters import model_arguments, normalisation_arguments
from planners.sb3.normalisation import restore_statistics, statistics_of
from planners.sb3.scoring import score
from planners.sb3.spaces import check_spaces, described
from planners.sb3.spec import TrainSpec
from planners.sb3.vec_env import NativeVecEnv

AGENT = "agent.zip"
BEST = "best_model.zip"
CURVE = "evaluations.jsonl"
LOGS = "tensorboard"


def train(spec: TrainSpec, folder: str | os.PathLike, progress: bool = True) -> Agent:
    """Train an agent; a run that was killed goes on from its last checkpoint, with new episodes in
    all rows.

    The folder gets `agent.zip` and `best_model.zip` (the best by success rate, then by return, of
    those evaluated on the way), each with a description beside it, the curve `evaluations.jsonl`,
    and logs for TensorBoard. A training that has ended is not run again.

    Args:
        spec: what to train, and how.
        folder: of this training alone.
        progress: whether to show a progress bar.

    Returns:
        The agent at the end of the training.

    Raises:
        MissingDependencyError: if a package of the extra `rl` is missing.
        AgentError: if the folder is another training's, or its checkpoint is broken or foreign.
        UnknownNameError: for an unknown keyword argument or hyper-parameter.
        InvalidParameterError: for a bad value of one.
    """
    check_installed()
    folder = Path(folder)
    check_folder(folder, spec)
    if (folder / AGENT).with_suffix(".json").is_file():
        return Agent.load(folder / AGENT)
    folder.mkdir(parents=True, exist_ok=True)  # fails now, not at the end
    training = Training(spec, folder, model_arguments(spec))
    # only now, so that a misspelt setting can be corrected in the same folder
    claim_folder(folder, spec)
    return training.run(progress)


def read_curve(folder: str | os.PathLike) -> list[dict[str, Any]]:
    """The evaluations of a training so far: steps, seconds, and what `score` gives."""
    return [
        json.loads(line) for line in (Path(folder) / CURVE).read_text(encoding="utf-8").splitlines()
    ]


class Training:
    """One training run in its folder.

    Args:
        spec: what to train, and how.
        folder: of this training.
        arguments: of the algorithm, from `model_arguments`.

    Raises:
        AgentError: if the folder's checkpoint is broken or foreign.
    """

    def __init__(self, spec: TrainSpec, folder: Path, arguments: dict[str, Any]):
        self.spec = spec
        self.folder = folder
        self.history = list[dict[str, Any]]()
        self.seconds = 0.0
        self._clock = 0.0
        self.every = -(-spec.timesteps // spec.evaluations)
        native = NativeVecEnv(spec.env_id, spec.n_envs, **spec.env_kwargs)
        self.horizon = native.native.model.task.horizon
        self.spaces = {
            "observation": described(native.observation_space),
            "action": described(native.action_space),
        }
        self.test_env = NativeVecEnv(spec.env_id, spec.eval_episodes, **spec.env_kwargs)
        self.venv: Any = VecMonitor(native)
        normalisation = normalisation_arguments(spec)
        if normalisation is not None:
            with _refusing("normalize"):
                self.venv = VecNormalize(self.venv, **normalisation)
        clear_checkpoints(folder, torn_only=True)
        self.model = self._restored(arguments["device"]) or self._fresh(arguments)

    @property
    def next_mark(self) -> int:
        """Steps after which the agent is to be evaluated again."""
        done = self.history[-1]["steps"] if self.history else 0
        return (done // self.every + 1) * self.every

    def run(self, progress: bool = True) -> Agent:
        """Train to the end, and write the agent."""
        self.model.set_logger(configure(str(self.folder / LOGS), ["tensorboard"]))
        self._clock = time.perf_counter()
        left = self.spec.timesteps - self.model.num_timesteps
        with tqdm(
            total=self.spec.timesteps,
            initial=self.model.num_timesteps,
            disable=console.no_bar(progress),
            unit="step",
            unit_scale=True,
            delay=0.5,
            desc=f"{self.spec.algo} on {self.spec.env_id}",
        ) as bar:
            if left > 0:
                # Without a reset of the count, SB3 takes what is left, and schedules go by the
                # whole.
                self.model.learn(left, callback=_Watch(self, bar), reset_num_timesteps=False)
        if not self.history or self.history[-1]["steps"] < self.model.num_timesteps:
            self.keep()
        agent = self._agent()
        agent.save(self.folder / AGENT)
        clear_checkpoints(self.folder)
        self.model.logger.close()
        return agent

    def keep(self) -> None:
        """Evaluate the agent and write a checkpoint, the curve, and the agent itself if it is the
        best so far.
        """
        found = score(self.model, self.test_env)
        now = time.perf_counter()
        self.seconds = self.seconds + now - self._clock
        self._clock = now
        steps = self.model.num_timesteps
        self.history.append({"steps": steps, "seconds": round(self.seconds, 3), **found})
        for name, value in found.items():
            self.model.logger.record(f"eval/{name}", value)
        self.model.logger.dump(steps)
        state = {
            "env_id": self.spec.env_id,
            "spec": self.spec.as_json(),
            "spaces": self.spaces,
            "normalisation": statistics_of(self.model.get_vec_normalize_env()),
            "steps": steps,
            "seconds": self.seconds,
            "history": self.history,
        }
        write_checkpoint(self.folder, self.model, state)
        self._publish()

    def _publish(self) -> None:
        """Write what follows from the checkpoint: the curve, and the agent if it is the best."""
        with files.replacing(self.folder / CURVE) as file:
            file.write("".join(json.dumps(record) + "\n" for record in self.history).encode())
        if self.history[-1] is max(
            reversed(self.history), key=lambda record: (record["success_rate"], record["return"])
        ):
            self._agent().save(self.folder / BEST)

    def _agent(self) -> Agent:
        return Agent(
            spec=self.spec,
            model=self.model,
            horizon=self.horizon,
            spaces=self.spaces,
            normalisation=statistics_of(self.model.get_vec_normalize_env()),
            steps=self.model.num_timesteps,
            seconds=round(self.seconds, 1),
            evaluation=self.history[-1],
        )

    def _fresh(self, arguments: dict[str, Any]) -> Any:
        if len(self.spaces["observation"]) > 1 and arguments["policy"] == "MlpPolicy":
            # the same network, for dict observations
            arguments = {**arguments, "policy": "MultiInputPolicy"}
        with _refusing(f"the hyper-parameters of {self.spec.algo}"):
            return get_algorithm(self.spec.algo)(env=self.venv, seed=self.spec.seed, **arguments)

    def _restored(self, device: str) -> Any:
        """The model of the last checkpoint; None where there is none."""
        found = read_checkpoint(self.folder)
        if found is None:
            return None
        path, state = found
        self._check(path, state)
        model = get_algorithm(self.spec.algo).load(path / MODEL, env=self.venv, device=device)
        if (path / BUFFER).is_file():
            model.load_replay_buffer(path / BUFFER)
        restore_statistics(model.get_vec_normalize_env(), state["normalisation"])
        # The seed of the start would draw the same episodes again.
        model.set_random_seed(
            int(np.random.SeedSequence([self.spec.seed, state["steps"]]).generate_state(1)[0] >> 1)
        )
        self.history = state["history"]
        self.seconds = state["seconds"]
        self.model = model
        self._publish()
        return model

    def _check(self, path: Path, state: dict[str, Any]) -> None:
        """Refuse a checkpoint of another training, environment or space."""
        if state["env_id"] != self.spec.env_id:
            raise AgentError(
                f"{path} was trained on {state['env_id']!r}, not on {self.spec.env_id!r}"
            )
        for kind, space in (
            ("observation", self.venv.observation_space),
            ("action", self.venv.action_space),
        ):
            check_spaces(str(path), state["spaces"][kind], space, kind)
        if state["spec"] != self.spec.as_json():
            raise AgentError(
                f"{path} belongs to another training ({self.spec.difference(state['spec'])})"
            )


@contextmanager
def _refusing(what: str) -> Iterator[None]:
    """Say in our words that SB3 does not take a value."""
    try:
        yield
    except (TypeError, ValueError, AssertionError) as error:
        raise InvalidParameterError(f"Stable-Baselines3 refuses {what}: {error}") from error


class _Watch(BaseCallback):
    """Moves the progress bar, and looks after the training between an update and the next rollout.

    Args:
        training: what is watched.
        bar: the progress bar.
    """

    def __init__(self, training: Training, bar: tqdm):
        super().__init__()
        self._training = training
        self._bar = bar

    def _on_rollout_start(self) -> None:
        if self.model.num_timesteps >= self._training.next_mark:
            self._training.keep()
            last = self._training.history[-1]
            self._bar.set_postfix(success=f"{last['success_rate']:.0%}", d2g=f"{last['d2g']:.3f} m")

    def _on_step(self) -> bool:
        self._bar.update(self.model.num_timesteps - self._bar.n)
        return True
