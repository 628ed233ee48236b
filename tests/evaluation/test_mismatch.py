"""What the studies of other plants compare with what, and what their tables say."""

from __future__ import annotations

import numpy as np
import pytest

from evaluation import evaluate
from evaluation.jobs import Context
from evaluation.metrics import max_deviation
from evaluation.studies import work
from evaluation.studies.common import SMOKE_PLANNER, Case, StudyRun
from evaluation.studies.mismatch import (
    evaluate_all,
    mismatch_columns,
    notes,
    shortfalls,
    success_rate,
    with_starts,
)
from evaluation.tables import cell
from planners import OpenLoopPolicy

PUSH = "piec_envs/PlanarArmPush-v0"
NO_FIELD = {"escape_field": None}
SEED = 2
EPISODES = 3


@pytest.fixture
def once(sweep_plan, tmp_path, monkeypatch):
    """Evaluate the sweeping plan once under a protocol, as studies do."""
    monkeypatch.setattr(work, "get_plan", lambda spec, seed, context: sweep_plan)

    def run(protocol: str) -> dict:
        plan = work.plan_spec(PUSH, NO_FIELD, {"objective": "contact"})
        spec = work.evaluation_spec(plan, NO_FIELD, protocol, EPISODES)
        return work.evaluate_once(spec, SEED, Context(folder=str(tmp_path)))

    return run


@pytest.fixture
def executed(sweep_plan):
    """Execute the sweeping plan under a protocol with the seeds of studies."""
    return lambda protocol: evaluate(
        OpenLoopPolicy(sweep_plan), PUSH, protocol, EPISODES, 1000 * SEED, NO_FIELD
    )


def result(n=1, rate=1.0, twin_n=1, **changes) -> dict:
    base = {
        "n": n,
        "success_rate": rate,
        "d2g_mean": 0.0,
        "deviation": 0.1,
        "final_deviation": 0.01,
        "diverged": 0,
    }
    twin = {"unperturbed_n": twin_n, "unperturbed_success_rate": 1.0, "unperturbed_d2g": 0.0}
    return {**base, **twin, **changes}


def test_drawn_starts_are_compared_row_by_row_with_the_same_starts(once, executed):
    perturbed = executed("friction-0.00-start")
    twin = executed("nominal-start")
    assert np.array_equal(perturbed.pose[:, 0], twin.pose[:, 0])
    # (EPISODES, N + 1)
    offset = np.hypot(*np.moveaxis(perturbed.pose[..., :2] - twin.pose[..., :2], -1, 0))
    found = once("friction-0.00-start")
    assert found["deviation"] == pytest.approx(offset.max(axis=1).mean())
    assert found["final_deviation"] == pytest.approx(offset[:, -1].mean())
    assert found["n"] == found["unperturbed_n"] == EPISODES
    assert found["unperturbed_d2g"] == pytest.approx(twin.d2g.mean())
    assert found["unperturbed_success_rate"] == twin.success.mean()


def test_noise_is_compared_with_the_one_nominal_execution(once, executed):
    nominal = executed("nominal")
    deviation = max_deviation(executed("disturbance-5mm").pose, nominal.pose[0])
    found = once("disturbance-5mm")
    assert (found["n"], found["unperturbed_n"]) == (EPISODES, 1)
    assert (
        found["deviation"] == pytest.approx(deviation.mean())
        and found["unperturbed_d2g"] == nominal.d2g[0]
    )


def test_drawn_starts_alone_are_compared_with_the_tasks_start(once, executed):
    deviation = max_deviation(executed("nominal-start").pose, executed("nominal").pose[0])
    assert once("nominal-start")["deviation"] == pytest.approx(deviation.mean())


@pytest.mark.parametrize("protocol", ["nominal", "friction-0.50", "friction-0.50-start"])
def test_what_changes_nothing_deviates_by_nothing(once, protocol):
    found = once(protocol)
    assert found["deviation"] == found["final_deviation"] == 0
    assert found["success_rate"] == found["unperturbed_success_rate"] and found["diverged"] == 0


def test_starts_are_drawn_less_often_than_noise(tmp_path):
    study = StudyRun(tmp_path / "study", (0,), episodes=3, progress=False, starts=2)
    case = Case("contact", {**SMOKE_PLANNER, "objective": "contact"}, NO_FIELD)
    study.plan([case])
    found = evaluate_all(study, [case], ["friction-0.00", "disturbance-1mm"])
    assert list(found) == with_starts(["friction-0.00", "disturbance-1mm"])
    assert [by_case[0][0]["n"] for by_case in found.values()] == [1, 2, 3, 2]


def test_one_execution_of_each_plan_has_wilsons_interval():
    single = [result() for _ in range(5)]
    several = [result(n=20, rate=rate) for rate in (1.0, 0.5)]
    assert cell(success_rate(single)) == "100 [57, 100] %"
    assert cell(success_rate(several)) == "75 [50, 100] %"
    assert cell(success_rate(several, "unperturbed_")) == "100 [34, 100] %"


def test_rows_stand_beside_their_twin():
    results = [
        result(n=20, rate=rate, twin_n=20, diverged=k, deviation=k / 10)
        for k, rate in enumerate((1.0, 0.9))
    ]
    cells = {name: cell(value) for name, value in mismatch_columns(results).items()}
    assert cells["n"] == cells["unperturbed n"] == "2 x 20" and cells["diverged"] == "1"
    assert cells["success"] == "95 [90, 100] %" and cells["each plan"] == "100, 90 %"
    assert (
        cells["deviation, m"] == "0.050 [0.000, 0.100]"
        and cells["unperturbed success"] == "100 [100, 100] %"
    )


def test_notes_say_where_caging_falls_short():
    cases = [Case("contact", {}), Case("caging", {})]
    bad = [result(rate=0.8), result(rate=0.9)]
    good = [result(rate=0.9), result(rate=1.0)]
    found = {"combined": [good, bad], "shape-square": [bad, good]}
    assert (
        shortfalls(cases, found)
        == "Where caging falls short of 90 %: `combined` (85 %, least plan 80 %)."
    )
    assert "nowhere" in shortfalls(cases, {"shape-square": [bad, good]})
    assert shortfalls(cases[:1], {"combined": [bad]}) == ""
    assert notes(cases, found, "Before.").startswith("Before.") and "`combined` (85 %" in notes(
        cases, found
    )
