"""Committed results against those of a run, value by value."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evaluation.tables import csv_text, markdown, write_atomic

SHOWN = 20  # rows of the table that people see
NAME = "comparison"


@dataclass(frozen=True)
class Difference:
    """One value of a result, as it is committed and as this run found it.

    Args:
        work: what people call the piece of work.
        value: name of the value in its result.
        committed: the value there, None if there is none.
        yours: that of this run, None if there is none.
    """

    work: str
    value: str
    committed: Any
    yours: Any

    @property
    def size(self) -> float:
        """The difference over the larger of the two; infinite between what is no number, 0 if
        equal.
        """
        a = self.committed
        b = self.yours
        if _same(a, b):
            return 0.0
        numbers = all(
            isinstance(item, int | float) and not isinstance(item, bool) for item in (a, b)
        )
        if not numbers or not (math.isfinite(a) and math.isfinite(b)):
            return math.inf
        return abs(a - b) / max(abs(a), abs(b))

    def row(self) -> dict[str, Any]:
        """A row of the table."""
        differs = (
            "no"
            if self.size == 0
            else "yes"
            if math.isinf(self.size)
            else f"by {100 * self.size:.2g} %"
        )
        names = {"work": self.work, "value": self.value}
        return {**names, "committed": self.committed, "yours": self.yours, "differs": differs}


def _same(a: Any, b: Any) -> bool:
    both = isinstance(a, float) and isinstance(b, float)
    return a == b or (both and math.isnan(a) and math.isnan(b))


def compare(
    committed: Mapping[str, Mapping[str, Any]],
    own: Mapping[str, Mapping[str, Any]],
    labels: Mapping[str, str],
) -> list[Difference]:
    """All values of all results that both have, equal ones too.

    Args:
        committed: records by key.
        own: records by key.
        labels: what people call each piece of work, by key.

    Returns:
        The values, in the order of `own`.
    """
    found = []
    for key in own:
        if key not in committed:
            continue
        ours, theirs = (dict(leaves(record["result"])) for record in (own[key], committed[key]))
        label = f"{_kind(own[key])}{labels.get(key) or key}"
        found += [
            Difference(label, name, theirs.get(name), ours.get(name)) for name in {**theirs, **ours}
        ]
    return found


def _kind(record: Mapping[str, Any]) -> str:
    work = record["spec"].get("work")
    return f"{work}: " if work else ""


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """The numbers and texts of a result with their names.

    Args:
        value: JSON values.
        name: of the whole.

    Yields:
        Pairs such as ("nominal.d2g", 0.0) and ("contact[2]", 0.1).
    """
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from leaves(item, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list | tuple):
        for i, item in enumerate(value):
            yield from leaves(item, f"{name}[{i}]")
    else:
        yield name, value


def summary(found: list[Difference]) -> str:
    """How many values there are and how many differ, in one sentence."""
    works = len({item.work for item in found})
    sizes = [item.size for item in found if item.size > 0]
    if not sizes:
        return (
            f"committed against yours: all {len(found)} values of {works} pieces of work are "
            f"the same"
        )
    large = sum(size > 1e-6 for size in sizes)
    return (
        f"committed against yours: {len(sizes)} of {len(found)} values of {works} pieces of work "
        f"differ, "
        f"{large} of them by more than a millionth"
    )


def comparison_table(found: list[Difference]) -> str:
    """What people see: the largest differences, "" if there are none."""
    differing = sorted((item for item in found if item.size > 0), key=lambda item: -item.size)
    if not differing:
        return ""
    more = (
        f"{len(differing) - SHOWN} more differ; all values are in {NAME}.csv"
        if len(differing) > SHOWN
        else ""
    )
    return markdown([item.row() for item in differing[:SHOWN]], notes=more)


def write_comparison(folder: Path, found: list[Difference]) -> list[Path]:
    """Write the table for people and all values as CSV.

    Args:
        folder: where to.
        found: from `compare`.

    Returns:
        Both files.
    """
    text = f"# Committed against yours\n\n{summary(found)}\n\n{comparison_table(found)}"
    rows = [{**item.row(), "differs": item.size} for item in found]
    return [
        write_atomic(folder / f"{NAME}.md", text),
        write_atomic(folder / f"{NAME}.csv", csv_text(rows)),
    ]
