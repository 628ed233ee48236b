from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from evaluation.records import read_records
from evaluation.studies import STUDIES, get_study
from evaluation.studies.columns import distance_columns, success_columns
from evaluation.studies.common import Case, StudyRun
from evaluation.studies.mismatch import with_starts
from evaluation.studies.work import plan_file
from evaluation.tables import cell
from piec_envs.env.registry import MOTIONS
from piec_envs.errors import UnknownNameError
from planners import Plan

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = {name: study.load().Settings() for name, study in STUDIES.items()}
PLANNED = [name for name in SETTINGS if name.startswith("planar-") and name != "planar-caging"]
RUN = "import sys; from evaluation.cli import main; sys.exit(main(sys.argv[1:]))"


def outcome(folder: Path) -> list[dict]:
    """Records without what differs from run to run."""
    kept = ("key", "spec", "seed", "result")
    return [
        {name: record[name] for name in kept} for record in read_records(folder / "records.jsonl")
    ]


LEARNED = "rl-comparison"  # needs the extra `rl`


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    """A whole smoke run of every study that needs no learning, in the order of the table."""
    folder = tmp_path_factory.mktemp("results")
    for name in STUDIES:
        if name == LEARNED:
            continue
        module = get_study(name).load()
        for path in module.run(module.Settings.smoke(), folder / name, progress=False):
            assert path.stat().st_size > 0 and path.parent == folder / name
    return folder


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_leaves_records_table_and_figures(results, name):
    if name == LEARNED:
        module = get_study(name).load()
        module.run(module.Settings.smoke(), results / name, progress=False)
    folder = results / name
    assert STUDIES[name].description
    assert {"records.jsonl", "table.md", "table.csv"} <= {path.name for path in folder.iterdir()}
    assert list(folder.glob("*.png")) and "| n " in (folder / "table.md").read_text()


@pytest.mark.parametrize("name", PLANNED)
def test_a_study_of_plans_leaves_them_and_says_what_n_is(results, name):
    folder = results / name
    assert len(list((folder / "plans").glob("*.npz"))) == 2
    assert "n counts distinct executions" in (folder / "table.md").read_text()


def test_what_the_planning_model_draws_is_not_drawn_by_the_plant():
    drawn = {"randomize": {"friction": [0.2, 0.8]}}
    case, plain = (
        Case("drawn", {"objective": "contact"}, {"object": "square"}, model=model)
        for model in (drawn, {})
    )
    spec = case.evaluation_work(0, "nominal", 1).spec
    assert spec["plan"]["env_kwargs"] == {"object": "square", **drawn} and spec["env_kwargs"] == {
        "object": "square"
    }
    assert case.plan_work(0).key != plain.plan_work(0).key


def test_studies_share_plans(results):
    plans = [Plan.load(path) for path in (results / "plans").iterdir()]
    kinds = {
        env_id: sorted(plan.objective for plan in plans if plan.env_id == env_id)
        for env_id in MOTIONS
    }
    assert kinds["piec_envs/PlanarArmPush-v0"] == ["adversarial", "caging", "contact"]
    assert kinds["piec_envs/PlanarArmTrack-v0"] == [] and 3 <= len(plans) == sum(
        map(len, kinds.values())
    )
    planned = [
        (plan.env_id, plan.objective, plan.preset, str(sorted(plan.env_kwargs.items())))
        for plan in plans
    ]
    # never a copy, and sim-to-real takes that of franka-fixed
    assert len(planned) == len(set(planned))
    for name in PLANNED:
        for path in (results / name / "plans").iterdir():
            assert path.read_bytes() == (results / "plans" / path.name).read_bytes()


def test_the_annulus_is_a_cage_behind_a_hard_wall_alone(results):
    hard, leaky = (record["result"] for record in outcome(results / "eikonal-toy"))
    assert hard["star"] == hard["star_exact"] == np.inf and hard["misjudged"] == 0
    assert hard["area"] == pytest.approx(hard["area_exact"], rel=0.02)
    assert leaky["star"] == pytest.approx(leaky["star_exact"], rel=0.25) and leaky["area"] == 0
    for result in (hard, leaky):
        assert result["hidden"] > 10 and result["error_median"] < 0.02
        np.testing.assert_allclose(result["points"], result["points_exact"], rtol=0.03)


