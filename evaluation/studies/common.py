"""What studies share: cases, the run that plans and evaluates them with records, and rows of
tables.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tqdm import tqdm

from evaluation.figures.modes import mode_of
from evaluation.jobs import Context, Work, run_recorded
from evaluation.outcome import Evaluation
from evaluation.protocols import get_protocol
from evaluation.studies import PUSH
from evaluation.studies.work import (
    drawn_evaluation,
    evaluation_spec,
    get_plan,
    plan_file,
    plan_spec,
)
from piec_envs import console
from planners import Plan

PLANNER_SEEDS = (0, 1, 2, 3, 4)
DRAWN_STARTS = 20
SMOKE_PLANNER = {
    "iterations": 2,
    "population": 4,
    "restarts": 1,
    "start": "rest",
    "robust_iterations": 0,
}
DO = "evaluation.studies.work:do"


@dataclass(frozen=True)
class Case:
    """One planner, and the env that it plans for and that its plans are executed in.

    Args:
        label: what tables and figures call it.
        planner: arguments of `CmaEsPlanner`.
        env_kwargs: keyword arguments of the nominal model and of the plant; protocols change the
            plant.
        env_id: id of the environment.
        model: keyword arguments of the nominal model alone.
    """

    label: str
    planner: Mapping[str, Any]
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)
    env_id: str = PUSH
    model: Mapping[str, Any] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """The label as tables show it."""
        name, comma, rest = self.label.partition(", ")
        return mode_of(name).label + comma + rest

    def plan_work(self, seed: int) -> Work:
        """Planning with one seed."""
        spec = plan_spec(self.env_id, {**self.env_kwargs, **self.model}, self.planner)
        return Work(spec, seed, f"{self.label}, seed {seed}")

    def evaluation_work(self, seed: int, protocol: str, episodes: int) -> Work:
        """Evaluating the plan of one seed under a protocol.

        Args:
            seed: the planner's.
            protocol: its name.
            episodes: how many.

        Returns:
            The piece of work.
        """
        spec = evaluation_spec(self.plan_work(seed).spec, self.env_kwargs, protocol, episodes)
        return Work(spec, seed, f"{self.label}, seed {seed}, {protocol}")


def mode_cases(
    objectives: Sequence[str], planner: Mapping[str, Any], env_kwargs: Mapping[str, Any]
) -> list[Case]:
    """One case for each objective; all else is the same.

    Args:
        objectives: rows of the table of objectives, which also label the cases.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the nominal model and of the plant.

    Returns:
        The cases.
    """
    return [Case(name, {**planner, "objective": name}, env_kwargs) for name in objectives]


@dataclass(frozen=True)
class StudyRun:
    """One run of a study; everything done stands in its record file, so that it can be resumed.

    Args:
        out_dir: the study's folder.
        seeds: the planner's seeds.
        episodes: rollouts of each plan under each random protocol.
        jobs: workers, or an executor.
        progress: whether to show progress.
        starts: rollouts of each plan under each protocol that draws the start.
        cache: folder with the plans that studies share; None takes the one above `out_dir`.
    """

    out_dir: Path
    seeds: Sequence[int]
    episodes: int
    jobs: Any = 1
    progress: bool = True
    starts: int = DRAWN_STARTS
    cache: Path | None = None

    @property
    def context(self) -> Context:
        """What the pieces of work are told."""
        return Context(folder=str(self.cache or self.out_dir.parent), progress=self.progress)

    def plan(self, cases: Sequence[Case]) -> list[list[dict[str, Any]]]:
        """Plan with every seed; copies of the plans are left in the study's own folder.

        Returns:
            For each case the results of `plan_once`, one for each seed.
        """
        works = [case.plan_work(seed) for case in cases for seed in self.seeds]
        results = self._run(works, "planning")
        (self.out_dir / "plans").mkdir(parents=True, exist_ok=True)
        for work in works:
            get_plan(work.spec, work.seed, self.context)  # made again if the cache was emptied
            source = plan_file(self.context.folder, work.spec, work.seed)
            target = self.out_dir / "plans" / source.name
            if source != target:
                shutil.copyfile(source, target)
        return self._by_case(results)

    def evaluate(self, cases: Sequence[Case], protocol: str) -> list[list[dict[str, Any]]]:
        """Evaluate every plan under a protocol.

        Args:
            cases: whose plans.
            protocol: its name.

        Returns:
            For each case the results of `evaluate_once`, one for each seed.
        """
        works = [self._evaluation(case, seed, protocol) for case in cases for seed in self.seeds]
        return self._by_case(self._run(works, f"evaluating, {protocol}"))

    def load_plan(self, case: Case, seed: int) -> Plan:
        """The plan of one seed.

        Args:
            case: whose plan.
            seed: the planner's.

        Returns:
            The plan, made again if it is missing.
        """
        return get_plan(case.plan_work(seed).spec, seed, self.context)

    def load_evaluation(self, case: Case, seed: int, protocol: str) -> Evaluation:
        """What the plan of one seed did, for figures.

        Args:
            case: whose plan.
            seed: the planner's.
            protocol: its name.

        Returns:
            The evaluation, with the states that its file keeps.
        """
        work = self._evaluation(case, seed, protocol)
        return drawn_evaluation(work.spec, seed, self.context)

    def _evaluation(self, case: Case, seed: int, protocol: str) -> Work:
        drawn = get_protocol(protocol).start_noise is not None
        return case.evaluation_work(seed, protocol, self.starts if drawn else self.episodes)

    def draw(self, *drawings: Callable[[], Path]) -> list[Path]:
        """Make figures one after the other; returns their files."""
        return [
            draw()
            for draw in tqdm(
                drawings, "drawing", disable=console.no_bar(self.progress), leave=False, delay=0.5
            )
        ]

    def _run(self, works: list[Work], label: str) -> list[dict[str, Any]]:
        file = self.out_dir / "records.jsonl"
        records = run_recorded(
            DO, works, file, self.jobs, self.context, label if self.progress else ""
        )
        return [record["result"] for record in records]

    def _by_case(self, results: list[dict[str, Any]]) -> list[list[dict[str, Any]]]:
        n = len(self.seeds)
        return [results[lo : lo + n] for lo in range(0, len(results), n)]
