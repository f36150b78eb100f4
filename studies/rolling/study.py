"""Rolling bodies of given sizes: the outer ring as a function of the eccentricity, and the rings for two given sizes.

Run: python -m studies.rolling.study [OUT]       tables on the screen, rings.png in OUT (default: here)
"""

import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Circle
from scipy.optimize import root

import linkjax as lj
from linkjax.rolling import Rolling, chain, closing_outer_radius, closure_gap, rings_for

HERE = Path(__file__).parent
INNER, LARGEST, SMALLEST = 0.040, 0.027, 0.022
BLUE, VERMILION, GREY = "#0072B2", "#D55E00", "#8a8a8a"


def asked(bodies: int, start: float = 0.0) -> Rolling:
    """The rings between which the largest and the smallest of so many bodies have the given radii.

    Newton's method on three equations, closure and the two sizes. It starts from the rings whose extreme bodies are on
    the line of centres.
    """
    guess = rings_for(LARGEST, SMALLEST, bodies)

    def design(x: jax.Array) -> Rolling:
        return Rolling(x[0], x[1], bodies, eccentricity=x[2], start=start)

    def missed(x: jax.Array) -> jax.Array:
        radii = chain(design(x)).radii
        return jnp.array([0.1 * closure_gap(design(x)), radii.max() - LARGEST, radii.min() - SMALLEST])

    begin = np.array([guess.inner_radius, guess.outer_radius, guess.eccentricity])
    found = root(jax.jit(missed), begin, jac=jax.jit(jax.jacfwd(missed)), tol=1e-12)
    if np.abs(missed(found.x)).max() > 1e-12:
        raise ValueError(f"no rings found for {bodies} bodies: {found.message}")
    return design(jnp.asarray(found.x))


@jax.jit
def course(e: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Outer radius that closes eight bodies on the inner ring of the prototype; their largest and smallest radius."""
    outer = closing_outer_radius(INNER, 8, e)
    return outer, 0.5 * (outer + e - INNER), 0.5 * (outer - e - INNER)


def draw(design: Rolling, path: Path) -> None:
    """The radii over the eccentricity, and the seven bodies between their rings."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    e = jnp.linspace(0.0, 0.03, 61)
    outer, largest, smallest = jax.vmap(course)(e)
    left.plot(1e3 * e, 1e3 * largest, color=VERMILION, label="largest body")
    left.plot(1e3 * e, 1e3 * smallest, color=VERMILION, linestyle="--", label="smallest body")
    left.plot(1e3 * e, 1e3 * (outer - outer[0]), color=BLUE, label="growth of the outer ring")
    left.set(
        xlabel="eccentricity [mm]", ylabel="[mm]", xlim=(0, 30), ylim=(0, None), title="Eight bodies, inner ring 40 mm"
    )
    left.legend(frameon=False)
    made = chain(design)
    rings = ((0.0, design.inner_radius, BLUE), (design.eccentricity, design.outer_radius, GREY))
    for x, radius, colour in rings:
        right.add_patch(Circle((1e3 * float(x), 0), 1e3 * float(radius), fill=False, edgecolor=colour, linewidth=2))
    for x, y, radius in zip(made.centres.x, made.centres.y, made.radii, strict=True):
        at, size = (1e3 * float(x), 1e3 * float(y)), 1e3 * float(radius)
        right.add_patch(Circle(at, size, facecolor="#f4d58c", edgecolor="black"))
        right.text(*at, f"{size:.3f}", ha="center", va="center", fontsize=9)
    right.set(aspect="equal", title="Seven bodies of 22 to 27 mm")
    right.set_axis_off()
    right.autoscale_view()
    figure.savefig(path, dpi=120)


def main(out: Path = HERE) -> None:
    """Print the tables and draw the figure."""
    lj.enable_x64()
    print(f"{'eccentricity':>14s}{'outer ring':>14s}{'largest':>12s}{'smallest':>12s}  [mm], inner ring 40, 8 bodies")
    for e in (0.0, 0.002, 0.005, 0.010, 0.020, 0.030):
        print(
            "".join(
                f"{1e3 * float(x):{w}.5f}" for x, w in zip((e, *course(jnp.asarray(e))), (14, 14, 12, 12), strict=True)
            )
        )
    print(f"\nrings for bodies of {1e3 * SMALLEST:g} to {1e3 * LARGEST:g} mm [mm]")
    print(f"{'bodies':>8s}{'inner':>12s}{'outer':>12s}{'eccentricity':>14s}")
    for bodies in range(5, 13):
        design = asked(bodies)
        sizes = (design.inner_radius, design.outer_radius, design.eccentricity)
        print(f"{bodies:8d}" + "".join(f"{1e3 * float(x):{w}.5f}" for x, w in zip(sizes, (12, 12, 14), strict=True)))
    out.mkdir(parents=True, exist_ok=True)
    draw(asked(7), out / "rings.png")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
