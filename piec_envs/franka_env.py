"""Environments of the Franka Panda, which moves joints 1, 4 and 6 in the plane of its shoulder."""

from __future__ import annotations

from typing import Any

from piec_envs.cage_env import CageEnv, CageVectorEnv
from piec_envs.errors import check_name

GEOMETRIES = {"meshes": "franka", "capsules": "franka_capsules"}  # rows of the table of robots
OBJECT = "water_jug"


def robot_of(geometry: str) -> str:
    """The robot with that geometry.

    Raises:
        UnknownNameError: for any other than "meshes" and "capsules".
    """
    check_name("geometry", geometry, GEOMETRIES)
    return GEOMETRIES[geometry]


class FrankaCageEnv(CageEnv):
    """Enclose an everyday object with the whole arm of a Franka Panda on a fixed base (paper section 7.1).

    Joints 2, 3, 5 and 7 are locked so that joints 1, 4 and 6 turn about vertical axes and the arm moves in
    the plane z = 0.333 m.

    **Action.** Box(-1, 1, (3,)): the posture (q1, q4, q6), each joint from its lower (-1) to its upper (1)
    limit, those of the real robot (+-2.897, -3.072 to -0.070, -0.018 to 3.753 rad). It is taken at once;
    nothing moves on the way.

    **Observation.** Box(4,): object x, y (m), cos and sin of its angle.

    **Reward.** 0.02 (T_hat - 1e3 overlap), as in `PlanarArmCageEnv`. A free object 0.3 m from the base has
    0.27 to 0.30.

    **Start.** Arm straight, which may overlap the object; the object drawn evenly from the ring around the
    base, within 0.4 m and clear of the base, at any angle. Option of `reset`: "pose" (x, y, angle).

    **End.** Terminated after one step. Success: the object is enclosed and nothing overlaps by more than
    1e-6 m; see `PlanarArmCageEnv`. At 0.3 m from the base no posture is known that encloses an object of
    household size (study `franka-caging`); nearer to it some do.

    **Info.** is_success, enclosed, escape_time (s), caging (0.02 of it), min_distance, penetration,
    self_distance (m), q_r, pose. At reset they describe the straight arm, which counts as not enclosing.

    **Arguments.** geometry: "meshes", cross-sections of the robot's collision meshes, which the extra
    `franka` installs, or "capsules", which needs no extra. object: "water_jug" by default; "box" and
    "paper_pack" are the paper's others. Then those of `CageConfig` but the robot, `dtype` ("float64" or
    "float32"), `render_mode` and `renderer` ("drawing" or "mujoco").

    **Version history.** v0: first version.
    """

    def __init__(self, geometry: str = "meshes", object: str = OBJECT, **options: Any):
        super().__init__(robot_of(geometry), object=object, **options)


class FrankaCageVectorEnv(CageVectorEnv):
    """The VectorEnv of `FrankaCageEnv`.

    Args:
        num_envs: B.
        geometry: "meshes" or "capsules".
        object: row of the table of objects.
        options: the other arguments of `CageVectorEnv`.
    """

    def __init__(self, num_envs: int = 1, geometry: str = "meshes", object: str = OBJECT, **options: Any):
        super().__init__(robot_of(geometry), num_envs, object=object, **options)
