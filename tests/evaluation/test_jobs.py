from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import joblib
import pytest
from joblib.externals.loky import get_reusable_executor

from evaluation.jobs import Context, Work, function_name, resolve, run_jobs, run_recorded
from evaluation.records import read_records, to_json
from piec_envs.errors import InvalidParameterError, UnknownNameError
from piec_envs.sources import source

WORKS = [Work({"n": n}, seed) for n in (3, 1) for seed in (0, 7)]


@pytest.fixture
def draw(tmp_path, monkeypatch):
    """A function that workers can import."""
    (tmp_path / "draws.py").write_text(
        "import numpy as np\n"
        "def draw(spec, seed, context):\n"
        "    return {'x': np.random.default_rng(seed).random(spec['n']).tolist()}\n"
        "def told(spec, seed, context):\n"
        "    return [context.folder, context.threads, context.progress]\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")
    # joblib's workers know the PYTHONPATH that they were started with
    get_reusable_executor().shutdown()
    yield "draws:draw"
    get_reusable_executor().shutdown()


def outcome(function, jobs):
    return {
        work.key: to_json(result)
        for work, result, seconds in run_jobs(function, WORKS, jobs)
        if seconds >= 0
    }


def test_results_do_not_depend_on_the_number_or_kind_of_workers(draw):
    alone = outcome(draw, 1)
    assert len(alone) == len(WORKS)
    assert outcome(draw, 2) == alone
    with joblib.parallel_config(backend="threading"):
        assert outcome(draw, 2) == alone
    with joblib.parallel_config(backend="multiprocessing"):
        assert outcome(draw, 2) == alone
    with ThreadPoolExecutor(2) as pool:
        assert outcome(draw, pool) == alone


def test_workers_get_one_thread_and_no_progress_bar(draw):
    context = Context("here", None, True)
    alone = [result for _, result, _ in run_jobs("draws:told", WORKS, 1, context)]
    with ThreadPoolExecutor(1) as pool:
        beside = [result for _, result, _ in run_jobs("draws:told", WORKS, pool, context)]
    assert alone == [["here", None, True]] * 4
    assert beside == [[str(Path("here").absolute()), 1, False]] * 4  # workers may run elsewhere


def test_an_executor_is_handed_no_more_than_its_limit(draw):
    class Limited(ThreadPoolExecutor):
        limit = 2
        handed = 0
        most = 0

        def submit(self, *arguments):
            future = super().submit(*arguments)
            self.handed += 1
            self.most = max(self.most, self.handed)
            return future

    with Limited(4) as pool:
        for _ in run_jobs(draw, WORKS, pool):
            pool.handed -= 1
    assert pool.handed == 0 and pool.most == 2


def test_only_what_is_missing_is_done(draw, tmp_path):
    path = tmp_path / "r.jsonl"
    first = run_recorded(draw, WORKS[:2], path)
    (tmp_path / "draws.py").unlink()
    assert run_recorded(draw, WORKS[1::-1], path) == first[::-1]
    assert len(read_records(path)) == 2


def test_records_name_the_sources_of_the_worker(draw, tmp_path):
    for jobs in (1, 2):
        records = run_recorded(draw, WORKS, tmp_path / f"{jobs}.jsonl", jobs)
        assert [record["source"] for record in records] == [source()] * len(WORKS)

    class Elsewhere(ThreadPoolExecutor):
        """Workers whose tree was edited."""

        def submit(self, function, *arguments):
            result, seconds, _ = function(*arguments)
            return super().submit(lambda: (result, seconds, {"digest": "other"}))

    with Elsewhere(1) as pool:
        records = run_recorded(draw, WORKS, tmp_path / "other.jsonl", pool)
    assert all(record["source"] == {"digest": "other"} for record in records)


def test_functions_have_names():
    assert resolve(function_name(run_jobs)) is run_jobs
    for name in ("evaluation.jobs:nothing", "nowhere:run", "run"):
        with pytest.raises(UnknownNameError, match="module:function"):
            resolve(name)


@pytest.mark.parametrize("jobs", [0, -1, 1.5, "two", True])
def test_bad_numbers_of_jobs(jobs):
    with pytest.raises(InvalidParameterError, match="jobs"):
        list(run_jobs(run_jobs, WORKS, jobs))
