"""Training of escape fields; needs the extra `learn` (torch)."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path

from piec_envs.errors import MissingDependencyError
from piec_envs.escape.training.recipes import RECIPES, Recipe, get_recipe
from piec_envs.escape.weights import FieldWeights

__all__ = ["RECIPES", "Recipe", "get_recipe", "train_field"]


def train_field(
    recipe: str | Recipe,
    robot_name: str = "planar_arm",
    seed: int = 0,
    file: str | os.PathLike | None = None,
    device: str = "cpu",
    threads: int | None = None,
    progress: bool = True,
) -> FieldWeights:
    """Train an escape field; a run that was killed goes on where it stopped.

    Args:
        recipe: a row of the table of recipes, or a recipe.
        robot_name: a row of the table of robots.
        seed: of all randomness.
        file: where to write the weights, with a checkpoint beside it until the end; None writes
            nothing.
        device: torch device.
        threads: for labels and look-aheads; None takes all cores.
        progress: whether to show a bar with the loss and the held-out error.

    Returns:
        The trained field.

    Raises:
        MissingDependencyError: if torch is not installed.
        UnknownNameError: for an unknown recipe or robot.
        InvalidParameterError: if torch cannot use the device.
        WeightsError: if a checkpoint lies there that is broken or another training's.
    """
    if find_spec("torch") is None:
        raise MissingDependencyError("torch", "learn")
    from piec_envs.escape.training.trainer import Training

    if file is not None:
        Path(file).parent.mkdir(parents=True, exist_ok=True)  # fails now, not at the end
    chosen = get_recipe(recipe) if isinstance(recipe, str) else recipe
    checkpoint = None if file is None else Path(file).with_suffix(".checkpoint.npz")
    weights = Training(chosen, robot_name, seed, checkpoint, device, threads).run(progress)
    if file is not None and checkpoint is not None:
        weights.save(file)
        checkpoint.unlink(missing_ok=True)
    return weights
