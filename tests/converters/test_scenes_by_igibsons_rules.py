"""What iGibson does when it loads a scene of its dataset, and a converted scene does, too: masses, and saved states."""

from __future__ import annotations

import json
import pathlib

import numpy as np
import pytest
from tiny_dataset import write_dataset, write_model
from tiny_geometry import box, groups
from tiny_house import SCENE, furniture, instance_xml, scene_xml

import ig2mj

INERTIAL = (
    '<inertial><mass value="1.056"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
)
ON = json.dumps({"ToggledOn": {"value": True, "hand_in_marker_steps": 0}, "Temperature": 40.0})
SIZES = (0.1, 0.2, 0.3, 0.4)


@pytest.fixture(scope="module")
def scene(tmp_path_factory, convert):
    """A house with a basket in four sizes, one more that keeps its inertial, a microwave and a sink that run."""
    root = write_dataset(tmp_path_factory.mktemp("dataset") / "tiny")
    half = {"low": (-0.1, -0.1, -0.1), "high": (0.1, 0.1, 0.1)}
    for model, metadata in (("given", {}), ("kept", {"keep_inertials": True})):
        folder = write_model(root, "basket", model, {"base_link": groups(box((0.2,) * 3))}, **half, metadata=metadata)
        urdf = folder / f"{model}.urdf"
        text = urdf.read_text()
        urdf.write_text(text.replace('<link name="base_link">', f'<link name="base_link">{INERTIAL}'))
    button = {"toggle_button": {"geometry": None, "size": None, "xyz": [0.1, 0.0, 0.0], "rpy": None}}
    write_model(root, "microwave", "mi0", {"base_link": groups(box((0.2,) * 3))}, **half, metadata={"links": button})
    things = [
        instance_xml(f"basket_{k}", "basket", "given", (1.0 + 0.2 * k, -1.0, 0.5), bounding_box=" ".join([str(s)] * 3))
        for k, s in enumerate(SIZES)
    ]
    things.append(instance_xml("basket_9", "basket", "kept", (1.0, 1.0, 0.5), bounding_box="0.4 0.4 0.4"))
    things.append(instance_xml("microwave_0", "microwave", "mi0", (1.6, 1.0, 0.5), scale="1 1 1", states=ON))
    things.append(instance_xml("sink_1", "sink", "si0", (1.6, -1.2, 0.601), bounding_box="0.6 0.5 0.4", states=ON))
    file = pathlib.Path(root / "scenes" / SCENE / "urdf" / "task.urdf")
    file.write_text(scene_xml(*furniture(), *things))
    return convert(file, root)


def test_a_basket_of_any_size_weighs_its_box_times_the_density(scene):
    masses = [scene.entries[f"basket_{k}"].mass for k in range(len(SIZES))]
    np.testing.assert_allclose(masses, [67.0 * size**3 for size in SIZES], rtol=1e-3)
    assert scene.entries["basket_9"].mass == pytest.approx(1.056)


def test_what_was_left_on_is_on_when_the_scene_is_loaded_and_after_a_reset(scene):
    simulation = ig2mj.Simulation(ig2mj.load_scene(scene.folder))
    for _ in range(2):
        for name in ("microwave_0", "sink_1"):
            assert simulation.predicate("toggled_on", name)
        assert not simulation.predicate("toggled_on", "sink_0")
        simulation.step()
        simulation.reset()
