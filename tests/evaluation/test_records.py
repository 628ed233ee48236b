from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from evaluation.jobs import Work, run_recorded
from evaluation.records import RecordFile, from_json, make_record, read_records, to_json, work_key
from piec_envs.errors import RecordError
from piec_envs.sources import source

ROOT = Path(__file__).resolve().parents[2]


def write(path: Path, count: int) -> list[dict]:
    with RecordFile(path) as file:
        for seed in range(count):
            file.append(make_record({"a": 1}, seed, {"x": seed / 3}, 0.1))
    return read_records(path)


def test_the_key_depends_on_the_values_alone():
    key = work_key({"a": 1, "b": [0.5, None]}, 3)
    assert key == work_key({"b": (0.5, None), "a": np.int64(1)}, np.int64(3))
    assert key == "7864d8b38ed5637d"  # stable: old files stay readable
    assert (
        len({key, work_key({"a": 1, "b": [0.5, None]}, 4), work_key({"a": 2, "b": [0.5, None]}, 3)})
        == 3
    )


def test_numbers_that_json_lacks_survive():
    value = {"a": [math.inf, -math.inf, 1.5, None, True], "b": {"c": np.arange(3)}, "p": Path("x")}
    text = json.dumps(to_json(value), allow_nan=False)
    assert from_json(json.loads(text)) == {
        "a": [math.inf, -math.inf, 1.5, None, True],
        "b": {"c": [0, 1, 2]},
        "p": "x",
    }
    assert math.isnan(from_json(to_json(math.nan)))
    with pytest.raises(RecordError, match="object"):
        to_json({"a": object()})


def test_round_trip(tmp_path):
    records = write(tmp_path / "r.jsonl", 3)
    assert [record["seed"] for record in records] == [0, 1, 2]
    assert records[1]["result"] == {"x": 1 / 3}
    assert {"python", "numpy", "numba", "gymnasium", "mujoco", "piec-envs"} <= set(
        records[0]["versions"]
    )
    assert read_records(tmp_path / "missing.jsonl") == []


def test_a_record_names_the_sources_it_was_made_by(tmp_path):
    (record,) = write(tmp_path / "r.jsonl", 1)
    assert record["source"] == source()
    with RecordFile(tmp_path / "r.jsonl") as file:
        file.append(
            make_record({"a": 1}, 7, {}, 0.1, {"commit": "abc", "modified": True, "digest": "0"})
        )
    assert read_records(tmp_path / "r.jsonl")[1]["source"] == {
        "commit": "abc",
        "modified": True,
        "digest": "0",
    }


def test_records_from_before_sources_were_noted_stay_readable(tmp_path):
    old = {
        name: value
        for name, value in make_record({"a": 1}, 0, {"x": 0}, 0.1).items()
        if name != "source"
    }
    path = tmp_path / "r.jsonl"
    path.write_text(json.dumps(old, separators=(",", ":")) + "\n")
    assert read_records(path) == [old]
    assert run_recorded("nowhere:nothing", [Work({"a": 1}, 0)], path) == [old]
    with RecordFile(tmp_path / "copy.jsonl") as file:
        file.append(old)
    assert read_records(tmp_path / "copy.jsonl") == [old]


def test_every_committed_record_is_readable_and_has_the_key_of_its_spec():
    files = sorted((ROOT / "results").glob("*/records.jsonl"))
    records = [record for file in files for record in read_records(file)]
    assert len(files) >= 18 and len(records) > 3000
    assert all(record["key"] == work_key(record["spec"], record["seed"]) for record in records)


@pytest.mark.parametrize("keep", [1, 10, 26, 27, 60, -1])
def test_a_cut_off_last_line_is_dropped_and_mended(tmp_path, keep):
    path = tmp_path / "r.jsonl"
    whole = write(path, 3)
    data = path.read_bytes()
    start = data[:-1].rfind(b"\n") + 1
    path.write_bytes(data[:start] + data[start:][:keep])
    assert read_records(path) == whole[:2]
    with RecordFile(path) as file:
        assert len(file.records) == 2
        file.append(make_record({"a": 1}, 2, {"x": 2 / 3}, 0.1))
    assert read_records(path) == whole


