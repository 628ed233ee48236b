"""One run of the planner by CMA-ES: searches on the nominal model, then iterations under noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cma
import numpy as np
from tqdm import tqdm

from piec_envs import Model, State, choose_field
from planners.base import Plan, realised_plan
from planners.carry import carried_base
from planners.cma_es_configuration import enclosing_posture
from planners.objectives import DIVERGENCE_WEIGHT, PathCost
from planners.strategy import make_strategy
from planners.via_points import ViaPointTrajectory

Found = tuple[float, np.ndarray]  # cost, and via points as they were asked for


@dataclass
class Search:
    """One run of the planner.

    Args:
        planner: the `CmaEsPlanner` with its settings.
        model: the nominal one.
        start: one state.
        samples: the start with the planner's own disturbances.
        seed: of all randomness.
    """

    planner: Any
    model: Model
    start: State
    samples: State
    seed: int

    def __post_init__(self):
        self.found: list[Found] = []  # of what the plan is chosen from
        self.begun: list[list[Found]] = []  # of each search, for every stage, as it goes
        self.iterations = 0
        self.trajectory = ViaPointTrajectory(self.planner.via_points, self.model.task.horizon)
        self.lower = self.model.robot.joint_array("lower")
        self.upper = self.model.robot.joint_array("upper")
        self.cost = PathCost(self.model, self.start)

    @property
    def tried(self) -> list[Found]:
        """The best of every search so far, that of a search in progress too."""
        return [pair for best in self.begun for pair in best if np.isfinite(pair[0])]

    def run(self, bar: tqdm) -> None:
        """Search on the nominal model, then polish the best results under noise.

        Args:
            bar: counts the iterations.
        """
        planner = self.planner
        free = planner.via_points if self.model.task.tracks else planner.moving_points
        searches = [
            self._strategy(self._first_guess(i)[:free], planner.sigma, i, planner.population)
            for i in range(planner.restarts)
        ]
        bar.update()
        found = self._iterate(searches, planner.screened, self.cost.nominal, bar)
        kept = _cheapest(found, planner.survivors)
        rest = planner.iterations - planner.screened
        best = self._iterate([searches[i] for i in kept], rest, self.cost.nominal, bar)
        self.found = [
            min(found[i], result, key=lambda pair: pair[0])
            for i, result in zip(kept, best, strict=True)
        ]
        if planner.robust_iterations:
            self._polish(bar)

    def _polish(self, bar: tqdm) -> None:
        """Move the first via points of the results on, with the arm at rest after them.

        An arm that has closed on the object does best to hold still, which a search over all via
        points takes long to find.
        """
        planner = self.planner
        via = np.array([self._limit(x)[: planner.robust_points] for _, x in self.found])
        few = self.samples.take(np.arange(planner.screening_samples))
        if planner.robust_screened:
            kept = list(range(len(via)))
        else:
            kept = _cheapest([(cost, via) for cost in self._final_cost(self._whole(via))], 1)
        searches = [
            self._strategy(
                via[i], planner.robust_sigma, planner.restarts + place, planner.robust_population
            )
            for place, i in enumerate(kept)
        ]
        if planner.robust_screened:
            found = self._iterate(
                searches, planner.robust_screened, lambda paths: self._judge(paths, few), bar
            )
            best = _cheapest(found, 1)[0]
            self.found.append(found[best])
            searches = [searches[best]]
        rest = planner.robust_iterations - planner.robust_screened
        self.found += [
            found for found in self._iterate(searches, rest, self._final_cost, bar) if len(found[1])
        ]

    def _judge(self, paths: np.ndarray, samples: State) -> np.ndarray:
        """Cost of commanded paths under noise."""
        if self.planner.judge == "commanded":
            return self.cost.disturbed(paths, samples)
        return self.cost.executed(self.cost.realised(paths), samples)

    def _final_cost(self, paths: np.ndarray) -> np.ndarray:
        """What commanded paths are chosen by in the end."""
        if self.planner.robust_iterations:
            return self._judge(paths, self.samples)
        return self.cost.nominal(paths)

    def _plan_cost(self, paths: np.ndarray) -> np.ndarray:
        """What plans, which are realised paths, are chosen by."""
        if self.planner.robust_iterations and self.planner.judge == "executed":
            return self.cost.executed(paths, self.samples)
        return self._final_cost(paths)

    def _iterate(
        self,
        strategies: Sequence[cma.CMAEvolutionStrategy],
        iterations: int,
        cost: Callable[[np.ndarray], np.ndarray],
        bar: tqdm,
    ) -> list[Found]:
        """Ask and tell all strategies in step; returns each one's best."""
        best: list[Found] = [(np.inf, np.zeros(0))] * len(strategies)
        self.begun.append(best)
        for _ in range(iterations):
            asked = [strategy.ask() for strategy in strategies]
            costs = cost(self._whole([x for candidates in asked for x in candidates]))
            parts = np.split(costs, len(strategies))
            for i, (strategy, candidates) in enumerate(zip(strategies, asked, strict=True)):
                strategy.tell(candidates, parts[i].tolist())
                least = int(np.argmin(parts[i]))
                if parts[i][least] < best[i][0]:
                    best[i] = (float(parts[i][least]), np.asarray(candidates[least]))
            self.iterations += 1
            bar.update()
            bar.set_postfix(cost=f"{min(cost for cost, _ in best):.4g}")
        return best

    def _strategy(
        self, via: np.ndarray, sigma: float, stream: int, population: int
    ) -> cma.CMAEvolutionStrategy:
        return make_strategy(via.ravel(), sigma, population, (self.seed, stream))

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

    def _whole(self, candidates) -> np.ndarray:
        """Commanded paths of candidates, shape (B, N, n)."""
        return self._paths(np.array([self._limit(x) for x in candidates]))

    def _paths(self, via: np.ndarray) -> np.ndarray:
        return np.clip(self.trajectory.path(self.start.q_r[0], via), self.lower, self.upper)

    def best_plan(self, env_id: str, nominal: dict[str, Any]) -> Plan:
        """Re-simulate the realised path of each result and keep the cheapest, of those that come
        home if any does.

        Args:
            env_id: id of the environment.
            nominal: keyword arguments of the nominal model.

        Returns:
            The plan.
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
            self._plan_cost,
            env_id=env_id,
            env_kwargs=nominal,
            via_points=via,
            objective=self.planner.objective,
            preset=self.planner.preset,
            seed=self.seed,
        )


def _cheapest(found: Sequence[Found], count: int) -> list[int]:
    """Which results cost least, in order."""
    return sorted(range(len(found)), key=lambda i: found[i][0])[:count]
