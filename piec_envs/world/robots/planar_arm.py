"""The planar 4-DOF arm of the paper (section 4.6)."""

from __future__ import annotations

import numpy as np

from piec_envs.world.robots.robot import Joint, Link, Robot
from piec_envs.world.shapes import capsule

LENGTHS = (0.4, 0.4, 0.4, 0.2)  # m
RADIUS = 0.05  # m
LIMITS = (np.pi, 2.6, 2.6, 2.6)  # +- rad


def planar_arm() -> Robot:
    """Four capsule links of 0.4, 0.4, 0.4 and 0.2 m, radius 0.05 m, anchored at the origin."""
    origins = (0.0, *LENGTHS[:-1])  # each joint sits at the end of the link before it
    joints = tuple(
        Joint(
            name=f"q{j + 1}",
            origin=(origin, 0.0, 0.0),
            axis=(0.0, 0.0, 1.0),
            lower=-limit,
            upper=limit,
            speed_limit=0.05,
            max_lead=0.01,
            stiffness=500.0,
            damping=60.0,
            armature=0.1,
            effort=20.0,
        )
        for j, (origin, limit) in enumerate(zip(origins, LIMITS, strict=True))
    )
    links = tuple(
        Link(f"link {j + 1}", frame=j + 1, shapes=(capsule((0.0, 0.0), (length, 0.0), RADIUS),))
        for j, length in enumerate(LENGTHS)
    )
    return Robot("planar_arm", joints, links, home=np.zeros(4), workspace_radius=1.4)
