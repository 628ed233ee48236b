"""Tasks and their stage cost: what planners minimise and, with its sign turned, the reward."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from piec_envs.errors import InvalidParameterError, check_name

# steps of an episode, and of those until a reference has reached its end
HORIZON = 1000
ARRIVAL = 900
REWARD_SCALE = 1e-3  # reward = -REWARD_SCALE * stage cost, of order 1 per step
GOAL_RADIUS = 0.05  # m
ARC = 2 * np.pi / 3  # rad, of the references of the mobile Franka
TRACKING_TOLERANCE = 0.03  # m, on the mean tracking error of a successful episode
PAPER_REFERENCE_POINTS = 50  # the paper's presets track the nearest of this many points

PRIORS = ("caging", "contact", "proximity")


class CostWeights(NamedTuple):
    """Weights of the stage cost w_task c_task + w_command |u|^2 + w_prior c_prior; the last step
    adds w_miss d2g.

    Args:
        task: weight of the task term (squared distance to the goal, or distance to the reference).
        command: weight of the squared joint velocity in rad/s or m/s.
        prior: weight of the contact prior or of minus the caging.
        saturation: caging above this value pays a tenth.
        shortest: whether tracking takes the distance to the nearest point of the reference, as the
            paper does, instead of to the point of this time.
        miss: weight of the distance to the goal region at the end of an episode.
    """

    task: float = 2e3
    command: float = 1e3
    prior: float = 1e2
    saturation: float = 1.0
    shortest: bool = False
    miss: float = 1e5


# The paper's weights to the letter (appendix A.2.1): nothing is added for where an episode ends. It
# writes w_track = lambda w_cage; lambda = 100 here.
_LETTER = {
    "push": CostWeights(task=1e2, command=1e3, prior=1e2, saturation=np.inf, miss=0.0),
    "track": CostWeights(
        task=1e4, command=1e3, prior=1e2, saturation=np.inf, shortest=True, miss=0.0
    ),
}
# For each preset, the weights of each kind of task.
PRESETS = {
    "default": {"push": CostWeights(), "track": CostWeights(task=1e4)},
    "paper": _LETTER,
    "paper-miss": {
        kind: weights._replace(miss=CostWeights().miss) for kind, weights in _LETTER.items()
    },
}
PAPER_PRESETS = ("paper", "paper-miss")  # with the paper's rigid contact and unlimited lead


def check_weight(name: str, value: Any) -> None:
    """Refuse what cannot be a weight of the stage cost.

    Args:
        name: a field of `CostWeights`.
        value: the value given.

    Raises:
        InvalidParameterError: unless it is a truth value for "shortest", a finite number of at
            least 0 for the others, or infinity for "saturation".
    """
    if name == "shortest":
        if not isinstance(value, bool):
            raise InvalidParameterError(f"weights['shortest'] must be True or False, got {value!r}")
        return
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and (0 <= value < np.inf or (name == "saturation" and value == np.inf))):
        raise InvalidParameterError(
            f"weights[{name!r}] must be a finite number of at least 0, got {value!r}"
        )


@dataclass(frozen=True, eq=False)
class Task:
    """A manipulation task.

    Args:
        name: its key in the table of tasks.
        robot: name of the robot that it is made for; the same robot with other shapes can do it,
            too.
        object: name of the object.
        start: object pose at the start, shape (3,), m and rad.
        goal: centre of the goal region, shape (2,), m.
        horizon: steps of an episode.
        reference: the object's reference position at each step, shape (horizon + 1, 2), m;
            no rows where the task only has a goal.
        env_id: id of the environment whose task it is.
        side: what the keyword argument `reference` of that environment calls it, where several
            tasks share the id.
        summary: the task in a sentence.
    """

    name: str
    robot: str
    object: str
    start: np.ndarray
    goal: np.ndarray
    horizon: int = HORIZON
    reference: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    env_id: str = ""
    side: str = ""
    summary: str = ""

    @property
    def tracks(self) -> bool:
        """Whether the object is to be moved along a reference."""
        return len(self.reference) > 0

    @property
    def kind(self) -> str:
        """Whether the object is to be moved along a reference ("track") or to a goal alone
        ("push").
        """
        return "track" if self.tracks else "push"


PLANAR_ARM = Task(
    name="planar_arm_push",
    robot="planar_arm",
    object="circle",
    start=np.array([0.55, 0.25, 0.0]),
    goal=np.array([-0.3, 0.4]),
    env_id="piec_envs/PlanarArmPush-v0",
    summary="Push an object into a goal region with the whole planar 4-DOF arm (paper section "
    "5.4).",
)
MOBILE = Task(
    name="mobile_franka_push",
    robot="mobile_franka",
    object="circle_119",
    start=np.array([0.35, 0.1, 0.0]),
    goal=np.array([0.2, -0.4]),
    env_id="piec_envs/MobileFrankaPush-v0",
    summary="Push an object into a goal region with a Franka Panda on a mobile base (paper "
    "section 7.2).",
)
FIXED = Task(
    name="franka_push",
    robot="franka",
    object="paper_pack",
    start=np.array([0.4, 0.2, np.pi / 2]),
    goal=np.array([0.2, -0.2]),
    env_id="piec_envs/FrankaPush-v0",
    summary="Push a pack of paper rolls into a goal region with a Franka Panda on a fixed base "
    "(paper section 7.3).",
)


def planar_arm_track() -> Task:
    """Move the object of the planar arm around the base, its angle and its distance growing evenly
    in time.
    """
    (x, y, _) = PLANAR_ARM.start
    goal = PLANAR_ARM.goal
    share = np.minimum(np.arange(HORIZON + 1) / ARRIVAL, 1.0)  # (horizon + 1,)
    angle = np.interp(share, [0, 1], [np.arctan2(y, x), np.arctan2(*goal[::-1])])
    radius = np.interp(share, [0, 1], [np.hypot(x, y), np.hypot(*goal)])
    # (horizon + 1, 2)
    reference = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return replace(
        PLANAR_ARM,
        name="planar_arm_track",
        reference=reference,
        env_id="piec_envs/PlanarArmTrack-v0",
        summary="Move an object along an arc around the base, in time, with the whole planar "
        "4-DOF arm.",
    )


def mobile_franka_track(side: str) -> Task:
    """Move the object of the mobile Franka along an arc of a circle, at constant speed.

    Args:
        side: "left" or "right" of the straight line, seen with x to the right.
    """
    start = MOBILE.start[:2]
    goal = MOBILE.goal
    middle = (start + goal) / 2
    half = (goal - start) / 2
    sign = 1.0 if side == "right" else -1.0
    bulge = np.array([-half[1], half[0]])  # to the right, as long as half the line
    centre = middle - sign * bulge / np.tan(ARC / 2)
    angle = sign * ARC * np.minimum(np.arange(HORIZON + 1) / ARRIVAL, 1.0)
    c = np.cos(angle)
    s = np.sin(angle)
    (x, y) = start - centre
    # (horizon + 1, 2) clockwise to the right
    turned = np.column_stack([c * x + s * y, c * y - s * x])
    return replace(
        MOBILE,
        name=f"mobile_franka_track_{side}",
        reference=centre + turned,
        env_id="piec_envs/MobileFrankaTrack-v0",
        side=side,
        summary="Move an object along an arc, in time, with a Franka Panda on a mobile base "
        "(paper section 7.2.2).",
    )


TASKS = {
    task.name: task
    for task in (
        PLANAR_ARM,
        planar_arm_track(),
        MOBILE,
        mobile_franka_track("right"),
        mobile_franka_track("left"),
        FIXED,
    )
}


def get_task(name: str) -> Task:
    """The task of that name.

    Raises:
        UnknownNameError: if the table has no such row.
    """
    check_name("task", name, TASKS)
    return TASKS[name]
