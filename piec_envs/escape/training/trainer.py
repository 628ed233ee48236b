"""The training loop: one iteration after the other, with checkpoints from which it goes on
exactly.
"""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from piec_envs.console import no_bar
from piec_envs.errors import InvalidParameterError, as_count
from piec_envs.escape.speed import SpeedModel
from piec_envs.escape.training.checkpoint import read_checkpoint, write_checkpoint
from piec_envs.escape.training.extended import ExtendedLoss
from piec_envs.escape.training.fitted import FittedLoss
from piec_envs.escape.training.heldout import HeldOut
from piec_envs.escape.training.recipes import Extended, Fitted, Recipe, Residual
from piec_envs.escape.training.reference import FieldModule
from piec_envs.escape.training.residual import ResidualLoss
from piec_envs.escape.weights import FieldWeights, input_count
from piec_envs.world.robots import get_robot

CHECKPOINT_SECONDS = 30.0
REPORTS = 20  # held-out errors measured during a training
LEAST_RATE = 0.01  # of the cosine schedule, as a share of the first
# special ones first
LOSSES: dict[type, Any] = {Fitted: FittedLoss, Extended: ExtendedLoss, Residual: ResidualLoss}


def learning_rate(recipe: Recipe, iteration: int, length: int) -> float:
    """Learning rate of an iteration within a round.

    Args:
        recipe: gives the schedule and the rate at the start.
        iteration: within the round, from 0.
        length: of the round, in iterations.

    Returns:
        The rate.
    """
    if recipe.schedule == "halving":
        return recipe.learning_rate * 0.5 ** (iteration // recipe.halve_every)
    wave = 0.5 * (1 + np.cos(np.pi * iteration / length))
    return recipe.learning_rate * (LEAST_RATE + (1 - LEAST_RATE) * float(wave))


class Training:
    """One training run. It is the same again from the same seed, with the same number of torch
    threads.

    Args:
        recipe: how to train.
        robot_name: a row of the table of robots.
        seed: of all randomness.
        checkpoint: file to go on from, and to write now and then; None keeps none.
        device: torch device.
        threads: for labels and look-aheads; None takes all cores.

    Raises:
        UnknownNameError: if the robot is not known.
        InvalidParameterError: if torch cannot use the device, the robot's base slides, or a number
            is out of range.
        WeightsError: if the checkpoint is broken or another training's.
    """

    def __init__(
        self,
        recipe: Recipe,
        robot_name: str = "planar_arm",
        seed: int = 0,
        checkpoint: str | os.PathLike | None = None,
        device: str = "cpu",
        threads: int | None = None,
    ):
        check_device(device)
        if get_robot(robot_name).base_dof:
            raise InvalidParameterError(
                f"the base of {robot_name!r} slides, and its field moves along: train a robot "
                f"with a fixed base"
            )
        threads = None if threads is None else as_count("threads", threads)
        self.recipe = recipe
        self.robot_name = robot_name
        self.speed = SpeedModel()
        self.seed = as_count("seed", seed, 0)
        torch.manual_seed(seed)
        self.module = FieldModule(
            input_count(robot_name, recipe.inputs), recipe.width, recipe.depth
        ).to(device)
        loss = next(made for kind, made in LOSSES.items() if isinstance(recipe, kind))
        self.loss = loss(recipe, robot_name, self.speed, seed, device, threads)
        self.held_out = HeldOut(robot_name, self.speed, threads)
        self.optimiser = self._fresh_optimiser()
        self.iteration = 0
        self.seconds = 0.0
        self.history = list[dict[str, Any]]()
        self.round_start = self.module.arrays()
        self.checkpoint = None if checkpoint is None else Path(checkpoint)
        self.device = device
        if self.checkpoint is not None and self.checkpoint.is_file():
            read_checkpoint(self.checkpoint, self)

    @property
    def identity(self) -> str:
        """What must agree for a checkpoint to be this training's."""
        return json.dumps([self.recipe.described(), self.robot_name, self.seed], sort_keys=True)

    def _fresh_optimiser(self) -> torch.optim.Adam:
        return torch.optim.Adam(self.module.parameters(), lr=self.recipe.learning_rate, fused=True)

    def weights(self, arrays: dict[str, np.ndarray] | None = None) -> FieldWeights:
        """Present or given arrays as `FieldWeights`."""
        record = {
            "seconds": round(self.seconds, 1),
            "held_out": self.history,
            "torch": torch.__version__,
        }
        return FieldWeights(
            robot=self.robot_name,
            inputs=self.recipe.inputs,
            arrays=arrays or self.module.arrays(),
            speed=self.speed,
            recipe=self.recipe.described(),
            seed=self.seed,
            record=record,
        )

    def run(self, progress: bool = True, stop_at: int | None = None) -> FieldWeights:
        """Train to the end.

        Args:
            progress: whether to show a bar with the loss and the held-out error.
            stop_at: iteration to stop at before the end, as if killed; a checkpoint is left.

        Returns:
            The trained field.
        """
        lengths = self.loss.lengths
        stop = min(sum(lengths), sum(lengths) if stop_at is None else stop_at)
        self._clock = self._saved = time.perf_counter()
        with tqdm(
            total=sum(lengths),
            initial=self.iteration,
            disable=no_bar(progress),
            unit="it",
            delay=0.5,
        ) as bar:
            for number, length in enumerate(lengths):
                start = sum(lengths[:number])
                if start <= self.iteration < min(start + length, stop):
                    bar.set_description(f"round {number}" if len(lengths) > 1 else "training")
                    self._round(number, (start, length), stop, bar)
        self._keep_time()
        if self.checkpoint is not None:
            write_checkpoint(self.checkpoint, self)
        return self.weights()

    def _round(self, number: int, span: tuple[int, int], stop: int, bar: tqdm) -> None:
        start, length = span
        if self.iteration == start:
            self.round_start = self.module.arrays()
            self.optimiser = self._fresh_optimiser()
        normal = self.loss.begin_round(number, self.weights(self.round_start))
        if normal is not None:
            self.module.mean.copy_(normal[0])
            self.module.scale.copy_(normal[1])
        while self.iteration < min(start + length, stop):
            loss = self._step(learning_rate(self.recipe, self.iteration - start, length))
            bar.update()
            self._look_after(loss, bar)

    def _step(self, rate: float) -> torch.Tensor:
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        loss = self.loss(self.module, self.iteration)
        self.optimiser.zero_grad()
        loss.backward()
        self.optimiser.step()
        self.iteration += 1
        return loss

    def _look_after(self, loss: torch.Tensor, bar: tqdm) -> None:
        """Report and save, when it is time."""
        total = sum(self.loss.lengths)
        if self.iteration % max(total // REPORTS, 1) == 0 or self.iteration == total:
            error = self.held_out.error(self.weights())
            self.history.append(
                {"iteration": self.iteration, "loss": float(loss.detach()), **error}
            )
            bar.set_postfix(
                loss=f"{self.history[-1]['loss']:.3g}", held_out=f"{100 * error['median']:.3g} %"
            )
        if self.checkpoint is not None and time.perf_counter() - self._saved > CHECKPOINT_SECONDS:
            self._keep_time()
            write_checkpoint(self.checkpoint, self)
            self._saved = time.perf_counter()

    def _keep_time(self) -> None:
        now = time.perf_counter()
        self.seconds = self.seconds + now - self._clock
        self._clock = now


def check_device(device: str) -> None:
    """Refuse a device that torch does not have.

    Raises:
        InvalidParameterError: naming the device.
    """
    try:
        torch.empty(1, device=device)
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        raise InvalidParameterError(f"torch cannot use the device {device!r}: {error}") from error
