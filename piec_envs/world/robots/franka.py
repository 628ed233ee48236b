"""The Franka Panda as a planar arm: joints 1, 4 and 6 turn about vertical axes (paper, section 7).

It stands still or on a base that slides, can touch the object with some of its parts or with all,
and has the shapes of its meshes or capsules: `FRANKAS` has a row for each combination.

With q2 at 90 degrees, q3 at -90 and q5 at 0 these axes are vertical and all links lie about the
plane at z = 0.333 m. With q7 at 45 degrees the hand stands upright and is thin in that plane.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial

import numpy as np

from piec_envs.errors import check_name
from piec_envs.world.robots.panda import (
    BODIES,
    DH,
    EFFORT,
    FINGERS,
    FLANGE,
    LOWER,
    PACKAGE,
    UPPER,
    body_frames,
    mesh_vertices,
)
from piec_envs.world.robots.robot import Joint, Link, Robot
from piec_envs.world.sections import cross_section
from piec_envs.world.shapes import RoundedPolygon, capsule, disc

ACTIVE = (0, 3, 5)  # of the seven joints
# the others stay there, rad
POSTURE = np.array([0.0, np.pi / 2, -np.pi / 2, 0.0, 0.0, 0.0, np.pi / 4])
PLANE = float(DH[0, 2])  # m, height of the plane
REACH_UP = 0.15  # m above and below the plane: half the height of the tallest object
RADIUS = 1.0  # m, of the workspace
HOME = np.array([0.0, -0.47, 2.95])  # rad, straight
GRIP = 0.0538  # m, length of the fingers
POINT_RADIUS = 0.03  # m, of the sphere at the fingertips
CAPSULE_RADII = {
    "link 2": 0.06,
    "link 3": 0.06,
    "link 4": 0.06,
    "link 5": 0.055,
    "link 6": 0.055,
    "link 7": 0.045,
    "hand": 0.032,
}

# Links in the plane: which bodies they are, and after how many of the turning joints.
LINKS: Mapping[str, tuple[tuple[str, ...], int]] = {
    **{f"link {i}": ((f"link{i}",), 1) for i in (1, 2, 3)},
    **{f"link {i}": ((f"link{i}",), 2) for i in (4, 5)},
    **{f"link {i}": ((f"link{i}",), 3) for i in (6, 7)},
    "hand": (("hand",), 3),
    "fingers": (("left finger", "right finger"), 3),
}

FRANKA_BASES = {"fixed": "franka", "mobile": "mobile_franka"}
FRANKA_GEOMETRIES = {"meshes": "", "capsules": "_capsules"}
# What can touch the object: these links, all, or a sphere at the fingertips in place of any.
FRANKA_CONTACTS: Mapping[str, tuple[str, ...]] = {
    "whole_arm": (),
    "link": ("link 7", "hand", "fingers"),
    "point": (),
}
SLIDE = Joint(
    name="x",
    origin=(0.0, 0.0, 0.0),
    axis=(1.0, 0.0, 0.0),
    lower=-2.0,
    upper=2.0,
    speed_limit=0.05,
    max_lead=0.01,
    stiffness=1e4,
    damping=1000.0,
    armature=25.0,
    effort=200.0,
)


def all_joints(q_r: np.ndarray) -> np.ndarray:
    """The seven joints of a planar posture (..., n), whose last three are the active ones, shape
    (..., 7), rad.
    """
    q = np.broadcast_to(POSTURE, (*np.shape(q_r)[:-1], 7)).copy()
    q[..., ACTIVE] = np.asarray(q_r)[..., -len(ACTIVE) :]
    return q


def planar_frames() -> np.ndarray:
    """Poses in the plane of the base and of the frames after each joint, all at 0, shape (4, 4, 4),
    m.

    Each has z upwards and x along that of its Denavit-Hartenberg frame, whose z may point
    downwards.
    """
    frames = [np.eye(4)]
    frames[0][2, 3] = PLANE
    for body in (1, 4, 6):
        pose = body_frames(POSTURE)[body]
        x = pose[:3, 0]
        z = np.array([0.0, 0.0, 1.0])
        frames.append(np.eye(4))
        frames[-1][:3, :3] = np.column_stack([x, np.cross(z, x), z])
        frames[-1][:3, 3] = pose[:3, 3]
    return np.stack(frames)


@cache
def _joints() -> tuple[Joint, ...]:
    """Joints 1, 4 and 6 in the plane."""
    frames = planar_frames()
    bodies = body_frames(POSTURE)
    joints = []
    for j, active in enumerate(ACTIVE):
        relative = np.linalg.inv(frames[j]) @ frames[j + 1]
        angle = np.arctan2(relative[1, 0], relative[0, 0])
        x, y, angle = (np.round([*relative[:2, 3], angle], 9) + 0.0).tolist()  # no negative zeros
        joints.append(
            Joint(
                name=f"q{active + 1}",
                origin=(x, y, angle),
                axis=(0.0, 0.0, float(np.sign(bodies[active + 1, 2, 2]))),
                lower=float(LOWER[active]),
                upper=float(UPPER[active]),
                speed_limit=0.05,
                max_lead=0.01,
                stiffness=1e4,
                damping=200.0,
                armature=0.1,
                effort=float(EFFORT[active]),
            )
        )
    return tuple(joints)


def franka(base: str = "fixed", contact: str = "whole_arm", geometry: str = "meshes") -> Robot:
    """One row of the table of Pandas.

    Args:
        base: "fixed" or "mobile": a base that slides along x and y and takes part in no contact.
        contact: "whole_arm", "link" (the last link and the gripper) or "point" (a sphere at the
            fingertips).
        geometry: "meshes", the cross-sections of its collision meshes, or "capsules".

    Returns:
        The robot, with three joints that turn, or two that slide and then those.

    Raises:
        UnknownNameError: for another word.
        MissingDependencyError: if the package that brings the meshes is not installed.
        MeshError: if a mesh is not the expected one.
    """
    name = franka_name(base, contact, geometry)
    whole = franka_name(base, "whole_arm", geometry)
    slides = (SLIDE, replace(SLIDE, name="y", axis=(0.0, 1.0, 0.0))) if base == "mobile" else ()
    links, scenery = _meshes() if geometry == "meshes" else _capsules()
    if contact != "whole_arm":
        scenery += tuple(link for link in links if link.name not in FRANKA_CONTACTS[contact])
        links = tuple(link for link in links if link.name in FRANKA_CONTACTS[contact]) or (
            _fingertips(),
        )
    links, scenery = (
        tuple(replace(link, frame=link.frame + len(slides)) for link in part)
        for part in (links, scenery)
    )
    return Robot(
        name=name,
        joints=(*slides, *_joints()),
        links=links,
        home=np.concatenate([np.zeros(len(slides)), HOME]),
        workspace_radius=RADIUS,
        scenery=scenery,
        geometry_source=f"meshes of {PACKAGE}" if geometry == "meshes" else "capsules",
        whole=whole,
    )


def franka_name(base: str, contact: str, geometry: str) -> str:
    """Name of a Panda in the table of robots.

    Args:
        base, contact, geometry: words as in `franka`.

    Returns:
        The name, such as "mobile_franka_link_capsules".

    Raises:
        UnknownNameError: for another word.
    """
    for kind, word, known in (
        ("base", base, FRANKA_BASES),
        ("contact", contact, FRANKA_CONTACTS),
        ("geometry", geometry, FRANKA_GEOMETRIES),
    ):
        check_name(kind, word, known)
    return (
        FRANKA_BASES[base]
        + ("" if contact == "whole_arm" else f"_{contact}")
        + FRANKA_GEOMETRIES[geometry]
    )


FRANKAS: dict[str, Callable[[], Robot]] = {
    franka_name(*words): partial(franka, *words)
    for words in itertools.product(FRANKA_BASES, FRANKA_CONTACTS, FRANKA_GEOMETRIES)
}


@cache
def _meshes() -> tuple[tuple[Link, ...], tuple[Link, ...]]:
    """The links with the cross-sections of their meshes, and the foot, which touches nothing."""
    links = []
    for name, (bodies, frame) in LINKS.items():
        solids = tuple(_solid(body, frame) for body in bodies)
        outline = cross_section(np.concatenate(solids), -REACH_UP, REACH_UP)
        links.append(Link(name, frame, (RoundedPolygon(outline),), solids=solids))
    return tuple(links), (Link("link 0", 0, (), solids=(_solid("link0", 0),)),)


def _solid(body: str, frame: int) -> np.ndarray:
    """Corners of a body's mesh in a planar frame, shape (V, 3), m."""
    pose = np.linalg.inv(planar_frames()[frame]) @ body_frames(POSTURE)[BODIES.index(body)]
    return mesh_vertices(body) @ pose[:3, :3].T + pose[:3, 3]


