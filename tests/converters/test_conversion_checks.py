"""Each check after conversion passes on a sound scene and names what is wrong with an unsound one."""

import mujoco
import numpy as np
import pytest
from ig2mj_converters.base.outcome import CheckResult
from ig2mj_converters.checks.run import run_checks

from ig2mj.scene.manifest import JointEntry, LinkEntry, Manifest, ObjectEntry

GEOM = 'group="3" friction="0.25" gap="0.003" margin="0"'


def cabinet(stop="", exclude=True, frictionloss=10.0):
    """A fixed box with a drawer that slides 0.3 m along x; `stop` is put into the base body."""
    outside = '<exclude body1="cabinet" body2="cabinet_drawer"/>' if exclude else ""
    return (
        f"""<body name="cabinet" pos="0 0 0.5">
          <geom name="cabinet/collision_0" type="box" size=".3 .3 .02" pos="0 0 .1" mass="8" {GEOM}/>
          {stop}
          <body name="cabinet_drawer"><joint name="cabinet_slide" type="slide" axis="1 0 0" range="0 .3"
              limited="true" frictionloss="{frictionloss}"/>
            <geom name="cabinet_drawer/collision_0" type="box" size=".25 .25 .05" mass="2" {GEOM}/></body></body>""",
        outside,
    )


def block(name, pos, size=".05 .05 .05", mass=1.0):
    return (
        f'<body name="{name}" pos="{pos}"><freejoint name="{name}/free"/>'
        f'<geom name="{name}/collision_0" type="box" size="{size}" mass="{mass}" {GEOM}/></body>'
    )


def entry(name, box, mass=1.0, fixed=False, **more):
    return ObjectEntry(
        name=name, category=name, model="m", bodies=[name], fixed=fixed, bounding_box=box, mass=mass, **more
    )


