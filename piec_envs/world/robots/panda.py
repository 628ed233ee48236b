"""The Franka Panda in space: its kinematics, limits, and the collision meshes of an installed
package.

No mesh is kept here. They are read, and checked by their hash, from where `gymnasium_robotics`
keeps them; that package is not imported, and its own frames are not used.
"""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from piec_envs.errors import MeshError, MissingDependencyError, check_name

PACKAGE = "gymnasium_robotics"
EXTRA = "franka"
WITHOUT = "take capsules: geometry='capsules', the robot 'franka_capsules'"
FOLDER = Path("envs/assets/kitchen_franka/franka_assets/meshes/collision")
SHA_256 = {  # first 16 hex digits
    "link0": "dfc6d94330de8ddb",
    "link1": "e41a39a94108fcf5",
    "link2": "370f7605a0fae352",
    "link3": "0a8d638b9349c6c0",
    "link4": "0180ebb5772ec984",
    "link5": "dd17e688c7870e72",
    "link6": "20b768e99a0e0440",
    "link7": "92ac6afcf7574c03",
    "hand": "94493e94f30fe940",
    "finger": "2d07a740392f3b9b",
}

# Denavit-Hartenberg constants in Craig's convention, as published by the maker: a_(i-1),
# alpha_(i-1), d_i.
DH = np.array(
    [
        (0.0, 0.0, 0.333),
        (0.0, -np.pi / 2, 0.0),
        (0.0, np.pi / 2, 0.316),
        (0.0825, np.pi / 2, 0.0),
        (-0.0825, -np.pi / 2, 0.384),
        (0.0, np.pi / 2, 0.0),
        (0.088, np.pi / 2, 0.0),
    ]
)  # (7, 3) m, rad, m
FLANGE = 0.107  # m along the last axis
HAND_ANGLE = -np.pi / 4  # rad about it, of the hand on the flange
FINGERS = 0.0584  # m from the hand to its closed fingers
LOWER = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])  # rad
UPPER = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])  # rad
EFFORT = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])  # Nm

BODIES = (*(f"link{i}" for i in range(8)), "hand", "left finger", "right finger")


def mesh_of(body: str) -> str:
    """Name of a body's mesh: both fingers share one.

    Raises:
        UnknownNameError: if the Panda has no such body.
    """
    check_name("body of the Panda", body, BODIES)
    return "finger" if body.endswith("finger") else body


def _transform(a, alpha, d, theta) -> np.ndarray:
    """RotX(alpha) TransX(a) RotZ(theta) TransZ(d), shape (..., 4, 4), for theta of shape (...)."""
    c = np.cos(theta)
    s = np.sin(theta)
    c_a = np.cos(alpha)
    s_a = np.sin(alpha)
    one = np.ones_like(c)
    zero = np.zeros_like(c)
    rows = (
        (c, -s, zero, a * one),
        (s * c_a, c * c_a, -s_a * one, -d * s_a * one),
        (s * s_a, c * s_a, c_a * one, d * c_a * one),
        (zero, zero, zero, one),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def body_frames(q: np.ndarray) -> np.ndarray:
    """Poses of all bodies of the arm in space, its fingers closed.

    Args:
        q: the seven joints, shape (..., 7), rad.

    Returns:
        Homogeneous transforms in the order of `BODIES`, shape (..., 11, 4, 4), m.
    """
    q = np.asarray(q, dtype=float)
    frames = [np.broadcast_to(np.eye(4), (*q.shape[:-1], 4, 4))]
    for j, (a, alpha, d) in enumerate(DH):
        frames.append(frames[-1] @ _transform(a, alpha, d, q[..., j]))
    hand = frames[-1] @ _transform(0.0, 0.0, FLANGE, np.array(HAND_ANGLE))
    fingers = [hand @ _transform(0.0, 0.0, FINGERS, np.array(angle)) for angle in (0.0, np.pi)]
    return np.stack([*frames, hand, *fingers], axis=-3)


def mesh_folder() -> Path:
    """Where the meshes are installed.

    Raises:
        MissingDependencyError: if the package that brings them is not.
    """
    spec = find_spec(PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise MissingDependencyError(PACKAGE, EXTRA, WITHOUT)
    return Path(spec.submodule_search_locations[0]) / FOLDER


@cache
def mesh_vertices(body: str) -> np.ndarray:
    """Corners of the collision mesh of a body, a convex hull.

    Args:
        body: one of `BODIES`.

    Returns:
        Points in the frame of the body, each once, shape (V, 3), m.

    Raises:
        UnknownNameError: for another name.
        MissingDependencyError: if the package that brings the meshes is not installed.
        MeshError: if its file is missing, or not the one that this suite was made with.
    """
    name = mesh_of(body)
    path = mesh_folder() / f"{name}.stl"
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(f"the mesh {name!r} cannot be read: {error}") from error
    found = hashlib.sha256(data).hexdigest()[:16]
    if found != SHA_256[name]:
        raise MeshError(
            f"the mesh {name!r} in {path} is not the expected one: its SHA-256 begins with "
            f"{found}, "
            f"not with {SHA_256[name]}; install another version of {PACKAGE!r}"
        )
    return _read_stl(data)


def _read_stl(data: bytes) -> np.ndarray:
    """The different corners of a binary STL file, shape (V, 3)."""
    layout = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    # (3 F, 3)
    corners = np.frombuffer(data, layout, offset=84)["corners"].reshape(-1, 3).astype(float)
    return np.unique(corners, axis=0)
