"""The hay press in plain NumPy, written by hand with analytic first and second derivatives.

As an engineer would write it without linkjax; used by the other baselines. SI units.
The load is specific to the benchmark: 30 kN opposing the slider between 90 and 335 degrees of crank angle
(the study's scene puts it on the rocker), flywheel 40 kg m2 on the crank, time-mean speed 73.27 rad/s.
Reference: delta = 0.0903376817, constant drive torque 3909.79995 N m, speed at 0 degrees 74.65753055 rad/s.
"""

import math

import numpy as np

DESIGN = {
    "l1": 0.3,
    "l2": 1.02,
    "ex": 0.45 * math.cos(math.pi / 6),
    "ey": 0.45 * math.sin(math.pi / 6),
    "l4": 0.5,
    "l5": 0.32,
    "fx": 0.57,
    "fy": 0.58,
    "c2": 0.5,
    "c4": 0.21,
    "c5": 0.2,
    "m2": 15.0,
    "m3": 40.0,
    "m4": 3.2,
    "m5": 10.0,
    "j2": 0.65,
    "j4": 0.05,
    "j5": 0.12,
}
FLYWHEEL, GRAVITY, LOAD, MEAN_SPEED = 40.0, 9.81, 30e3, 73.27
WINDOW = (math.pi / 2, math.radians(335.0))
BREAKS = (0.0, math.pi / 2, math.pi, math.radians(335.0))


def coefficients(d, phi, sqrt=np.sqrt, cos=np.cos, sin=np.sin):
    """Reduced inertia, its derivative, gravity torque, slider coefficient, sums m r' and m r'' (x, y)."""
    c, s = cos(phi), sin(phi)
    bx, by = d["l1"] * c, d["l1"] * s
    s2 = -by / d["l2"]
    c2 = sqrt(1 - s2 * s2)
    w2 = -bx / (d["l2"] * c2)
    e2 = (by + d["l2"] * w2 * w2 * s2) / (d["l2"] * c2)
    vd = -by - d["l2"] * w2 * s2
    ad = -bx - d["l2"] * (e2 * s2 + w2 * w2 * c2)
    v2x, v2y = -by - d["c2"] * w2 * s2, bx + d["c2"] * w2 * c2
    a2x, a2y = -bx - d["c2"] * (e2 * s2 + w2 * w2 * c2), -by + d["c2"] * (e2 * c2 - w2 * w2 * s2)
    ex, ey = c2 * d["ex"] - s2 * d["ey"], c2 * d["ey"] + s2 * d["ex"]
    vex, vey = -by - w2 * ey, bx + w2 * ex
    aex, aey = -bx - e2 * ey - w2 * w2 * ex, -by + e2 * ex - w2 * w2 * ey
    dx, dy = d["fx"] - bx - ex, d["fy"] - by - ey
    r2 = dx * dx + dy * dy
    a = (d["l4"] ** 2 - d["l5"] ** 2 + r2) / (2 * r2)
    h = sqrt(d["l4"] ** 2 / r2 - a * a)
    gx, gy = a * dx - h * dy, a * dy + h * dx
    hx, hy = gx - dx, gy - dy
    det = gy * hx - hy * gx
    w4, w5 = (vex * hx + hy * vey) / det, (gy * vey + gx * vex) / det
    qx, qy = aex - w4 * w4 * gx + w5 * w5 * hx, aey - w4 * w4 * gy + w5 * w5 * hy
    e4, e5 = (qx * hx + hy * qy) / det, (gy * qy + gx * qx) / det
    k4, k5 = d["c4"] / d["l4"], d["c5"] / d["l5"]
    v4x, v4y = vex - w4 * k4 * gy, vey + w4 * k4 * gx
    a4x, a4y = aex - e4 * k4 * gy - w4 * w4 * k4 * gx, aey + e4 * k4 * gx - w4 * w4 * k4 * gy
    v5x, v5y = -w5 * k5 * hy, w5 * k5 * hx
    a5x, a5y = -e5 * k5 * hy - w5 * w5 * k5 * hx, e5 * k5 * hx - w5 * w5 * k5 * hy
    m2, m3, m4, m5 = d["m2"], d["m3"], d["m4"], d["m5"]
    inertia = (
        m2 * (v2x**2 + v2y**2)
        + m3 * vd**2
        + m4 * (v4x**2 + v4y**2)
        + m5 * (v5x**2 + v5y**2)
        + d["j2"] * w2**2
        + d["j4"] * w4**2
        + d["j5"] * w5**2
    )
    slope = 2 * (
        m2 * (v2x * a2x + v2y * a2y)
        + m3 * vd * ad
        + m4 * (v4x * a4x + v4y * a4y)
        + m5 * (v5x * a5x + v5y * a5y)
        + d["j2"] * w2 * e2
        + d["j4"] * w4 * e4
        + d["j5"] * w5 * e5
    )
    gravity = -GRAVITY * (m2 * v2y + m4 * v4y + m5 * v5y)
    return (
        inertia,
        slope,
        gravity,
        vd,
        m2 * v2x + m3 * vd + m4 * v4x + m5 * v5x,
        m2 * v2y + m4 * v4y + m5 * v5y,
        m2 * a2x + m3 * ad + m4 * a4x + m5 * a5x,
        m2 * a2y + m4 * a4y + m5 * a5y,
    )
