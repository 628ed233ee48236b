"""What the active-set method does besides where nothing gives: rows that depend on each other, and
answers to doubt.

Four rows of two points on one face, or those of an object pinched between links, depend on each
other. With compliance each row still has a part of its own; without, the pivot of a dependent row
is rounding noise.
"""

from __future__ import annotations

import numpy as np

from piec_envs.kernels import inlined_kernel

FAILED = -1  # in place of a number of rows
# a row whose part off the others has at most this share of its square depends on them
NOISE = 1e-13
SHARE = 1e-9  # less of a row in another is rounding noise
# m; largest violation, or gap under pressure, of an answer that is taken for one
RIGID_RESIDUAL = 1e-9


@inlined_kernel
def _depends(p, dual):
    """Whether the last of the p passive rows depends on those before it, but for rounding."""
    a = dual.passive[p - 1]
    return dual.inverse[p - 1] ** 2 * dual.G[a, a] * NOISE >= 1.0


@inlined_kernel
def _exchange(p, dual):
    """Let the last of the p passive rows, which depends on those before it, take the place of one
    of them.

    With a = sum_k share_k a_k the step stays the same while the last multiplier grows by t and the
    others fall by t share_k; the dual falls as long as none turns negative (Goldfarb and Idnani
    1983, step 2c).

    Returns:
        Position from which the factor is not known any more; -1 where no row can leave: the
        constraints contradict each other.
    """
    last, share, passive = p - 1, dual.z, dual.passive
    for i in range(last):
        share[i] = dual.L[last, i]
    for i in range(last - 1, -1, -1):
        share[i] *= dual.inverse[i]
        for j in range(i):
            share[j] -= dual.L[i, j] * share[i]
    leaving, most = -1, np.inf
    for i in range(last):
        if share[i] > SHARE and dual.multipliers[passive[i]] < most * share[i]:
            leaving, most = i, dual.multipliers[passive[i]] / share[i]
    if leaving < 0:
        return -1
    for i in range(last):
        dual.multipliers[passive[i]] = max(dual.multipliers[passive[i]] - most * share[i], 0.0)
    dual.multipliers[passive[leaving]] = 0.0
    dual.multipliers[passive[last]] = most
    for i in range(leaving, last):
        passive[i] = passive[i + 1]
    return leaving


@inlined_kernel
def give_way(p, dual):
    """Let the last of the p passive rows take the place of another one where it depends on the
    others.

    Args:
        p: size of the passive set, whose factor is known.
        dual: the scratch of `active_set`.

    Returns:
        (begin, p): the first position whose factor is not known, and the set's size; begin is -1
        where the constraints contradict each other.
    """
    if _depends(p, dual):
        return _exchange(p, dual), p - 1
    return p, p


@inlined_kernel
def is_answer(m, p, dual):
    """Whether no row is violated, and those that press are closed; the rest of the KKT conditions
    hold as computed.

    Args:
        m: number of rows.
        p: size of the passive set.
        dual: the scratch of `active_set`, with `value` filled.

    Returns:
        True if it is an answer.
    """
    worst = 0.0
    for i in range(m):
        worst = max(worst, -dual.value[i])
    for i in range(p):
        worst = max(worst, dual.value[dual.passive[i]])
    return worst <= RIGID_RESIDUAL
