"""What cannot be of this world is a warning of the conversion, and an error under --strict."""

from __future__ import annotations

import pytest
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.convert_object import convert_object

from ig2mj.errors import InputError


def box(size: str, tag: str = "collision") -> str:
    return f'<{tag}><geometry><box size="{size}"/></geometry></{tag}>'


def inertial(mass: float) -> str:
    return f'<inertial><mass value="{mass}"/></inertial>'


def convert(folder, inside: str, **options):
    file = folder / "thing.urdf"
    file.write_text(f'<robot name="thing"><link name="base_link">{inside}</link></robot>')
    given = ConvertOptions(cache=False, **options)
    return convert_object(file, "notebook", folder / "out", options=given)


ODD = {
    "in millimetres": (box("300 200 40"), "is 300 m across: are its meshes in another unit"),
    "smaller than a millimetre": (box("0.0005 0.0004 0.0003"), "is 0.0005 m across: are its meshes in another unit"),
    "thinner than a millimetre": (box("0.2 0.1 0.0005"), "is 0.5 mm thin"),
    "lighter than foam": (box("1 1 1") + inertial(0.5), "weighs 0.5 kg, 0.5 kg/m3"),
    "heavier than gold": (box("0.1 0.1 0.1") + inertial(50), "weighs 50 kg, 5e+04 kg/m3"),
    "heavy far from where it is": (
        box("0.2 0.2 0.2") + '<inertial><mass value="1"/><origin xyz="50 0 0"/></inertial>',
        "has its centre of mass 49.9 m outside",
    ),
    "seen twice as large": (box("0.2 0.2 0.2") + box("0.2 0.5 0.2", "visual"), "is 0.2 m along y where it collides"),
    "seen half as large": (
        box("0.2 0.2 0.5") + box("0.2 0.2 0.2", "visual"),
        "0.5 m along z where it collides",
    ),
}


@pytest.mark.parametrize("what", ODD)
def test_an_implausible_object_is_a_warning_and_an_error_under_strict(tmp_path, what):
    inside, message = ODD[what]
    outcome = convert(tmp_path, inside, report=False)
    assert any(message in line for line in outcome.first_warnings), outcome.first_warnings
    with pytest.raises(InputError, match="--strict treats warnings as errors"):
        convert(tmp_path, inside, report=False, strict=True)


PLAIN = {
    "a book": box("0.2 0.15 0.03") + inertial(0.5),
    "a book that is seen as it collides": box("0.2 0.15 0.03") + box("0.21 0.15 0.03", "visual") + inertial(0.5),
    "a thin plate": box("0.2 0.2 0.002") + inertial(0.3),
    "a handle that does not collide": box("0.02 0.02 0.02") + box("0.02 0.02 0.039", "visual") + inertial(0.1),
}


@pytest.mark.parametrize("what", PLAIN)
def test_a_plain_object_has_no_warning_and_passes_strict(tmp_path, what):
    outcome = convert(tmp_path, PLAIN[what], strict=True, report=False)
    assert outcome.warnings == 0


def test_an_object_that_does_not_stay_at_rest_is_a_warning_and_an_error_under_strict(tmp_path):
    ball = '<collision><origin xyz="{0} 0 {1}"/><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    top_heavy = ball.format(0, 0) + ball.format(0.3, 0.3) + ball.format(0.6, 0.6)
    top_heavy += '<inertial><origin xyz="0.6 0 0.6"/><mass value="5"/></inertial>'
    outcome = convert(tmp_path, top_heavy)
    assert any("does not stay at rest in the first second: moved" in line for line in outcome.first_warnings)
    assert not next(check for check in outcome.checks if check.name == "settle").passed
    with pytest.raises(InputError, match="does not stay at rest"):
        convert(tmp_path, top_heavy, strict=True, report=False)
