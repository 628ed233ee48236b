from __future__ import annotations

import json
import sys

import pytest

from evaluation.cli import main
from piec_envs.versions import install_command

HYPER = ["n_envs=2", "n_steps=10", "batch_size=20", "n_epochs=1", 'policy_kwargs={"net_arch": [8]}']
TRAIN = [
    "train",
    "--steps",
    "60",
    "--set",
    "escape_field=null",
    "action_repeat=100",
    "--hyper",
    *HYPER,
]


@pytest.fixture
def piec(capsys):
    """Run a command with --json; returns its exit code and its document."""

    def run(*arguments):
        code = main([str(argument) for argument in [*arguments, "--json"]])
        return code, json.loads(capsys.readouterr().out)

    return run


def test_train_and_evaluate_the_agent(piec, tmp_path, capsys):
    pytest.importorskip("stable_baselines3")
    code, document = piec(*TRAIN, "--out", tmp_path / "run")
    file = tmp_path / "run" / "agent.zip"
    assert code == 0 and document["wrote"][0] == str(file) and document["steps"] == 60
    assert document["spec"]["env_kwargs"] == {
        "action_repeat": 100,
        "escape_field": None,
        "start_noise": [0.01, 0.05],
    }
    assert main([*TRAIN, "--out", str(tmp_path / "run")]) == 0
    text = capsys.readouterr().out
    assert f"piec evaluate {file} --protocol nominal-start" in text
    assert text.rstrip().endswith(f"wrote {tmp_path / 'run' / 'tensorboard'}")
    arguments = [
        "evaluate",
        file,
        "--episodes",
        3,
        "--protocol",
        "nominal-start",
        "--out",
        tmp_path / "table",
    ]
    code, document = piec(*arguments, "--set", "escape_field=null")
    assert code == 0 and document["evaluations"][0]["n"] == 3
    assert "run/agent" in (tmp_path / "table" / "table.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--algo", "ppp"], "Did you mean 'ppo on piec_envs/PlanarArmPush-v0'?"),
        (["--env", "piec_envs/PlanarArmCage-v0"], "ppo on piec_envs/PlanarArmPush-v0"),
        (["--steps", "0"], "timesteps"),
        (["--threads", "0"], "threads"),
        (["--hyper", "luck=1"], "unknown hyper-parameter 'luck'"),
        (["--set", "luck=1"], "unexpected keyword argument 'luck'"),
        (["--set", "luck"], "name=value"),
    ],
)
def test_bad_input_ends_with_one_line(arguments, message, tmp_path, capsys):
    pytest.importorskip("stable_baselines3")
    assert main(["train", *arguments, "--out", str(tmp_path / "run"), "--json"]) == 2
    captured = capsys.readouterr()
    assert message in json.loads(captured.out)["error"]
    assert captured.err.startswith("piec train: error: ")


@pytest.mark.parametrize("command", [["train"], ["evaluate", "agent.zip"]])
def test_without_stable_baselines3_the_extra_is_named(command, monkeypatch, piec):
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    for name in [
        name for name in sys.modules if name.startswith(("planners", "evaluation.commands"))
    ]:
        monkeypatch.delitem(sys.modules, name)
    import planners  # the rest works
    from planners import sb3

    assert planners.CmaEsPlanner().population and "ppo" in sb3.ALGORITHMS
    code, document = piec(*command)
    assert code == 2 and install_command("rl") in document["error"]
