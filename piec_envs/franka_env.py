"""Environments of the Franka Panda, which moves joints 1, 4 and 6 in the plane of its shoulder."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from piec_envs.cage_env import CageEnv, CageVectorEnv
from piec_envs.env import MotionEnv, make_config
from piec_envs.episodes.config import EnvConfig
from piec_envs.errors import check_name
from piec_envs.vector_env import MotionVectorEnv
from piec_envs.world.robots.franka import franka_name

OBJECT = "water_jug"
SIDES = ("right", "left")


def configure(base: str, task: str, options: Mapping[str, Any], *others: str) -> EnvConfig:
    """Validate keyword arguments of an environment of motion.

    Args:
        base: "fixed" or "mobile".
        task: row of the table of tasks.
        options: the keyword arguments, among them contact and geometry.
        others: names of keyword arguments that have been taken from `options`.

    Raises:
        UnknownArgumentError: for a keyword that does not exist.
    """
    rest = dict(options)
    contact, geometry = rest.pop("contact", "whole_arm"), rest.pop("geometry", "meshes")
    return make_config(task, rest, franka_name(base, contact, geometry), ("contact", "geometry", *others))


def mobile_push(options: Mapping[str, Any]) -> EnvConfig:
    """The configuration of `MobileFrankaPushEnv`."""
    return configure("mobile", "mobile_franka_push", options)


def mobile_track(options: Mapping[str, Any]) -> EnvConfig:
    """The configuration of `MobileFrankaTrackEnv`."""
    rest = dict(options)
    side = rest.pop("reference", "right")
    check_name("reference", side, SIDES)
    return configure("mobile", f"mobile_franka_track_{side}", rest, "reference")


def fixed_push(options: Mapping[str, Any]) -> EnvConfig:
    """The configuration of `FrankaPushEnv`."""
    return configure("fixed", "franka_push", options)


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

    own_arguments = ("geometry",)

    def __init__(self, geometry: str = "meshes", object: str = OBJECT, **options: Any):
        super().__init__(franka_name("fixed", "whole_arm", geometry), object=object, **options)


class FrankaCageVectorEnv(CageVectorEnv):
    """The VectorEnv of `FrankaCageEnv`.

    Args:
        num_envs: B.
        geometry: "meshes" or "capsules".
        object: row of the table of objects.
        options: the other arguments of `CageVectorEnv`.
    """

    own_arguments = ("geometry",)

    def __init__(self, num_envs: int = 1, geometry: str = "meshes", object: str = OBJECT, **options: Any):
        super().__init__(franka_name("fixed", "whole_arm", geometry), num_envs, object=object, **options)


class MobileFrankaPushEnv(MotionEnv):
    """Push an object into a goal region with a Franka Panda on a mobile base (paper section 7.2).

    The base slides and takes part in no contact; joints 1, 4 and 6 move the arm in the plane z = 0.333 m,
    as in `FrankaCageEnv`. All is as in `PlanarArmPushEnv` but the following.

    **Action.** Box(-1, 1, (5,)): commanded velocities of the base along x and y over 0.05 m/s and of q1, q4
    and q6 over 0.05 rad/s. The base stays within 2 m of the origin along each axis, the joints within the
    limits of the real robot; commands lead by at most 0.01 m and 0.01 rad.

    **Observation.** Box(23,): cos q, sin q of the joints (3 each); q_r and q_cmd over the limits, base first
    (5 each); object x, y from the base (m), cos and sin of its angle; goal minus object (m); step over 1000.

    **Start.** The object, `circle_119` (radius 0.119 m), at (0.35, 0.1) m; the arm in `start`: "cage", the
    posture that holds the object longest with the parts that can touch it; for the whole arm also "open",
    elbow and wrist at right angles, so that it touches the object and does not close around it; "home",
    straight at the origin, which may overlap the object; or five joint positions. Study `franka-starts`
    states and solves the static problems.

    **End.** Success: d2g = 0 at the last step: the object's centre is within 0.05 m of the goal (0.2, -0.4).

    **Arguments.** contact: which parts touch the object: "whole_arm", "link" (last link and gripper) or
    "point" (a sphere of radius 0.03 m at the fingertips); the others are only drawn, and the escape field is
    that of the parts that touch. geometry: "meshes", cross-sections of the robot's collision meshes, which
    the extra `franka` installs, or "capsules", which needs no extra. Then those of `EnvConfig`, `dtype`,
    `render_mode` and `renderer`.

    **Version history.** v0: first version.
    """

    def __init__(self, **options: Any):
        super().__init__(mobile_push, **options)


class MobileFrankaTrackEnv(MotionEnv):
    """Move an object along an arc, in time, with a Franka Panda on a mobile base (paper section 7.2.2).

    Everything is as in `MobileFrankaPushEnv` but the following.

    **Observation.** Box(25,): before the time stands the reference of the next step minus the object.

    **Reward.** The task term is the distance to the reference point of this time (with the paper's presets to
    the nearest of 50 points of the reference).

    **Task.** The reference is an arc of 120 degrees between start and goal to the right of the straight line
    (towards +x) or, with `reference="left"`, to its left; it ends after 900 steps at constant speed.

    **End.** As in `MobileFrankaPushEnv`. Success: d2g = 0 at the last step and a mean tracking error of at
    most 0.03 m over the episode.

    **Info.** Also tracking_error and mean_tracking_error, m.

    **Version history.** v0: first version.
    """

    def __init__(self, **options: Any):
        super().__init__(mobile_track, **options)


class FrankaPushEnv(MotionEnv):
    """Push a pack of paper rolls into a goal region with a Franka Panda on a fixed base (paper section 7.3).

    Everything is as in `MobileFrankaPushEnv` but the following.

    **Action.** Box(-1, 1, (3,)): commanded velocities of q1, q4 and q6 over 0.05 rad/s.

    **Observation.** Box(19,): there is no base; object x, y are from the origin.

    **Start.** The object, `paper_pack` (2 x 3 discs), at (0.4, 0.2) m, turned by 90 degrees.

    **End.** Success: d2g = 0 at the last step: the object's centre is within 0.05 m of the goal (0.2, -0.2).

    **Version history.** v0: first version.
    """

    def __init__(self, **options: Any):
        super().__init__(fixed_push, **options)


class MobileFrankaPushVectorEnv(MotionVectorEnv):
    """The VectorEnv of `MobileFrankaPushEnv`.

    Args:
        num_envs: B.
        options: the other arguments of `MotionVectorEnv`.
    """

    def __init__(self, num_envs: int = 1, **options: Any):
        super().__init__(mobile_push, num_envs, **options)


class MobileFrankaTrackVectorEnv(MotionVectorEnv):
    """The VectorEnv of `MobileFrankaTrackEnv`.

    Args:
        num_envs: B.
        options: the other arguments of `MotionVectorEnv`.
    """

    def __init__(self, num_envs: int = 1, **options: Any):
        super().__init__(mobile_track, num_envs, **options)


class FrankaPushVectorEnv(MotionVectorEnv):
    """The VectorEnv of `FrankaPushEnv`.

    Args:
        num_envs: B.
        options: the other arguments of `MotionVectorEnv`.
    """

    def __init__(self, num_envs: int = 1, **options: Any):
        super().__init__(fixed_push, num_envs, **options)
