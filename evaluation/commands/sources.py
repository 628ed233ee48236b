"""Files of plans and agents as the commands take them, and what they are judged in."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evaluation.commands import settings

OWN = "own"


@dataclass(frozen=True)
class Source:
    """A plan or an agent from a file.

    Args:
        path: of the file.
        made: the `Plan` or the `Agent`.
        name: what tables call it.
    """

    path: Path
    made: Any
    name: str

    def base_kwargs(self, args: argparse.Namespace) -> dict[str, Any]:
        """Keyword arguments of its environment before the protocol, as --plant and --set say."""
        from evaluation.plants import base_kwargs

        return base_kwargs(self.made, args.plant, settings(args.set))


def load_sources(paths: Sequence[Path]) -> list[Source]:
    """The plans and agents (.zip) in files.

    Raises:
        PlanError: if one is missing, broken, or no plan.
        AgentError: if one is missing, broken, or no agent.
    """
    made = [_load(path) for path in paths]
    names = [_short(path) for path in paths]
    unique = [
        name if names.count(name) == 1 else str(path)
        for path, name in zip(paths, names, strict=True)
    ]
    return [Source(*entry) for entry in zip(paths, made, unique, strict=True)]


def _load(path: Path) -> Any:
    if path.suffix == ".zip":
        from planners.sb3 import Agent

        return Agent.load(path)
    from planners import Plan

    return Plan.load(path)


def _short(path: Path) -> str:
    """A plan by its file; all agents are agent.zip, so that they go by their folder, too."""
    return f"{path.parent.name}/{path.stem}" if path.suffix == ".zip" else path.stem


def add_plant_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of every command that executes plans and agents."""
    parser.add_argument(
        "--plant",
        default=OWN,
        help="what --set overrides: own (the task and the nominal model that the file was made "
        "for), disturbed "
        "(these, with what was drawn or fled while it was made) or default (its task in the "
        "environment's default "
        "plant); default: %(default)s",
    )
    parser.add_argument(
        "--set",
        nargs="+",
        metavar="NAME=VALUE",
        help="keyword arguments of the environment, such as friction=0.2",
    )


def plants_text(
    sources: Sequence[Source], plants: Sequence[Mapping[str, Mapping[str, Any]]]
) -> str:
    """What stands above a table: the plants in force, files that share theirs together.

    Args:
        sources: the files.
        plants: for each, from the protocol to what `plant_in_force` found.

    Returns:
        Markdown, one paragraph and list for each plant.
    """
    together: dict[tuple[str, ...], list[str]] = {}
    for source, by_protocol in zip(sources, plants, strict=True):
        together.setdefault(_lines(source, by_protocol), []).append(source.name)
    blocks = [
        "\n".join([f"Plant of {', '.join(names)}:", "", *lines])
        for lines, names in together.items()
    ]
    return "\n\n".join(blocks) + "\n"


def _lines(source: Source, plants: Mapping[str, Mapping[str, Any]]) -> tuple[str, ...]:
    """The first plant in full, how each of the others differs from it, and what it was made with
    beside them.
    """
    from evaluation.plants import plain, plant_changes, plant_line

    (first, whole), *others = plants.items()
    lines = [f"{first}: {plant_line(whole)}"]
    lines += [f"{name}: {plant_changes(whole, plant) or 'the same'}" for name, plant in others]
    quiet = source.made.model_kwargs
    all_of_it = source.made.disturbed_kwargs
    beside = {
        name: all_of_it[name] for name in sorted(set(all_of_it) - set(quiet)) if all_of_it[name]
    }
    told = [f"{name} {plain(value)}" for name, value in beside.items() if value != whole.get(name)]
    if told:
        lines.append(f"made with {', '.join(told)}, which --plant disturbed puts in force")
    return tuple(f"- {line}" for line in lines)
