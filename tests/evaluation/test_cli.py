from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evaluation.cli import main
from evaluation.commands import COMMANDS, settings, warmup
from evaluation.records import read_records
from piec_envs import ENVS
from piec_envs.compilation import SECONDS
from piec_envs.errors import InvalidParameterError, PlanError
from piec_envs.escape import make_field
from planners import CmaEsPlanner

ROOT = Path(__file__).resolve().parents[2]
TINY = [
    "--planner",
    "iterations=1",
    "population=4",
    "restarts=1",
    "start=rest",
    "robust_iterations=0",
]


HELP = """
import sys
from evaluation.cli import main
try:
    main(["--help"])
except SystemExit:
    print([name for name in ("torch", "mujoco", "matplotlib", "cma", "scipy") if name in
sys.modules]) """


@pytest.fixture
def piec(capsys):
    """Run a command with --json; returns its exit code and its document."""

    def run(*arguments):
        code = main([str(argument) for argument in [*arguments, "--json"]])
        return code, json.loads(capsys.readouterr().out)

    return run


@pytest.fixture
def plan_file(sweep_plan, tmp_path):
    return sweep_plan.save(tmp_path / "sweep.npz")


def test_help_is_quick_and_lists_every_command():
    done = subprocess.run(
        [sys.executable, "-c", HELP], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.rstrip().endswith("[]")
    assert all(name in done.stdout for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_helps_with_an_example(name, capsys):
    with pytest.raises(SystemExit) as leaving:
        main([name, "--help"])
    text = capsys.readouterr().out
    assert leaving.value.code == 0
    assert f"  piec {name}" in text.partition("examples:")[2]
    assert "--json" in text


def test_list(piec, capsys):
    code, tables = piec("list")
    assert code == 0
    assert (
        "piec_envs/PlanarArmPush-v0" in tables["environments"]
        and "disturbance-5mm" in tables["protocols"]
    )
    assert set(tables["commands"]) == set(COMMANDS)
    assert (
        "label-free" in tables["recipes of train-field"]["pinn"]
        and "label-free" in tables["escape fields"]["pinn"]
    )
    assert main(["list"]) == 0
    assert "planar-disturbance" in capsys.readouterr().out


def test_plan(piec, tmp_path):
    out = tmp_path / "new" / "plan.npz"
    code, document = piec(
        "plan", "--objective", "contact", *TINY, "--set", "object=square", "--out", out
    )
    assert code == 0 and out.exists()
    assert document["wrote"] == [str(out)] and document["nominal"]["d2g"] >= 0


def test_evaluate_says_where_and_does_nothing_twice(piec, plan_file, tmp_path, capsys):
    arguments = ["evaluate", plan_file, "--episodes", 3, "--protocol", "disturbance-5mm", "nominal"]
    arguments += ["--set", "escape_field=null", "--out", tmp_path / "out"]
    code, first = piec(*arguments)
    assert code == 0
    assert [row["n"] for row in first["evaluations"]] == [3, 1]
    assert len(read_records(tmp_path / "out" / "records.jsonl")) == 2
    assert piec(*arguments) == (0, first)
    assert len(read_records(tmp_path / "out" / "records.jsonl")) == 2
    assert main([str(argument) for argument in arguments]) == 0
    assert f"wrote {tmp_path / 'out' / 'table.md'}" in capsys.readouterr().out


def test_demo(piec, tmp_path):
    code, document = piec("demo", "--smoke", "--out", tmp_path)
    assert code == 0 and set(document["results"]) == {"contact", "proximity", "caging"}
    names = {"table.md", "table.csv", "overview.png", "animation.gif", "records.jsonl"}
    assert names <= {path.name for path in tmp_path.iterdir()}
    assert len(list((tmp_path / "plans").glob("*.npz"))) == 3
    assert "[" in (tmp_path / "table.md").read_text()


def test_quick_is_the_quick_planner(piec, tmp_path, monkeypatch):
    made = []

    def caught(self, *arguments, **kwargs):
        made.append(self)
        raise PlanError("not planned")

    monkeypatch.setattr(CmaEsPlanner, "plan", caught)
    assert piec("plan", "--quick", "--out", tmp_path / "plan.npz")[0] == 2
    assert piec("demo", "--quick", "--out", tmp_path / "demo")[0] == 2
    assert piec("demo", "--out", tmp_path / "demo")[0] == 2
    quick, shown, whole = made
    assert quick == CmaEsPlanner.quick() and shown == CmaEsPlanner.quick(objective="contact")
    assert whole == CmaEsPlanner(objective="contact") and quick.rollouts < whole.rollouts / 3
    code, document = piec("plan", "--quick", "--planner", "carry", "--out", tmp_path / "plan.npz")
    assert code == 2 and "known: cma-es" in document["error"]


def test_warmup_uses_what_it_says_and_nothing_twice(piec, monkeypatch, capsys):
    used = []
    monkeypatch.setattr(warmup, "_use", used.append)
    monkeypatch.setattr("piec_envs.compilation._kept", lambda name: bool(used))
    ids = ["piec_envs/PlanarArmPush-v0", "piec_envs/PlanarArmCage-v0"]
    assert main(["warmup", "--env", *ids]) == 0
    told = capsys.readouterr().err.splitlines()
    assert f"{len(SECONDS)} slow kernels to compile, up to about" in told[0] and used == ids
    assert all(any(name in line for line in told) for name in SECONDS)
    code, document = piec("warmup", "--env", "all")
    assert code == 0 and document["envs"] == list(ENVS) and document["compiled"] == []
    code, document = piec("warmup", "--env", "piec_envs/Nothing-v0")
    assert code == 2 and "PlanarArmPush" in document["error"]


@pytest.mark.parametrize("env_id", ["piec_envs/PlanarArmPush-v0", "piec_envs/PlanarArmCage-v0"])
def test_warmup_leaves_nothing_to_compile(piec, env_id):
    """Once it has run, everything that it uses is found on the disk."""
    code, document = piec("warmup", "--env", env_id)
    assert code == 0 and document["envs"] == [env_id]
    assert piec("warmup", "--env", env_id)[1]["compiled"] == []


def test_render(piec, plan_file, tmp_path):
    code, document = piec(
        "render",
        plan_file,
        "--frames",
        2,
        "--out",
        tmp_path / "a.gif",
        "--set",
        "escape_field=null",
    )
    assert code == 0 and document["end"]["d2g"] > 0
    assert (tmp_path / "a.gif").read_bytes()[:3] == b"GIF"
    code, _ = piec("render", "--state", '{"pose": [0.5, 0.4, 0.0]}', "--out", tmp_path / "a.png")
    assert code == 0 and (tmp_path / "a.png").read_bytes()[1:4] == b"PNG"


def test_render_takes_from_the_plan_what_it_was_made_for(piec, sweep_plan, tmp_path):
    start = [0.4, 0.3, -1.0, -2.1, 0.8]
    plan = replace(
        sweep_plan,
        env_id="piec_envs/MobileFrankaPush-v0",
        robot="mobile_franka_link_capsules",
        joints=("x", "y", "q1", "q4", "q6"),
        env_kwargs={"contact": "link", "geometry": "capsules", "start": start, "friction": 0.1},
        path=np.tile(start, (1001, 1)),
        via_points=np.tile(start, (5, 1)),
    )
    file = plan.save(tmp_path / "link.npz")
    code, document = piec("render", file, "--frames", 1, "--set", "escape_field=null")
    assert code == 0 and document["end"]["goal_distance"] > 0.2
    assert file.with_suffix(".gif").read_bytes()[:3] == b"GIF"


def test_bench(piec, tmp_path, monkeypatch):
    # test_demo runs it
    monkeypatch.setattr("evaluation.bench.demo._run_demo", lambda *arguments: 1.0)
    code, document = piec("bench", "--quick", "--out", tmp_path / "bench.json")
    assert code == 0
    assert json.loads((tmp_path / "bench.json").read_text())["rows"] == document["rows"]
    names = {
        "contact step, fast over osqp",
        "rank of plan costs",
        "default plan, caging",
        "quick plan, caging, success at 5 mm",
        "piec demo, warm",
    }
    assert names <= {row["benchmark"] for row in document["rows"]}
    assert document["missed"] == [
        row["benchmark"] for row in document["rows"] if row["met"] == "miss"
    ]
    assert "targets are met" in (tmp_path / "bench.md").read_text()


def test_train_field(piec, tmp_path, capsys):
    pytest.importorskip("torch")
    numbers = [
        "configurations=6",
        "points=8",
        "iterations=3",
        "batch=16",
        "width=8",
        "rounds=1",
        "lengths=[0.1, 0.4]",
    ]
    arguments = [
        "train-field",
        "--recipe",
        "pinn",
        "--threads",
        "1",
        "--out",
        tmp_path,
        "--set",
        *numbers,
    ]
    code, document = piec(*arguments)
    file = tmp_path / "planar_arm-pinn.npz"
    assert code == 0 and document["wrote"] == [str(file), str(file.with_suffix(".json"))]
    assert document["held_out"]["median"] > 0 and document["settings"]["lengths"] == [0.1, 0.4]
    assert (
        make_field("network", weights=str(file)).query(np.full((1, 2), 0.3), np.zeros(4)) > 0
    ).all()
    assert main([str(argument) for argument in arguments]) == 0
    text = capsys.readouterr().out
    assert (
        f'make_field("network", "planar_arm", weights="{file}")' in text and f"wrote {file}" in text
    )
    assert main(["train-field", "--device", "quantum", "--out", str(tmp_path)]) == 2
    assert "device 'quantum'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["reproduce", "planar-adversery"], "Did you mean 'planar-adversary'?"),
        (["reproduce", "eikonal-toy", "--jobs", "0"], "at least 1"),
        (["reproduce", "eikonal-toy", "--engine", "rai"], "Did you mean 'ray'?"),
        (["reproduce", "eikonal-toy", "--engine-option", "timeout_min=5"], "no options"),
        (["plan", "--objective", "luck"], "known: adversarial"),
        (["plan", "--planner", "luck=1"], "planner setting"),
        (["plan", "--planner", "iterations=many"], "such as 30"),
        (["plan", "--set", "object"], "name=value"),
        (["plan", "--set", "friction=-1"], "friction"),
        (["train-field", "--recipe", "pin"], "Did you mean 'pinn'?"),
        (["train-field", "--robot", "planar_leg"], "Did you mean 'planar_arm'?"),
        (["train-field", "--set", "luck=1"], "recipe setting"),
        (["train-field", "--set", "width=many"], "such as 64"),
        (["train-field", "--set", "width=6"], "multiple of 4"),
        (["train-field", "--recipe", "pinn", "--set", 'lengths=[0.1, "far"]'], "such as (0.05"),
        (["train-field", "--threads", "0"], "threads"),
        (["evaluate", "missing.npz"], "missing.npz"),
        (["render", "missing.npz"], "missing.npz"),
        (["render", "--state", "[1]"], "JSON object"),
        (["render", "--state", '{"pose": [0.5, 0.0, 0.0]}'], "overlaps"),
        (["render", "--out", "a.jpg"], ".png"),
    ],
)
def test_bad_input_ends_with_one_line_and_code_2(arguments, message, capsys):
    assert main([*arguments, "--json"]) == 2
    captured = capsys.readouterr()
    assert message in json.loads(captured.out)["error"]
    (line,) = [line for line in captured.err.splitlines() if "compiling" not in line]
    assert line.startswith(f"piec {arguments[0]}: error: ") and message in line


def test_settings_are_json_or_text():
    pairs = ["a=1", "b=square", "c=null", "d=[1, 2]", "e=x=y"]
    assert settings(pairs) == {"a": 1, "b": "square", "c": None, "d": [1, 2], "e": "x=y"}
    assert settings(None) == {}
    with pytest.raises(InvalidParameterError, match="name=value"):
        settings(["=3"])
