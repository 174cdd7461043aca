"""The report says everything in JSON, and shows it on one page that needs nothing else."""

import base64
import html.parser
import io
import json
import re

import mujoco
import numpy as np
import pytest
from ig2mj_converters.base.description import RoomMaps, Shape
from ig2mj_converters.checks.run import run_checks
from ig2mj_converters.hulls.link_hulls import HullOptions, decompose_link
from ig2mj_converters.report.drawing import BACKGROUND, draw
from ig2mj_converters.report.page import ReportInput, write_report
from PIL import Image

from ig2mj.scene.manifest import JointEntry, Manifest, ObjectEntry, RoomEntry, RoomsEntry

XML = """<mujoco><option gravity="0 0 -9.8"/><worldbody>
  <body name="floors"><geom name="floors/collision_0" type="box" size="2 2 .1" pos="0 0 -.1" group="3"/>
    <geom name="floors/visual_0" type="box" size="2 2 .1" pos="0 0 -.1" contype="0" conaffinity="0" rgba=".6 .5 .4 1"/>
  </body>
  <body name="table" pos="1 0 .4"><geom name="table/collision_0" type="box" size=".3 .3 .4" group="3"/></body>
  <body name="mug &lt;b&gt;" pos="-1 .5 1"><freejoint/>
    <geom name="mug/collision_0" type="cylinder" size=".05 .06" mass=".3" group="3"/>
    <geom name="mug/visual_0" type="sphere" size=".06" contype="0" conaffinity="0" mass="0" rgba="1 0 0 1"/></body>
</worldbody></mujoco>"""

MUG = "mug <b>"


@pytest.fixture(scope="module")
def scene():
    model = mujoco.MjModel.from_xml_string(XML)
    objects = [
        ObjectEntry("floors", "floors", "m", ["floors"], True, (4, 4, 0.2), 0.0),
        ObjectEntry("table", "table", "m", ["table"], True, (0.6, 0.6, 0.8), 0.0, rooms=["kitchen_0"]),
        ObjectEntry(MUG, "mug", "m", [MUG], False, (0.1, 0.1, 0.12), 0.3, rooms=["kitchen_0"]),
    ]
    rooms = RoomsEntry(instances={"kitchen_0": RoomEntry("kitchen")})
    return model, Manifest(1, "small home", objects, source={"converter": "ig2mj 0", "urdf": "a&b.urdf"}, rooms=rooms)


@pytest.fixture(scope="module")
def given(scene):
    room_map = np.zeros((100, 100), np.int16)
    room_map[20:80, 20:80] = 1
    hulls = decompose_link([Shape("cylinder", np.eye(4), (0.05, 0.12))], HullOptions(cache=False))
    return ReportInput(
        "scene",
        hulls={MUG: {"base_link": hulls}},
        checks=run_checks(*scene),
        warnings=["a warning <script>alert(1)</script>"],
        object_warnings={"table": ["has no joints"]},
        skipped=["chair/123 is missing"],
        timings={"models": 1.5, "checks": 0.1},
        rooms=RoomMaps(room_map, ["kitchen_0"], ["kitchen"], 0.04),
        encrypted=["table"],
    )


def by_name(facts):
    return {o["name"]: o for o in facts["objects"]}


def test_json_holds_everything_and_is_strict_json(scene, given, tmp_path):
    write_report(tmp_path, *scene, given)
    facts = json.loads((tmp_path / "report.json").read_text(), parse_constant=lambda x: pytest.fail(x))
    assert facts["totals"]["objects"] == 3 and facts["totals"]["loose"] == 1 and facts["totals"]["rooms"] == 1
    assert facts["totals"]["failed_checks"] == 1 and facts["checks"][0]["name"] == "settle"
    mug = by_name(facts)[MUG]
    assert mug["hulls_before"] == mug["hulls_after"] == 1 and mug["kinds"] == {"cylinder": 1}
    assert mug["bounding_box"]["got"] == pytest.approx([0.1, 0.1, 0.12])
    assert mug["status"] == "failed" and mug["complaints"][0]["check"] == "settle"
    assert by_name(facts)["table"]["status"] == "warning" and by_name(facts)["table"]["encrypted"]
    assert by_name(facts)["floors"]["status"] == "ok"
    assert facts["skipped"] == ["chair/123 is missing"] and facts["timings"] == {"models": 1.5, "checks": 0.1}


