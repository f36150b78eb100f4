# pyright: reportAttributeAccessIssue=false, reportOptionalIterable=false, reportOperatorIssue=false
"""Groups of higher class beside the ends of their ranges, and after groups with limited ranges: against mpmath, and
against the fine continuation in NumPy of `test_followed`."""

from __future__ import annotations

import cmath
import dataclasses
import math
import re

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import linkjax as lj
from linkjax import RRR, Crank, Flywheel, Gear, Harmonic, Link, Mechanism, Teeth, Vec
from linkjax._compile import compiled_soon
from linkjax.groups import General
from linkjax.kinematics import Prepared, crank_ranges, pose, prepared
from tests.physics.test_folds import least
from tests.physics.test_followed import Made, angles_of, drawn, followed, on_legs, point, triad

NEAR = 10.0 ** -np.arange(2, 11)  # rad from an end


def exact(made: Made, x: np.ndarray, phi, end: bool) -> tuple[list, object, float]:
    """Coordinates of a triad to 50 digits, from rough ones, and the crank angle, which at an `end` makes the Jacobian
    singular; and the effect of one rounding unit: one over the least singular value, of rows of length one."""
    numbers = [each.cell_contents for each in made.closure.__closure__]
    crank, inside, legs, phase, pivots = numbers

    def rods(x, y, turn, phi):
        hinges = (crank * mpmath.exp(mpmath.mpc(0, phase + phi)), *map(mpmath.mpmathify, pivots))
        u = mpmath.exp(mpmath.mpc(0, turn))
        return [x + 1j * y + at * u - hinge for at, hinge in zip(inside, hinges, strict=True)]

    def gap(*at):
        return [abs(rod) ** 2 - mpmath.mpf(leg) ** 2 for rod, leg in zip(rods(*at), legs, strict=True)]

    def matrix(*at):
        u = mpmath.exp(mpmath.mpc(0, at[2]))
        moves = [(1, 1j, 1j * corner * u) for corner in map(mpmath.mpmathify, inside)]
        return mpmath.matrix(
            [[(rod.conjugate() * d).real for d in each] for rod, each in zip(rods(*at), moves, strict=True)]
        )

    with mpmath.workdps(50):
        if end:
            *at, phi = mpmath.findroot(lambda *at: [*gap(*at), mpmath.det(matrix(*at))], (*x, phi), tol=1e-60)
            return at, phi, math.inf
        at = list(mpmath.findroot(lambda *x: gap(*x, phi), tuple(x), tol=1e-60))
        jacobian = np.asarray(matrix(*at, phi).tolist(), dtype=float)
    sizes = np.linalg.svd(jacobian / np.linalg.norm(jacobian, axis=1, keepdims=True))[1]
    return at, phi, 1 / sizes[-1]


