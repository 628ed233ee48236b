"""MuJoCo models of the scenes: the same robots, objects and shapes as everywhere, given a height.

The arm moves in the plane at half the object's height, its links being what the robot says they are in
space, or else its shapes given a height; the object is an upright prism that rests on a table. Geoms
touch through explicit pairs alone, since MuJoCo would otherwise take the larger friction of the two:
arm and object with the scene's mu, object and table with a friction of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from piec_envs.world.objects import Object, get_object
from piec_envs.world.robots import Link, Robot, get_robot
from piec_envs.world.shapes import RoundedPolygon

TIMESTEP = 0.002  # s
TABLE_FRICTION = 0.3  # between object and table
# Time constant (s) and damping ratio, and impedance, of the two kinds of contact. The arm's are as stiff
# as this time step allows with a margin of two, so that a squeezed object stays within a fraction of a
# millimetre. The table's are MuJoCo's own: stiffer, and a slowly pushed object sticks and slips.
ARM_CONTACT = {"solref": (0.008, 1.0), "solimp": (0.95, 0.99, 0.001, 0.5, 2.0)}
TABLE_CONTACT = {"solref": (0.02, 1.0), "solimp": (0.9, 0.95, 0.001, 0.5, 2.0)}
SOLID_COLOUR = (0.93, 0.93, 0.95, 1.0)
LINK_COLOUR, OBJECT_COLOUR, TABLE_COLOUR = (0.42, 0.55, 0.70, 1.0), (0.9, 0.62, 0.1, 1.0), (0.93, 0.93, 0.91, 1.0)
ARC_POINTS = 8  # on each rounded corner of an extruded outline


@lru_cache(maxsize=1024)
def get_model(robot_name: str, object_name: str, friction: float) -> Any:
    """The compiled model of a scene, an `mujoco.MjModel` to be treated as read-only.

    Args:
        robot_name: a row of the table of robots.
        object_name: a row of the table of objects.
        friction: mu between arm and object.
    """
    return build_spec(get_robot(robot_name), get_object(object_name), friction).compile()


def build_spec(robot: Robot, item: Object, friction: float) -> Any:
    """The scene as an `mujoco.MjSpec`; its first coordinates are the robot's joints, then the object's pose.

    Args:
        robot: the robot.
        item: the object.
        friction: mu between arm and object.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    option = spec.option
    option.timestep = TIMESTEP
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # Coulomb's cone itself
    spec.worldbody.add_geom(
        name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.1], rgba=TABLE_COLOUR, **_NO_COLLISION
    )
    links = _add_robot(spec, robot, item.height / 2)
    parts = _add_object(spec, item)
    for part in parts:
        for link in links:
            _add_pair(spec, link, part, friction, ARM_CONTACT)
        _add_pair(spec, "table", part, TABLE_FRICTION, TABLE_CONTACT)
    return spec


_NO_COLLISION = {"contype": 0, "conaffinity": 0}  # but for the explicit pairs


def _add_robot(spec: Any, robot: Robot, height: float) -> list[str]:
    """The chain with its drives; returns the names of its geoms."""
    frames = [spec.worldbody.add_body(name="base", pos=[0, 0, height])]
    for joint in robot.joints:
        x, y, angle = joint.origin
        body = frames[-1].add_body(name=joint.name, pos=[x, y, 0], quat=_turned(angle))
        turns = joint.axis[2] != 0
        kind = mujoco.mjtJoint.mjJNT_HINGE if turns else mujoco.mjtJoint.mjJNT_SLIDE
        axis = [0, 0, joint.axis[2]] if turns else [*joint.axis[:2], 0]
        body.add_joint(
            name=joint.name, type=kind, axis=axis, armature=joint.armature,
            range=[joint.lower, joint.upper], limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        )  # fmt: skip
        frames.append(body)
        drive = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.gaintype, drive.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        drive.gainprm[0] = joint.stiffness
        drive.biasprm[1], drive.biasprm[2] = -joint.stiffness, -joint.damping
        drive.forcelimited, drive.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, [-joint.effort, joint.effort]
    for link in robot.scenery:
        _add_solids(spec, frames[link.frame], link)
    names = []
    for link in robot.links:
        if link.solids:
            names += _add_solids(spec, frames[link.frame], link)
        else:
            part = _Part(link.name, link.shapes, link.mass, LINK_COLOUR, is_link=True)
            names += _add_part(spec, frames[link.frame], part, height)
    return names


