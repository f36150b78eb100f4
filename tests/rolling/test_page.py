"""The page of rolling bodies in a browser: every member is at its position in the chain."""

from __future__ import annotations

import math

import numpy as np
import pytest

import linkjax as lj
from linkjax.report import write_rolling_report
from linkjax.rolling import document

CASES = [{}, {"held": "inner", "driven": "outer", "rotation": "cw"}, {"held": "carrier", "start": "20 deg"}]


@pytest.fixture(params=CASES, ids=str)
def case(request, tmp_path):
    machine = lj.load_rolling("rolling-eccentric", request.param)
    return machine, write_rolling_report(document(machine, name="rolling-eccentric"), tmp_path / "report.html")


def test_members_stand_and_turn_as_the_chain_does(browser, case):
    machine, path = case
    page = browser.new_page(viewport={"width": 1000, "height": 900})
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(path.as_uri())
    for degrees in (0.0, 100.0, 250.0):
        page.evaluate("at => { const s = document.getElementById('angle'); s.value = at; "
                      "s.dispatchEvent(new Event('input')); }", degrees)  # fmt: skip
        found = page.evaluate(
            "[...document.querySelectorAll('[data-body], #outer-ring, #inner-ring')].map(c => { "
            "const m = c.parentNode.transform.baseVal.consolidate().matrix; "
            "return [m.e, m.f, m.a, -m.b, c.r.baseVal.value]; })"
        )
        view = page.evaluate("JSON.parse(document.getElementById('machine-data').textContent)")
        angle = math.radians(degrees) * (-1 if float(machine.speed) < 0 else 1)
        made, turned = machine.at(angle), machine.turned(angle)
        want = [(made.outer_centre.x, made.outer_centre.y, turned.outer, machine.design.outer_radius),
                (made.inner_centre.x, made.inner_centre.y, turned.inner, machine.design.inner_radius),
                *zip(made.centres.x, made.centres.y, turned.bodies, made.radii, strict=True)]  # fmt: skip
        for ours, (x, y, spin, radius) in zip(found, want, strict=True):
            at = (view["left"] + view["scale"] * float(x), view["base"] - view["scale"] * float(y))
            np.testing.assert_allclose(ours[:2], at, rtol=0, atol=2e-3)
            np.testing.assert_allclose(ours[2:4], (math.cos(spin), math.sin(spin)), rtol=0, atol=1e-5)
            assert ours[4] == pytest.approx(view["scale"] * float(radius), rel=1e-6)
    page.click("#play")
    page.wait_for_function("Number(document.getElementById('angle').value) > 251")
    assert page.inner_text("#play") == "Pause" and not wrong
    page.uncheck("#show-names")
    assert page.evaluate("document.getElementById('names').style.display") == "none"
    wide = page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    assert wide
    page.close()
