"""What the suite calls the paper's is the paper's: presets, budget, and the numbers of sections and
equations.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from evaluation.records import read_records
from evaluation.studies import STUDIES, paper
from evaluation.studies.budget import STUDY_PLANNER, YOUNGER
from evaluation.studies.common import SMOKE_PLANNER, StudyRun
from evaluation.studies.paper import PAPER_NOTES, PAPER_PLANNER, all_notes, paper_cases
from piec_envs.dynamics.contact_model import PAPER_MODEL, ContactModel
from piec_envs.env.config import EnvConfig
from piec_envs.model.task import PAPER_PRESETS, PRESETS, TASKS, CostWeights
from planners import CmaEsPlanner

# Appendix A.2.1 as it stands there, written out anew; the lines from "restarts" on are what it does
# not say.
BUDGET = {
    "iterations": 100,
    "population": 50,
    "via_points": 5,
    "moving_points": 5,
    "restarts": 1,
    "screening": 0,
    "survivors": 1,
    "robust_iterations": 0,
    "escape_field": "auto",
    "start": "rest",
    "sigma": 0.2,
    "escape_every": 5,
}
WITHOUT_EFFECT = {
    "arrive",
    "judge",
    "adversary",
    "robust_samples",
    "robust_disturbance",
    "robust_sigma",
    "robust_points",
    "robust_share",
    "robust_screening",
}
RESULTS = Path(__file__).resolve().parents[2] / "results"
PLANNING = [name for name, study in STUDIES.items() if hasattr(study.load(), "StudyRun")]


class Planned(Exception):
    """Carries the cases that a study was about to plan."""


def cases_of(name: str, monkeypatch, tmp_path):
    """All cases of a study as it is recorded, caught before the first is planned."""

    def caught(self, cases):
        raise Planned(cases)

    monkeypatch.setattr(StudyRun, "plan", caught)
    module = STUDIES[name].load()
    with pytest.raises(Planned) as found:
        module.run(module.Settings(), tmp_path / name, progress=False)
    return found.value.args[0]


@pytest.mark.parametrize("name", PLANNING)
def test_a_case_called_paper_has_the_papers_budget_and_nothing_of_its_study(
    name, monkeypatch, tmp_path
):
    older = {key: value for key, value in STUDY_PLANNER.items() if key not in YOUNGER}
    for case in cases_of(name, monkeypatch, tmp_path):
        preset = case.label.partition(", ")[2]
        planner = case.plan_work(0).spec["planner"]
        if preset not in PAPER_PRESETS:
            assert planner.get("preset", "default") == "default"
            continue
        own = {"objective": planner["objective"], "preset": preset}
        assert (
            planner == {**older, **{key: BUDGET[key] for key in older if key in BUDGET}, **own}
            and "moving_points" in YOUNGER
        )
        assert (
            case.env_kwargs["preset"] == preset
            and "weights" not in case.env_kwargs
            and not case.model
        )
        assert case.evaluation_work(0, "nominal", 1).spec["env_kwargs"]["preset"] == preset


@pytest.mark.parametrize("name", PLANNING)
def test_studies_ask_for_the_plans_that_are_recorded(name, monkeypatch, tmp_path):
    """Their budget is their own: another default of the planner asks for no other plan."""
    recorded = {record["key"] for record in read_records(RESULTS / name / "records.jsonl")}
    asked = {case.plan_work(0).key for case in cases_of(name, monkeypatch, tmp_path)}
    assert asked and asked <= recorded


def test_the_budget_of_studies_is_stated_in_full():
    assert set(STUDY_PLANNER) == {item.name for item in dataclasses.fields(CmaEsPlanner)}


@pytest.mark.parametrize(
    "name", ["objectives", "disturbance", "dynamics", "shape", "friction", "adversary"]
)
def test_all_modes_stand_beside_each_other_with_the_papers_budget(name, monkeypatch, tmp_path):
    labels = {case.label for case in cases_of(f"planar-{name}", monkeypatch, tmp_path)}
    for preset in PAPER_PRESETS:
        assert {f"{mode}, {preset}" for mode in ("contact", "proximity", "caging")} <= labels


@pytest.mark.parametrize("name", ["franka-push", "franka-fixed"])
def test_the_franka_has_both_presets(name, monkeypatch, tmp_path):
    labels = {case.label for case in cases_of(name, monkeypatch, tmp_path)}
    assert {
        f"{method}, {preset}" for method in ("WAContact", "WACaging") for preset in PAPER_PRESETS
    } <= labels


def test_every_number_of_the_budget_is_stated():
    assert PAPER_PLANNER == BUDGET
    named = {item.name for item in dataclasses.fields(CmaEsPlanner)}
    assert named == {*BUDGET, *WITHOUT_EFFECT, "objective", "preset"}
    assert CmaEsPlanner(**PAPER_PLANNER).rollouts == 100 * 50


def test_the_letter_has_the_papers_weights_and_nothing_else():
    # tracking: w_track = lambda w_cage, lambda = 100
    letter = {"push": (1e2, 1e3, 1e2), "track": (1e4, 1e3, 1e2)}
    for kind, weights in letter.items():
        found = PRESETS["paper"][kind]
        assert (found.task, found.command, found.prior) == weights
        assert (
            found.saturation == np.inf and found.miss == 0 and found.shortest == (kind == "track")
        )
        assert PRESETS["paper-miss"][kind] == found._replace(miss=CostWeights().miss)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("preset", PRESETS)
def test_the_papers_presets_have_its_contact_model(task, preset):
    model = EnvConfig(task=task, preset=preset, escape_field=None).contact_model
    assert model == (PAPER_MODEL if preset in PAPER_PRESETS else ContactModel())
    assert set(PAPER_PRESETS) == set(PRESETS) - {"default"}


def test_notes_say_what_the_papers_rows_are():
    assert all_notes("own", ()) == "own" and all_notes("own", ("caging",)).endswith(PAPER_NOTES)
    assert [case.label for case in paper_cases(["caging"], {})] == [
        "caging, paper",
        "caging, paper-miss",
    ]
    letter = PRESETS["paper"]["push"]
    assert f"100 d^2, is {letter.task * 0.5**2:g} at half a metre" in PAPER_NOTES
    assert f"caging term {letter.prior * 1.6:g} in a closed cage" in PAPER_NOTES
    assert f"1e{np.log10(PRESETS['paper-miss']['push'].miss):.0f} d2g" in PAPER_NOTES


def test_the_papers_plans_have_a_table_of_their_own_beside_the_studys(monkeypatch, tmp_path):
    monkeypatch.setattr(paper, "PAPER_PLANNER", {**BUDGET, **SMOKE_PLANNER})
    module = STUDIES["planar-shape"].load()
    settings = dataclasses.replace(
        module.Settings.smoke(), objectives=("contact",), paper=("contact",), starts=1
    )
    files = module.run(settings, tmp_path / "planar-shape", progress=False)
    assert tmp_path / "planar-shape" / "paper.md" in files
    text = (tmp_path / "planar-shape" / "paper.md").read_text()
    for preset in PAPER_PRESETS:
        # nominal and square, each from drawn starts as well
        assert text.count(f"| contact (mode 1), {preset} ") == 4
    assert PAPER_NOTES in text
    assert ", paper" not in (tmp_path / "planar-shape" / "table.md").read_text()
