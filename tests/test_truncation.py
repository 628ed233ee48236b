"""Files that end too early, at whichever byte: what is read is what was written before, or an error
of ours.
"""

from __future__ import annotations

import numpy as np
import pytest

from evaluation.records import RecordFile, make_record, read_records
from piec_envs.errors import PlanError, RecordError
from planners import Plan


def write_records(path, seeds):
    with RecordFile(path) as file:
        for seed in seeds:
            file.append(
                make_record(
                    {"name": "größe"}, seed, {"x": [seed / 3, float("nan")], "s": "{}\n\x00"}, 0.1
                )
            )
    return path.read_bytes()


def put(path, data):
    """Change the contents of a file in place, which is far quicker than to make it anew."""
    with open(path, "r+b") as file:
        file.write(data)
        file.truncate()


def seeds_of(records):
    return [record["seed"] for record in records]


def test_records_are_a_prefix_at_every_byte(tmp_path):
    """Read, opened for appending, and merged with the file of another machine."""
    data = write_records(tmp_path / "whole.jsonl", range(3))
    whole = [str(record) for record in read_records(tmp_path / "whole.jsonl")]
    other = write_records(tmp_path / "other.jsonl", [7])
    ends = [index + 1 for index, byte in enumerate(data) if byte == ord("\n")]
    path = tmp_path / "cut.jsonl"
    path.touch()
    for cut in range(len(data) + 1):
        put(path, data[:cut])
        left = sum(end <= cut for end in ends)
        assert [str(record) for record in read_records(path)] == whole[:left]
        with RecordFile(path) as file:
            assert len(file.records) == left
        assert path.read_bytes() == data[: ([0, *ends])[left]]  # what was cut off is gone
        put(path, data[:cut] + other)
        assert seeds_of(read_records(path)) == [*range(left), 7]


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_mended_file_goes_on(tmp_path, share):
    path = tmp_path / "cut.jsonl"
    data = write_records(path, range(3))
    path.write_bytes(data[: int(share * len(data))])
    kept = seeds_of(read_records(path))
    write_records(path, range(len(kept), 4))
    assert seeds_of(read_records(path)) == [0, 1, 2, 3]


def test_a_file_of_another_kind_is_refused_at_every_byte(tmp_path):
    """And left as it is; an empty one, or the first bytes that both kinds share, may still become
    records.
    """
    data = b'{"format":"piec-other-9","key":"a"}\nrest'
    path = tmp_path / "other.jsonl"
    for cut in range(len(b'{"format":"piec-') + 1, len(data) + 1):
        path.write_bytes(data[:cut])
        for read in (read_records, RecordFile):
            with pytest.raises(RecordError):
                read(path)
        assert path.read_bytes() == data[:cut]


@pytest.fixture(scope="module")
def plan():
    about = {
        "env_id": "piec_envs/PlanarArmPush-v0",
        "robot": "planar_arm",
        "joints": ("q1", "q2", "q3", "q4"),
    }
    path = np.linspace(0, 1, 5)[:, None] * [1.5, 1.0, 0.8, 0.5]
    made = {
        "objective": "contact",
        "preset": "default",
        "seed": 0,
        "cost": 1.0,
        "nominal": {"d2g": 0.1},
    }
    return Plan(horizon=4, env_kwargs={}, path=path, via_points=np.zeros((2, 4)), **about, **made)


def test_no_part_of_a_plan_file_is_a_plan(plan, tmp_path):
    path = plan.save(tmp_path / "cut.npz")
    data = path.read_bytes()
    for cut in range(len(data)):
        put(path, data[:cut])
        with pytest.raises(PlanError, match=r"cut\.npz"):
            Plan.load(path)
    put(path, data)
    np.testing.assert_array_equal(Plan.load(path).path, plan.path)


def test_a_damaged_plan_file_is_the_same_plan_or_none(plan, tmp_path):
    """One byte turned over, at every place: of some nothing depends, such as the time in the
    archive.
    """
    path = plan.save(tmp_path / "damaged.npz")
    data = path.read_bytes()
    for place in range(len(data)):
        put(path, data[:place] + bytes([data[place] ^ 0xFF]) + data[place + 1 :])
        try:
            np.testing.assert_array_equal(Plan.load(path).path, plan.path)
        except PlanError:
            continue