@compiled_soon()
def plates(mechanism: Mechanism | Prepared, at: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Coordinates of the plate, and the least margin."""

    def one(phi):
        here = pose(mechanism, phi)
        p, u = here.points["P"].r, here.links["plate"].u
        return jnp.stack([p.x, p.y, jnp.atan2(u.y, u.x)]), least(mechanism, phi)

    return jax.vmap(one)(at)


# found among random triads: their branches bend so much beside an end that a cubic through points one degree apart
# misses them; the second range is less than one degree wide
BENT = [
    triad(
        0.46782629159873823,
        -1.1185864093682094,
        ((-0.4572876433748776 - 0.6139139818433552j), (0.9254539570425424 - 0.5939100367524446j)),
        (
            (0.1711780296578198 - 0.07275730736245367j),
            (0.8128197504856862 + 0.2617803721181373j),
            (-0.03528671804267147 - 0.49207275437526854j),
        ),
    ),
    triad(
        0.3200894616278453,
        0.31967946205072284,
        ((-0.6641776008900402 + 0.6663253382802536j), (0.3589884680959121 + 0.39125326626179446j)),
        (
            (-0.7191818804409633 + 0.9809370604721501j),
            (-0.4921266794629231 - 0.292002204258037j),
            (-0.5321018631573766 + 0.8852848390553001j),
        ),
    ),
]


@pytest.mark.slow
def test_random_triads_beside_their_ends(rng):
    """Ends to 1e-12 rad. Positions from 1e-2 to 1e-10 rad before them, on the side of crank angle zero, are assembled
    with errors within 1e-14 times the condition number and 1e-12; positions from 1e-4 to 1e-8 rad beyond are
    reported as not assembled, and there is no NaN."""
    ended, worst = 0, 0.0
    for made in [*(drawn(rng, False) for _ in range(40)), *BENT]:
        found = crank_ranges(made.mechanism)[0]
        if not found.at_start or found.stop - found.start > 2 * math.pi - 0.06:
            continue
        ended += 1
        ready = prepared(made.mechanism)
        everywhere, _ = plates(ready, jnp.linspace(-7.0, 7.0, 99))
        assert np.all(np.isfinite(everywhere))
        sense = np.sign(np.linalg.det(made.closure(made.start, 0.0)[1]))
        for end, way in ((found.start, 1.0), (found.stop, -1.0)):
            far = np.minimum(NEAR, 0.5 * (found.stop - found.start))
            (got, margin), (_, outside) = plates(ready, end + way * far), plates(ready, end - way * NEAR[2:7])
            assert np.all(margin > 0) and np.all(outside < 0), (ended, end)
            true_end = exact(made, np.asarray(got[-1]), end + way * far[-1], True)[1]
            assert abs(true_end - end) < 1e-12
            for x, phi in zip(np.asarray(got), end + way * far, strict=True):
                at, _, condition = exact(made, x, phi, False)
                off = max(abs(float(mpmath.mpf(a) - b)) for a, b in zip(x, at, strict=True))
                worst = max(worst, off / (1e-14 * condition + 1e-12))
                assert np.sign(np.linalg.det(made.closure(np.asarray(at, dtype=float), phi)[1])) == sense
    assert ended > 20
    assert worst < 1


def unnamed(made: Made) -> dict[str, Link]:
    """Its links, whose mass centres get new names when more are added."""
    return {name: dataclasses.replace(link, centre_name="") for name, link in made.mechanism.links.items()}


def behind(made: Made, hinge, corners: tuple[complex, ...], pivots: tuple[complex, complex]) -> Made:
    """An additional plate on three legs, one of them on the point K of an existing link, which is at `hinge(x,
    phi)`, given with its derivatives with respect to x."""
    at = hinge(made.start, 0.0)[0]
    legs = [abs(corner - end) for corner, end in zip(corners, (at, *pivots), strict=True)]
    axis = corners[1] - corners[0]
    inside = [(corner - corners[0]) / (axis / abs(axis)) for corner in corners]
    links = unnamed(made)
    links |= {name: Link(length=leg) for name, leg in zip(("uno", "dos", "tres"), legs, strict=True)}
    links["slab"] = Link(length=abs(axis), points={"R2": point(inside[2])})
    members = ("slab", ("P2", "Q2", "R2")), ("uno", ("K", "P2")), ("dos", ("G", "Q2")), ("tres", ("H", "R2"))
    group = General(members, ("K", "G", "H"), dict(zip(("P2", "Q2", "R2"), map(point, corners), strict=True)))
    fixed = {**made.mechanism.fixed, "G": point(pivots[0]), "H": point(pivots[1])}
    count = len(made.start)

    def closure(x, phi):
        gap, matrix = made.closure(x[:count], phi)
        k, slopes = hinge(x[:count], phi)
        more, rows = on_legs(x[count:], (k, *pivots), inside, legs)
        rod = x[count] + 1j * x[count + 1] - k
        whole = np.zeros((count + 3, count + 3))
        whole[:count, :count], whole[count:, count:] = matrix, rows
        whole[count, :count] = [-2 * (rod.conjugate() * d).real for d in slopes]
        return np.concatenate([gap, more]), whole

    start = np.asarray([*made.start, corners[0].real, corners[0].imag, cmath.phase(axis)])
    return Made(Mechanism(fixed, links, [*made.mechanism.groups, group]), closure, start, "slab")


def four_bar(lengths: tuple[float, float, float], base: float, phase: float, k: complex) -> tuple[Made, object]:
    """One in closed form, and the position of point K of its coupler."""
    a, b, c = lengths
    hinge = a * cmath.exp(1j * phase)
    r = abs(base - hinge)
    along = (r * r + b * b - c * c) / (2 * r)
    elbow = hinge + (base - hinge) / r * (along + 1j * math.sqrt(b * b - along * along))
    links = {"crank": Link(length=a), "coupler": Link(length=b, points={"K": point(k)}), "rocker": Link(length=c)}
    groups = [Crank("crank", "A", "B", phase=phase), RRR(("coupler", "rocker"), "B", "D", "C", 1)]

    def closure(x, phi):
        rod = a * cmath.exp(1j * (phase + phi)) + b * cmath.exp(1j * x[0]) - base
        slope = 2 * (rod.conjugate() * 1j * b * cmath.exp(1j * x[0])).real
        return np.asarray([abs(rod) ** 2 - c * c]), np.asarray([[slope]])

    def point_k(x, phi):
        arm = k * cmath.exp(1j * x[0])
        return a * cmath.exp(1j * (phase + phi)) + arm, (1j * arm,)

    start = np.asarray([cmath.phase(elbow - hinge)])
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(base, 0.0)}
    return Made(Mechanism(fixed, links, groups), closure, start, "coupler"), point_k


def on_plate(k: complex):
    def hinge(x, phi):
        arm = k * cmath.exp(1j * x[2])
        return x[0] + 1j * x[1] + arm, (1.0, 1j, 1j * arm)

    return hinge


def with_k(made: Made, k: complex) -> Made:
    plate = made.mechanism.links["plate"]
    links = {**unnamed(made), "plate": Link(length=plate.length, points={**plate.points, "K": point(k)})}
    return made._replace(mechanism=Mechanism(made.mechanism.fixed, links, made.mechanism.groups))


K_OF_FOUR_BAR = -0.5712483475083188 + 0.13044376590304663j
K_OF_FIRST, K_OF_SECOND = -0.1783178800473813 - 0.3884985665254801j, 0.28181771644916687 - 0.2864268022131127j
BEHIND = {
    # its range ends where that of the four-bar ends; beyond, it would continue in another assembly mode
    "behind a dyad": lambda: behind(
        *four_bar((0.5012274016524757, 0.7514049993984951, 0.6545780479618694), 0.4142386717826857,
                  -0.7942617442435318, K_OF_FOUR_BAR),
        (-0.8120382428551569 - 0.6530530168127295j, 0.9807617395307597 + 0.9270816485267779j,
         0.8609797955035372 - 0.13782444680525607j),
        (-0.16642327359851805 - 0.6924991298351377j, -0.8718926360962198 + 0.8856617296588014j),
    ),
    # the first of these continues for more than a turn, the second ends the machine's range
    "behind one that goes up for more than a turn": lambda: behind(
        with_k(triad(0.46774938783064235, -0.5783993444208719,
                     (-0.36328927294377333 + 0.7952678469498398j, -0.31218557330440455 - 0.33514121706188615j),
                     (-0.3921267985823733 + 0.1397757977476779j, -0.002008217261841194 - 0.23730686882687402j,
                      0.7042544539742674 - 0.06350094290801533j)), K_OF_FIRST),
        on_plate(K_OF_FIRST),
        (0.05330999800508596 + 0.4356238775024077j, 0.2595692759011723 - 0.9616954798899906j,
         -0.25945752470631733 + 0.3435321729801868j),
        (-0.864809576232626 + 0.14342049161573023j, -0.2873957242414391 - 0.7077840837666167j),
    ),
    "behind one that goes down for more than a turn": lambda: behind(
        with_k(triad(0.5938202830021266, -2.279679897188506,
                     (-0.06103952748146768 + 0.3108251661136847j, -0.27380989546224255 + 0.016126071031589584j),
                     (0.47912681852694594 + 0.37761781255448246j, -0.4807613381916127 - 0.588060475361653j,
                      0.1483244499218508 + 0.7077651500309534j)), K_OF_SECOND),
        on_plate(K_OF_SECOND),
        (-0.7536803006009427 - 0.358690957287241j, -0.3803934017631323 + 0.78180922517432j,
         0.3305025793964049 + 0.4484816783788297j),
        (-0.47256420563889967 + 0.062486512922937054j, 0.8652919361022959 - 0.41700655360963523j),
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("make", BEHIND.values(), ids=BEHIND)
def test_behind_another_group(make):
    """Ends of the range to 1e-6 rad, and positions in it, all reported as assembled."""
    made = make()
    (low, below), (high, above) = (followed(made, way) for way in (-1.0, 1.0))
    found = crank_ranges(made.mechanism)[0]
    np.testing.assert_allclose((found.start, found.stop), (low, high), atol=1e-6)
    seen = {at: x for at, x in {**below, **above}.items() if low + 1e-3 < at < high - 1e-3}
    at = np.resize(list(seen), 256)
    got, margin = angles_of(prepared(made.mechanism, 2), link=made.link, at=jnp.asarray(at))
    off = np.asarray(got) - np.asarray([seen[each][-1] for each in at])
    assert np.max(np.abs(np.sin(0.5 * off))) < 1e-9
    assert np.min(margin) > 0


@compiled_soon()
def wheels(mechanism: Mechanism | Prepared, at: jax.Array) -> tuple[jax.Array | None, jax.Array]:
    """Angle of the gear, and the least margin."""
    return jax.vmap(lambda phi: (pose(mechanism, phi).links["wheel"].angle, least(mechanism, phi)))(at)


def test_wheels_on_a_rocker_near_its_dead_position(rng):
    """Their revolutions are those of the rocker up to the end of its range, where its speed is unbounded."""
    numbers = [((0.53897, 0.57063, 0.81091), 0.30711, -0.56094)]
    numbers += [
        (tuple(10 ** rng.uniform(-0.6, 0, 3)), 10 ** rng.uniform(-0.6, 0), rng.uniform(-3, 3)) for _ in range(60)
    ]
    ended = 0
    for (a, b, c), base, phase in numbers:
        to = abs(base - a * cmath.exp(1j * phase))
        cosines = [(a * a + base * base - (b + s * c) ** 2) / (2 * a * base) for s in (1, -1)]
        turns = [s * math.acos(x) - phase for x in cosines if abs(x) < 1 for s in (1, -1)]
        if not (abs(b - c) < to < b + c and turns):
            continue
        ended += 1
        stop = min(turn % (2 * math.pi) for turn in turns)
        made, _ = four_bar((a, b, c), base, phase, 0.0)
        fixed = {**made.mechanism.fixed, "F": Vec(base, 1.0)}
        gear = Gear("wheel", "F", Teeth((20, 30)), "rocker", "D")
        machine = Mechanism(fixed, {**unnamed(made), "wheel": Link()}, [*made.mechanism.groups, gear])
        at = np.sort(np.concatenate([np.linspace(0, stop, 137)[:-1], stop - stop * 10.0 ** -np.linspace(1.5, 9, 119)]))
        got, margin = wheels(prepared(machine), jnp.asarray(at))
        rocker = np.unwrap([_rocker((a, b, c), base, phase + phi) for phi in at])
        off = np.asarray(got) + 1.5 * rocker
        assert np.min(margin) > 0
        np.testing.assert_allclose(off - off[0], 0.0, atol=1e-7)
    assert ended > 20


def _rocker(lengths: tuple[float, float, float], base: float, crank: float) -> float:
    """Angle of the rocker of a four-bar."""
    a, b, c = lengths
    hinge = a * cmath.exp(1j * crank)
    r = abs(base - hinge)
    along = (r * r + b * b - c * c) / (2 * r)
    elbow = hinge + (base - hinge) / r * (along + 1j * math.sqrt(max(b * b - along * along, 0.0)))
    return cmath.phase(elbow - base)


# at crank angle zero the drawing at the beginning of a motion law leads to another assembly mode
SWUNG = triad(
    0.6235812433172111,
    1.2757053680593842,
    ((-0.7215504143063136 + 0.61068745951669j), (-0.41475731707720875 - 0.05351188054862965j)),
    (
        (0.5908964636530711 - 0.25728056544535827j),
        (0.7707897422226384 + 0.02107756643203551j),
        (0.8865770534526232 + 0.5429163554359593j),
    ),
)


@pytest.mark.slow
def test_ranges_of_a_crank_that_follows_a_law(rng):
    """They are those of the crank without the law, for every beginning, and in the assembly mode drawn there."""
    made = [SWUNG, *(drawn(rng, False) for _ in range(6))]
    for k, each in enumerate(made):
        crank, group = each.mechanism.groups
        (low, below), (high, above) = (followed(each, way) for way in (-1.0, 1.0))
        if not math.isfinite(low + high):
            continue
        seen = list((above if k % 2 else below).items())
        begin, x = seen[max(len(seen) - 3, 0)]
        turn = cmath.exp(1j * (x[2] - each.start[2]))
        corners = [group.sketch[name] for name in "PQR"]
        first = complex(corners[0].x, corners[0].y)
        moved = [x[0] + 1j * x[1] + (complex(at.x, at.y) - first) * turn for at in corners]
        driven = dataclasses.replace(crank, law=Harmonic(begin, begin + 0.02))
        drawn_there = dataclasses.replace(group, sketch=dict(zip("PQR", map(point, moved), strict=True)))
        machine = Mechanism(each.mechanism.fixed, each.mechanism.links, [driven, drawn_there])
        found = crank_ranges(machine)[0]
        np.testing.assert_allclose((found.start, found.stop), (low, high), atol=1e-6)


# an oscillation over its whole range would begin where the drawing leads to another assembly mode
FAR_AROUND = triad(
    0.30584897572866454,
    2.8233525787957428,
    ((-0.6394249183138097 + 0.49372077129967584j), (0.5044468367385548 + 0.1339557489058245j)),
    (
        (0.8421593545658599 - 0.5884499035419624j),
        (0.7018022491833029 - 0.6620253773458276j),
        (0.9287154417885592 + 0.24738545621230346j),
    ),
)


@pytest.mark.slow
def test_the_law_that_is_proposed_can_be_driven():
    """The message about a crank that cannot rotate fully is correct: its range, and a law within it."""
    machine = dataclasses.replace(FAR_AROUND.mechanism, flywheel=Flywheel(1.0))
    low, high = (math.degrees(followed(FAR_AROUND, way)[0]) for way in (-1.0, 1.0))
    with pytest.raises(lj.MachineError, match=f"only as another .* from {low:.4f} to {high:.4f} degrees") as told:
        lj.analyse(lj.Scene(machine, speed=3.0), angles=8, nodes=32)
    start, stop = re.findall(r'(?:start|stop) = "([-0-9.]+) deg"', str(told.value))
    law = Harmonic(math.radians(float(start)), math.radians(float(stop)))
    crank, group = machine.groups
    driven = dataclasses.replace(machine, groups=(dataclasses.replace(crank, law=law), group))
    lj.analyse(lj.Scene(driven, speed=3.0), angles=8, nodes=32)
