"""Every engine does the same work with the same results, and loses none of it with a worker."""

from __future__ import annotations

import os
import re
import signal
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from joblib.externals.loky import get_reusable_executor

from evaluation import slurm_workers
from evaluation.engines import ENGINES, open_engine
from evaluation.jobs import Context, Work, call, run_jobs, run_recorded
from evaluation.records import read_records
from evaluation.studies import eikonal_toy
from evaluation.workers import answer, installed
from piec_envs.errors import (
    EngineError,
    InvalidParameterError,
    MissingDependencyError,
    UnknownNameError,
)
from piec_envs.versions import install_command

ROOT = Path(__file__).resolve().parents[2]
CHORES = """
import os, signal, time
from pathlib import Path
from piec_envs.errors import UnknownNameError

class Secret(Exception):
    def __init__(self, a, b):
        super().__init__(f"{a} and {b}")

def chore(spec, seed, context):
    log = Path(spec["folder"]) / str(seed)
    with open(log, "a") as file:
        file.write(f"{os.getpid()}\\n")
    if seed == 1 and spec["task"] == "wait to be killed" and len(log.read_text().split()) == 1:
        time.sleep(120)
    if seed == 1 and spec["task"] == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if seed == 1 and spec["task"] == "run out of time":
        os.kill(os.getpid(), signal.SIGUSR2)
        time.sleep(1)
    if seed == 1 and spec["task"] == "raise":
        raise UnknownNameError("object", "sqare", ["square"])
    if seed == 1 and spec["task"] == "raise what cannot be sent":
        raise Secret("this", "that")
    return {"square": seed**2, "threads": context.threads}
"""


@pytest.fixture(scope="module")
def chores(tmp_path_factory):
    """A module that workers can import, wherever they are started."""
    folder = tmp_path_factory.mktemp("chores")
    (folder / "chores.py").write_text(CHORES)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        patch.setenv("PYTHONPATH", os.pathsep.join([str(folder), str(ROOT)]))
        patch.delenv("RAY_ADDRESS", raising=False)
        # joblib's workers know the PYTHONPATH that they were started with
        get_reusable_executor().shutdown()
        yield
        get_reusable_executor().shutdown()


@pytest.fixture(scope="module")
def ray(chores):
    pytest.importorskip("ray")
    with open_engine("ray", 2):
        yield


@pytest.fixture(params=ENGINES)
def workers(request, chores, tmp_path, monkeypatch):
    """Opens two workers of each engine, of which a lost piece of work is tried twice."""
    options = {}
    if request.param == "ray":
        request.getfixturevalue("ray")
    # submitit's own stand-in for a cluster: processes of this machine
    elif request.param == "slurm":
        pytest.importorskip("submitit")
        monkeypatch.setattr(slurm_workers, "LATE_SECONDS", 1.0)
        options = {"cluster": "local", "folder": str(tmp_path / "slurm"), "timeout_min": 2}
    for module in ("jobs", "ray_workers", "slurm_workers"):
        monkeypatch.setattr(f"evaluation.{module}.RETRIES", 1)
    return lambda: open_engine(request.param, 2, options)


def works(folder, task, count=4):
    return [Work({"folder": str(folder), "task": task}, seed) for seed in range(count)]


def tries(folder, seed):
    return len((folder / str(seed)).read_text().split())


@contextmanager
def killing(log: Path):
    """Kill the first process that writes its number into a file."""

    def kill():
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and not (log.exists() and log.read_text().endswith("\n")):
            time.sleep(0.02)
        os.kill(int(log.read_text().split()[0]), signal.SIGKILL)

    thread = threading.Thread(target=kill)
    thread.start()
    yield
    thread.join()


def test_a_killed_worker_loses_nothing(workers, tmp_path):
    path = tmp_path / "records.jsonl"
    with workers() as jobs, killing(tmp_path / "1"):
        records = run_recorded("chores:chore", works(tmp_path, "wait to be killed"), path, jobs)
    assert [record["result"] for record in records] == [
        {"square": seed**2, "threads": 1} for seed in range(4)
    ]
    assert path.read_bytes().count(b"\n") == len(read_records(path)) == 4  # each once
    assert tries(tmp_path, 1) == 2


def test_work_that_kills_every_worker_ends_with_a_clear_error(workers, tmp_path):
    path = tmp_path / "records.jsonl"
    with workers() as jobs:
        run_recorded("chores:chore", works(tmp_path, "die")[:1], path, jobs)
        with pytest.raises(EngineError, match=r"lost|tries"):
            run_recorded("chores:chore", works(tmp_path, "die")[:2], path, jobs)
    assert [record["seed"] for record in read_records(path)] == [0]
    assert tries(tmp_path, 1) == 2