@cache
def _capsules() -> tuple[tuple[Link, ...], tuple[Link, ...]]:
    """The links as capsules along the Denavit-Hartenberg frames, which needs no mesh; there is no
    foot.
    """
    frames = planar_frames()
    links = []
    for name, (start, end, frame) in _axes().items():
        a, b = (np.linalg.inv(frames[frame]) @ np.append(point, 1.0) for point in (start, end))
        links.append(
            Link(
                name, frame, (capsule(np.round(a[:2], 9), np.round(b[:2], 9), CAPSULE_RADII[name]),)
            )
        )
    return tuple(links), ()


def _fingertips() -> Link:
    """The sphere between the fingertips."""
    last = body_frames(POSTURE)[7]
    frame = len(ACTIVE)
    tip = last[:3, 3] + (FLANGE + FINGERS + GRIP) * last[:3, 2]
    x, y = np.round((np.linalg.inv(planar_frames()[frame]) @ np.append(tip, 1.0))[:2], 9)
    return Link("point", frame, (disc(POINT_RADIUS, (x, y)),))


def _axes() -> dict[str, tuple[np.ndarray, np.ndarray, int]]:
    """Segments along the arm in space, and the planar frame that each is fixed in."""
    bodies = body_frames(POSTURE)
    origins = bodies[:, :3, 3]
    last = bodies[7]
    flange = origins[7] + FLANGE * last[:3, 2]
    elbow = origins[4] + DH[4, 0] * bodies[4, :3, 0]
    return {
        "link 2": (origins[2], origins[3], 1),
        "link 3": (origins[3], origins[4], 1),
        "link 4": (origins[4], elbow, 2),
        "link 5": (elbow, origins[5], 2),
        "link 6": (origins[6], origins[7], 3),
        "link 7": (origins[7], flange, 3),
        "hand": (flange, flange + (FINGERS + GRIP - CAPSULE_RADII["hand"]) * last[:3, 2], 3),
    }
