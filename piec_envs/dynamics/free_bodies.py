"""Where an object and its loose bodies stand in the physics state that MuJoCo remembers of a row.

The state of a robot of n joints beside k free bodies, the object first, is the time, the n joint
positions, then x, y, z and a quaternion of each body, then all velocities.
"""

from __future__ import annotations

import numpy as np

from piec_envs.world.objects import Object

# numbers that place a free body, and of its velocity
PLACE = 7
TWIST = 6
SUNK = 1e-4  # m into the table, about as deep as a prism rests
SAME_ANGLE = 1e-9  # rad; a quaternion gives an angle back no better


def planar(places: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Poses x, y, angle of free bodies.

    Args:
        places: position and quaternion, shape (B, 7).
        before: earlier angles, shape (B,); of all equal angles the nearest is taken.

    Returns:
        Shape (B, 3).
    """
    w, x, y, z = places[:, 3:].T
    heading = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    turn = (heading - before + np.pi) % (2 * np.pi) - np.pi
    return np.column_stack([places[:, :2], before + turn])


def places_in(state: np.ndarray, dof: int, bodies: int) -> np.ndarray:
    """Places of the free bodies in a physics state.

    Args:
        state: time, joints, places and velocities, shape (S,).
        dof: joints of the robot.
        bodies: how many free bodies.

    Returns:
        Position, m, and quaternion of each, a view of shape (bodies, 7).
    """
    return state[1 + dof : 1 + dof + PLACE * bodies].reshape(bodies, PLACE)


def poses_at_start(item: Object, pose: np.ndarray) -> np.ndarray:
    """Poses of the object and its loose bodies at the start of an episode.

    Args:
        item: the object.
        pose: its x, y, angle, shape (3,), m and rad.

    Returns:
        Shape (k, 3).
    """
    c = np.cos(pose[2])
    s = np.sin(pose[2])
    beside = np.array([body.pose for body in item.loose]).reshape(-1, 3)  # (k - 1, 3)
    turned = beside[:, :2] @ np.array([[c, s], [-s, c]])  # (k - 1, 2)
    return np.vstack([pose, pose + np.column_stack([turned, beside[:, 2]])])


def upright(item: Object, poses: np.ndarray) -> np.ndarray:
    """Places of the object and its loose bodies, standing on the table.

    They begin in it by `SUNK`: at exactly half their height rounding decides which of their corners
    the engine finds in contact first, and some turn while they come to rest.

    Args:
        item: the object.
        poses: of the object, or of it and its loose bodies, shape (k, 3).

    Returns:
        Position and quaternion of each, shape (k, 7).
    """
    places = np.zeros((len(poses), PLACE))
    heights = np.array([item.height, *(body.height for body in item.loose)])[: len(poses)]
    places[:, :2] = poses[:, :2]
    places[:, 2] = heights / 2 - SUNK
    places[:, 3] = np.cos(poses[:, 2] / 2)
    places[:, 6] = np.sin(poses[:, 2] / 2)
    return places


def rest_state(item: Object, q_r: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """The physics state of a robot and bodies that stand still.

    Args:
        item: the object.
        q_r: joint positions, shape (n,), rad or m.
        poses: of the object and its loose bodies, shape (k, 3).

    Returns:
        Shape (S,).
    """
    places = upright(item, poses).ravel()
    return np.concatenate([[0.0], q_r, places, np.zeros(len(q_r) + TWIST * len(poses))])


def remembered_places(
    item: Object, q_r: np.ndarray, pose: np.ndarray, memory: np.ndarray
) -> np.ndarray | None:
    """Places of the object and its loose bodies as a row remembers them, shape (k, 7).

    Args:
        item: the object.
        q_r: joint positions, shape (n,).
        pose: object pose, shape (3,).
        memory: the row's, a physics state of shape (S,), of any length if it is another's.

    Returns:
        None where the memory does not fit the joints and the pose: they were changed, or it is
        another's.
    """
    n = len(q_r)
    bodies = 1 + len(item.loose)
    if memory.shape != (1 + 2 * n + (PLACE + TWIST) * bodies,):
        return None
    places = places_in(memory, n, bodies)
    known = planar(places[:1], pose[None, 2])[0]
    fits = (
        (memory[1 : 1 + n] == q_r).all()
        and (known[:2] == pose[:2]).all()
        and abs(known[2] - pose[2]) < SAME_ANGLE
    )
    return places if fits else None


def places_of(item: Object, q_r: np.ndarray, pose: np.ndarray, memory: np.ndarray) -> np.ndarray:
    """Places of the object and its loose bodies: those remembered, or else those at the start.

    Args:
        item, q_r, pose, memory: as in `remembered_places`.

    Returns:
        Position and quaternion of each, shape (k, 7).
    """
    places = remembered_places(item, q_r, pose, memory)
    return upright(item, poses_at_start(item, pose)) if places is None else places
