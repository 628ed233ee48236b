"""`piec bench --soak`: every id, dynamics and object is stepped, and a run goes on where its record
ends.
"""

from __future__ import annotations

import json

import pytest

from evaluation.bench import soak
from evaluation.bench.soak import Cell, make_cells, run_cell, run_soak
from evaluation.commands.bench import SOAK_STEPS
from piec_envs.dynamics.by_row import DYNAMICS
from piec_envs.env.registry import ENVS
from piec_envs.world.objects import OBJECTS

PUSH = "piec_envs/PlanarArmPush-v0"
SMALL = [
    Cell(PUSH, "quasi_dynamic", "square", "paper", 60),
    Cell(PUSH, "mujoco", "a4_box_roll_1", "default", 8),
    Cell("piec_envs/PlanarArmCage-v0", "static", "circle", "default", 2),
]


def test_the_cells_cover_all_ids_dynamics_and_objects():
    cells = make_cells(SOAK_STEPS)
    assert {cell.env_id for cell in cells} == set(ENVS)
    assert {cell.dynamics for cell in cells} == {*DYNAMICS, "static"}
    assert {cell.object for cell in cells} == set(OBJECTS)
    total = sum(cell.steps for cell in cells)
    assert total == pytest.approx(SOAK_STEPS, rel=0.01)
    mujoco = sum(cell.steps for cell in cells if cell.dynamics == "mujoco")
    assert 0.02 < mujoco / total < 0.05


@pytest.mark.parametrize("cell", SMALL, ids=lambda cell: cell.dynamics)
def test_a_cell_counts_its_steps_and_finds_nothing_wrong(cell):
    row = run_cell(cell, seed=0)
    assert row["steps"] >= cell.steps
    assert row["not finite"] == row["outside"] == row["diverged"] == 0
    assert row["penetration"] < 3e-3 and row["memory"] > 10


def test_a_run_goes_on_where_its_record_ends(tmp_path, monkeypatch):
    out = tmp_path / "soak.json"
    monkeypatch.setattr(soak, "make_cells", lambda steps: SMALL)
    whole = run_soak(100, out, progress=False)
    assert whole["summary"]["complete"] and whole["summary"]["steps"] == sum(
        row["steps"] for row in whole["rows"]
    )
    cut = json.loads(out.read_text())
    cut["rows"] = cut["rows"][:2]
    cut["summary"]["complete"] = False
    cut["rows"][0]["seconds"] = 123.0  # as it would not be measured again
    out.write_text(json.dumps(cut))
    again = run_soak(100, out, progress=False)
    assert again["rows"][0]["seconds"] == 123.0 and again["summary"]["complete"]
    kept = ("steps", "episodes", "contact", "diverged", "penetration", "start")
    for one, other in zip(again["rows"], whole["rows"], strict=True):
        assert {name: one[name] for name in kept} == {name: other[name] for name in kept}
    assert out.with_suffix(".md").read_text().startswith("# Soak")
