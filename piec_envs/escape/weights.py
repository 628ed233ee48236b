"""The weights of a learned field and their file: arrays as npz, all else as a JSON sidecar.

Nothing is unpickled. The sidecar names the robot and carries a digest of its geometry and one of
the arrays, so that a file that is broken, mixed up or made for another robot is refused.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from piec_envs.errors import UnknownNameError, WeightsError, check_name
from piec_envs.escape.features import feature_count
from piec_envs.escape.perceptron import BLOCK
from piec_envs.escape.speed import SpeedModel
from piec_envs.files import BROKEN_FILE, replacing, why_unreadable
from piec_envs.sources import source as current_source
from piec_envs.versions import versions as current_versions
from piec_envs.world.packed import pack_robot
from piec_envs.world.robots import get_robot

FORMAT = "piec-field-1"
INPUTS = ("skeleton", "raw")
ARRAYS = ("mean", "scale", "w_in", "b_in", "w", "b", "w_out", "b_out")


@dataclass(frozen=True, eq=False)
class FieldWeights:
    """A trained escape field.

    With inputs "skeleton" the network sees the features of `piec_envs.escape.features` and answers
    T = T_0(p) exp(softplus(z - 3)), which keeps T = 0 on the circle and T >= T_0. With "raw" it
    sees (p, q_r) and answers T = softplus(z), as in the paper.

    Args:
        robot: name of the robot.
        inputs: "skeleton" or "raw".
        arrays: float32, by name: mean and scale of the inputs (F,); w_in (H, F), b_in (H,);
            w (depth - 1, H, H), b (depth - 1, H); w_out (H,), b_out (1,).
        speed: the speed model that it was trained for.
        recipe: how it was trained.
        seed: of the training.
        record: what training noted, such as seconds and held-out errors.
        versions: of the engine.
        source: commit and digest of the suite's sources; None in files from before it was noted.
    """

    robot: str
    inputs: str
    arrays: Mapping[str, np.ndarray]
    speed: SpeedModel
    recipe: Mapping[str, Any]
    seed: int
    record: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=current_versions)
    source: Mapping[str, Any] | None = field(default_factory=current_source)

    def __post_init__(self):
        check_name("kind of inputs", self.inputs, INPUTS)
        missing = [name for name in ARRAYS if name not in self.arrays]
        if missing:
            raise WeightsError(f"the arrays {', '.join(missing)} are missing")
        arrays = {name: np.array(self.arrays[name], dtype=np.float32) for name in ARRAYS}
        object.__setattr__(self, "arrays", arrays)
        self._check_shapes()

    def _check_shapes(self) -> None:
        inputs = input_count(self.robot, self.inputs)
        width = self.arrays["b_in"].size
        layers = len(self.arrays["b"])
        shapes = {
            "mean": (inputs,),
            "scale": (inputs,),
            "w_in": (width, inputs),
            "b_in": (width,),
            "w": (layers, width, width),
            "b": (layers, width),
            "w_out": (width,),
            "b_out": (1,),
        }
        for name, shape in shapes.items():
            array = self.arrays[name]
            if array.shape != shape or not np.isfinite(array).all():
                raise WeightsError(
                    f"{name} must be finite, of shape {shape}; got shape {array.shape}"
                )
        if not (self.arrays["scale"] > 0).all():
            raise WeightsError("scale must be above 0")
        if width == 0 or width % BLOCK:
            raise WeightsError(
                f"the width of the hidden layers must be a multiple of {BLOCK}, got {width}"
            )

    @property
    def digest(self) -> str:
        """SHA-256 of the arrays' shapes and bytes."""
        return array_digest(self.arrays)

    def save(self, path: str | os.PathLike) -> Path:
        """Write the npz file and the JSON file beside it, each under a temporary name first.

        Args:
            path: of the npz file.

        Returns:
            The path of the npz file.
        """
        target = Path(path).with_suffix(".npz")
        target.parent.mkdir(parents=True, exist_ok=True)
        meta = {
            "format": FORMAT,
            "robot": self.robot,
            "geometry": geometry_digest(self.robot),
            "inputs": self.inputs,
            "arrays": self.digest,
            "speed": asdict(self.speed),
            "recipe": dict(self.recipe),
            "seed": self.seed,
            "record": dict(self.record),
            "versions": dict(self.versions),
            "source": self.source,
        }
        text = json.dumps(meta, indent=1, sort_keys=True) + "\n"
        with replacing(target) as npz, replacing(target.with_suffix(".json")) as sidecar:
            np.savez_compressed(npz, allow_pickle=False, **self.arrays)
            sidecar.write(text.encode())
        return target

    @classmethod
    def load(cls, path: str | os.PathLike) -> FieldWeights:
        """Read a pair of files.

        Args:
            path: of the npz file.

        Raises:
            WeightsError: if a file is missing, truncated, no weight file, or does not fit its
                sidecar.
        """
        path = Path(path).with_suffix(".npz")
        try:
            meta = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
            if meta["format"] != FORMAT:
                raise WeightsError(
                    f"{path} has format {meta['format']!r}, but {FORMAT!r} is needed"
                )
            with np.load(path, allow_pickle=False) as data:
                arrays = {name: np.array(data[name], dtype=np.float32) for name in ARRAYS}
            if array_digest(arrays) != meta["arrays"]:
                raise WeightsError(f"{path} does not hold the weights that its JSON file describes")
            if geometry_digest(meta["robot"]) != meta["geometry"]:
                raise WeightsError(
                    f"{path} was trained for another geometry of the robot {meta['robot']!r}"
                )
            kept = {
                name: meta[name]
                for name in ("robot", "inputs", "recipe", "seed", "record", "versions")
            }
            return cls(
                arrays=arrays, speed=SpeedModel(**meta["speed"]), source=meta.get("source"), **kept
            )
        except WeightsError:
            raise
        except UnknownNameError as error:
            raise WeightsError(f"{path}: {error}") from error
        except BROKEN_FILE as error:
            raise WeightsError(why_unreadable(path, "weight file", error)) from error