def check(bodies, entries, contacts="", allowed=(), keyframe="") -> dict[str, CheckResult]:
    xml = f"""<mujoco><compiler angle="radian"/><option timestep="0.00833333" gravity="0 0 -9.8"/>
      <worldbody><geom name="ground" type="plane" size="5 5 .1" {GEOM}/>{"".join(bodies)}</worldbody>
      <contact>{contacts}</contact>{keyframe}</mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    before = model.geom_contype.copy(), model.body_pos.copy(), model.opt.gravity.copy()
    results = run_checks(model, Manifest(1, "test", list(entries)), allowed)
    for was, now in zip(before, (model.geom_contype, model.body_pos, model.opt.gravity), strict=True):
        np.testing.assert_array_equal(was, now)
    return {r.name: r for r in results}


CABINET = entry("cabinet", (0.6, 0.6, 0.17), 10.0, True, joints=[JointEntry("cabinet_slide", "slide", (0.0, 0.3))])
BLOCK = entry("block", (0.1, 0.1, 0.1))


def test_a_sound_scene_passes_every_check():
    body, outside = cabinet()
    results = check([body, block("block", "1 0 0.05")], [CABINET, BLOCK], outside)
    assert list(results) == [
        "compiles", "bounding_box", "mass", "penetration", "settle", "joint_sweep", "self_contact", "joint_clearance",
    ]  # fmt: skip
    assert [r.name for r in results.values() if not r.passed] == []
    assert results["joint_sweep"].measured == {"cabinet_slide": pytest.approx(1.0, abs=0.03)}


@pytest.mark.parametrize(("asked", "fine"), [(0.1, True), (0.1014, True), (0.11, False), (0.09, False)])
def test_bounding_box_may_be_off_by_one_and_a_half_percent(asked, fine):
    """1.5 %, or 2 mm for what is thin."""
    result = check([block("block", "0 0 0.05")], [entry("block", (asked, 0.1, 0.1))])["bounding_box"]
    assert result.passed == fine
    assert result.measured["block"]["got"] == pytest.approx([0.1, 0.1, 0.1])


def test_bounding_box_is_that_of_the_base_axes_not_the_world():
    turned = block("block", "0 0 0.2", "0.2 .05 .05").replace('pos="0 0 0.2"', 'pos="0 0 0.2" euler="0 0 0.7"')
    assert check([turned], [entry("block", (0.4, 0.1, 0.1))])["bounding_box"].passed


def test_a_blade_may_be_left_out_of_the_bounding_box():
    knife = (
        f'<body name="knife" pos="0 0 1"><freejoint/><geom name="knife/collision_0" type="box" size=".05 .01 .01" '
        f'mass=".1" {GEOM}/>'
        f'<geom name="knife/slicer" type="box" size=".05 .01 .01" pos=".1 0 0" mass="0" {GEOM}/></body>'
    )
    for asked in (0.1, 0.2):
        given = entry("knife", (asked, 0.02, 0.02), 0.1, links={"slicer": LinkEntry(geom="knife/slicer")})
        assert check([knife], [given])["bounding_box"].passed


def test_a_wrong_mass_is_named():
    result = check([block("block", "0 0 0.05", mass=2)], [BLOCK])["mass"]
    assert not result.passed and "weighs 2 kg, asked 1 kg" in result.failures[0]["problem"]


def test_overlap_at_the_start_is_listed_with_its_depth_unless_the_source_allows_it():
    bodies = [block("block", "0 0 0.05"), block("other", "0 0 0.14")]
    given = [BLOCK, entry("other", (0.1, 0.1, 0.1))]
    result = check(bodies, given)["penetration"]
    assert not result.passed and result.failures[0]["depth"] == pytest.approx(0.01, abs=1e-4)
    assert {result.failures[0]["object"], result.failures[0]["other"]} == {"block", "other"}
    excused = check(bodies, given, allowed=[frozenset(("block", "other"))])["penetration"]
    assert excused.passed and "1 more" in excused.summary


def test_what_falls_is_listed_as_not_settled_and_what_is_parked_is_not():
    bodies = [block("block", "0 0 1"), block("other", "1 0 1")]
    result = check(bodies, [BLOCK, entry("other", (0.1, 0.1, 0.1), parked=True)])["settle"]
    assert [f["object"] for f in result.failures] == ["block"]
    assert result.failures[0]["drift"] == pytest.approx(0.95, abs=0.02) and "down" in result.failures[0]["problem"]


def test_the_first_keyframe_is_the_start():
    results = check([block("block", "0 0 1")], [BLOCK], keyframe='<keyframe><key qpos="0 0 .05 1 0 0 0"/></keyframe>')
    assert results["settle"].passed


def test_a_joint_with_something_of_its_own_object_in_the_way_jams_and_touches():
    stop = f'<geom name="cabinet/stop" type="box" size=".02 .2 .05" pos=".4 0 0" {GEOM}/>'
    body, _ = cabinet(stop)
    given = entry("cabinet", (0.7, 0.6, 0.17), 10.0, True)
    results = check([body], [given], '<exclude body1="world" body2="cabinet_drawer"/>')
    sweep, touch = results["joint_sweep"], results["self_contact"]
    assert not sweep.passed and sweep.failures[0]["joint"] == "cabinet_slide" and sweep.failures[0]["reached"] < 0.6
    assert not touch.passed and "cabinet/stop" in touch.failures[0]["geoms"]


def test_dry_friction_of_fact_10_does_not_count_as_jamming():
    body, outside = cabinet(frictionloss=30.0)
    assert check([body], [CABINET], outside)["joint_sweep"].passed


def test_damping_does_not_count_as_jamming():
    """A jar's lid: 30 g, held back by the damping that every hinge gets more than by its inertia."""
    body = f"""<body name="jar" pos="0 0 .2"><freejoint name="jar/free"/>
      <geom name="jar/collision_0" type="box" size=".04 .04 .06" mass=".4" {GEOM}/>
      <body name="jar_lid" pos="-.04 0 .07"><joint name="jar_hinge" axis="0 -1 0" range="0 2" limited="true"
          frictionloss=".36" damping=".05" armature=".001"/>
        <geom name="jar_lid/collision_0" type="box" size=".04 .04 .005" pos=".04 0 0" mass=".03" {GEOM}/>
      </body></body>"""
    given = entry("jar", (0.08, 0.08, 0.135), 0.43, joints=[JointEntry("jar_hinge", "hinge", (0.0, 2.0))])
    results = check([body], [given], '<exclude body1="jar" body2="jar_lid"/>')
    assert results["joint_sweep"].passed, results["joint_sweep"].failures


