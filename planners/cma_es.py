"""CMA-ES over via points, all restarts and candidates in one batched rollout (paper, appendix
A.2.1).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import cma
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
    choose_field,
    console,
)
from planners.base import Plan, nominal_start, realised_plan
from planners.carry import carried_base
from planners.cma_es_configuration import enclosing_posture
from planners.interrupted import PlanningInterrupted
from planners.objectives import DIVERGENCE_WEIGHT, Objective, PathCost, get_objective
from planners.strategy import NOISE_STREAM, make_strategy
from planners.via_points import ViaPointTrajectory

STARTS = ("rest", "enclose")
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
        sigma: first step size, rad or m.
        start: first guess: "rest" stays at the start configuration, "enclose" moves to a posture
            that encloses the object at the goal, curled one way and the other in turn where the
            limits allow; a base that slides carries the start posture there, or along the
            reference, instead.
        arrive: share of the horizon after which the first guess has reached that posture.
        escape_field: name of the field that the planner optimises, or its options with a "name";
            "auto" is the robot's best.
        escape_every: k: the field is evaluated on every k-th step of a rollout.
        robust_iterations: further iterations from the best result, with the task term averaged over
            ...
        robust_samples: ... this many disturbed rollouts of the planner's own.
        robust_disturbance: their sigma for each axis, m.
        robust_sigma: first step size of these iterations, rad or m.
        robust_points: via points that these iterations move; the arm rests from the last of them
            on.
    """

    objective: str = "caging"
    preset: str = "default"
    population: int = 50
    iterations: int = 100
    restarts: int = 6
    screening: int = 15
    survivors: int = 2
    via_points: int = 5
    sigma: float = 0.2
    start: str = "enclose"
    arrive: float = 0.6
    escape_field: str | Mapping[str, Any] = "auto"
    escape_every: int = 5
    robust_iterations: int = 40
    robust_samples: int = 8
    robust_disturbance: float = 0.005
    robust_sigma: float = 0.06
    robust_points: int = 3

    def __post_init__(self):
        get_objective(self.objective)
        check_name("start", self.start, STARTS)
        check_name("preset", self.preset, PRESETS)
        least = {"screening": 0, "robust_iterations": 0, "population": 2}
        for item in dataclasses.fields(self):
            if item.type == "int":
                as_count(item.name, getattr(self, item.name), least.get(item.name, 1))
        for name in ("sigma", "arrive", "robust_sigma", "robust_disturbance"):
            if not float(as_floats(name, getattr(self, name), (), InvalidParameterError)) > 0:
                raise InvalidParameterError(f"{name} must be above 0, got {getattr(self, name)}")
        if self.robust_points > self.via_points:
            raise InvalidParameterError(
                f"robust_points must be 1 to {self.via_points}, got {self.robust_points}"
            )

    @property
    def rollouts(self) -> int:
        """Trajectories that the searches simulate, disturbed ones included."""
        screening = min(self.screening, self.iterations) if self.restarts > self.survivors else 0
        kept = min(self.survivors, self.restarts) * (self.iterations - screening)
        nominal = self.restarts * screening + kept
        return self.population * (nominal + self.robust_iterations * (1 + self.robust_samples))

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
        search = _Search(self, model, start, disturbed_samples(drawn, self, seed), seed)
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
        own = {"prior": objective.prior, "preset": self.preset, "adversary": objective.adversary}
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


