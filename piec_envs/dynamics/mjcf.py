"""MuJoCo models of the scenes: the same robots, objects and shapes as everywhere, given a height.

The arm moves in the plane at half the object's height, its links being what the robot says they are
in space, or else its shapes given a height; the object and its loose bodies are upright prisms that
rest on a table. Geoms touch through explicit pairs alone, since MuJoCo would otherwise take the
larger friction of the two: the arm and a body with the scene's mu, a body and the table, and two
bodies, with frictions of their own.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import combinations, product
from typing import Any

import mujoco
import numpy as np

from piec_envs.dynamics.geoms import round_form, turned, upright_form
from piec_envs.world.objects import Object, get_object
from piec_envs.world.robots import Link, Robot, get_robot
from piec_envs.world.shapes import RoundedPolygon

TIMESTEP = 0.002  # s
TABLE_FRICTION = 0.3  # between object and table, and loose bodies and table
OBJECT_FRICTION = 0.4  # between the object and a loose body
# Time constant (s) and damping ratio, and impedance, of the two kinds of contact. The arm's are as
# stiff as this time step allows with a margin of two, so that a squeezed object stays within a
# fraction of a millimetre. The table's are MuJoCo's own: stiffer, and a slowly pushed object sticks
# and slips.
ARM_CONTACT = {"solref": (0.008, 1.0), "solimp": (0.95, 0.99, 0.001, 0.5, 2.0)}
TABLE_CONTACT = {"solref": (0.02, 1.0), "solimp": (0.9, 0.95, 0.001, 0.5, 2.0)}
PALE = 0.3  # opacity of parts that can touch the object in another row of the robot alone
CARRIAGE = (1.0, 0.01, 0.01, 0.01)  # mass (kg) and inertia (kg m^2) of a frame that carries no link
SOLID_COLOUR = (0.93, 0.93, 0.95, 1.0)
LINK_COLOUR = (0.42, 0.55, 0.70, 1.0)
OBJECT_COLOUR = (0.9, 0.62, 0.1, 1.0)
TABLE_COLOUR = (0.93, 0.93, 0.91, 1.0)
LOOSE_COLOUR = (0.62, 0.38, 0.22, 1.0)


@lru_cache(maxsize=1024)
def mujoco_model(robot_name: str, object_name: str, friction: float, mass: float = 1.0) -> Any:
    """The model of a scene, an `mujoco.MjModel` to be treated as read-only: a changed copy of one
    that is compiled.

    Args:
        robot_name: a row of the table of robots.
        object_name: a row of the table of objects.
        friction: mu between arm and object.
        mass: of the object, as a factor of its nominal one; its inertia scales along.

    Returns:
        The model.
    """
    model = copy.copy(_compiled(robot_name, object_name))
    model.pair_friction[_arm_pairs(model), :2] = friction
    if mass != 1.0:
        body = model.body("object").id
        model.body_mass[body] *= mass
        model.body_inertia[body] *= mass
        # what the compiler derives from masses, but for two means
        mujoco.mj_setConst(model, mujoco.MjData(model))
        model.stat.meanmass = model.body_mass[1:].mean()
        model.stat.meaninertia = model.dof_M0.mean()
    return model


@cache
def _compiled(robot_name: str, object_name: str) -> Any:
    return build_spec(get_robot(robot_name), get_object(object_name), friction=1.0).compile()


def _arm_pairs(model: Any) -> np.ndarray:
    """Which contact pairs are the arm's with a free body, shape (pairs,)."""
    free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
    bodies = model.geom_bodyid[np.stack([model.pair_geom1, model.pair_geom2])]  # (2, pairs)
    # the world's body, 0, is the table's
    return (np.isin(bodies, free).sum(axis=0) == 1) & (bodies > 0).all(axis=0)


