"""How figures name and colour each kind of plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Mode:
    """How figures name and colour one kind of plan.

    Args:
        label: its name in legends and titles.
        colour: safe for the common kinds of colour blindness.
    """

    label: str
    colour: str


MODES = {
    "contact": Mode("contact (mode 1)", "#e69f00"),
    "proximity": Mode("proximity (mode 2)", "#3b7db8"),
    "caging": Mode("caging (mode 3)", "#882255"),
    "adversarial": Mode("adversarial (mode 4)", "#44aa99"),
    "Point": Mode("Point", "#8b91a0"),
    "Link": Mode("Link", "#3b7db8"),
    "WAContact": Mode("WAContact", "#e69f00"),
    "WACaging": Mode("WACaging", "#882255"),
}
_OTHERS = ("#555b6b", "#b58a3c", "#5f7fa6", "#a3667f", "#7d9c8f")


def mode_of(name: str, among: Sequence[str] = ()) -> Mode:
    """The row of a mode; a name that is no mode is its own label, in a muted colour.

    Args:
        name: of the mode.
        among: all names of the figure, so that two strangers differ in colour.

    Returns:
        Label and colour.
    """
    if name in MODES:
        return MODES[name]
    strangers = [other for other in among if other not in MODES]
    return Mode(
        name.replace("_", " "),
        _OTHERS[strangers.index(name) % len(_OTHERS) if name in strangers else 0],
    )
