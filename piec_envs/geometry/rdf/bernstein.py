"""The distance polynomial of one body, compiled: Bernstein polynomials on a box (Li et al. 2024).

u = 1/2 + asinh((x - c) / w) / (2 e) per axis runs from 0 to 1 on the box and is steep at the body,
so that a low degree resolves its edges. Beyond the box the distance to the box is added to the
value at its nearest point.
"""

from __future__ import annotations

import numpy as np

from piec_envs.kernels import kernel, lane_kernel


@kernel
def _fill_basis(rdf, s, axis, x, scratch, slopes):
    """Basis at the clamped x, and d/du if asked; returns (x beyond the box, m; du_dx, 1/m)."""
    top = rdf.weights.shape[1] - 1
    shifted, half, width = x - rdf.centre[s, axis], rdf.half[s, axis], rdf.width[s, axis]
    inner = min(max(shifted, -half), half)
    u = 0.5 + 0.5 * np.arcsinh(inner / width) / rdf.extent[s, axis]
    up, down = scratch.power[0], scratch.power[1]  # u^i, (1 - u)^i
    up[0] = down[0] = 1.0
    for i in range(top):
        up[i + 1], down[i + 1] = up[i] * u, down[i] * (1.0 - u)
    for i in range(top + 1):
        scratch.basis[axis, i] = rdf.binomials[0, i] * up[i] * down[top - i]
    if slopes:
        before = 0.0
        for i in range(top):
            here = rdf.binomials[1, i] * up[i] * down[top - 1 - i]
            scratch.slope[axis, i] = before - here
            before = here
        scratch.slope[axis, top] = before
    return shifted - inner, 0.5 / (rdf.extent[s, axis] * np.sqrt(inner * inner + width * width))


@lane_kernel
def _along_x(weights, factors, out):
    """out[m] = sum over i of factors[i] weights[i, m], shapes (n, n^2), (n,) and (n^2,)."""
    for m in range(out.shape[0]):
        out[m] = 0.0
    rest = weights.shape[0] % 4
    for i in range(rest):
        for m in range(out.shape[0]):
            out[m] += factors[i] * weights[i, m]
    for i in range(rest, weights.shape[0], 4):
        f_0, f_1, f_2, f_3 = factors[i], factors[i + 1], factors[i + 2], factors[i + 3]
        for m in range(out.shape[0]):
            out[m] += (f_0 * weights[i, m] + f_1 * weights[i + 1, m]) + (
                f_2 * weights[i + 2, m] + f_3 * weights[i + 3, m]
            )


@lane_kernel
def _along_x_twice(weights, factors, slopes, out, rise):
    """`_along_x` with two rows of factors, in one pass over the weights."""
    for m in range(out.shape[0]):
        out[m] = 0.0
        rise[m] = 0.0
    rest = weights.shape[0] % 4
    for i in range(rest):
        for m in range(out.shape[0]):
            out[m] += factors[i] * weights[i, m]
            rise[m] += slopes[i] * weights[i, m]
    for i in range(rest, weights.shape[0], 4):
        f_0, f_1, f_2, f_3 = factors[i], factors[i + 1], factors[i + 2], factors[i + 3]
        g_0, g_1, g_2, g_3 = slopes[i], slopes[i + 1], slopes[i + 2], slopes[i + 3]
        for m in range(out.shape[0]):
            a, b, c, d = weights[i, m], weights[i + 1, m], weights[i + 2, m], weights[i + 3, m]
            out[m] += (f_0 * a + f_1 * b) + (f_2 * c + f_3 * d)
            rise[m] += (g_0 * a + g_1 * b) + (g_2 * c + g_3 * d)


@lane_kernel
def _along_y(panel, factors, out):
    """out[k] = sum over j of factors[j] panel[j n + k], shapes (n^2,), (n,) and (n,)."""
    n = out.shape[0]
    for k in range(n):
        out[k] = 0.0
    for j in range(n):
        f, row = factors[j], panel[j * n : (j + 1) * n]
        for k in range(n):
            out[k] += f * row[k]


@kernel
def _along_z(row, factors):
    total = 0.0
    for k in range(row.shape[0]):
        total += factors[k] * row[k]
    return total


@kernel
def shape_distance(rdf, s, p, scratch):
    """Distance from a point to a body of shape s (Li et al. 2024).

    Args:
        rdf, scratch: a `PackedRdf` and an `RdfScratch`.
        s, p: row of the shape, and three numbers, the point in the frame of the body, m.

    Returns:
        The polynomial at the nearest point of the box plus the way there, m.
    """
    e_x, _ = _fill_basis(rdf, s, 0, p[0], scratch, False)
    e_y, _ = _fill_basis(rdf, s, 1, p[1], scratch, False)
    e_z, _ = _fill_basis(rdf, s, 2, p[2], scratch, False)
    n = rdf.weights.shape[1]
    _along_x(rdf.weights[s].reshape(n, n * n), scratch.basis[0], scratch.panel[0])
    _along_y(scratch.panel[0], scratch.basis[1], scratch.rows[0])
    return _along_z(scratch.rows[0], scratch.basis[2]) + np.sqrt(e_x * e_x + e_y * e_y + e_z * e_z)


@kernel
def shape_slope(rdf, s, p, scratch):
    """Distance from a point to a body of shape s, and its gradient in the point.

    Args:
        rdf, s, p, scratch: as in `shape_distance`.

    Returns:
        (d, g_x, g_y, g_z): the distance, m, and the gradient in the frame of the body.
    """
    e_x, u_x = _fill_basis(rdf, s, 0, p[0], scratch, True)
    e_y, u_y = _fill_basis(rdf, s, 1, p[1], scratch, True)
    e_z, u_z = _fill_basis(rdf, s, 2, p[2], scratch, True)
    n, panel, rows, basis, slope = (
        rdf.weights.shape[1],
        scratch.panel,
        scratch.rows,
        scratch.basis,
        scratch.slope,
    )
    weights = rdf.weights[s].reshape(n, n * n)
    _along_x_twice(weights, basis[0], slope[0], panel[0], panel[1])
    _along_y(panel[0], basis[1], rows[0])
    _along_y(panel[1], basis[1], rows[1])
    _along_y(panel[0], slope[1], rows[2])
    beyond = np.sqrt(e_x * e_x + e_y * e_y + e_z * e_z)
    g_x = _along_z(rows[1], basis[2]) * u_x if e_x == 0.0 else e_x / beyond
    g_y = _along_z(rows[2], basis[2]) * u_y if e_y == 0.0 else e_y / beyond
    g_z = _along_z(rows[0], slope[2]) * u_z if e_z == 0.0 else e_z / beyond
    return _along_z(rows[0], basis[2]) + beyond, g_x, g_y, g_z
