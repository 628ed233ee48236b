"""What `piec demo` says of its stages, held against a clock that the tests turn."""

from __future__ import annotations

import pytest

from evaluation.cli import make_parser
from evaluation.commands import demo, stages
from evaluation.commands.stages import Stages, seconds
from piec_envs.console import VARIABLE

EXPECTED = {"plan": 10.0, "execute": 4.0, "draw": 2.0}


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands still until its hand is moved, on a machine with two cores."""
    hand = [0.0]
    monkeypatch.setattr(stages.time, "perf_counter", lambda: hand[0])
    monkeypatch.setattr(stages, "available_threads", lambda: 2)
    return hand


def lines(capsys):
    out, err = capsys.readouterr()
    assert out == ""
    return err.splitlines()


def test_each_stage_has_an_estimate_before_and_a_time_after(clock, capsys):
    told = Stages(EXPECTED)
    assert lines(capsys) == [
        "piec: 3 stages, about 16 s; kernels not compiled yet add minutes once"
    ]
    for name, spent in (("plan", 20.0), ("execute", 60.0), ("draw", 4.0)):
        with told.stage(name):
            clock[0] += spent
    told.end()
    assert lines(capsys) == [
        "piec: 1 of 3: plan, about 10 s",
        "piec: 1 of 3: plan took 20 s",
        "piec: 2 of 3: execute, about 8 s",
        "piec: 2 of 3: execute took 60 s",
        "piec: 3 of 3: draw, about 4 s",  # half as quick as expected: compiling was once
        "piec: 3 of 3: draw took 4 s",
        "piec: took 84 s in all",
    ]


def test_what_an_earlier_run_did_is_said_and_teaches_nothing(clock, capsys):
    told = Stages(EXPECTED, done=lambda: 5)
    with told.stage("plan", recorded=True):
        clock[0] += 0.1
    with told.stage("execute"):
        clock[0] += 4.0
    assert lines(capsys)[2:4] == [
        "piec: 1 of 3: plan was done by an earlier run",
        "piec: 2 of 3: execute, about 4 s",
    ]


def test_more_cores_take_less_and_quiet_says_nothing(clock, capsys, monkeypatch):
    monkeypatch.setattr(stages, "available_threads", lambda: 16)
    Stages(EXPECTED)
    assert "3 stages, about 2 s" in lines(capsys)[0]
    told = Stages(EXPECTED, quiet=True)
    with told.stage("plan"):
        pass
    told.end()
    assert lines(capsys) == []


@pytest.mark.parametrize(
    ("value", "text"), [(0.2, "1 s"), (8.4, "8 s"), (99.4, "99 s"), (160.0, "2 min 40 s")]
)
def test_durations_are_told_in_words(value, text):
    assert seconds(value) == text


@pytest.mark.parametrize("quiet", [False, True])
def test_the_demo_names_its_stages_unless_asked_to_be_quiet(quiet, tmp_path, capfd, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(int(quiet)))
    demo.run(make_parser().parse_args(["demo", "--smoke", "--out", str(tmp_path)]))
    told = [line for line in capfd.readouterr().err.splitlines() if "piec: " in line]
    names = [
        "planning for contact",
        "planning for proximity",
        "planning for caging",
        "executing each plan 2 times",
    ]
    names += ["drawing the picture", "drawing the animation"]
    assert len(told) == (0 if quiet else 1 + 2 * len(names) + 1)
    for name, line in zip(names, told[1:-1:2], strict=not quiet):
        assert name in line