def input_count(robot_name: str, inputs: str) -> int:
    """How many numbers a network sees.

    Args:
        robot_name: a row of the table of robots.
        inputs: "skeleton" or "raw".

    Returns:
        F.
    """
    robot = get_robot(robot_name)
    turning = robot.dof - robot.base_dof
    return feature_count(turning) if inputs == "skeleton" else 2 + turning


def array_digest(arrays: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of the arrays' shapes and bytes."""
    digest = hashlib.sha256()
    for name in ARRAYS:
        digest.update(
            f"{name}{arrays[name].shape}".encode() + np.ascontiguousarray(arrays[name]).tobytes()
        )
    return digest.hexdigest()


def geometry_digest(robot_name: str) -> str:
    """SHA-256 of what the escape field depends on: joints, limits, shapes and the workspace."""
    robot = pack_robot(robot_name)
    shapes = robot.shapes
    joints = robot.joint_origin, robot.joint_axis, robot.lower, robot.upper
    digest = hashlib.sha256(f"{get_robot(robot_name).workspace_radius:.9f}".encode())
    for array in (*joints, shapes.first, shapes.vertices, shapes.radius, shapes.frame):
        digest.update(np.round(array, 9).astype(float).tobytes())
    return digest.hexdigest()


def shipped_file(robot_name: str, name: str) -> Path:
    """Where the package keeps the weights of a name for a robot, whether they ship or not.

    Args:
        robot_name: a row of the table of robots.
        name: of the weights.

    Returns:
        The path of the npz file.
    """
    return Path(str(files("piec_envs") / "assets" / "fields" / f"{robot_name}-{name}.npz"))


def has_weights(robot_name: str, name: str = "network") -> bool:
    """Whether weights of a name ship for a robot.

    Args:
        robot_name: a row of the table of robots.
        name: of the weights.

    Returns:
        Whether the file is there.
    """
    return shipped_file(robot_name, name).is_file()


def find_weights(robot_name: str, weights: str | os.PathLike | FieldWeights) -> FieldWeights:
    """Weights by the name under which they ship, by the path of a file, or as they are.

    Args:
        robot_name: a row of the table of robots, for which they must be.
        weights: a name, a path, or the weights.

    Returns:
        The weights.

    Raises:
        WeightsError: if there are none, or they are for another robot.
    """
    found = (
        weights
        if isinstance(weights, FieldWeights)
        else FieldWeights.load(_locate(robot_name, weights))
    )
    if found.robot != robot_name:
        raise WeightsError(
            f"these weights are for the robot {found.robot!r}, not for {robot_name!r}"
        )
    return found


def _locate(robot_name: str, weights: str | os.PathLike) -> Path:
    named = shipped_file(robot_name, str(weights))
    path = named if named.is_file() else Path(weights).with_suffix(".npz")
    if path.is_file():
        return path
    shipped = sorted(
        file.stem.removeprefix(f"{robot_name}-")
        for file in named.parent.glob(f"{robot_name}-*.npz")
    )
    raise WeightsError(
        f"no weights {str(weights)!r} for {robot_name!r}: neither a file nor one of those that "
        f"ship "
        f"({', '.join(shipped) or 'none'}); train them with `piec train-field`"
    )
