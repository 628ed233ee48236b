"""The file of a fitted robot distance field: arrays and their description in one npz, nothing to
unpickle.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from piec_envs.errors import DistanceFieldError
from piec_envs.files import BROKEN_FILE, replacing, why_unreadable
from piec_envs.geometry.rdf.fit import RECIPE
from piec_envs.geometry.rdf.shape import Box, FittedShape
from piec_envs.world.robots.panda import SHA_256

FORMAT = "piec-rdf-1"
ARRAYS = ("weights", "slack", *Box._fields)


def save_shapes(path: str | os.PathLike, shapes: Mapping[str, FittedShape]) -> Path:
    """Write fitted shapes, under a temporary name first.

    Args:
        path: of the npz file.
        shapes: by the names of their meshes, all of one degree.

    Returns:
        The path of the file.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    fitted = list(shapes.values())
    arrays = {key: np.array([getattr(shape.box, key) for shape in fitted]) for key in Box._fields}
    arrays |= {
        "weights": np.array([shape.weights for shape in fitted]),
        "slack": np.array([s.slack for s in fitted]),
    }
    meta = {
        "format": FORMAT,
        "degree": len(fitted[0].weights) - 1,
        "shapes": list(shapes),
        "meshes": {name: SHA_256[name] for name in shapes},
        "recipe": RECIPE,
        "error": {name: shape.error for name, shape in shapes.items()},
        "arrays": _digest(arrays),
    }
    text = np.frombuffer(json.dumps(meta, sort_keys=True).encode(), dtype=np.uint8)
    with replacing(target) as file:
        np.savez(file, allow_pickle=False, meta=text, **arrays)
    return target


def load_shapes(path: str | os.PathLike, degree: int | None = None) -> dict[str, FittedShape]:
    """Read fitted shapes.

    Args:
        path: of the npz file.
        degree: that they must have; None takes any.

    Returns:
        The fitted shapes by the names of their meshes.

    Raises:
        DistanceFieldError: if the file is missing, broken or foreign, was fitted to other meshes or
            in another way, or has another degree.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            meta = json.loads(data["meta"].tobytes())
            arrays = {name: np.array(data[name], dtype=float) for name in ARRAYS}
        _check(meta, arrays, degree)
        return {
            name: FittedShape(
                arrays["weights"][i],
                Box(*(arrays[key][i] for key in Box._fields)),
                float(arrays["slack"][i]),
                {side: float(value) for side, value in meta["error"][name].items()},
            )
            for i, name in enumerate(meta["shapes"])
        }
    except DistanceFieldError as error:
        raise DistanceFieldError(f"{path}: {error}") from error
    except (*BROKEN_FILE, AttributeError) as error:
        raise DistanceFieldError(
            why_unreadable(path, "file of a robot distance field", error)
        ) from error


def _check(meta: Mapping, arrays: Mapping[str, np.ndarray], degree: int | None) -> None:
    """Refuse a description that is not that of the arrays, or of other shapes than the Panda's."""
    expected = {
        "format": FORMAT,
        "degree": meta["degree"] if degree is None else degree,
        "meshes": {name: SHA_256.get(name) for name in meta["shapes"]},
        "recipe": RECIPE,
        "arrays": _digest(arrays),
    }
    for key, value in expected.items():
        if meta[key] != value:
            raise DistanceFieldError(f"{key} is {meta[key]!r}, but {value!r} is needed")
    if set(meta["shapes"]) != set(SHA_256):
        raise DistanceFieldError(
            f"it holds the shapes {meta['shapes']}, but {list(SHA_256)} are needed"
        )
    count = len(meta["shapes"])
    edge = meta["degree"] + 1
    shapes = {"weights": (count, edge, edge, edge), "slack": (count,)}
    for name, array in arrays.items():
        if array.shape != shapes.get(name, (count, 3)) or not np.isfinite(array).all():
            raise DistanceFieldError(
                f"{name} must be finite, of shape {shapes.get(name, (count, 3))}"
            )


def _digest(arrays: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of the arrays' shapes and bytes."""
    digest = hashlib.sha256()
    for name in ARRAYS:
        digest.update(
            f"{name}{arrays[name].shape}".encode() + np.ascontiguousarray(arrays[name]).tobytes()
        )
    return digest.hexdigest()
