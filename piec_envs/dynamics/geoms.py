"""Planar shapes given a height: what a rounded polygon is as a geom of MuJoCo."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from piec_envs.world.shapes import RoundedPolygon

RAISED = 5e-4  # m; corners of a prism's base that it does not stand on
# on each rounded corner of an extruded outline: faces within half a degree of the arc
ARC_POINTS = 91


def round_form(shape: RoundedPolygon) -> dict[str, Any]:
    """A sphere or a capsule: links are round in space; arguments of a body's `add_geom`."""
    r = shape.radius
    if len(shape.vertices) == 1:
        return {
            "type": mujoco.mjtGeom.mjGEOM_SPHERE,
            "size": [r, 0, 0],
            "pos": [*shape.vertices[0], 0],
        }
    (x, y), (end_x, end_y) = shape.vertices
    return {
        "type": mujoco.mjtGeom.mjGEOM_CAPSULE,
        "size": [r, 0, 0],
        "fromto": [x, y, 0, end_x, end_y, 0],
    }


def upright_form(spec: Any, name: str, shape: RoundedPolygon, half: float) -> dict[str, Any]:
    """A cylinder, a box, or an extruded convex mesh: objects are upright prisms.

    Args:
        spec: the `mujoco.MjSpec` that gets the mesh.
        name: of the mesh.
        shape: the shape.
        half: half the height, m; it reaches from -half to half.

    Returns:
        Arguments of a body's `add_geom`.
    """
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
            "quat": turned(np.arctan2(edge[1], edge[0])),
        }
    outline = shape.outline(ARC_POINTS)  # (m, 2)
    foot = np.where(_are_feet(len(outline)), -half, RAISED - half)  # (m,)
    corners = np.concatenate(
        [np.column_stack([outline, foot]), np.column_stack([outline, np.full(len(foot), half)])]
    )
    spec.add_mesh(name=name, uservert=corners.ravel())
    return {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": name}


def _are_feet(corners: int) -> np.ndarray:
    """On which of its corners a prism stands, shape (corners,): two and those across from them, if
    they are even.

    Of more corners than four in contact the engine keeps four, whose middle need not be that of the
    prism. Resting on them a prism leans, and one that leans creeps.
    """
    feet = np.full(corners, corners % 2 == 1)
    half = corners // 2
    feet[[0, half // 2, half, half + half // 2]] = True
    return feet


def turned(angle: float) -> list[float]:
    """Quaternion of a turn about the vertical."""
    return [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)]
