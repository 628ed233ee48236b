"""The table of protocols."""

from __future__ import annotations

from evaluation.axes import protocol_at
from evaluation.protocol import AROUND, ROLLS, Protocol
from piec_envs import check_name


def _frictions() -> list[Protocol]:
    values = (0.0, 0.2, 0.25, 0.5, 0.75, 0.8, 1.0)
    return [
        Protocol(
            f"friction-{mu:.2f}", f"friction between arm and object is {mu:g}", {"friction": mu}
        )
        for mu in values
    ]


def _shapes() -> list[Protocol]:
    shapes = {name: shape for name, (shape, _) in AROUND.items()}
    return [
        Protocol(f"shape-{name}", f"the object is the {shape}", {"object": name})
        for name, shape in shapes.items()
    ]


def _disturbances() -> list[Protocol]:
    rows = []
    for kind, suffix, meaning in (
        ("gaussian", "", "gaussian, of this sigma for each axis"),
        ("direction", "-direction", "of this length in a uniform direction (the paper's bound)"),
    ):
        for millimetres in (1, 3, 5):
            rows.append(
                Protocol(
                    f"disturbance-{millimetres}mm{suffix}",
                    f"the object is displaced by {millimetres} mm in every step, {meaning}",
                    {"disturbance": millimetres / 1000, "disturbance_kind": kind},
                )
            )
    return rows


_COMBINED = {
    "dynamics": "mujoco",
    "object": "square",
    "friction": 0.25,
    "disturbance": 0.005,
    "disturbance_kind": "gaussian",
}

# What differs at once between the planner's model and a pack of paper rolls on a real table.
_REAL = {"friction": [0.3, 0.7], "mass": [0.7, 1.3], "delay": [0.0, 0.05]}
_PLACED = (0.006, 0.03)  # m, rad; how well the object stands where it should


def _sim_to_real() -> list[Protocol]:
    kinds = {
        "sm1": ("the wrapped pack", {"object": "paper_pack_wrapped"}, {}),
        "sm2": ("a sharp box around it", {"object": "a4_box"}, {}),
        "sm3": ("that box and a loose roll at one of four places", {}, {"object": ROLLS}),
    }
    says = "under MuJoCo with friction, mass, delay and start drawn"
    return [
        Protocol(
            f"sim-to-real-{name}",
            f"{what}, {says}",
            {"dynamics": "mujoco", **params},
            _PLACED,
            {**_REAL, **drawn},
        )
        for name, (what, params, drawn) in kinds.items()
    ]


_ROWS = (
    Protocol("nominal", "the env as it is; without randomness every episode is the same one"),
    *_frictions(),
    *_shapes(),
    Protocol("dynamics-mujoco", "second-order contact dynamics, by MuJoCo", {"dynamics": "mujoco"}),
    *_disturbances(),
    Protocol(
        "adversary", "the object flees down the escape-time field at u_bar", {"adversary": 1.0}
    ),
    Protocol(
        "combined",
        "MuJoCo, the square, friction 0.25 and gaussian displacements of 5 mm at once",
        _COMBINED,
    ),
)

PROTOCOLS = {protocol.name: protocol for row in _ROWS for protocol in (row, row.with_start)} | {
    protocol.name: protocol for protocol in _sim_to_real()
}


def get_protocol(name: str) -> Protocol:
    """The protocol of that name: a row of the table, or `AXIS=VALUE` such as `sigma=0.02`.

    Raises:
        UnknownNameError: if the table has no such row, or that of axes no such axis.
        InvalidParameterError: for a value that is no number.
    """
    if "=" in str(name):
        return protocol_at(name)
    check_name("protocol", name, PROTOCOLS)
    return PROTOCOLS[name]