class Page(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.images, self.links, self.open = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        if tag == "img":
            self.images.append(values["src"])
        self.links += [v for k, v in attrs if k in ("src", "href") and v]
        if tag not in ("meta", "img", "br", "input", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def pixels(uri):
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(uri.split(",", 1)[1]))).convert("RGB")).astype(int)


def test_page_is_self_contained_well_formed_and_escapes_what_it_is_told(scene, given, tmp_path):
    write_report(tmp_path, *scene, given)
    text = (tmp_path / "report.html").read_text()
    page = Page(text)
    assert page.open == []
    assert all(link.startswith("data:image/") for link in page.links)
    assert not re.search(r"https?://|@import|url\(", text)
    assert "<script>alert" not in text and "mug &lt;b&gt;" in text and "a&amp;b.urdf" in text
    for fact in ("kitchen_0", "has no joints", "chair/123 is missing", "encrypted visuals"):
        assert fact in text
    assert text.index("settle") < text.index("compiles")  # what failed comes first


def test_without_a_renderer_every_object_still_has_a_picture(scene, given, tmp_path):
    facts = write_report(tmp_path, *scene, given)
    assert "drawings" in facts["pictures"]
    images = Page((tmp_path / "report.html").read_text()).images
    assert len(images) == 3 + 2 * 3
    for uri in images:
        assert np.ptp(pixels(uri), axis=(0, 1)).max() > 40, "an empty picture"


def test_a_renderer_that_fails_is_reported_and_replaced(scene, given, tmp_path):
    def broken(*_, **__):
        raise RuntimeError("no driver\nat all")

    facts = write_report(tmp_path, *scene, given, broken, lambda *a, **k: None)
    assert "no driver at all" in facts["pictures"]
    assert len(Page((tmp_path / "report.html").read_text()).images) == 9


def test_a_renderer_sees_one_object_at_a_time_and_the_model_stays_as_it_was(scene, given, tmp_path):
    model, manifest = scene
    groups, colours = model.geom_group.copy(), model.geom_rgba.copy()
    seen = []

    def record(model, data, view, *, width, height, groups):
        seen.append({model.geom(g).name for g in range(model.ngeom) if model.geom_group[g] in groups})
        return np.zeros((height, width, 3), np.uint8)

    facts = write_report(tmp_path, model, manifest, given, record, lambda *a, **k: None)
    assert facts["pictures"] == "rendered"
    assert {"mug/visual_0"} in seen and {"mug/collision_0"} in seen and {"table/collision_0"} in seen
    assert {"floors/visual_0", "mug/visual_0", "table/collision_0"} in seen  # the scene: hulls where there is no visual
    np.testing.assert_array_equal(model.geom_group, groups)
    np.testing.assert_array_equal(model.geom_rgba, colours)


def test_a_drawing_shows_near_things_before_far_ones():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom type="box" size=".5 .5 .1" rgba="1 0 0 1"/>
        <geom type="box" size=".5 .5 .1" pos="0 0 1" rgba="0 0 1 1"/></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    above = draw(model, data, [0, 1], width=60, height=60, elevation=-90)[30, 30].astype(int)
    below = draw(model, data, [0, 1], width=60, height=60, elevation=90)[30, 30].astype(int)
    assert above[2] > 60 + above[0] and below[0] > 60 + below[2]
    assert tuple(draw(model, data, [], width=8, height=8)[4, 4]) == BACKGROUND


def test_one_object_without_rooms_or_checks_makes_a_report(tmp_path):
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="a"><joint name="a_j" type="hinge"/><geom size=".1" mass="1"/></body>'
        "</worldbody></mujoco>"
    )
    entry = ObjectEntry("a", "a", "m", ["a"], True, (0.2, 0.2, 0.2), 1.0, joints=[JointEntry("a_j", "hinge")])
    facts = write_report(tmp_path, model, Manifest(1, "a", [entry]), ReportInput("object"))
    assert facts["totals"]["joints"] == 1 and len(Page((tmp_path / "report.html").read_text()).images) == 2