def test_what_the_work_raises_is_raised_here_and_not_tried_again(workers, tmp_path):
    with workers() as jobs, pytest.raises(UnknownNameError, match="Did you mean 'square'"):
        list(run_jobs("chores:chore", works(tmp_path, "raise", count=2), jobs))
    assert tries(tmp_path, 1) == 1


@pytest.mark.parametrize("workers", ["ray"], indirect=True)
def test_an_exception_that_cannot_be_sent_is_told(workers, tmp_path):
    with workers() as jobs, pytest.raises(RuntimeError, match="Secret: this and that"):
        list(run_jobs("chores:chore", works(tmp_path, "raise what cannot be sent", count=2), jobs))


@pytest.mark.parametrize("workers", ["slurm"], indirect=True)
def test_a_job_that_runs_out_of_time_is_not_tried_again(workers, tmp_path):
    with workers() as jobs, pytest.raises(EngineError, match="timeout_min"):
        list(run_jobs("chores:chore", works(tmp_path, "run out of time", count=2), jobs))
    assert tries(tmp_path, 1) == 1


@pytest.mark.parametrize("workers", ["slurm"], indirect=True)
def test_a_lost_job_keeps_nobody_waiting(workers, tmp_path, monkeypatch):
    with workers() as jobs:
        work = works(tmp_path, "die")[1]
        lost = jobs.submit(call, "chores:chore", dict(work.spec), work.seed, Context())
        first = lost.job
        first.wait()
        with monkeypatch.context() as patch:
            patch.setattr(time, "sleep", lambda seconds: pytest.fail("the watcher sleeps"))
            assert not lost.done() and lost.job is first  # its answer may be late
            now = time.monotonic() + slurm_workers.LATE_SECONDS
            patch.setattr(time, "monotonic", lambda: now)
            assert not lost.done() and lost.job is not first
        with pytest.raises(EngineError, match="lost 2 times"):
            lost.result()
    assert tries(tmp_path, 1) == 2


def test_a_study_does_not_depend_on_the_engine(ray, tmp_path):
    kept = ("key", "spec", "seed", "result")
    found = []
    for engine, jobs in (("local", 1), ("local", 2), ("ray", 2)):
        folder = tmp_path / f"{engine}{jobs}"
        with open_engine(engine, jobs) as workers:
            eikonal_toy.run(eikonal_toy.Settings.smoke(), folder, workers, progress=False)
        records = sorted(read_records(folder / "records.jsonl"), key=lambda record: record["key"])
        found.append([{name: record[name] for name in kept} for record in records])
    assert len(found[0]) == 2 and found[0] == found[1] == found[2]


def test_workers_with_other_versions_are_refused():
    here = installed()
    assert answer(here, max, 1, 2) == (2, None)
    _, other = answer({**here, "sources": "0" * 16}, max, 1, 2)
    assert isinstance(other, EngineError) and "sources" in str(other)
    value, error = answer({**here, "numpy": "0.1"}, max, 1, 2)
    assert value is None and isinstance(error, EngineError) and "instead of 0.1" in str(error)


@pytest.mark.parametrize("name", ["ray", "slurm"])
def test_a_missing_package_names_its_extra(name, monkeypatch):
    monkeypatch.setattr("evaluation.workers.find_spec", lambda package: None)
    with (
        pytest.raises(MissingDependencyError, match=re.escape(install_command(name))),
        open_engine(name),
    ):
        pass


@pytest.mark.parametrize(
    ("engine", "jobs", "options", "error", "message"),
    [
        ("slrm", 1, {}, UnknownNameError, "Did you mean 'slurm'"),
        ("local", 0, {}, InvalidParameterError, "at least 1"),
        ("local", 1, {"timeout_min": 5}, InvalidParameterError, "no options, got timeout_min"),
        ("ray", 1, {"num_cpus": 5}, EngineError, "too late for its options num_cpus"),
        ("slurm", 1, {"cluster": "lokal"}, EngineError, "lokal"),
        ("slurm", 1, {"cluster": "local", "luck": 1}, EngineError, "luck"),
        ("slurm", 1, {"cluster": "local", "timeout_min": "long"}, EngineError, "timeout_min"),
    ],
)
def test_bad_engines_and_options(
    engine, jobs, options, error, message, request, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    if engine == "slurm":
        pytest.importorskip("submitit")
    elif engine == "ray":
        request.getfixturevalue("ray")
    with pytest.raises(error, match=message), open_engine(engine, jobs, options):
        pass


def test_slurm_where_there_is_none(tmp_path, monkeypatch):
    pytest.importorskip("submitit")
    monkeypatch.setenv("PATH", "")
    with (
        pytest.raises(EngineError, match="srun"),
        open_engine("slurm", options={"folder": str(tmp_path)}),
    ):
        pass
