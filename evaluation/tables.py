"""Tables as Markdown and CSV, written whole or not at all."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from evaluation.metrics import Interval
from piec_envs import InvalidParameterError


def write_atomic(path: str | os.PathLike, content: str | bytes) -> Path:
    """Write a file under a temporary name and rename it, so that nobody sees half of it.

    Args:
        path: where to; its folder is made if missing.
        content: text, written as UTF-8, or bytes.

    Returns:
        The path.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    temporary.write_bytes(content.encode() if isinstance(content, str) else content)
    os.replace(temporary, target)
    return target


class Rates(tuple[float, ...]):
    """Rates of several plans, or one: `100, 97 %` in Markdown, fractions in CSV."""


class Estimate(NamedTuple):
    """A mean between the bounds of its interval: `0.041 [0.039, 0.044]`."""

    value: float  # the mean
    low: float  # lower bound
    high: float  # upper bound


class Spread(NamedTuple):
    """Mean and standard deviation: `0.041 ± 0.002`."""

    mean: float  # the mean
    deviation: float  # the standard deviation


def percent(rate: Interval) -> str:
    """A rate with its interval, such as `95 [89, 98] %`."""
    return f"{100 * rate.value:.0f} [{100 * rate.low:.0f}, {100 * rate.high:.0f}] %"


def cell(value: Any) -> str:
    """One value as a Markdown table shows it."""
    if value is None:
        return "-"
    if isinstance(value, Interval):
        return percent(value)
    if isinstance(value, Estimate):
        return f"{value.value:.3f} [{value.low:.3f}, {value.high:.3f}]"
    if isinstance(value, Spread):
        return f"{value.mean:.3f} ± {value.deviation:.3f}"
    if isinstance(value, Rates):
        return ", ".join(f"{100 * rate:.0f}" for rate in value) + " %"
    if isinstance(value, float):
        return f"{value:.3g}"
    if isinstance(value, list | tuple):
        return ", ".join(cell(item) for item in value)
    return str(value)


def columns_of(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """All columns in the order of their first use.

    Raises:
        InvalidParameterError: if there are no rows.
    """
    if not rows:
        raise InvalidParameterError("a table needs at least one row")
    return list(dict.fromkeys(name for row in rows for name in row))


def markdown(
    rows: Sequence[Mapping[str, Any]], title: str = "", notes: str = "", above: str = ""
) -> str:
    """Rows as a Markdown table with aligned columns.

    Args:
        rows: from column to value; a column missing in a row is shown as "-".
        title: heading above it.
        notes: text below it.
        above: text between heading and table, such as the plant in force.

    Returns:
        The text.
    """
    names = columns_of(rows)
    body = [[cell(row.get(name)).replace("|", "\\|") for name in names] for row in rows]
    widths = [max(len(line[i]) for line in (names, *body)) for i in range(len(names))]
    ruler = ["-" * width for width in widths]
    lines = [
        "| " + " | ".join(t.ljust(w) for t, w in zip(line, widths, strict=True)) + " |"
        for line in (names, ruler, *body)
    ]
    head = [f"# {title}", ""] if title else []
    between = [above.rstrip(), ""] if above else []
    return "\n".join([*head, *between, *lines, *(["", notes] if notes else [])]) + "\n"


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as CSV with numbers in full; an interval or an estimate becomes three columns, a spread
    two.
    """
    flat = [_flatten(row) for row in rows]
    out = io.StringIO()
    writer = csv.DictWriter(out, columns_of(flat), lineterminator="\n")
    writer.writeheader()
    writer.writerows(flat)
    return out.getvalue()


def _flatten(row: Mapping[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Interval | Estimate):
            flat.update({name: value.value, f"{name} low": value.low, f"{name} high": value.high})
        elif isinstance(value, Spread):
            flat.update({name: value.mean, f"{name} std": value.deviation})
        elif isinstance(value, list | tuple):
            flat[name] = " ".join(str(item) for item in value)
        else:
            flat[name] = value
    return flat


def write_table(
    folder: str | os.PathLike,
    rows: Sequence[Mapping[str, Any]],
    title: str,
    notes: str = "",
    name: str = "table",
    above: str = "",
) -> list[Path]:
    """Write `name.md` and `name.csv` into a folder.

    Args:
        folder: where to.
        rows, title, notes, above: as in `markdown`.
        name: of the files.

    Returns:
        Both paths.
    """
    folder = Path(folder)
    return [
        write_atomic(folder / f"{name}.md", markdown(rows, title, notes, above)),
        write_atomic(folder / f"{name}.csv", csv_text(rows)),
    ]
