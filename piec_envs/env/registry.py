"""The table of environments, and their registration with Gymnasium; loads nothing that is slow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gymnasium as gym

from piec_envs.errors import InvalidParameterError, PiecError, UnknownNameError, check_name
from piec_envs.model.task import TASKS, Task

MAKERS = "piec_envs.env.makers"


@dataclass(frozen=True, eq=False)
class Entry:
    """One row of the table of environments.

    Args:
        env_id: its id.
        robot: row of the table of robots; of a Panda the one with all its parts.
        summary: the task in a sentence.
        tasks: rows of the table of tasks, of which the keyword argument `reference` takes one where
            there are several; none for static caging, which ends with its first step.
        object: of static caging, where no argument says otherwise.
    """

    env_id: str
    robot: str
    summary: str
    tasks: tuple[Task, ...] = ()
    object: str = ""

    @property
    def motion(self) -> bool:
        """Whether an episode is a motion; static caging ends with its first step."""
        return bool(self.tasks)

    @property
    def render_fps(self) -> int:
        """Pictures of a second."""
        return 10 if self.motion else 1

    @property
    def name(self) -> str:
        """The id without its namespace and version, such as PlanarArmPush."""
        return self.env_id.partition("/")[2].partition("-")[0]

    @property
    def base(self) -> str:
        """Of a Panda, "fixed" or "mobile"; else ""."""
        from piec_envs.world.robots.franka import FRANKA_BASES  # not with the package itself

        return {robot: base for base, robot in FRANKA_BASES.items()}.get(self.robot, "")

    @property
    def choices(self) -> dict[str, str]:
        """Keyword arguments that choose the robot or the task, with their defaults."""
        chosen: dict[str, str] = {}
        if self.base and self.motion:
            chosen["contact"] = "whole_arm"
        if self.base:
            chosen["geometry"] = "meshes"
        if len(self.tasks) > 1:
            chosen["reference"] = self.tasks[0].side
        return chosen


_CAGES = (
    Entry(
        "piec_envs/PlanarArmCage-v0",
        "planar_arm",
        "Enclose an object near the base with the whole planar 4-DOF arm, as a static problem "
        "(paper section 4.5).",
        object="three_discs",
    ),
    Entry(
        "piec_envs/FrankaCage-v0",
        "franka",
        "Enclose an everyday object with the whole arm of a Franka Panda on a fixed base (paper "
        "section 7.1).",
        object="water_jug",
    ),
)


def _entries() -> dict[str, Entry]:
    """One row for each id that a task names, and those of static caging."""
    tasks: dict[str, list[Task]] = {}
    for task in TASKS.values():
        tasks.setdefault(task.env_id, []).append(task)
    motion = [
        Entry(env_id, rows[0].robot, rows[0].summary, tuple(rows)) for env_id, rows in tasks.items()
    ]
    return {entry.env_id: entry for entry in (*motion, *_CAGES)}


ENVS = _entries()
MOTIONS = tuple(env_id for env_id, entry in ENVS.items() if entry.motion)  # what plans are made for


class NoMotionError(UnknownNameError):
    """The id of an environment of static caging where one of motion is needed.

    Args:
        env_id: the id given.
    """

    def __init__(self, env_id: str):
        self._given = (env_id,)
        PiecError.__init__(
            self,
            f"{env_id!r} is static caging: an episode is one posture, so that there is no motion "
            f"to plan, to train "
            f"or to execute. Environments of motion: {', '.join(MOTIONS)}. Postures are searched "
            f"for by "
            "planners.CmaEsConfiguration, SqpConfiguration and ExhaustiveConfiguration",
        )


def check_motion(env_id: Any) -> None:
    """Refuse what is not the id of an environment of motion.

    Args:
        env_id: the id given; anything.

    Raises:
        InvalidParameterError: for an environment object instead of an id.
        UnknownNameError: for an unknown id, or one of static caging.
    """
    if isinstance(env_id, gym.Env | gym.vector.VectorEnv):
        made = env_id.spec
        own = f"; pass {made.id!r} and its keyword arguments" if made is not None else ""
        raise InvalidParameterError(
            f"an environment is named by its id, such as {MOTIONS[0]!r}, but an environment "
            f"object was given: "
            f"{type(env_id.unwrapped).__name__}{own}"
        )
    motions = [name for name, entry in ENVS.items() if entry.motion]
    if isinstance(env_id, str) and env_id in ENVS and env_id not in motions:
        raise NoMotionError(env_id)
    check_name("environment", env_id, motions)


def register_envs() -> None:
    """Register every row of the table; rows that are registered already stay as they are.

    Gymnasium's own limit on the steps is not set: what an environment truncates at, its horizon
    over `action_repeat`, only the environment knows, and writes it into its spec.
    """
    for env_id, entry in ENVS.items():
        if env_id not in gym.registry:
            gym.register(
                env_id, f"{MAKERS}:{entry.name}", vector_entry_point=f"{MAKERS}:{entry.name}Vector"
            )


def register_task(task: Task) -> None:
    """Add a task to its table, and the environment that it names to Gymnasium's; for tasks of one's
    own.

    Args:
        task: its `env_id` is free, or that of a task with another `side`.

    Raises:
        InvalidParameterError: if its name or its id is taken, or the id has no namespace and
            version.
    """
    namespace, _, name = task.env_id.partition("/")
    if not namespace or "-v" not in name:
        raise InvalidParameterError(f"env_id is namespace/Name-v0, got {task.env_id!r}")
    if task.name in TASKS or (task.env_id in gym.registry and not task.side):
        raise InvalidParameterError(
            f"the task {task.name!r} or the environment {task.env_id!r} is there already"
        )
    TASKS[task.name] = task
    ENVS.update({env_id: entry for env_id, entry in _entries().items() if env_id == task.env_id})
    register_envs()
