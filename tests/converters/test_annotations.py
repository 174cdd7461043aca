"""`convert object --annotations FILE`: abilities, thresholds and functional parts from a TOML file."""

import numpy as np
import pytest
from own_objects import write_cup

from ig2mj.errors import InputError
from ig2mj.scene.manifest import LinkEntry
from ig2mj.scene.scene import load_scene

WHOLE = """
[abilities]
heatSource = { temperature = 180.0, requires_toggled_on = true }
toggleable = true
dustyable = false

[links.heat_source]
pos = [0.0, 0.0, 0.06]

[links.toggle_button]
pos = [-0.036, 0.0, 0.0]

[links.cleaning_tool_area]
pos = [0.0, 0.0, -0.03]
size = [0.06, 0.05, 0.02]
rpy = [0.0, 0.0, 90.0]
"""


def read(tmp_path, text):
    from ig2mj_converters.reading.annotations import read_annotations

    file = tmp_path / "cup.toml"
    file.write_text(text)
    return read_annotations(file)


def test_annotations_are_in_the_manifest_and_in_the_model(tmp_path):
    (tmp_path / "a.toml").write_text(WHOLE)
    folder = write_cup(tmp_path, annotations=tmp_path / "a.toml", fixed=True)
    scene = load_scene(folder)
    entry = scene.manifest.objects[0]
    assert entry.fixed and not entry.assisted_grasp
    assert set(entry.abilities) == {"breakable", "heatSource", "stainable", "toggleable"}
    assert entry.abilities["heatSource"]["temperature"] == 180
    assert entry.abilities["heatSource"]["heating_rate"] == 0.04, "the default of what the file leaves out"
    assert entry.links == {
        "heat_source": LinkEntry(site="cup/heat_source"),
        "toggle_button": LinkEntry(site="cup/toggle_button"),
        "cleaning_tool_area": LinkEntry(geom="cup/cleaning_tool_area"),
    }
    data = scene.start_data()
    above = data.site("cup/heat_source").xpos - data.body("cup").xpos
    assert np.allclose(data.body("cup").xmat.reshape(3, 3).T @ above, (0, 0, 0.06))
    box = scene.model.geom("cup/cleaning_tool_area")
    assert np.allclose(box.size, (0.03, 0.025, 0.01)) and np.allclose(np.abs(box.quat), (0.5**0.5, 0, 0, 0.5**0.5))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("abilities = 3", "abilities: is 3 and no table"),
        ("[ability]\nx = 1", "ability: no table is named 'ability'; near matches: abilities"),
        ("[abilities]\ncookabel = true", r"abilities\.cookabel: no ability.*near matches: cookable"),
        ("[abilities]\ncookable = 70", r"abilities\.cookable: is 70 \(true, false, or a table"),
        ("[abilities]\ncookable = { temp = 70 }", r"abilities\.cookable: has no parameter 'temp' .*cook_temperature"),
        ("[abilities]\ncookable = { cook_temperature = true }", "parameter 'cook_temperature' is True .*a number"),
        (
            "[abilities]\ncookable = { cook_temperature = 'hot' }",
            r"cookable\.cook_temperature: is 'hot'.*number",
        ),
        ("[links.button]\npos = [0, 0, 0]", r"links\.button: no kind of link.*toggle_button"),
        ("[links.heat_source]\nsize = [1, 1, 1]", r"links\.heat_source\.size: no key is named 'size'"),
        ("[links.slicer]\npos = [0, 0, 0]", r"links\.slicer: has no size \(size = \[x, y, z\] in metres\)"),
        ("[links.slicer]\npos = [0, 0]\nsize = [1, 1, 1]", r"links\.slicer\.pos: is not a list of 3 numbers"),
        ("[links.slicer]\npos = [0, 0, 0]\nsize = [1, 0, 1]", r"links\.slicer\.size: .*positive"),
        ("[links.heat_source]\npos = [0, 0, nan]", "not finite"),
        ("pos = ", "is not TOML"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line_that_names_the_element(tmp_path, text, said):
    with pytest.raises(InputError, match=said) as error:
        read(tmp_path, text)
    assert "cup.toml" in str(error.value) and "\n" not in str(error.value)


def test_a_link_far_from_the_object_and_an_ability_without_its_link_are_warned_of(tmp_path):
    from ig2mj_converters.base.description import ObjectModel
    from ig2mj_converters.reading.annotations import annotate, annotation_warnings

    text = "[abilities]\ntoggleable = true\ncookable = false\n[links.heat_source]\npos = [0.0, 0.0, 60.0]"
    model = ObjectModel("mug", "cup", tmp_path, {}, {}, "base_link")
    annotate(model, read(tmp_path, text))
    found = annotation_warnings(model, np.full(3, -0.04), np.full(3, 0.04))
    assert found == [
        "link 'heat_source' is 59.96 m outside of the object, whose box is -0.04, -0.04, -0.04 to 0.04, 0.04, 0.04",
        "ability 'toggleable' has no effect without the link 'toggle_button': annotate it",
    ]
