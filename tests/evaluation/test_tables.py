from __future__ import annotations

import csv

import pytest

from evaluation.metrics import Interval, wilson_interval
from evaluation.tables import (
    Estimate,
    Rates,
    Spread,
    csv_text,
    markdown,
    percent,
    write_atomic,
    write_table,
)
from piec_envs.errors import InvalidParameterError

ROWS = [
    {
        "mode": "caging",
        "success": wilson_interval(95, 100),
        "each": Rates([1, 0.904]),
        "end": Spread(0.0414, 0.002),
    },
    {"mode": "a|b", "end": Estimate(0.0414, 0.0399, 0.0436), "extra": None},
]


def test_intervals_read_as_percent():
    assert percent(wilson_interval(95, 100)) == "95 [89, 98] %"
    assert percent(Interval(1.0, 0.9637, 1.0)) == "100 [96, 100] %"


def test_markdown():
    lines = markdown(ROWS, "A title", "A note.").splitlines()
    assert lines[0] == "# A title" and lines[-1] == "A note."
    assert [cell.strip() for cell in lines[2].strip("|").split("|")] == [
        "mode",
        "success",
        "each",
        "end",
        "extra",
    ]
    assert "95 [89, 98] %" in lines[4] and "100, 90 %" in lines[4] and "0.041 ± 0.002" in lines[4]
    assert "a\\|b" in lines[5] and lines[5].count(" - ") == 3 and "0.041 [0.040, 0.044]" in lines[5]
    assert len({len(line) for line in lines[2:6]}) == 1


def test_csv_holds_numbers_in_full():
    first, second = csv.DictReader(csv_text(ROWS).splitlines())
    assert (
        float(first["success"]) == 0.95
        and float(first["success low"]) == wilson_interval(95, 100).low
    )
    assert first["each"] == "1 0.904" and float(first["end std"]) == 0.002
    assert second["mode"] == "a|b" and second["success"] == ""
    assert [float(second[name]) for name in ("end", "end low", "end high")] == [
        0.0414,
        0.0399,
        0.0436,
    ]


def test_writing_is_atomic(tmp_path):
    paths = write_table(tmp_path / "new", ROWS, "A title")
    assert [path.name for path in paths] == ["table.md", "table.csv"]
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["table.csv", "table.md"]
    write_atomic(paths[0], "second")
    assert paths[0].read_text() == "second"


def test_no_rows_is_an_error():
    with pytest.raises(InvalidParameterError, match="row"):
        markdown([])
