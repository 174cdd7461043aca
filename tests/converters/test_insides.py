"""The inside of containers, found from collision geometry."""

import mujoco
import numpy as np
import pytest
from ig2mj_converters.hulls.insides import find_inside
from ig2mj_converters.upgrade import upgrade_folders

import ig2mj
from ig2mj.errors import InputError
from ig2mj.scene.manifest import FORMAT_VERSION, Manifest, ObjectEntry, load_manifest, save_manifest
from ig2mj.scene.scene import OldFormatWarning

WALL = 0.005


def _entry(category: str = "bowl") -> ObjectEntry:
    return ObjectEntry(
        name="it", category=category, model="m", bodies=["it"], fixed=False, bounding_box=(1, 1, 1), mass=1
    )


def _box(size, pos) -> str:
    return f'<geom type="box" size="{" ".join(map(str, size))}" pos="{" ".join(map(str, pos))}"/>'


def _model(*geoms: str) -> mujoco.MjModel:
    body = "".join(geoms)
    return mujoco.MjModel.from_xml_string(f'<mujoco><worldbody><body name="it">{body}</body></worldbody></mujoco>')


def _tub(x: float, y: float, z: float, walls: int = 4) -> list[str]:
    """A box without a lid: half sizes of the room inside, its floor at z = 0."""
    sides = [
        _box((WALL, y, z), (x + WALL, 0, z)),
        _box((WALL, y, z), (-x - WALL, 0, z)),
        _box((x + 2 * WALL, WALL, z), (0, y + WALL, z)),
        _box((x + 2 * WALL, WALL, z), (0, -y - WALL, z)),
    ]
    return [_box((x, y, WALL), (0, 0, -WALL)), *sides[:walls]]


@pytest.mark.parametrize("x, y, z", [(0.05, 0.05, 0.05), (0.1, 0.06, 0.03), (0.2, 0.3, 0.05)])
def test_a_tub_holds_its_room(x, y, z):
    found = find_inside(_entry(), _model(*_tub(x, y, z)))
    assert found is not None
    assert found.litres == pytest.approx(8000 * x * y * z, rel=0.15)
    assert np.ptp(np.array(found.rim)[:, 2]) == 0
    assert found.rim[0][2] == pytest.approx(2 * z, abs=0.1 * z)


def test_what_is_open_at_a_side_and_what_is_solid_hold_nothing():
    assert find_inside(_entry(), _model(*_tub(0.1, 0.1, 0.1, walls=3))) is None
    assert find_inside(_entry(), _model(_box((0.1, 0.1, 0.1), (0, 0, 0)))) is None
    assert find_inside(_entry("sofa"), _model(*_tub(0.1, 0.1, 0.1))) is None


def test_a_bottle_is_closed_and_holds_most_of_its_body():
    found = find_inside(
        _entry("milk"), _model(_box((0.04, 0.04, 0.1), (0, 0, 0)), _box((0.01, 0.01, 0.02), (0, 0, 0.12)))
    )
    assert found is not None
    assert 0.5 < found.litres / (8000 * 0.04 * 0.04 * 0.1) < 1
    assert found.rim[0][2] == pytest.approx(0.14)


def test_folders_of_version_1_load_with_a_warning_and_are_upgraded(tmp_path):
    folder = tmp_path / "home"
    folder.mkdir()
    body = "".join(_tub(0.05, 0.05, 0.05))
    text = f'<mujoco><worldbody><body name="it"><freejoint/>{body}</body></worldbody></mujoco>'
    (folder / "scene.xml").write_text(text)
    save_manifest(Manifest(format_version=1, name="home", objects=[_entry()]), folder / "manifest.json")
    with pytest.warns(OldFormatWarning, match="ig2mj convert upgrade"):
        before = ig2mj.load_scene(folder)
    done = upgrade_folders(folder)
    assert (done.folders, done.upgraded, done.containers) == (1, 1, 1)
    assert upgrade_folders(folder).upgraded == 0
    assert load_manifest(folder).format_version == FORMAT_VERSION
    assert ig2mj.load_scene(folder).digest == before.digest
    with pytest.raises(InputError, match="no converted scene"):
        upgrade_folders(tmp_path / "nothing")
