"""Planning against learning on nominal and mismatched plants.

Agents of reinforcement learning act on what they see (closed loop), or replay what they did on the
nominal model (open loop), as plans do. Planners and agents optimise the same stage cost, and are
executed under the same protocols from the same drawn starts. Needs the extra `rl`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.figures import learning_curves, success_matrix
from evaluation.jobs import run_recorded
from evaluation.studies.agent_work import LOOPS, AgentCase
from evaluation.studies.columns import executions
from evaluation.studies.common import DO, PLANNER_SEEDS, SMOKE_PLANNER, StudyRun, mode_cases
from evaluation.studies.rl_columns import agent_cost, means, plan_cost, success
from evaluation.tables import write_table

ROBUST = {
    "friction": [0.1, 0.9],
    "object": ["circle", "octagon", "hexagon", "square"],
    "disturbance": [0.0, 0.005],
}
# twice the weight, or under noise the object is held where the cage is tighter, beside the region
HOME = {"miss": 2e5}
TRAININGS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "PPO": ("ppo", {}),
    "PPO, no caging": ("ppo", {"prior": None}),
    "PPO, randomised": ("ppo", {"randomize": ROBUST, "weights": HOME}),
    "SAC": ("sac", {}),
    "SAC, no caging": ("sac", {"prior": None}),
}
PROTOCOLS: Mapping[str, str] = {
    "nominal-start": "nominal",
    "disturbance-1mm-start": "1 mm",
    "disturbance-3mm-start": "3 mm",
    "disturbance-5mm-start": "5 mm",
    "friction-0.20-start": "friction 0.2",
    "friction-0.80-start": "friction 0.8",
    "shape-square-start": "square",
    "dynamics-mujoco-start": "MuJoCo",
    "combined-start": "combined",
}
NOTES = """\
n counts distinct executions in each column: plans (or agents) x executions, from starts drawn
within 0.01 m and 0.05 rad. Success: mean over plans with a bootstrap over them, or Wilson's
interval within one agent, at 95 %. Millimetres: the object is displaced by this sigma for each axis
in every step of 0.1 s. Combined: MuJoCo, the square, friction 0.25 and 5 mm at once. Steps:
simulated control steps of 0.1 s that a plan or an agent took to obtain, and minutes the time,
means, on one core beside other jobs. Agents are the best of those evaluated during their training.
Closed: the agent sees the object once a second; open: the joint path of its nominal episode is
executed blindly, as a plan's. Planners and agents optimise the same stage cost; "no caging" leaves
its last term out, "randomised" draws friction (0.1 to 0.9), object (circle, octagon, hexagon,
square) and displacements (0 to 5 mm) in each episode of the training, and charges the distance to
the goal region at the end twice. Planners polish their plans under noise of their own."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        objectives: of the planner.
        trainings: label -> algorithm, and changes to the keyword arguments of the environment of
            the training.
        hyper: changes to the hyper-parameters that ship.
        protocols: plants, and what tables and figures call them.
        planner_seeds: one plan of each objective for each.
        agent_seeds: one agent of each training for each.
        starts: executions of each plan under each protocol.
        agent_starts: executions of each agent.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the environment.
    """

    objectives: tuple[str, ...] = ("contact", "proximity", "caging")
    trainings: Mapping[str, tuple[str, Mapping[str, Any]]] = field(
        default_factory=lambda: TRAININGS
    )
    hyper: Mapping[str, Any] = field(default_factory=dict)
    protocols: Mapping[str, str] = field(default_factory=lambda: PROTOCOLS)
    planner_seeds: tuple[int, ...] = PLANNER_SEEDS
    agent_seeds: tuple[int, ...] = (0,)
    starts: int = 20
    agent_starts: int = 100
    planner: Mapping[str, Any] = field(default_factory=dict)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(
            objectives=("caging",),
            trainings={"PPO": ("ppo", {"action_repeat": 100})},
            hyper={"n_envs": 4, "n_steps": 5, "batch_size": 20, "n_timesteps": 40},
            protocols={"nominal-start": "nominal"},
            planner_seeds=(0,),
            starts=2,
            agent_starts=2,
            planner=SMOKE_PLANNER,
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/rl-comparison; plans and agents are in folders beside it.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    plans = StudyRun(Path(out_dir), settings.planner_seeds, 1, jobs, progress, settings.starts)
    agents = StudyRun(Path(out_dir), settings.agent_seeds, 1, jobs, progress, settings.agent_starts)
    planned = mode_cases(settings.objectives, settings.planner, settings.env_kwargs)
    learned = [agent_case(settings, label, loop) for label in settings.trainings for loop in LOOPS]
    plans.plan(planned)
    trained = train_all(agents, [case for case in learned if case.loop == LOOPS[0]])
    costs = [plan_cost(plans, case) for case in planned]
    costs += [agent_cost(agents, case, trained[case.label]) for case in learned]
    results = {}
    for name in settings.protocols:
        executed = agents.evaluate(learned, name)  # type: ignore[arg-type]
        results[name] = [*plans.evaluate(planned, name), *executed]
    named = [{"method": case.title, "loop": "open"} for case in planned]
    named += [{"method": case.label, "loop": case.loop} for case in learned]
    rows = [
        {
            **name,
            "n": executions(next(iter(results.values()))[i]),
            **costs[i],
            **{title: success(results[key][i]) for key, title in settings.protocols.items()},
        }
        for i, name in enumerate(named)
    ]
    folder = Path(out_dir)
    return [
        *write_table(folder, rows, "Success of plans and agents", NOTES),
        *write_table(
            folder, means(named, results, settings.protocols, "d2g_mean"), D2G, NOTES, "d2g"
        ),
        *write_table(
            folder,
            means(named, results, settings.protocols, "mean_caging"),
            CAGING,
            NOTES,
            "caging",
        ),
        *_draw(plans, settings, named, results, trained),
    ]


D2G = "Distance to the goal region at the end, m"
CAGING = "Caging, mean over time"


def agent_case(settings: Settings, label: str, loop: str) -> AgentCase:
    """One training, executed closed or open loop.

    Args:
        settings: the knobs.
        label: of the training, a key of `settings.trainings`.
        loop: "closed" or "open".

    Returns:
        The case.
    """
    algo, changes = settings.trainings[label]
    return AgentCase(
        label, algo, loop, {**settings.env_kwargs, **changes}, settings.hyper, settings.env_kwargs
    )


def train_all(study: StudyRun, cases: Sequence[AgentCase]) -> dict[str, list[dict[str, Any]]]:
    """Train every agent with every seed.

    Args:
        study: the run.
        cases: one for each training.

    Returns:
        By label the results of `train_once`, one for each seed.
    """
    works = [case.train_work(seed) for case in cases for seed in study.seeds]
    label = "training" if study.progress else ""
    records = run_recorded(
        DO, works, study.out_dir / "records.jsonl", study.jobs, study.context, label
    )
    found = [record["result"] for record in records]
    count = len(study.seeds)
    return {case.label: found[i * count : (i + 1) * count] for i, case in enumerate(cases)}


def _draw(
    study: StudyRun,
    settings: Settings,
    named: Sequence[Mapping[str, Any]],
    results: Mapping[str, Any],
    trained: Any,
) -> list[Path]:
    """All success rates, and how the agents learned."""
    rates = np.array(
        [[success(results[key][i]).value for key in settings.protocols] for i in range(len(named))]
    )
    names = [f"{row['method']}, {row['loop']} loop" for row in named]
    lines = list(range(len(settings.objectives), len(named), len(LOOPS)))
    curves = {label: [result["curve"] for result in found] for label, found in trained.items()}
    repeat = agent_case(settings, next(iter(settings.trainings)), LOOPS[0]).action_repeat
    columns = list(settings.protocols.values())
    return study.draw(
        partial(success_matrix, rates, names, columns, study.out_dir / "success.png", lines),
        partial(learning_curves, curves, repeat, study.out_dir / "learning.png"),
    )
