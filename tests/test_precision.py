"""Precision is the user's choice, and the loss in single precision is reported."""

import subprocess
import sys

PROGRAM = """
import jax, linkjax as lj
scene = lj.load("slider-crank")
cycle = lj.analyse(scene, angles=4, nodes=48)
print(cycle.delta.dtype, f"{float(cycle.delta):.9g}", f"{float(cycle.delta_error):.9g}")
"""


def test_single_precision_works_and_warns():
    import linkjax as lj
    from linkjax._compile import compiled_soon

    run = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    kind, delta, error = run.stdout.split()
    assert kind == "float32"
    assert "float32" in run.stderr and "linkjax.enable_x64()" in run.stderr
    full = float(compiled_soon(lj.steady_motion, static=("nodes",))(lj.load("slider-crank"), nodes=48).delta)
    assert abs(float(delta) / full - 1) < 1e-4
    assert abs(float(delta) - full) <= float(error) < 1e-3 * full
