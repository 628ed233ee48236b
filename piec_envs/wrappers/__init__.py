"""Wrappers that change the plant under a policy, single and vector.

They hold no physics: each calls `set_params`, the one mechanism behind the keyword arguments and
`reset(options={"params": ...})` too.
"""

from piec_envs.wrappers.mismatch import (
    MISMATCHES,
    AdversarialEscape,
    DynamicsMismatch,
    FrictionMismatch,
    Mismatch,
    RandomDisturbance,
    ShapeMismatch,
    VectorAdversarialEscape,
    VectorDynamicsMismatch,
    VectorFrictionMismatch,
    VectorMismatch,
    VectorRandomDisturbance,
    VectorShapeMismatch,
)

__all__ = [
    "MISMATCHES",
    "AdversarialEscape",
    "DynamicsMismatch",
    "FrictionMismatch",
    "Mismatch",
    "RandomDisturbance",
    "ShapeMismatch",
    "VectorAdversarialEscape",
    "VectorDynamicsMismatch",
    "VectorFrictionMismatch",
    "VectorMismatch",
    "VectorRandomDisturbance",
    "VectorShapeMismatch",
]
