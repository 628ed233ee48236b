"""The scene's MuJoCo model with lights, sky and a base column, for pictures alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from piec_envs.world.objects import get_object

if TYPE_CHECKING:
    from piec_envs.world.objects import Object
    from piec_envs.world.robots import Robot

HIDDEN = (0.0, 0.0, 0.0, 0.0)
COLUMN = (0.20, 0.23, 0.29, 1.0)
BACKGROUND = (0.80, 0.84, 0.89)
# where each stands, m, and how bright it is
LIGHTS = (((-1.6, 0.9, 2.8), 0.42), ((1.2, -1.4, 2.6), 0.22))


def lit_model(robot: Robot, object_name: str, size: int) -> Any:
    """A model to be drawn.

    Args:
        robot: the robot.
        object_name: row of the table of objects.
        size: height and width of a frame, pixels.

    Returns:
        The compiled `mujoco.MjModel`.
    """
    from piec_envs.dynamics.mjcf import build_spec

    item = get_object(object_name)
    spec = build_spec(robot, item, friction=1.0)
    for geom in spec.geoms:
        if geom.name == "table":
            geom.rgba = HIDDEN  # without end; the workspace is drawn as a round one
    if not any(link.frame == robot.base_dof for link in robot.scenery):
        _add_column(spec, robot, item)
    _add_lights(spec)
    spec.stat.center = [0, 0, 0]
    spec.stat.extent = 1.5 * robot.workspace_radius
    _set_quality(spec.visual, size)
    # over the extent; beyond it shadows turn to noise
    spec.visual.map.shadowclip = 2.5 if robot.base_dof else 1.0
    return spec.compile()


def _add_column(spec: Any, robot: Robot, item: Object) -> None:
    """What a robot without a base of its own stands on."""
    import mujoco

    base = spec.body(robot.joints[robot.base_dof - 1].name if robot.base_dof else "base")
    base.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[0.07, 0.6 * item.height, 0],
        pos=[0, 0, 0.1 * item.height],
        rgba=COLUMN,
        contype=0,
        conaffinity=0,
        mass=0,
    )


def _add_lights(spec: Any) -> None:
    """Lights that cast shadows, and an even sky."""
    import mujoco

    for position, shade in LIGHTS:
        spec.worldbody.add_light(
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            pos=position,
            dir=[-c for c in position],
            diffuse=3 * [shade],
            specular=3 * [0.12],
            castshadow=True,
        )
    spec.add_texture(
        name="background",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=BACKGROUND,
        rgb2=BACKGROUND,
        width=64,
        height=384,
    )


def _set_quality(visual: Any, size: int) -> None:
    """How finely frames of `size` pixels are drawn, and how bright the light is from everywhere."""
    visual.global_.offwidth = visual.global_.offheight = size
    visual.headlight.ambient = 3 * [0.38]
    visual.headlight.diffuse = 3 * [0.08]
    visual.headlight.specular = 3 * [0.0]
    visual.quality.shadowsize = 4096
    visual.quality.offsamples = 8
    visual.quality.numslices = 64