def _add_solids(spec: Any, body: Any, link: Link) -> list[str]:
    """One convex mesh for each solid of a link, with an equal share of its mass; returns their names."""
    names = [f"{link.name} solid {k}" for k in range(len(link.solids))]
    for name, corners in zip(names, link.solids, strict=True):
        spec.add_mesh(name=name, uservert=corners.ravel())
        body.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, mass=link.mass / len(names),
            rgba=SOLID_COLOUR, **_NO_COLLISION,
        )  # fmt: skip
    return names


def _add_object(spec: Any, item: Object) -> list[str]:
    """The free object; returns the names of its geoms."""
    body = spec.worldbody.add_body(name="object", pos=[0, 0, item.height / 2])
    body.add_freejoint(name="object")
    return _add_part(spec, body, _Part("object", item.shapes, item.mass, OBJECT_COLOUR, is_link=False), item.height / 2)


@dataclass(frozen=True, eq=False)
class _Part:
    """A rigid part to be given a body's geoms."""

    name: str
    shapes: tuple[RoundedPolygon, ...]
    mass: float
    colour: tuple[float, ...]
    is_link: bool


def _add_part(spec: Any, body: Any, part: _Part, half: float) -> list[str]:
    """One geom for each shape, with its share of the mass by area; returns their names."""
    total, names = sum(shape.area for shape in part.shapes), []
    for k, shape in enumerate(part.shapes):
        name = f"{part.name} shape {k}"
        round_link = part.is_link and len(shape.vertices) < 3
        form = _round_form(shape) if round_link else _upright_form(spec, name, shape, half)
        body.add_geom(name=name, mass=part.mass * shape.area / total, rgba=part.colour, **form, **_NO_COLLISION)
        names.append(name)
    return names


def _round_form(shape: RoundedPolygon) -> dict[str, Any]:
    """A sphere or a capsule: links are round in space."""
    r = shape.radius
    if len(shape.vertices) == 1:
        return {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [r, 0, 0], "pos": [*shape.vertices[0], 0]}
    (x, y), (end_x, end_y) = shape.vertices
    return {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "size": [r, 0, 0], "fromto": [x, y, 0, end_x, end_y, 0]}


def _upright_form(spec: Any, name: str, shape: RoundedPolygon, half: float) -> dict[str, Any]:
    """A cylinder, a box, or an extruded convex mesh, from -half to half."""
    if len(shape.vertices) == 1:
        return {
            "type": mujoco.mjtGeom.mjGEOM_CYLINDER,
            "size": [shape.radius, half, 0],
            "pos": [*shape.vertices[0], 0],
        }
    if shape.is_rectangle:
        edge, following = np.diff(shape.vertices[:3], axis=0)  # (2,), (2,)
        return {
            "type": mujoco.mjtGeom.mjGEOM_BOX,
            "size": [np.hypot(*edge) / 2, np.hypot(*following) / 2, half],
            "pos": [*shape.vertices.mean(axis=0), 0],
            "quat": _turned(np.arctan2(edge[1], edge[0])),
        }
    outline = shape.outline(ARC_POINTS)  # (m, 2)
    corners = np.concatenate([np.column_stack([outline, np.full(len(outline), z)]) for z in (-half, half)])
    spec.add_mesh(name=name, uservert=corners.ravel())
    return {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": name}


def _add_pair(spec: Any, first: str, second: str, friction: float, contact: dict[str, Any]) -> None:
    spec.add_pair(
        name=f"{first} on {second}", geomname1=first, geomname2=second, condim=3,
        friction=[friction, friction, 0, 0, 0], margin=0.0, gap=0.0, **contact,
    )  # fmt: skip


def _turned(angle: float) -> list[float]:
    """Quaternion of a turn about the vertical."""
    return [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)]
