"""A plan, its file, and the open-loop policy that executes it."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from piec_envs import (
    CONTROL_PERIOD,
    MEASURE_COLUMNS,
    ROBOTS,
    Model,
    PlanError,
    Setup,
    State,
    UnknownNameError,
    files,
    get_robot,
    make_setup,
    provenance,
)
from planners.made_for import disturbed_kwargs, model_kwargs, task_kwargs
from planners.observed import ObservationReader

FORMAT = "piec-plan-1"
DRAWN = ("start_noise", "randomize")  # keyword arguments by which a reset draws a start and a plant
SAME_START = 1e-6  # rad or m
_META_FIELDS = (
    "env_id",
    "robot",
    "joints",
    "horizon",
    "env_kwargs",
    "objective",
    "preset",
    "seed",
    "cost",
    "nominal",
)


@dataclass(frozen=True, eq=False)
class Plan:
    """A joint path to be executed open loop.

    Args:
        env_id: id of the environment it was planned for.
        robot: name of the robot.
        joints: names of its joints.
        horizon: steps of the task's episode.
        env_kwargs: keyword arguments of the nominal model, JSON-able.
        path: joint positions, shape (N + 1, n), rad or m; index 0 is the start.
        via_points: what the planner optimised, shape (points, n).
        objective: name of the objective.
        preset: name of the weights.
        seed: the planner's seed.
        cost: cost of executing the path under the nominal model.
        nominal: measures of that execution's last step, and cost terms added up over it.
        versions: versions of the engine.
    """

    env_id: str
    robot: str
    joints: tuple[str, ...]
    horizon: int
    env_kwargs: dict[str, Any]
    path: np.ndarray
    via_points: np.ndarray
    objective: str
    preset: str
    seed: int
    cost: float
    nominal: dict[str, float]
    versions: dict[str, str] = field(default_factory=provenance.versions)

    @property
    def task_kwargs(self) -> dict[str, Any]:
        """Keyword arguments of its robot, its start and its task, goal included."""
        return task_kwargs(self.env_kwargs)

    @property
    def model_kwargs(self) -> dict[str, Any]:
        """Keyword arguments of its task and its nominal model, of which nothing is drawn and
        nothing flees.
        """
        return model_kwargs(self.env_kwargs)

    @property
    def disturbed_kwargs(self) -> dict[str, Any]:
        """The same, and whatever was drawn, displaced or fled while it was planned."""
        return disturbed_kwargs(self.env_kwargs)

    def policy(self) -> OpenLoopPolicy:
        """The policy that executes it."""
        return OpenLoopPolicy(self)

    def save(self, path: str | os.PathLike) -> Path:
        """Write the plan as an npz file without pickle, under a temporary name first."""
        target = Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        meta = {name: getattr(self, name) for name in (*_META_FIELDS, "versions")}
        temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
        with open(temporary, "wb") as file:
            np.savez(
                file,
                format=FORMAT,
                meta=json.dumps(meta, sort_keys=True),
                path=self.path,
                via_points=self.via_points,
            )
        os.replace(temporary, target)
        return target

    @classmethod
    def load(cls, path: str | os.PathLike) -> Plan:
        """Read a plan file.

        Raises:
            PlanError: if the file is missing, truncated, or no plan.
        """
        try:
            with np.load(path, allow_pickle=False) as data:
                if str(data["format"]) != FORMAT:
                    raise PlanError(f"{path} has format {data['format']}, but {FORMAT} is needed")
                meta = json.loads(str(data["meta"]))
                arrays = {
                    name: np.array(data[name], dtype=float) for name in ("path", "via_points")
                }
            plan = cls(**{**meta, **arrays, "joints": tuple(meta["joints"])})
        except PlanError:
            raise
        except files.BROKEN_FILE as error:
            raise PlanError(files.why_unreadable(path, "plan file", error)) from error
        if (
            plan.path.ndim != 2
            or plan.path.shape[1] != len(plan.joints)
            or not np.isfinite(plan.path).all()
        ):
            raise PlanError(
                f"{path} has a path of shape {plan.path.shape} for {len(plan.joints)} joints"
            )
        return plan

    def check_env(self, env_id: str) -> None:
        """Refuse the id of an environment that this plan was not made for.

        Raises:
            PlanError: with both ids.
        """
        if env_id != self.env_id:
            raise PlanError(f"this plan is for {self.env_id!r}, not for {env_id!r}")

    def check_fits(self, env_id: str, robot_name: str, start: np.ndarray) -> None:
        """Refuse an environment that this plan was not made for.

        Args:
            env_id: its id.
            robot_name: its robot.
            start: where its arm starts, shape (n,), rad or m.

        Raises:
            PlanError: if the id, the robot, its joints or the start differ.
        """
        self.check_env(env_id)
        joints = tuple(joint.name for joint in get_robot(robot_name).joints)
        if (robot_name, joints) != (self.robot, self.joints):
            raise PlanError(
                f"this plan moves joints {list(self.joints)} of {self.robot!r}, not "
                f"{list(joints)} of {robot_name!r}"
            )
        if np.abs(start - self.path[0]).max() > SAME_START:
            raise PlanError(
                f"this plan starts at {np.round(self.path[0], 3).tolist()}, but the arm at "
                f"{np.round(start, 3).tolist()}; take the keyword argument `start` that it was "
                f"planned with"
            )


def nominal_start(
    env_id: str, env_kwargs: Mapping[str, Any], seed: int
) -> tuple[Model, State, Setup]:
    """The nominal model and the task's own start, of which nothing is drawn.

    Args:
        env_id: id of the environment.
        env_kwargs: its keyword arguments.
        seed: of the episode.

    Returns:
        The model, the start, and what the model is made of with all that `env_kwargs` draws.

    Raises:
        UnknownNameError: for an unknown name or keyword argument.
        InvalidParameterError: for a value outside its range.
    """
    setup = make_setup(env_id, **env_kwargs)
    model = Model(dataclasses.replace(setup, start_noise=(0.0, 0.0), randomize={}))
    return model, model.reset(seed), setup


def realised_plan(
    model: Model,
    start: State,
    path: np.ndarray,
    cost: Callable[[np.ndarray], np.ndarray] | None = None,
    **about: Any,
) -> Plan:
    """The plan that executes what a nominal rollout of a path realises.

    Args:
        model: the nominal one.
        start: one state.
        path: commanded joint positions, shape (N, n), rad or m.
        cost: of realised paths (B, N, n), shape (B,); None is the summed stage cost.
        about: the plan's other fields: env_id, env_kwargs, via_points, objective, preset and seed.

    Returns:
        The plan; its path is the realised one.
    """
    realised = model.rollout(start, path[None], absolute=True).motion.q_r  # (1, N + 1, n)
    rollout = model.rollout(start, realised[:, 1:], absolute=True)
    measured = {name: float(rollout.column(name)[0, -1]) for name in ("goal_distance", "d2g")}
    terms = {
        f"sum_{n}": float(rollout.column(n)[0, 1:].sum())
        for n in MEASURE_COLUMNS
        if n.startswith("cost_")
    }
    return Plan(
        robot=model.robot.name,
        joints=tuple(joint.name for joint in model.robot.joints),
        horizon=model.task.horizon,
        path=realised[0],
        cost=float((rollout.cost if cost is None else cost(realised[:, 1:]))[0]),
        nominal={**measured, **terms},
        **about,
    )


class OpenLoopPolicy:
    """Executes a plan: open loop in the object, absolute in the joints.

    A stalled joint is caught up, since each action aims at the path's next position from the
    commanded one, which stands in the observation.

    Args:
        plan: the plan.

    Raises:
        PlanError: if this is no plan, or one for an environment or a robot that does not exist.
    """

    def __init__(self, plan: Plan):
        if not isinstance(plan, Plan):
            raise PlanError(
                f"OpenLoopPolicy executes a Plan, of a planner or of Plan.load(file), got {plan!r}"
            )
        if plan.robot not in ROBOTS:
            raise PlanError(
                f"this plan is for robot {plan.robot!r}; known: {', '.join(sorted(ROBOTS))}"
            )
        try:
            self._reader = ObservationReader(plan.env_id, plan.env_kwargs, plan.horizon)
        except UnknownNameError as error:
            raise PlanError(f"no environment can be made for this plan: {error}") from error
        self.plan = plan
        # (n,) largest motion of a step
        self._step = CONTROL_PERIOD * get_robot(plan.robot).speed_limit

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[np.ndarray, Any]:
        """Actions for one observation or a batch, with Stable-Baselines3's signature.

        Args:
            observation: array or dict of arrays from the environment.
            state: passed through; the time stands in the observation.
            episode_start: not needed.
            deterministic: not needed.

        Returns:
            Actions in [-1, 1], shape (..., n), and `state`.

        Raises:
            InvalidObservationError: if this cannot be an observation of the plan's environment.
        """
        flat = self._reader.flat(observation)
        now = self._reader.step(flat)
        target = self.plan.path[np.minimum(now + 1, len(self.plan.path) - 1)]
        return np.clip((target - self._reader.command(flat)) / self._step, -1.0, 1.0), state
