"""Settings of the quasi-dynamic model, by the default and by the paper."""

from __future__ import annotations

from typing import NamedTuple


class ContactModel(NamedTuple):
    """Settings of the quasi-dynamic model.

    Args:
        own_inertia: whether the object turns as an even solid of its shape, M_o,theta = M_o,x rho^2
            with rho its radius of gyration, instead of with the paper's 0.042, which is far stiffer
            for all our objects; each row's plant says so.
        compliance: c relative to the largest diagonal entry of the dual matrix; 0 is rigid.
        push_out: largest overlap that one step resolves, m.
        state_noise: whether a displacement moves the pose before the QP (the paper's literal
            reading) instead of entering the QP as the object's free motion.
        unlimited_lead: whether the command may run ahead of a stalled joint without limit.
    """

    compliance: float = 1e-4
    push_out: float = 0.01
    state_noise: bool = False
    unlimited_lead: bool = False
    own_inertia: bool = False


PAPER_MODEL = ContactModel(compliance=0.0, unlimited_lead=True)
