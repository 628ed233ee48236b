"""What a robot is: a planar chain of joints with shapes fixed to its frames."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from piec_envs.world.shapes import RoundedPolygon

LEAST_CURL = 0.6  # rad, by which every turning joint but the first bends in a curled configuration


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid part of the robot.

    Args:
        name: what tables and figures call it.
        frame: the frame it is fixed in; 0 is the base, j the frame after the j-th joint.
        shapes: its geometry in that frame.
        mass: kg.
        solids: what it is in space, where that is not its shapes given a height: corners of convex
            bodies in that frame, z from the plane in which the robot moves, shape (V, 3) each, m.
    """

    name: str
    frame: int
    shapes: tuple[RoundedPolygon, ...]
    mass: float = 1.0
    solids: tuple[np.ndarray, ...] = ()


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint: where it sits in the parent frame, how it moves, and its limits.

    Args:
        name: what tables and figures call it.
        origin: pose of the joint in its parent frame (x, y, angle); m, rad.
        axis: planar screw axis (v_x, v_y, omega): (0, 0, 1) turns, (1, 0, 0) slides along x.
        lower: least position, rad or m.
        upper: largest position, rad or m.
        speed_limit: largest commanded speed, rad/s or m/s.
        max_lead: largest distance of the command ahead of the joint, rad or m.
        stiffness: K of the paper's eq. 11, Nm/rad or N/m; second-order dynamics take it for a
            spring.
        damping: of the controller under second-order dynamics, Nm s/rad or N s/m.
        armature: inertia of the drive, kg m^2 or kg.
        effort: largest torque or force of the drive, Nm or N.
    """

    name: str
    origin: tuple[float, float, float]
    axis: tuple[float, float, float]
    lower: float
    upper: float
    speed_limit: float
    max_lead: float
    stiffness: float
    damping: float
    armature: float
    effort: float


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot as data.

    Args:
        name: its key in the table of robots.
        joints: from the base outwards.
        links: the parts that can touch the object.
        home: the configuration of a fresh episode, shape (n,), rad or m.
        workspace_radius: radius of the escape disc around the base, m.
        scenery: parts that touch nothing and are only drawn; one without shapes is not drawn in the
            plane.
        geometry_source: where its shapes come from, for records.
        whole: row of the same robot with all its parts as links, where this one has some of them as
            scenery; "" is this row itself.
    """

    name: str
    joints: tuple[Joint, ...]
    links: tuple[Link, ...]
    home: np.ndarray
    workspace_radius: float
    scenery: tuple[Link, ...] = ()
    geometry_source: str = "definition"
    whole: str = ""

    @property
    def whole_name(self) -> str:
        """Name of the row with all parts as links."""
        return self.whole or self.name

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @cached_property
    def base_dof(self) -> int:
        """Number of leading joints that only slide, and so move the base."""
        return next((j for j, joint in enumerate(self.joints) if joint.axis[2] != 0), self.dof)

    @property
    def tip(self) -> np.ndarray:
        """Vertex of the last frame's shapes that is farthest from that frame, shape (2,), m."""
        corners = np.concatenate(
            [s.vertices for link in self.links if link.frame == self.dof for s in link.shapes]
        )
        return corners[int(np.argmax(np.hypot(*corners.T)))].astype(float)

    @property
    def straight(self) -> np.ndarray:
        """Where each turning joint but the first lines up the segments before and after it, 0
        elsewhere, shape (n,).

        Segments go from joint to joint and on to the tip; of equal angles the one nearest to the
        middle of the limits is taken.
        """
        straight = np.zeros(self.dof)
        for j in range(self.base_dof + 1, self.dof):
            joint = self.joints[j]
            after = self.joints[j + 1].origin[:2] if j + 1 < self.dof else self.tip
            bend = (
                joint.origin[2]
                + np.arctan2(after[1], after[0])
                - np.arctan2(joint.origin[1], joint.origin[0])
            )
            aligned = -bend / joint.axis[2]
            middle = (joint.lower + joint.upper) / 2
            straight[j] = aligned + 2 * np.pi * np.round((middle - aligned) / (2 * np.pi))
        return straight

    def curl_sides(self, least: float = LEAST_CURL) -> tuple[float, ...]:
        """The sides, 1 (left) or -1, to which all turning joints but the first can bend by `least`,
        rad: as much as a curled configuration does.
        """
        turning = range(self.base_dof + 1, self.dof)
        room = {
            1.0: [self.joints[j].upper - self.straight[j] for j in turning],
            -1.0: [self.straight[j] - self.joints[j].lower for j in turning],
        }
        return tuple(side for side in (-1.0, 1.0) if all(bend >= least for bend in room[side]))

    @property
    def half_width(self) -> float:
        """Largest distance of a link's surface from its axis, frame origin to frame origin or tip,
        m.
        """
        widest = 0.0
        for link in self.links:
            end = (
                np.array(self.joints[link.frame].origin[:2]) if link.frame < self.dof else self.tip
            )
            for shape in link.shapes:
                t = np.clip(shape.vertices @ end / max(float(end @ end), 1e-12), 0.0, 1.0)
                off = np.hypot(*(shape.vertices - t[:, None] * end).T)
                widest = max(widest, float(off.max()) + shape.radius)
        return widest

    def joint_array(self, field: str) -> np.ndarray:
        """One field of every joint as an array, shape (n,) or (n, 3)."""
        return np.array([getattr(joint, field) for joint in self.joints], dtype=float)

    @property
    def speed_limit(self) -> np.ndarray:
        """v_max of each joint, shape (n,), rad/s or m/s."""
        return self.joint_array("speed_limit")
