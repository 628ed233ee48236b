"""CMA-ES over via points, all restarts and candidates in one batched rollout (paper, appendix
A.2.1).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from piec_envs import (
    PRESETS,
    InvalidParameterError,
    Model,
    Setup,
    State,
    as_count,
    as_floats,
    check_motion,
    check_name,
    console,
)
from planners.base import Plan, nominal_start
from planners.interrupted import PlanningInterrupted
from planners.objectives import Objective, get_objective
from planners.search import Search
from planners.strategy import NOISE_STREAM

STARTS = ("rest", "enclose")
JUDGES = ("executed", "commanded")
# the budget of `CmaEsPlanner.quick`: a quarter of the rollouts
QUICK: Mapping[str, Any] = {
    "iterations": 30,
    "restarts": 2,
    "robust_iterations": 5,
    "robust_samples": 4,
    "robust_share": 1.0,
    "robust_screening": 0,
}
DECIDED = ("prior", "preset", "adversary")  # keyword arguments that follow from the planner's own


@dataclass(frozen=True)
class CmaEsPlanner:
    """Plans a joint path by CMA-ES over via points.

    Args:
        objective: row of the table of objectives.
        preset: "default", "paper" or "paper-miss": weights of the stage cost and the contact model.
        population: trajectories in each iteration of one search.
        iterations: iterations of a search on the nominal model.
        restarts: searches that begin side by side; the best plan is taken.
        screening: iterations after which only ...
        survivors: ... this many of the searches go on.
        via_points: number of via points.
        moving_points: via points that the searches move in a push; the arm rests from the last of
            them on.
        sigma: first step size, rad or m.
        start: first guess: "rest" stays at the start configuration, "enclose" moves to a posture
            that encloses the object at the goal, curled one way and the other in turn where the
            limits allow; a base that slides carries the start posture there, or along the
            reference, instead.
        arrive: share of the horizon after which the first guess has reached that posture.
        adversary: speed at which the nominal object flees, as a share of u_bar; None takes the
            objective's.
        escape_field: name of the field that the planner optimises, or its options with a "name";
            "auto" is the robot's best.
        escape_every: k: the field is evaluated on every k-th step of a rollout.
        robust_iterations: further iterations from the best results, with the task term averaged
            over ...
        robust_samples: ... this many disturbed rollouts of the planner's own.
        robust_disturbance: their sigma for each axis, m.
        robust_sigma: first step size of these iterations, rad or m.
        robust_points: via points that these iterations move; the arm rests from the last of them
            on.
        robust_share: their population, as a share of `population`.
        robust_screening: as many of them, with a quarter of the samples, go on from all survivors
            side by side; the best of these has the others to itself. 0 goes on from the best
            survivor alone.
        judge: what is judged under noise: the path that a candidate realises, "executed" as the
            plan will be, or the nominal run of the path as "commanded".
    """

    objective: str = "caging"
    preset: str = "default"
    population: int = 50
    iterations: int = 30
    restarts: int = 6
    screening: int = 10
    survivors: int = 3
    via_points: int = 5
    moving_points: int = 3
    sigma: float = 0.2
    start: str = "enclose"
    arrive: float = 0.6
    adversary: float | None = None
    escape_field: str | Mapping[str, Any] = "auto"
    escape_every: int = 5
    robust_iterations: int = 28
    robust_samples: int = 16
    robust_disturbance: float = 0.005
    robust_sigma: float = 0.06
    robust_points: int = 3
    robust_share: float = 0.5
    robust_screening: int = 10
    judge: str = "executed"

    def __post_init__(self):
        get_objective(self.objective)
        check_name("start", self.start, STARTS)
        check_name("preset", self.preset, PRESETS)
        check_name("judge", self.judge, JUDGES)
        least = {"screening": 0, "robust_iterations": 0, "robust_screening": 0, "population": 2}
        for item in dataclasses.fields(self):
            if item.type == "int":
                as_count(item.name, getattr(self, item.name), least.get(item.name, 1))
        for name in ("sigma", "arrive", "robust_sigma", "robust_disturbance", "robust_share"):
            if not float(as_floats(name, getattr(self, name), (), InvalidParameterError)) > 0:
                raise InvalidParameterError(f"{name} must be above 0, got {getattr(self, name)}")
        self._check_adversary()
        for name in ("moving_points", "robust_points"):
            if getattr(self, name) > self.via_points:
                raise InvalidParameterError(
                    f"{name} must be 1 to {self.via_points}, got {getattr(self, name)}"
                )

    def _check_adversary(self) -> None:
        if self.adversary is None:
            return
        share = float(as_floats("adversary", self.adversary, (), InvalidParameterError))
        if share < 0 or (share > 0 and not get_objective(self.objective).escape_field):
            raise InvalidParameterError(
                f"adversary must be at least 0, and 0 where the objective computes no escape time; "
                f"got {share:g} with objective {self.objective!r}"
            )

    @classmethod
    def quick(cls, **changes: Any) -> CmaEsPlanner:
        """The planner with a small budget, for a first look.

        Args:
            changes: of its settings.

        Returns:
            The planner.
        """
        return cls(**{**QUICK, **changes})

    @property
    def screened(self) -> int:
        """Iterations that all searches make."""
        return min(self.screening, self.iterations) if self.restarts > self.survivors else 0

    @property
    def robust_screened(self) -> int:
        """Robust iterations that all survivors make."""
        return min(self.robust_screening, self.robust_iterations)

    @property
    def screening_samples(self) -> int:
        """Disturbed rollouts of a candidate in these."""
        return max(1, self.robust_samples // 4)

    @property
    def robust_population(self) -> int:
        """Trajectories in each robust iteration of one search."""
        return max(2, round(self.robust_share * self.population))

    @property
    def rollouts(self) -> int:
        """Trajectories that the searches simulate, disturbed ones included."""
        kept = min(self.survivors, self.restarts)
        nominal = self.restarts * self.screened + kept * (self.iterations - self.screened)
        each = 2 if self.judge == "executed" else 1  # nominal rollouts of a candidate under noise
        robust = kept * self.robust_screened * (each + self.screening_samples)
        robust += (self.robust_iterations - self.robust_screened) * (each + self.robust_samples)
        return self.population * nominal + self.robust_population * robust

    def plan(self, env_id: str, seed: int = 0, progress: bool = True, **env_kwargs: Any) -> Plan:
        """Plan for an environment.

        Args:
            env_id: id of the environment.
            seed: of all randomness.
            progress: whether to show a progress bar.
            env_kwargs: keyword arguments of the nominal model, but for those that the objective and
                the preset decide; the planner never sees the plant. What `start_noise` and
                `randomize` say is drawn for each disturbed rollout, and leaves the nominal one as
                it is.

        Returns:
            The best plan by re-simulated cost.

        Raises:
            UnknownNameError: for an unknown environment or keyword argument.
            InvalidParameterError: for a value outside its range.
            PlanningInterrupted: on Ctrl-C, with the best plan so far, once there is one.
        """
        check_motion(env_id)
        as_count("seed", seed, least=0)
        nominal = self._nominal_kwargs(env_kwargs)
        model, start, drawn = nominal_start(env_id, nominal, seed)
        nominal["escape_field"] = model.setup.escape_field  # by name, not as "auto"
        search = Search(self, model, start, disturbed_samples(drawn, self, seed), seed)
        total = self.iterations + self.robust_iterations + 1
        with tqdm(
            total=total,
            desc=f"planning {self.objective}",
            disable=console.no_bar(progress),
            leave=False,
        ) as bar:
            try:
                search.run(bar)
            except KeyboardInterrupt as interrupt:
                search.found = search.tried
                if search.found:
                    plan = search.best_plan(env_id, nominal)
                    raise PlanningInterrupted(plan, search.iterations, total - 1) from interrupt
                raise
        return search.best_plan(env_id, nominal)

    def _nominal_kwargs(self, env_kwargs: dict[str, Any]) -> dict[str, Any]:
        """Keyword arguments of the nominal model with this objective."""
        objective: Objective = get_objective(self.objective)
        own: dict[str, Any] = {"prior": objective.prior, "preset": self.preset}
        own["adversary"] = objective.adversary if self.adversary is None else self.adversary
        if objective.escape_field:
            own["escape_field"] = self.escape_field
            own["escape_every"] = self.escape_every
        else:
            own["escape_field"] = None
        drawn = env_kwargs.get("randomize")
        if isinstance(drawn, Mapping) and "adversary" in drawn:
            raise InvalidParameterError(
                "'adversary' follows from the planner's objective, so that it cannot be drawn"
            )
        for name in DECIDED:
            if name in env_kwargs and env_kwargs[name] != own[name]:
                raise InvalidParameterError(
                    f"{name!r} follows from the planner's objective and preset: {own[name]!r}, "
                    f"not {env_kwargs[name]!r}"
                )
        return {**own, **env_kwargs}


def disturbed_samples(setup: Setup, planner: CmaEsPlanner, seed: int) -> State:
    """Starts under the planner's own disturbances, the same for every objective.

    Args:
        setup: of the nominal model; what its `start_noise` and `randomize` say is drawn for each
            sample.
        planner: gives the number of samples and the disturbance.
        seed: of their random numbers.

    Returns:
        One state for each sample.
    """
    plant = setup.plant.replace({"disturbance": planner.robust_disturbance, "adversary": 0.0})
    disturbed = Model(dataclasses.replace(setup, plant=plant, escape_field=None, prior=-1))
    seeds = np.random.default_rng([NOISE_STREAM, seed]).integers(2**62, size=planner.robust_samples)
    return disturbed.begin(seeds.tolist(), plant)