def test_no_record_twice(tmp_path):
    write(tmp_path / "r.jsonl", 2)
    with RecordFile(tmp_path / "r.jsonl") as file, pytest.raises(RecordError, match="already"):
        file.append(make_record({"a": 1}, 1, {}, 0.0))


@pytest.mark.parametrize("cut", [0, 1, 10, 27, 60])
def test_files_of_two_machines_are_merged_one_behind_the_other(tmp_path, cut):
    here, there, merged = (tmp_path / name for name in ("a.jsonl", "b.jsonl", "c.jsonl"))
    whole = write(here, 3)
    with RecordFile(there) as file:
        for seed in (1, 3):
            file.append(make_record({"a": 1}, seed, {"x": "there"}, 0.2))
    merged.write_bytes(here.read_bytes()[: -cut or None] + there.read_bytes())
    # a last line cut off is lost, and nothing with it
    seeds = [0, 1, 2, 3] if not cut else [0, 1, 3]
    assert [record["seed"] for record in read_records(merged)] == seeds
    assert read_records(merged)[1] == whole[1]  # of two with one key the first counts
    works = [Work({"a": 1}, seed) for seed in seeds]
    records = run_recorded("nowhere:nothing", works, merged)  # none is done again
    assert [record["seed"] for record in records] == seeds and records[1] == whole[1]


def test_two_runs_do_not_write_at_once(tmp_path):
    with RecordFile(tmp_path / "r.jsonl"), pytest.raises(RecordError, match="another run"):
        RecordFile(tmp_path / "r.jsonl")
    RecordFile(tmp_path / "r.jsonl").__exit__(None, None, None)


@pytest.mark.parametrize(
    "content", ["hello\n", "hello", '{"a": 1}\n', '{"format":"piec-record-9","key":""}\n', "[]\n"]
)
def test_foreign_files_are_refused_and_left_alone(tmp_path, content):
    path = tmp_path / "r.jsonl"
    path.write_text(content)
    with pytest.raises(RecordError, match=r"r\.jsonl"):
        read_records(path)
    with pytest.raises(RecordError, match=r"r\.jsonl"):
        RecordFile(path)
    assert path.read_text() == content


WORK = """
import time

def slow(spec, seed, context):
    time.sleep(0.03)
    with open(spec["log"], "a") as log:
        log.write(f"{seed}\\n")
    return {"square": seed**2, "text": "x" * 20_000}
"""
RUN = """
import sys
from evaluation.jobs import Work, run_recorded
works = [Work({"log": sys.argv[2]}, seed) for seed in range(20)]
run_recorded("slow_work:slow", works, sys.argv[1])
"""


def test_a_killed_run_resumes_without_losing_or_repeating_a_record(tmp_path, monkeypatch):
    (tmp_path / "slow_work.py").write_text(WORK)
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / "r.jsonl"
    log = tmp_path / "log"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    process = subprocess.Popen([sys.executable, "-c", RUN, path, log], env=env)
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline and (not path.exists() or path.read_bytes().count(b"\n") < 8):
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = read_records(path)
    assert 8 <= len(before) < 20
    works = [Work({"log": str(log)}, seed) for seed in range(20)]
    records = run_recorded("slow_work:slow", works, path)
    assert [record["result"]["square"] for record in records] == [seed**2 for seed in range(20)]
    assert read_records(path)[: len(before)] == before
    assert sorted(record["seed"] for record in read_records(path)) == list(range(20))
    done = [int(line) for line in log.read_text().split()]
    # at most the piece cut off is done again
    assert set(done) == set(range(20)) and len(done) <= 21
