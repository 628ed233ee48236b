"""Trained agents as pieces of work: train once, and the policies of an agent, closed and open loop.

Agents lie in `agents` under the folder of all studies and are committed: whoever runs a study again
takes them from there, and an emptied folder is trained again. Needs the extra `rl`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evaluation.jobs import Context, Work
from evaluation.records import work_key
from evaluation.studies import PUSH

LOOPS = ("closed", "open")


@dataclass(frozen=True)
class AgentCase:
    """One training, and the env that its agent is executed in; to be used where studies take a
    `Case`.

    Args:
        label: what tables and figures call it.
        algo: row of the table of algorithms.
        loop: "closed", or "open" to replay its nominal episode as a plan.
        train_kwargs: keyword arguments of the environment of the training alone.
        hyper: changes to the hyper-parameters that ship, with `n_timesteps` among them.
        env_kwargs: keyword arguments of the plant.
        env_id: id of the environment.
    """

    label: str
    algo: str
    loop: str = "closed"
    train_kwargs: Mapping[str, Any] = field(default_factory=dict)
    hyper: Mapping[str, Any] = field(default_factory=dict)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)
    env_id: str = PUSH

    @property
    def action_repeat(self) -> int:
        """Control steps that an action of the training lasts."""
        return int(self.train_work(0).spec["train"]["env_kwargs"].get("action_repeat", 1))

    def train_work(self, seed: int) -> Work:
        """Training with one seed."""
        from planners.sb3 import default_spec

        hyper = dict(self.hyper)
        steps = hyper.pop("n_timesteps", None)
        spec = default_spec(
            self.env_id, self.algo, seed, steps, dict(self.train_kwargs), hyper
        ).as_json()
        del spec["seed"]
        return Work(
            {"work": "train", "env_id": self.env_id, "train": spec},
            seed,
            f"{self.label}, seed {seed}",
        )

    def evaluation_work(self, seed: int, protocol: str, episodes: int) -> Work:
        """Evaluating the agent of one seed under a protocol.

        Args:
            seed: of the training.
            protocol: its name.
            episodes: how many.

        Returns:
            The piece of work.
        """
        spec = {
            "work": "evaluate",
            "plan": self.train_work(seed).spec,
            "loop": self.loop,
            "env_kwargs": dict(self.env_kwargs),
            "protocol": protocol,
            "episodes": episodes,
        }
        return Work(spec, seed, f"{self.label}, {self.loop} loop, seed {seed}, {protocol}")


def agent_folder(folder: str | Path, spec: Mapping[str, Any], seed: int) -> Path:
    """Where a training is.

    Args:
        folder: of all studies.
        spec: of the training, from `AgentCase.train_work`.
        seed: of the training.

    Returns:
        The path, whether it is there or not.
    """
    name = spec["env_id"].rpartition("/")[2]
    return (
        Path(folder)
        / "agents"
        / f"{name}-{spec['train']['algo']}-seed{seed}-{work_key(spec, seed)[:8]}"
    )


def train_once(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Train an agent, go on where its training was stopped, or find it trained.

    Args:
        spec: from `AgentCase.train_work`.
        seed: of the training.
        context: with the folder of all studies.

    Returns:
        Its folder's name, the steps of the environment that the training took, and the evaluations
        on the way.
    """
    import torch

    from planners.sb3 import TrainSpec, train
    from planners.sb3.training import read_curve

    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # networks this small only wait for more
    try:
        folder = agent_folder(context.folder, spec, seed)
        agent = train(TrainSpec(**spec["train"], seed=seed), folder, context.progress)
    finally:
        torch.set_num_threads(threads)
    # Times differ from run to run, and records must not.
    curve = [
        {name: value for name, value in entry.items() if name != "seconds"}
        for entry in read_curve(folder)
    ]
    return {"folder": folder.name, "steps": agent.steps, "curve": curve}


def training_seconds(spec: Mapping[str, Any], seed: int, context: Context) -> float:
    """How long a training took, wherever and whenever that was.

    Args:
        spec: from `AgentCase.train_work`.
        seed: of the training.
        context: with the folder of all studies.

    Returns:
        The time, s.
    """
    file = agent_folder(context.folder, spec, seed) / "agent.json"
    return float(json.loads(file.read_text(encoding="utf-8"))["seconds"])


def agent_policy(spec: Mapping[str, Any], seed: int, context: Context) -> Any:
    """The policy of the best agent of a training.

    Args:
        spec: of an evaluation, from `AgentCase.evaluation_work`.
        seed: of the training.
        context: with the folder of all studies.

    Returns:
        The policy, closed or open loop as the spec says.
    """
    from planners.sb3 import Agent, AgentPolicy, open_loop
    from planners.sb3.training import BEST

    train_once(spec["plan"], seed, context)
    agent = Agent.load(agent_folder(context.folder, spec["plan"], seed) / BEST)
    return open_loop(agent) if spec["loop"] == "open" else AgentPolicy(agent)
