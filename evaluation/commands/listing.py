"""`piec list`: the tables of the suite."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from evaluation.commands import Report

if TYPE_CHECKING:
    from piec_envs import Object


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """It has no arguments of its own."""


def run(args: argparse.Namespace) -> Report:
    """List every table with its names."""
    tables = _tables()
    lines = []
    for title, rows in tables.items():
        width = max(map(len, rows))
        lines += [
            title,
            *(f"  {name.ljust(width)}  {text}".rstrip() for name, text in rows.items()),
            "",
        ]
    return Report("\n".join(lines), tables)


def _tables() -> dict[str, dict[str, str]]:
    """Title to names to one line about each."""
    from evaluation.axes import AXES
    from evaluation.commands import COMMANDS
    from evaluation.engines import ENGINES
    from evaluation.protocols import PROTOCOLS
    from evaluation.studies import STUDIES
    from piec_envs import DYNAMICS, ENVS, FIELDS, OBJECTS, PRESETS, PRIORS, RECIPES, ROBOTS, SOLVERS
    from planners.objectives import OBJECTIVES
    from planners.sb3.algorithms import ALGORITHMS
    from planners.table import PLANNERS

    return {
        "environments": {name: entry.summary for name, entry in ENVS.items()},
        "robots": {name: _robot(name) for name in ROBOTS},
        "objects": {name: _object_line(item) for name, item in OBJECTS.items()},
        "dynamics": {name: row.summary for name, row in DYNAMICS.items()},
        "solvers": dict.fromkeys(SOLVERS, ""),
        "escape fields": {name: _field(name, kind) for name, kind in FIELDS.items()},
        "recipes of train-field": {name: row.description for name, row in RECIPES.items()},
        "priors": dict.fromkeys(PRIORS, ""),
        "presets": dict.fromkeys(PRESETS, ""),
        "planners": {name: row.summary for name, row in PLANNERS.items()},
        "objectives": {name: row.label for name, row in OBJECTIVES.items()},
        "algorithms of train": {name: row.description for name, row in ALGORITHMS.items()},
        "protocols": {name: row.description for name, row in PROTOCOLS.items()},
        "protocols by size, AXIS=VALUE": {name: row.described() for name, row in AXES.items()},
        "studies": {name: row.description for name, row in STUDIES.items()},
        "engines": {name: row.description for name, row in ENGINES.items()},
        "commands": {name: row.help for name, row in COMMANDS.items()},
    }


def _object_line(item: Object) -> str:
    """Shapes, mass, and what comes with it."""
    loose = f", {len(item.loose)} loose" if item.loose else ""
    return f"{len(item.shapes)} shape(s), {item.mass} kg{loose}"


def _robot(name: str) -> str:
    """Joints, and where the shapes come from, as far as that is installed."""
    from piec_envs import MissingDependencyError, get_robot, provenance

    try:
        robot = get_robot(name)
    except MissingDependencyError as error:
        return f"needs the extra {error.extra!r}: {provenance.install_command(error.extra)}"
    return f"{robot.dof} joints, geometry: {robot.geometry_source}"


def _field(name: str, kind: Any) -> str:
    """What the field is; of a trained one, how, and for which robots its weights ship."""
    from piec_envs import RECIPES, ROBOTS, has_weights

    summary = _first_line(getattr(kind, "func", kind))
    if name not in RECIPES:
        return summary
    robots = [robot for robot in ROBOTS if has_weights(robot, name)]
    return (
        f"{summary} Recipe: {RECIPES[name].description}. Weights: "
        f"{', '.join(robots) or 'none ship'}."
    )


def _first_line(item: Any) -> str:
    return (item.__doc__ or "").strip().partition("\n")[0]
