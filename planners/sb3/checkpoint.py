"""Checkpoints of a training: folders that appear whole or not at all."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

from piec_envs import AgentError, files
from planners.sb3.agent import file_hash
from planners.sb3.spec import TrainSpec

FORMAT = "piec-agent-checkpoint-1"
MODEL = "model.zip"
BUFFER = "replay_buffer.pkl"
STATE = "state.json"
SPEC = "spec.json"


def check_folder(folder: Path, spec: TrainSpec) -> None:
    """Refuse the folder of another training.

    Args:
        folder: of a training; need not exist.
        spec: the training that is to use it.

    Raises:
        AgentError: with what differs, or if the file in it is broken.
    """
    file = folder / SPEC
    if not file.is_file():
        return
    try:
        stored = dict(json.loads(file.read_text(encoding="utf-8")))
    except files.BROKEN_FILE as error:
        raise AgentError(f"{file} is broken: {error}; move {folder} away to start anew") from error
    if stored != spec.as_json():
        raise AgentError(
            f"{folder} belongs to another training ({spec.difference(stored)}); "
            "choose another folder, or move it away to start anew"
        )


def claim_folder(folder: Path, spec: TrainSpec) -> None:
    """Make the folder a training's, by a file that says which.

    Args:
        folder: of the training, which exists.
        spec: the training.
    """
    with files.replacing(folder / SPEC) as out:
        out.write((json.dumps(spec.as_json(), indent=1) + "\n").encode())


def write_checkpoint(folder: Path, model: Any, state: dict[str, Any]) -> None:
    """Write the state of a training, and remove the checkpoint before it.

    Args:
        folder: of the training.
        model: of Stable-Baselines3; the replay buffer goes along where it has one.
        state: values of JSON, "steps" among them.
    """
    target = folder / f"checkpoint-{state['steps']:012d}"
    temporary = folder / f".{target.name}.{os.getpid()}.tmp"
    before = _checkpoints(folder)
    temporary.mkdir()
    try:
        model.save(temporary / MODEL)
        if getattr(model, "replay_buffer", None) is not None:
            model.save_replay_buffer(temporary / BUFFER)
        hashes = {path.name: file_hash(path) for path in sorted(temporary.iterdir())}
        (temporary / STATE).write_text(
            json.dumps({"format": FORMAT, **state, "sha256": hashes}), encoding="utf-8"
        )
        os.rename(temporary, target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    for old in before:
        shutil.rmtree(old)


def read_checkpoint(folder: Path) -> tuple[Path, dict[str, Any]] | None:
    """The latest checkpoint and its state; None where there is none.

    Raises:
        AgentError: if it is broken or foreign.
    """
    found = _checkpoints(folder)
    if not found:
        return None
    path = found[-1]
    try:
        state = json.loads((path / STATE).read_text(encoding="utf-8"))
        if state["format"] != FORMAT:
            raise AgentError(f"{path} has format {state['format']!r}, but {FORMAT!r} is needed")
        for name, expected in state["sha256"].items():
            if file_hash(path / name) != expected:
                raise AgentError(f"{path / name} is broken; move {path} away to start anew")
    except AgentError:
        raise
    except files.BROKEN_FILE as error:
        raise AgentError(
            f"{path} is no checkpoint, or is broken: {error}; move it away to start anew"
        ) from error
    return path, state


def clear_checkpoints(folder: Path, torn_only: bool = False) -> None:
    """Remove what a finished training needs no more, or only what a kill left half written.

    Args:
        folder: of the training.
        torn_only: whether whole checkpoints stay.
    """
    for path in folder.glob(".checkpoint-*.tmp"):
        shutil.rmtree(path)
    for path in [] if torn_only else _checkpoints(folder):
        shutil.rmtree(path)


def _checkpoints(folder: Path) -> list[Path]:
    return sorted(folder.glob("checkpoint-*"))
