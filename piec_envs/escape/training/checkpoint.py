"""The file from which a training goes on as if it had never stopped: arrays only, nothing to
unpickle.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch

from piec_envs.errors import WeightsError
from piec_envs.files import BROKEN_FILE, replacing

FORMAT = "piec-training-1"


class Resumable(Protocol):
    """The state of a training, as `Training` holds it."""

    module: torch.nn.Module
    optimiser: torch.optim.Optimizer
    round_start: dict[str, np.ndarray]
    iteration: int
    seconds: float
    history: list[dict[str, Any]]

    @property
    def identity(self) -> str:
        """What must agree for a checkpoint to be this training's."""
        ...


def write_checkpoint(path: Path, training: Resumable) -> None:
    """Write the state of a training, under a temporary name first.

    Args:
        path: of the npz file; its folder is made.
        training: the training.
    """
    arrays = {f"round/{name}": array for name, array in training.round_start.items()}
    for name, tensor in training.module.state_dict().items():
        arrays[f"module/{name}"] = tensor.detach().cpu().numpy()
    for number, state in training.optimiser.state_dict()["state"].items():
        for name, tensor in state.items():
            arrays[f"adam/{number}/{name}"] = tensor.detach().cpu().numpy()
    meta = {
        "identity": training.identity,
        "iteration": training.iteration,
        "seconds": training.seconds,
        "history": training.history,
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as file:
        np.savez(file, allow_pickle=False, format=FORMAT, meta=json.dumps(meta), **arrays)


def read_checkpoint(path: Path, training: Resumable) -> None:
    """Put a training into the state of a checkpoint.

    Args:
        path: of the npz file.
        training: is changed.

    Raises:
        WeightsError: if the file is broken, or of a training with another recipe, robot or seed.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            if str(data["format"]) != FORMAT:
                raise WeightsError(f"{path} has format {data['format']}, but {FORMAT} is needed")
            meta = json.loads(str(data["meta"]))
            arrays = {name: np.array(data[name]) for name in data.files if "/" in name}
        if meta["identity"] != training.identity:
            raise WeightsError(
                f"{path} belongs to another training ({meta['identity']}, not "
                f"{training.identity}); "
                "move it away to start anew"
            )
        _restore(training, arrays)
        training.iteration = meta["iteration"]
        training.seconds = meta["seconds"]
        training.history = meta["history"]
    except WeightsError:
        raise
    except BROKEN_FILE as error:
        raise WeightsError(
            f"{path} is no checkpoint, or is broken: {error}; move it away to start anew"
        ) from error


def _restore(training: Resumable, arrays: dict[str, np.ndarray]) -> None:
    group: dict[str, dict[str, np.ndarray]] = {"round": {}, "module": {}, "adam": {}}
    for name, array in arrays.items():
        kind, _, rest = name.partition("/")
        group[kind][rest] = array
    training.round_start = group["round"]
    training.module.load_state_dict(
        {name: torch.from_numpy(array) for name, array in group["module"].items()}
    )
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, array in group["adam"].items():
        number, _, key = name.partition("/")
        state.setdefault(int(number), {})[key] = torch.from_numpy(array)
    whole = training.optimiser.state_dict()
    training.optimiser.load_state_dict({**whole, "state": state})