def build_spec(robot: Robot, item: Object, friction: float) -> Any:
    """The scene as an `mujoco.MjSpec`; its coordinates are the joints, the object's place, those of
    loose bodies.

    Args:
        robot: the robot.
        item: the object.
        friction: mu between arm and object.

    Returns:
        The scene, not yet compiled.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    option = spec.option
    option.timestep = TIMESTEP
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # Coulomb's cone itself
    spec.worldbody.add_geom(
        name="table",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 0.1],
        rgba=TABLE_COLOUR,
        **_NO_COLLISION,
    )
    links = _add_robot(spec, robot, item.height / 2)
    bodies = [
        _add_free(
            spec,
            _Part("object", item.shapes, item.mass, OBJECT_COLOUR, is_link=False),
            item.height / 2,
        )
    ]
    for k, body in enumerate(item.loose, start=1):
        part = _Part(f"loose {k}", body.shapes, body.mass, LOOSE_COLOUR, is_link=False)
        bodies.append(_add_free(spec, part, body.height / 2))
    for geom in (geom for body in bodies for geom in body):
        for link in links:
            _add_pair(spec, link, geom, friction, ARM_CONTACT)
        _add_pair(spec, "table", geom, TABLE_FRICTION, TABLE_CONTACT)
    for one, other in combinations(bodies, 2):
        for first, second in product(one, other):
            _add_pair(spec, first, second, OBJECT_FRICTION, ARM_CONTACT)
    return spec


_NO_COLLISION = {"contype": 0, "conaffinity": 0}  # but for the explicit pairs


def _add_robot(spec: Any, robot: Robot, height: float) -> list[str]:
    """The chain with its drives; returns the names of its geoms."""
    frames = [spec.worldbody.add_body(name="base", pos=[0, 0, height])]
    for joint in robot.joints:
        x, y, angle = joint.origin
        body = frames[-1].add_body(name=joint.name, pos=[x, y, 0], quat=turned(angle))
        turns = joint.axis[2] != 0
        kind = mujoco.mjtJoint.mjJNT_HINGE if turns else mujoco.mjtJoint.mjJNT_SLIDE
        axis = [0, 0, joint.axis[2]] if turns else [*joint.axis[:2], 0]
        body.add_joint(
            name=joint.name,
            type=kind,
            axis=axis,
            armature=joint.armature,
            range=[joint.lower, joint.upper],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        )
        if not any(link.frame == len(frames) for link in (*robot.links, *robot.scenery)):
            body.mass = CARRIAGE[0]
            body.inertia = CARRIAGE[1:]
            body.explicitinertial = True
        frames.append(body)
        drive = spec.add_actuator(
            name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        drive.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        drive.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        drive.gainprm[0] = joint.stiffness
        drive.biasprm[1] = -joint.stiffness
        drive.biasprm[2] = -joint.damping
        drive.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        drive.forcerange = [-joint.effort, joint.effort]
    pale = PALE if robot.whole_name != robot.name else 1.0
    for link in robot.scenery:
        _add_link(spec, frames[link.frame], link, height, pale)
    return [
        name
        for link in robot.links
        for name in _add_link(spec, frames[link.frame], link, height, 1.0)
    ]


def _add_link(spec: Any, body: Any, link: Link, height: float, opacity: float) -> list[str]:
    """The solids of a link, or else its shapes given a height; returns the names of the geoms."""
    if link.solids:
        return _add_solids(spec, body, link, (*SOLID_COLOUR[:3], opacity))
    part = _Part(link.name, link.shapes, link.mass, (*LINK_COLOUR[:3], opacity), is_link=True)
    return _add_part(spec, body, part, height)


def _add_solids(spec: Any, body: Any, link: Link, colour: tuple[float, ...]) -> list[str]:
    """One convex mesh for each solid of a link, with an equal share of its mass; returns their
    names.
    """
    names = [f"{link.name} solid {k}" for k in range(len(link.solids))]
    for name, corners in zip(names, link.solids, strict=True):
        spec.add_mesh(name=name, uservert=corners.ravel())
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            mass=link.mass / len(names),
            rgba=colour,
            **_NO_COLLISION,
        )
    return names


@dataclass(frozen=True, eq=False)
class _Part:
    """A rigid part to be given a body's geoms."""

    name: str
    shapes: tuple[RoundedPolygon, ...]
    mass: float
    colour: tuple[float, ...]
    is_link: bool


def _add_free(spec: Any, part: _Part, half: float) -> list[str]:
    """A free body on the table, of twice the height `half` (m); returns the names of its geoms."""
    body = spec.worldbody.add_body(name=part.name, pos=[0, 0, half])
    body.add_freejoint(name=part.name)
    return _add_part(spec, body, part, half)


def _add_part(spec: Any, body: Any, part: _Part, half: float) -> list[str]:
    """One geom for each shape, with its share of the mass by area; returns their names."""
    total = sum(shape.area for shape in part.shapes)
    names = []
    for k, shape in enumerate(part.shapes):
        name = f"{part.name} shape {k}"
        round_link = part.is_link and len(shape.vertices) < 3
        form = round_form(shape) if round_link else upright_form(spec, name, shape, half)
        body.add_geom(
            name=name,
            mass=part.mass * shape.area / total,
            rgba=part.colour,
            **form,
            **_NO_COLLISION,
        )
        names.append(name)
    return names


def _add_pair(spec: Any, first: str, second: str, friction: float, contact: dict[str, Any]) -> None:
    spec.add_pair(
        name=f"{first} on {second}",
        geomname1=first,
        geomname2=second,
        condim=3,
        friction=[friction, friction, 0, 0, 0],
        margin=0.0,
        gap=0.0,
        **contact,
    )
