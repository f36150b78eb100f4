"""Messages in other units: numbers in prose are rewritten, quoted text is not."""

import pytest

from linkjax._display import Numbers, retold
from linkjax._results import MachineError, Result
from linkjax._units import display_units
from linkjax.cli._said import messages_in
from linkjax.scenes import SceneError


@pytest.mark.parametrize(
    ("units", "text", "told"),
    [
        ("", "are 0.1919 m apart, and 'a' (0.5 m) and 'b' (12 m)",
         "are 191.9 mm apart, and 'a' (500 mm) and 'b' (12 m)"),
        ("in", "'rod' is 0.254 m, but its ends are 0.1 to 0.2 m apart",
         "'rod' is 10 in, but its ends are 3.937 to 7.874 in apart"),
        ("mm", 'its crank\'s law = { start = "0.3 m" }, 5 m/s and 3 mm',
         'its crank\'s law = { start = "0.3 m" }, 5 m/s and 3 mm'),
        ("mm", "Scene 'Lift of 5 m': 1e-05 m are left open", "Scene 'Lift of 5 m': 0.01 mm are left open"),
        ("rad", "from 0.0000 to 180.0000 degrees of crank angle", "from 0 to 3.14159 rad of crank angle"),
        ("mm", "at 71.28 degrees of crank angle", "at 71.28 degrees of crank angle"),
        ("", "its law, which begins at 0.5236 rad", "its law, which begins at 30°"),
    ],
)  # fmt: skip
def test_amounts(units, text, told):
    assert retold(text, Numbers(display_units(units))) == told


def test_speeds_of_rotation():
    """To the written digits: 73.30382858376184 rad/s are 700 rpm."""
    with pytest.raises(MachineError) as caught, messages_in(Numbers(display_units("rpm"))):
        raise MachineError("at 73.3 rad/s", Result.NO_PERIODIC_REGIME)
    assert str(caught.value) == "at 700 rpm" and caught.value.result is Result.NO_PERIODIC_REGIME


def test_what_is_wrong_with_a_file():
    for units, told in (("in", "is 10 in, not 5 in"), ("rpm", "is 0.254 m, not 0.127 m")):
        with pytest.raises(SceneError) as caught, messages_in(Numbers(display_units(units))):
            raise SceneError("a.toml", "links.rod.length", "254 mm", "is 0.254 m, not 0.127 m", 'write length = "1 m"')
        error = caught.value
        assert (error.problem, error.remedy, error.value) == (told, 'write length = "1 m"', "254 mm")
