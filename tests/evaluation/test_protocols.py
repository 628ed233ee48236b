from __future__ import annotations

import pytest

from evaluation.protocols import PROTOCOLS, get_protocol, is_random
from piec_envs.episodes.config import EnvConfig
from piec_envs.episodes.state import PlantParams
from piec_envs.errors import UnknownNameError


@pytest.mark.parametrize("name", PROTOCOLS)
def test_rows_are_valid(name):
    protocol = get_protocol(name)
    assert protocol.name == name and protocol.description
    PlantParams().replace(protocol.params)
    EnvConfig("push", **protocol.env_kwargs({"object": "square"}))
    assert is_random(protocol.env_kwargs()) == (name not in ("nominal", "adversary"))


def test_the_issues_protocols_are_there():
    levels = [f"disturbance-{mm}mm{kind}" for kind in ("", "-direction") for mm in (1, 3, 5)]
    assert set(PROTOCOLS) == {"nominal", *levels, "adversary", "start"}
    assert get_protocol("disturbance-3mm-direction").params == {
        "disturbance": 0.003,
        "disturbance_kind": "direction",
    }


def test_a_protocol_overrides_the_users_arguments_and_keeps_the_others():
    base = {"disturbance": 0.1, "object": "square"}
    assert get_protocol("disturbance-1mm").env_kwargs(base)["disturbance"] == 0.001
    assert get_protocol("nominal").env_kwargs(base) == base


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(UnknownNameError, match=r"disturbance-5mm.*nominal"):
        get_protocol("disturbance-7mm")
