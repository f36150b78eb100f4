# pyright: reportMissingImports=false
"""Baseline: positions, first and second coefficients of three machines, written by hand and compiled by numba.

Four-bar, quick-return and Stephenson III six-bar from the closed forms of their dyads, with prange and fastmath. A row
of the result contains r, r', r'' (x and y) of the moving pins, then ω', ε' of the links of the dyads.
"""

import math
import os

os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")

import numba as nb


@nb.njit(fastmath=True, error_model="numpy")
def crank(p, k, length, phi):
    """A crank about (p[k], p[k+1])."""
    x, y = length * math.cos(phi), length * math.sin(phi)
    return p[k] + x, p[k + 1] + y, -y, x, -x, -y


@nb.njit(fastmath=True, error_model="numpy")
def rrr(a, b, l1, l2, side):
    """The pin of two bars on the moving points a and b, and ω', ε' of both."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    rr = dx * dx + dy * dy
    foot = 0.5 + (l1 * l1 - l2 * l2) / (2 * rr)
    h = side * math.sqrt(l1 * l1 / rr - foot * foot)
    px, py = foot * dx - h * dy, foot * dy + h * dx
    qx, qy = px - dx, py - dy
    det = 1 / (px * qy - py * qx)
    vx, vy = b[2] - a[2], b[3] - a[3]
    w1, w2 = (vx * qx + vy * qy) * det, (vx * px + vy * py) * det
    cx = b[4] - a[4] + w1 * w1 * px - w2 * w2 * qx
    cy = b[5] - a[5] + w1 * w1 * py - w2 * w2 * qy
    e1, e2 = (cx * qx + cy * qy) * det, (cx * px + cy * py) * det
    pin = (a[0] + px, a[1] + py, a[2] - w1 * py, a[3] + w1 * px,
           a[4] - e1 * py - w1 * w1 * px, a[5] + e1 * px - w1 * w1 * py)  # fmt: skip
    return pin, w1, e1, w2, e2


@nb.njit(fastmath=True, error_model="numpy")
def put(row, k, pin):
    for i in range(6):
        row[k + i] = pin[i]


@nb.njit(fastmath=True, error_model="numpy")
def four_bar(p, phi, row):
    """p: A, D, crank, coupler, rocker."""
    b = crank(p, 0, p[4], phi)
    c, w1, e1, w2, e2 = rrr(b, (p[2], p[3], 0.0, 0.0, 0.0, 0.0), p[5], p[6], 1.0)
    put(row, 0, b)
    put(row, 6, c)
    row[12], row[13], row[14], row[15] = w1, e1, w2, e2


@nb.njit(fastmath=True, error_model="numpy")
def stephenson(p, phi, row):
    """p: A, D, F, crank, coupler, rocker, arm, lever, E on the coupler."""
    b = crank(p, 0, p[6], phi)
    c, w1, e1, w2, e2 = rrr(b, (p[2], p[3], 0.0, 0.0, 0.0, 0.0), p[7], p[8], 1.0)
    ux, uy = (c[0] - b[0]) / p[7], (c[1] - b[1]) / p[7]
    x, y = p[11] * ux - p[12] * uy, p[11] * uy + p[12] * ux
    e = (b[0] + x, b[1] + y, b[2] - w1 * y, b[3] + w1 * x,
         b[4] - e1 * y - w1 * w1 * x, b[5] + e1 * x - w1 * w1 * y)  # fmt: skip
    g, w3, e3, w4, e4 = rrr(e, (p[4], p[5], 0.0, 0.0, 0.0, 0.0), p[9], p[10], -1.0)
    put(row, 0, b)
    put(row, 6, c)
    put(row, 12, e)
    put(row, 18, g)
    row[24], row[25], row[26], row[27] = w1, e1, w2, e2
    row[28], row[29], row[30], row[31] = w3, e3, w4, e4


@nb.njit(fastmath=True, error_model="numpy")
def quick_return(p, phi, row):
    """p: O, P, T, crank, lever, rod; the ram's guide runs along x, the ram on the left."""
    b = crank(p, 0, p[6], phi)
    dx, dy = b[0] - p[2], b[1] - p[3]
    rr = dx * dx + dy * dy
    r = math.sqrt(rr)
    ux, uy = dx / r, dy / r
    w = (ux * b[3] - uy * b[2]) / r
    slide = ux * b[2] + uy * b[3]
    e = (ux * b[5] - uy * b[4] - 2 * slide * w) / r
    x, y = p[7] * ux, p[7] * uy
    end = (p[2] + x, p[3] + y, -w * y, w * x, -e * y - w * w * x, e * x - w * w * y)
    q = end[1] - p[5]
    h = -math.sqrt(p[8] * p[8] - q * q)
    w2 = -end[3] / h
    e2 = -(end[5] + w2 * w2 * q) / h
    put(row, 0, b)
    put(row, 6, end)
    row[12], row[13] = end[0] + h, p[5]
    row[14], row[15] = end[2] + w2 * q, 0.0
    row[16], row[17] = end[4] + e2 * q - w2 * w2 * h, 0.0
    row[18], row[19], row[20], row[21] = w, e, w2, e2


def _swept(kernel):
    @nb.njit(parallel=True, fastmath=True, error_model="numpy")
    def sweep(designs, count, out):
        for i in nb.prange(designs.shape[0]):
            for n in range(count):
                kernel(designs[i], 2 * math.pi * n / count, out[i, n])

    return sweep


SWEEPS = {"four-bar": _swept(four_bar), "quick-return": _swept(quick_return), "stephenson-3": _swept(stephenson)}
