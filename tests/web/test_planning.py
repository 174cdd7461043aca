"""A robot that is asked for primitives in the page, and that plans for the goal."""

import time

import pytest

pytest.importorskip("viser")

from web_page import Page

from ig2mj.cli.web import _source
from ig2mj.errors import Ig2mjError
from ig2mj.planning import Domain
from ig2mj.web.access import access_for
from ig2mj.web.planning import PlanReport, offers
from ig2mj.web.tables import plan_table
from ig2mj.web.viewer import WebViewer


@pytest.fixture(scope="module")
def domain(tiny_home):
    from ig2mj.states.model import StateModel

    return Domain(StateModel.of_manifest(tiny_home.tables, tiny_home.manifest), 2)


def test_buttons_are_of_what_an_object_can_do(domain):
    assert list(offers(domain, "cabinet", ())) == ["Go to", "Open", "Close"]
    assert list(offers(domain, "stove", ())) == ["Go to", "Switch on", "Switch off"]
    assert list(offers(domain, "apple", ())) == ["Go to", "Grasp"]
    assert offers(domain, "apple", ("apple",)) == {"Go to": ("navigate_to", "apple"), "Release": ("release", "apple")}
    assert offers(domain, "apple", ("knife",))["Slice with knife"] == ("slice", "apple", "knife")
    assert offers(domain, "table", ("sponge",))["Wipe with sponge"] == ("wipe", "table", "sponge")
    assert offers(domain, "sink", ("sponge",))["Soak sponge"] == ("soak", "sponge", "sink")


def test_the_plan_is_a_table_with_the_reasons_of_failures():
    rows = (
        (1, "open <b>", "done", "3.0 s"),
        (2, "grasp apple_0", "no_grasp", "the hands are full"),
        (3, "close x", "", ""),
    )
    text = plan_table(PlanReport(rows, held=("mug_0",), note="stopped"))
    assert "open &lt;b&gt;" in text and "done 3.0 s" in text
    assert "the hands are full" in text and "in its hands: mug_0" in text and "stopped" in text


def test_requests_that_do_not_go_together_are_refused(tiny_home_folder):
    asked = {"goal": None, "set": (), "pool": None, "engine": "native", "seed": 0}
    with pytest.raises(Ig2mjError, match="one world of the native engine"):
        _source(str(tiny_home_folder), worlds=2, agent="zero", robot="humanoid", **asked)
    with pytest.raises(Ig2mjError, match="--agent is for a task"):
        _source(str(tiny_home_folder), worlds=1, agent="expert", robot=None, **asked)


@pytest.mark.slow
def test_a_page_solves_the_goal_and_asks_for_a_primitive(tiny_home_folder):
    asked = {"set": (), "pool": None, "worlds": 1, "engine": "native", "agent": "zero", "seed": 0}
    source = _source(str(tiny_home_folder), goal="(on_top apple pan)", robot="humanoid", **asked)
    with WebViewer(source, access_for(None, 0)) as viewer, Page(viewer.port) as page:
        viewer.runner.speed = 10.0
        assert page.receive(lambda: "its hands are empty" in page.texts())
        page.set("Plan", "Solve")
        assert page.receive(lambda: "the goal holds" in page.texts(), 120)
        assert "grasp apple" in page.texts() and "The goal holds" in page.texts()
        viewer.controls.choose(source.scene.object_index("stove"))
        assert page.receive(lambda: any(p.get("label") == "Switch on" for p in page.gui.values()))
        page.set("Switch on", True)
        assert page.receive(lambda: "toggle_on stove" in page.texts() and not source.report.busy, 60)
        deadline = time.monotonic() + 60
        while source.report.busy and time.monotonic() < deadline:
            page.receive(timeout=0.2)
        assert source.report.rows[-1][1:3] == ("toggle_on stove", "done")
        page.set("Time", "Reset")
        assert page.receive(lambda: source.report == PlanReport(), 60)
