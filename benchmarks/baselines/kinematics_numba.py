# pyright: reportMissingImports=false
"""Baseline: the same formulas compiled by numba with prange and fastmath, the speed of hand-written code.

Run: python kinematics_numba.py   (needs numba)   prints crank positions per second, all cores.
"""

import math
import os
import time

os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")  # the most reproducible layer

import numba as nb
import numpy as np

from benchmarks.baselines.hay_press import DESIGN

NAMES = list(DESIGN)


def _kernel_source():
    import inspect

    from benchmarks.baselines import hay_press

    body = inspect.getsource(hay_press.coefficients).split('"""')[2]
    for i, name in enumerate(NAMES):
        body = body.replace(f'd["{name}"]', f"p[{i}]")
    return "def kernel(p, phi):\n" + body


_scope = {"sqrt": math.sqrt, "cos": math.cos, "sin": math.sin, "GRAVITY": 9.81}
exec(_kernel_source(), _scope)  # the scalar version of hay_press.coefficients
kernel = nb.njit(fastmath=True)(_scope["kernel"])


@nb.njit(parallel=True, fastmath=True)
def sweep(designs, count, out):
    for i in nb.prange(designs.shape[0]):
        for n in range(count):
            out[i, n, :] = kernel(designs[i], 2 * math.pi * n / count)


if __name__ == "__main__":
    rng = np.random.default_rng(0)
    for batch in (1000, 10000):
        designs = np.array(list(DESIGN.values())) * (1 + 1e-3 * rng.normal(size=(batch, len(NAMES))))
        out = np.empty((batch, 64, 8))
        sweep(designs, 64, out)
        assert np.isfinite(out).all()
        times = []
        for _ in range(15):
            start = time.perf_counter()
            sweep(designs, 64, out)
            times.append(time.perf_counter() - start)
        print(
            f"{batch} designs x 64 angles: median {batch * 64 / np.median(times) / 1e6:.1f}, "
            f"best {batch * 64 / min(times) / 1e6:.1f} M positions/s"
        )