def test_an_object_that_touches_itself_is_named():
    body, _ = cabinet(exclude=False)
    near = body.replace('pos="0 0 .1"', 'pos="0 0 .06"')
    result = check([near], [CABINET])["self_contact"]
    assert [f["object"] for f in result.failures] == ["cabinet"]


def test_a_neighbour_in_the_way_of_a_drawer_is_a_note_only_if_it_is_fixed():
    body, outside = cabinet()
    wall = f'<body name="wall" pos=".45 0 .5"><geom name="wall/collision_0" type="box" size=".05 1 .5" {GEOM}/></body>'
    fixed = check([body, wall], [CABINET, entry("wall", (0.1, 2, 1), fixed=True)], outside)
    note = fixed["joint_clearance"]
    assert note.advisory and not note.passed and note.failures[0]["others"] == ["wall"]
    assert fixed["joint_sweep"].passed
    loose = check([body, block("block", "0.45 0 0.5")], [CABINET, BLOCK], outside)["joint_clearance"]
    assert loose.passed


@pytest.mark.parametrize(("air", "clear"), [(0.0018, False), (0.0025, True)])
def test_a_door_whose_far_corner_swings_into_the_wall_beside_it_is_noted(air: float, clear: bool):
    """A leaf 0.7 m by 5.5 cm reaches 2.2 mm beyond its free edge at 4.5 degrees, and nowhere else."""
    body = f"""<body name="cabinet" pos="0 0 .5">
      <geom name="cabinet/collision_0" type="box" size=".3 .3 .4" pos="-.4 0 0" mass="8" {GEOM}/>
      <body name="cabinet_door" pos=".055 .35 0"><joint name="cabinet_hinge" axis="0 0 1" range="0 1.9" limited="true"/>
        <geom name="cabinet_door/collision_0" type="box" size=".0275 .35 .4" pos="-.0275 -.35 0" {GEOM}/></body></body>
      <body name="wall" pos="0 {-0.45 - air} .5">
        <geom name="wall/collision_0" type="box" size="1 .1 .5" {GEOM}/></body>"""
    joint = JointEntry("cabinet_hinge", "hinge", (0.0, 1.9))
    given = [entry("cabinet", (0.8, 0.7, 0.8), 10.0, True, joints=[joint]), entry("wall", (2, 0.2, 1), fixed=True)]
    note = check([body], given, '<exclude body1="cabinet" body2="cabinet_door"/>')["joint_clearance"]
    assert note.passed == clear


def test_joints_tied_together_are_swept_together():
    """A mimic joint moves with the one it follows; holding it still would jam both."""
    body = f"""<body name="cabinet" pos="0 0 1">
      <geom name="cabinet/collision_0" type="box" size=".1 .1 .1" mass="8" {GEOM}/>
      <body name="cabinet_a" pos="0 1 0"><joint name="cabinet_j" axis="0 0 1" range="0 1.5" limited="true"/>
        <geom name="cabinet_a/collision_0" type="box" size=".1 .1 .1" mass="1" {GEOM}/></body>
      <body name="cabinet_b" pos="0 -1 0"><joint name="cabinet_k" axis="0 0 1" range="-1.5 0" limited="true"/>
        <geom name="cabinet_b/collision_0" type="box" size=".1 .1 .1" mass="1" {GEOM}/></body></body>"""
    tie = '</contact><equality><joint joint1="cabinet_k" joint2="cabinet_j" polycoef="0 -1 0 0 0"/></equality><contact>'
    assert check([body], [entry("cabinet", (0.2, 2.2, 0.2), 10, True)], tie)["joint_sweep"].passed