@pytest.mark.parametrize(
    "name", ["planar-friction", "planar-shape", "planar-dynamics", "planar-robustness"]
)
def test_studies_of_other_plants_stand_beside_the_unperturbed(results, name):
    with open(results / name / "table.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    protocols = {row["protocol"] for row in rows}
    assert protocols == set(
        with_starts([name for name in protocols if not name.endswith("-start")])
    )
    assert len(rows) == 2 * len(protocols)  # contact and caging
    for row in rows:
        assert all(
            row[column]
            for column in ("n", "success low", "deviation, m high", "unperturbed success")
        )
        if (
            row["protocol"].startswith(("nominal", "friction-0.50"))
            and row["protocol"] != "nominal-start"
        ):
            assert float(row["deviation, m"]) == 0
    assert "Where caging falls short" in (results / name / "table.md").read_text()


def test_the_planned_shape_is_measured(results):
    with open(results / "planar-shape" / "shapes.csv", newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert (row["planned"], row["true"]) == ("circle", "square")
    assert float(row["contact displacement, mm"]) == pytest.approx(31.066, abs=1e-3)
    assert float(row["normal error, deg"]) == pytest.approx(45, abs=0.01)


def test_two_workers_do_the_same_as_one(results, tmp_path):
    module = get_study("planar-objectives").load()
    alone = results / "planar-objectives"
    together = tmp_path / "planar-objectives"
    module.run(module.Settings.smoke(), together, jobs=2, progress=False)
    for name in ("table.md", "table.csv", "keyframes.png"):
        assert (together / name).read_bytes() == (alone / name).read_bytes()
    by_key = [{record["key"]: record for record in outcome(folder)} for folder in (alone, together)]
    assert by_key[0] == by_key[1]


def test_a_killed_study_resumes_without_losing_or_repeating_a_record(results, tmp_path):
    folder = tmp_path / "planar-adversary"
    records = folder / "records.jsonl"
    arguments = [
        sys.executable,
        "-c",
        RUN,
        "reproduce",
        "planar-adversary",
        "--smoke",
        "--out",
        str(tmp_path),
    ]
    process = subprocess.Popen(
        arguments, cwd=ROOT, env={**os.environ, "TQDM_DISABLE": "1"}, stdout=subprocess.DEVNULL
    )
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and (
        not records.exists() or records.read_bytes().count(b"\n") < 4
    ):
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = read_records(records)
    assert 4 <= len(before) < 8
    with open(records, "ab") as file:
        file.write(b'{"format":"piec-record-1","key":"cut o')
    module = get_study("planar-adversary").load()
    module.run(module.Settings.smoke(), folder, progress=False)
    assert read_records(records)[: len(before)] == before
    assert outcome(folder) == outcome(results / "planar-adversary")
    for name in ("table.csv", "usage.csv", "final_distance.png"):
        assert (folder / name).read_bytes() == (results / "planar-adversary" / name).read_bytes()


def test_lost_files_are_made_again(results, tmp_path):
    module = get_study("planar-disturbance").load()
    run = StudyRun(tmp_path / "study", (0,), episodes=2, progress=False)
    case = Case("contact", {**module.Settings.smoke().planner, "objective": "contact"})
    (first,) = run.evaluate([case], "disturbance-5mm")
    work = case.plan_work(0)
    file = plan_file(tmp_path, work.spec, 0)
    saved = np.load(file)["path"]
    file.write_bytes(b"broken")
    for path in (tmp_path / "rollouts").iterdir():
        path.unlink()
    assert run.evaluate([case], "disturbance-5mm") == [first]
    again = run.load_evaluation(case, 0, "disturbance-5mm")
    assert again.goal_distance[:, -1].mean() == first[0]["goal_distance_mean"]
    assert np.array_equal(np.load(file)["path"], saved)


def test_a_specs_key_changes_with_the_planner_and_not_with_its_name():
    case = Case("contact", {"objective": "contact"})
    full = Case("any name", {"objective": "contact", "population": 50})
    other = Case("contact", {"objective": "contact", "population": 51})
    assert case.plan_work(0).key == full.plan_work(0).key
    assert len({case.plan_work(0).key, case.plan_work(1).key, other.plan_work(0).key}) == 3


def test_columns_state_n_and_all_plans():
    results = [
        {
            "n": 100,
            "successes": k,
            "success_rate": k / 100,
            "d2g_mean": 0.0,
            "d2g_std": 0.0,
            "deviation": 0.1,
        }
        | {"goal_distance_mean": k / 1000, "goal_distance_std": 0.0}
        for k in (100, 90, 95)
    ]
    cells = {name: cell(value) for name, value in success_columns(results).items()}
    assert cells["n"] == "3 x 100" and cells["plans"] == "3"
    assert cells["first plan"] == "100 [96, 100] %"
    assert cells["each plan"] == "100, 90, 95 %" and cells["least"] == "90 %"
    assert cells["mean over plans"].startswith("95 [90, ")
    assert cell(distance_columns(results)["goal distance, m"]) == "0.095 ± 0.004"


def test_an_unknown_study_lists_the_known_ones():
    with pytest.raises(UnknownNameError, match="planar-disturbance"):
        get_study("planar-disturbances")
