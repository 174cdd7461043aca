"""Primitives in physics, as sequences of motion programs that are planned on the host.

A primitive is a generator: it yields motion programs (`list[Phase]`), is sent the reason why each failed ("" for
success), and returns its outcome. It plans every program from the world as it then is, tries again by itself with
another stance, grasp or spot, and ends by the predicate that it is for.
"""

from __future__ import annotations

from collections.abc import Callable

from ig2mj.planning.attaching import attach
from ig2mj.planning.bodies import HandedBody
from ig2mj.planning.cleaning import clean
from ig2mj.planning.doors import through_doors
from ig2mj.planning.driving import drive_near, go
from ig2mj.planning.filling import fill
from ig2mj.planning.grasping import grasp, is_graspable, off_others_things, release
from ig2mj.planning.mixing import mix
from ig2mj.planning.moves import Primitive, guarded
from ig2mj.planning.placing import bring_out, place
from ig2mj.planning.pouring import pour
from ig2mj.planning.pushing import push
from ig2mj.planning.spraying import spray
from ig2mj.planning.stances import stances
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.switching import toggle
from ig2mj.planning.treatments import cook, freeze, slice_, soak
from ig2mj.planning.turning_open import closes, opens
from ig2mj.planning.world import AWAY, PlannedWorld


def primitive(world: PlannedWorld, step: Step) -> Primitive:
    """What a robot does for a step."""
    return through_doors(world, step, _tried_again)


BROUGHT_OUT = ("open", "close", "toggle_on", "toggle_off", "wipe", "scrub", "slice", "pour", "spray", "mix")
"""Primitives that are tried again on open floor, with things that can be carried there."""


def _tried_again(world: PlannedWorld, step: Step) -> Primitive:
    """A primitive; what can be carried is brought out into the open where it fails, once."""
    action, (name, tool) = ACTIONS[step.primitive], _about(step)
    yield from off_others_things(world)
    outcome = yield from guarded(action(world, step))
    if outcome.done or step.primitive not in BROUGHT_OUT or outcome.reason in ("slipped", "timeout"):
        return outcome
    if world.domain.fixed(name) or not is_graspable(world, name) or (name not in world.held and all(world.held)):
        return outcome
    if not (yield from guarded(bring_out(world, name))).done:
        return outcome
    if tool != name and tool not in world.held and not (yield from guarded(grasp(world, Step("grasp", (tool,))))).done:
        return outcome
    return (yield from guarded(action(world, step)))


def _about(step: Step) -> tuple[str, str]:
    """What a step changes, and what it changes that with; of a step without tool, the same twice."""
    if step.primitive == "pour":
        return step.things[1], step.object
    return step.object, step.things[-1]


def navigate_to(world: PlannedWorld, step: Step) -> Primitive:
    """To where a hand reaches the object; a robot without hands that are planned, to near it."""
    if not isinstance(world.body, HandedBody):
        return Outcome(*(yield from drive_near(world, step.object)))
    reason, hand, floor = "no_base", len(world.body.hands) - 1, world.floor()
    for point in (world.com(step.object), *world.rim(step.object)):
        for stance in stances(world, hand, point, floor, AWAY):
            reason = yield from go(world, stance)
            if not reason:
                return Outcome()
    return Outcome(reason, f"{step.object} is not within reach of free floor" if reason == "no_base" else "")


ACTIONS: dict[str, Callable[[PlannedWorld, Step], Primitive]] = {
    "navigate_to": navigate_to,
    "grasp": grasp,
    "release": release,
    "place_on_top": place("on_top"),
    "place_inside": place("inside"),
    "place_next_to": place("next_to"),
    "place_under": place("under"),
    "place_on_floor": place("on_floor"),
    "open": opens,
    "close": closes,
    "toggle_on": toggle(True),
    "toggle_off": toggle(False),
    "wipe": clean("dusty"),
    "scrub": clean("stained"),
    "soak": soak,
    "fill": fill,
    "pour": pour,
    "slice": slice_,
    "cook": cook,
    "freeze": freeze,
    "push": push,
    "spray": spray,
    "mix": mix,
    "attach": attach,
}
"""Primitives that are carried out in physics."""