@dataclass
class _Search:
    """One run of the planner."""

    planner: CmaEsPlanner
    model: Model
    start: State
    samples: State
    seed: int
    # (cost, via points) per restart
    found: list[tuple[float, np.ndarray]] = field(default_factory=list)
    # the same of every stage, as it goes
    begun: list[list[tuple[float, np.ndarray]]] = field(default_factory=list)
    iterations: int = 0

    def __post_init__(self):
        self.trajectory = ViaPointTrajectory(self.planner.via_points, self.model.task.horizon)
        self.lower = self.model.robot.joint_array("lower")
        self.upper = self.model.robot.joint_array("upper")
        self.cost = PathCost(self.model, self.start)

    @property
    def tried(self) -> list[tuple[float, np.ndarray]]:
        """The best of every search so far, that of a search in progress too."""
        return [pair for best in self.begun for pair in best if np.isfinite(pair[0])]

    def run(self, bar: tqdm) -> None:
        """Search on the nominal model, then polish the best result under noise."""
        planner = self.planner
        searches = [
            self._strategy(self._first_guess(i), planner.sigma, i) for i in range(planner.restarts)
        ]
        bar.update()
        screening = (
            min(planner.screening, planner.iterations)
            if planner.restarts > planner.survivors
            else 0
        )
        found = self._iterate(searches, screening, self.cost.nominal, bar)
        kept = sorted(range(len(searches)), key=lambda i: found[i][0])[: planner.survivors]
        best = self._iterate(
            [searches[i] for i in kept], planner.iterations - screening, self.cost.nominal, bar
        )
        self.found = [
            min(found[i], result, key=lambda pair: pair[0])
            for i, result in zip(kept, best, strict=True)
        ]
        if planner.robust_iterations:
            self._polish(bar)

    def _polish(self, bar: tqdm) -> None:
        """Move the first via points of the best result on, with the arm at rest after them.

        An arm that has closed on the object does best to hold still, which a search over all via
        points takes long to find.
        """
        planner = self.planner
        free = self.planner.robust_points
        via = np.array([self._limit(x)[:free] for _, x in self.found])
        costs = self._final_cost(self._paths(np.array([self._limit(x) for x in via])))
        search = self._strategy(via[int(np.argmin(costs))], planner.robust_sigma, planner.restarts)
        self.found += self._iterate([search], planner.robust_iterations, self._final_cost, bar)

    def _final_cost(self, paths: np.ndarray) -> np.ndarray:
        """What the best plan is chosen by."""
        if self.planner.robust_iterations:
            return self.cost.disturbed(paths, self.samples)
        return self.cost.nominal(paths)

    def _iterate(self, strategies, iterations: int, cost, bar: tqdm) -> list:
        """Ask and tell all strategies in step; returns each one's best (cost, via points)."""
        best: list[tuple[float, np.ndarray]] = [(np.inf, np.zeros(0))] * len(strategies)
        self.begun.append(best)
        size = self.planner.population
        for _ in range(iterations):
            asked = [strategy.ask() for strategy in strategies]
            via = np.array([self._limit(x) for candidates in asked for x in candidates])
            costs = cost(self._paths(via))
            for i, (strategy, candidates) in enumerate(zip(strategies, asked, strict=True)):
                values = costs[i * size : (i + 1) * size]
                strategy.tell(candidates, values.tolist())
                least = int(np.argmin(values))
                if values[least] < best[i][0]:
                    best[i] = (float(values[least]), np.asarray(candidates[least]))
            self.iterations += 1
            bar.update()
            bar.set_postfix(cost=f"{min(cost for cost, _ in best):.4g}")
        return best

    def _strategy(self, via: np.ndarray, sigma: float, stream: int) -> cma.CMAEvolutionStrategy:
        return make_strategy(via.ravel(), sigma, self.planner.population, (self.seed, stream))

    def _first_guess(self, restart: int) -> np.ndarray:
        """Via points to start from, shape (points, n)."""
        home = self.start.q_r[0]
        points = self.planner.via_points
        if self.planner.start == "rest":
            return np.repeat(home[None], points, axis=0)
        # (points,)
        base = self.model.robot.base_dof
        share = np.linspace(0, 1, points + 1)[1:]
        if base:
            via = np.repeat(home[None], points, axis=0)
            via[:, :base] += carried_base(
                self.model.task, self.start.pose[0, :2], share, self.planner.arrive
            )
            return via
        escape = self.model.field or choose_field(self.planner.escape_field, self.model.robot.name)
        pose = np.append(self.model.task.goal, self.start.pose[0, 2])
        sides = self.model.robot.curl_sides()[::-1]  # left first
        curl = sides[restart % len(sides)]
        posture = enclosing_posture(self.model.setup, escape, pose, (self.seed, restart), curl)
        return home + np.minimum(1.0, share[:, None] / self.planner.arrive) * (posture - home)

    def _limit(self, x) -> np.ndarray:
        """Candidate as via points within the joint limits; the arm rests after the last one given.

        Returns:
            Shape (points, n).
        """
        via = np.clip(np.asarray(x).reshape(-1, len(self.lower)), self.lower, self.upper)
        return np.concatenate(
            [via, np.repeat(via[-1:], self.planner.via_points - len(via), axis=0)]
        )

    def _paths(self, via: np.ndarray) -> np.ndarray:
        return np.clip(self.trajectory.path(self.start.q_r[0], via), self.lower, self.upper)

    def best_plan(self, env_id: str, nominal: dict[str, Any]) -> Plan:
        """Re-simulate the realised path of each result and keep the cheapest, of those that come
        home if any does.
        """
        plans = [self._make_plan(env_id, nominal, self._limit(x)) for _, x in self.found]
        return min(
            plans,
            key=lambda plan: (plan.nominal["d2g"] > 0 or plan.cost >= DIVERGENCE_WEIGHT, plan.cost),
        )

    def _make_plan(self, env_id: str, nominal: dict[str, Any], via: np.ndarray) -> Plan:
        return realised_plan(
            self.model,
            self.start,
            self._paths(via[None])[0],
            self._final_cost,
            env_id=env_id,
            env_kwargs=nominal,
            via_points=via,
            objective=self.planner.objective,
            preset=self.planner.preset,
            seed=self.seed,
        )


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
