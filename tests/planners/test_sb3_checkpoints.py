"""Trainings that were stopped or killed, and checkpoints that do not belong."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from piec_envs.errors import AgentError

pytest.importorskip("stable_baselines3")

from small_trainings import PUSH, SPECS, TRACK

from planners.sb3 import train
from planners.sb3 import training as trainings
from planners.sb3.checkpoint import read_checkpoint, write_checkpoint
from planners.sb3.hyperparameters import model_arguments

ROOT = Path(__file__).resolve().parents[2]
KILLED = """
import sys, json
from planners.sb3 import TrainSpec, train
train(TrainSpec(**json.loads(sys.argv[1])), sys.argv[2], progress=False)
"""


@pytest.fixture
def interrupt(monkeypatch):
    """Interrupt trainings at the n-th evaluation."""

    def at(n):
        original = trainings.score
        calls = []

        def score(*arguments):
            calls.append(1)
            if len(calls) == n:
                raise KeyboardInterrupt
            return original(*arguments)

        monkeypatch.setattr(trainings, "score", score)

    return at


def history(folder):
    return [json.loads(line) for line in (folder / "evaluations.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_an_interrupted_training_goes_on(algo, interrupt, monkeypatch, tmp_path):
    spec = SPECS[algo]
    with monkeypatch.context():
        interrupt(3)
        with pytest.raises(KeyboardInterrupt):
            train(spec, tmp_path, progress=False)
    _, state = read_checkpoint(tmp_path)
    monkeypatch.undo()
    run = trainings.Training(spec, tmp_path, model_arguments(spec))
    assert run.model.num_timesteps == state["steps"] == {"ppo": 80, "sac": 50}[algo]
    if algo == "ppo":
        assert run.venv.obs_rms.mean.tolist() == state["normalisation"]["observation"][""]["mean"]
        assert run.venv.ret_rms.count == state["normalisation"]["return"]["count"] > 80
    else:
        assert run.model.replay_buffer.pos == 25
    (tmp_path / ".checkpoint-000000000099.1.tmp").mkdir()  # what a kill leaves
    agent = train(spec, tmp_path, progress=False)
    assert (
        agent.steps == spec.timesteps
        and history(tmp_path)[: len(state["history"])] == state["history"]
    )
    steps = [record["steps"] for record in history(tmp_path)]
    assert steps == sorted(set(steps)) and not list(tmp_path.glob("*checkpoint*"))
    if algo == "ppo":  # the schedule went by the whole training
        assert (
            agent.model._total_timesteps == 200
            and agent.model.policy.optimizer.param_groups[0]["lr"] == 0.0
        )


def test_a_killed_process_goes_on(tmp_path):
    spec = dataclasses.replace(SPECS["ppo"], timesteps=2000, evaluations=20)
    command = [sys.executable, "-c", KILLED, json.dumps(spec.as_json()), str(tmp_path)]
    process = subprocess.Popen(command, cwd=ROOT)
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob("checkpoint-*")) and time.monotonic() < deadline:
        time.sleep(0.005)
    process.kill()  # SIGKILL
    assert process.wait() == -9
    path, state = read_checkpoint(tmp_path)
    assert 100 <= state["steps"] < 2000 and path.name == f"checkpoint-{state['steps']:012d}"
    agent = train(spec, tmp_path, progress=False)
    assert agent.steps == agent.model.num_timesteps == 2000
    assert [record["steps"] for record in history(tmp_path)] == list(range(100, 2001, 100))
    assert not list(tmp_path.glob("*checkpoint*")) and not list(tmp_path.glob(".*"))


def test_a_torn_write_leaves_the_checkpoint_before(interrupt, tmp_path, monkeypatch):
    interrupt(2)
    with pytest.raises(KeyboardInterrupt):
        train(SPECS["ppo"], tmp_path, progress=False)
    _, state = read_checkpoint(tmp_path)

    class Torn:
        def save(self, path):
            Path(path).write_bytes(b"half")
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_checkpoint(tmp_path, Torn(), {**state, "steps": 999})
    assert read_checkpoint(tmp_path)[1] == state


def test_checkpoints_that_do_not_belong_are_refused(interrupt, tmp_path):
    interrupt(2)
    spec = SPECS["ppo"]
    with pytest.raises(KeyboardInterrupt):
        train(spec, tmp_path, progress=False)
    with pytest.raises(AgentError, match=r"timesteps: 200 there, 300 here"):
        train(dataclasses.replace(spec, timesteps=300), tmp_path, progress=False)
    path, state = read_checkpoint(tmp_path)

    def expect(message, **changes):
        (path / "state.json").write_text(json.dumps({**state, **changes}))
        with pytest.raises(AgentError, match=message):
            train(spec, tmp_path, progress=False)

    expect(f"trained on '{TRACK}', not on '{PUSH}'", env_id=TRACK)
    narrow = {"": {"low": [-1.0] * 25, "high": [1.0] * 25}}
    expect(
        "of 25 entries from -1 to 1, .*of 23 entries from -20",
        spaces={**state["spaces"], "observation": narrow},
    )
    expect("has actions of 25 entries", spaces={**state["spaces"], "action": narrow})
    expect("seed: 1 there, 0 here", spec={**state["spec"], "seed": 1})
    expect("format", format="tar")
    expect("model.zip is broken", sha256={"model.zip": "0" * 64})
    (path / "state.json").write_text("{")
    with pytest.raises(AgentError, match="broken"):
        train(spec, tmp_path, progress=False)
    (tmp_path / "spec.json").write_text("[]")
    with pytest.raises(AgentError, match=r"another training|broken"):
        train(spec, tmp_path, progress=False)
