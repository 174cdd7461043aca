"""Instructions: tasks in words, each in several wordings, of which some are held out.

The paper's activities have wordings of their own. Those of other tasks are made of a clause: the summary of the task,
or of activities in BDDL and goals what they ask for, in words.
"""

from __future__ import annotations

import re

from ig2mj.predicates.parse import parse
from ig2mj.tasks.bddl.task import PREFIX, BddlTask
from ig2mj.tasks.bddl.words import sentences
from ig2mj.tasks.own_goal import split_goal_name
from ig2mj.tasks.task import TaskLike

HELD_OUT = 4
"""The last wordings of each task are those that no training uses."""

WORDINGS: dict[str, tuple[str, ...]] = {
    "BimanualPickAndPlace": (
        "Lift the cauldron from the floor onto the coffee table.",
        "Pick up the cauldron with both hands and set it on the coffee table.",
        "Put the cauldron that is on the floor onto the coffee table.",
        "Move the pot from the floor to the table in front of the sofa.",
        "Take the cauldron off the floor and place it on the low table.",
        "The cauldron belongs on the coffee table. Please put it there.",
        "Carry the cauldron to the coffee table.",
        "Use both hands to place the cauldron on top of the coffee table.",
        "Please get that big pot up from the floor and onto the coffee table.",
        "I want the cauldron standing on the coffee table.",
        "Raise the cauldron and rest it on the table.",
        "Could you transfer the cauldron from the ground to the coffee table?",
    ),
    "CleaningStainedShelf": (
        "Wipe the stains off the shelf with the wet towel.",
        "Clean the stained shelf with the towel.",
        "Use the wet towel to remove the stains from the shelf.",
        "Rub the shelf with the towel until the stains are gone.",
        "The shelf is stained. Wipe it with the towel.",
        "Take the towel and scrub the shelf clean.",
        "Get the dirt off the shelf with the damp cloth.",
        "Please wipe down the shelf.",
        "There are marks on the shelf; clean them away with the towel.",
        "I would like a clean shelf. The towel is already wet.",
        "Polish the stains off that shelf.",
        "Could you sponge the shelf with the towel?",
    ),
    "CookingMeat": (
        "Cook the steak on the stove.",
        "Bring the steak from the counter to the burner until it is cooked.",
        "Put the meat on the hot burner and let it cook.",
        "Take the steak and hold it over the stove until it is done.",
        "Fry the steak.",
        "Place the steak on the stove so that it gets cooked.",
        "Move the meat from the counter onto the stove and cook it.",
        "Please cook the piece of meat that is on the counter.",
        "I am hungry: prepare the steak on the stove.",
        "Heat the steak on the burner till it is well done.",
        "Could you get that steak cooked for dinner?",
        "The raw steak needs to go onto the heat until it is ready.",
    ),
    "GraspingBook": (
        "Take the notebook from the coffee table.",
        "Grasp the notebook.",
        "Pick up the notebook that lies on the table.",
        "Get the notebook off the coffee table.",
        "Lift the notebook.",
        "Grab the book from the table.",
        "Please pick up the notebook.",
        "Hold the notebook in your hand.",
        "Could you fetch the notebook from the table?",
        "I need the notebook that is on the coffee table.",
        "Raise the notebook off the table's surface.",
        "Collect the book lying in front of you.",
    ),
    "SlicingFruit": (
        "Cut the apple with the knife.",
        "Slice the apple on the coffee table.",
        "Use the knife to cut the apple in two.",
        "Halve the apple with the knife.",
        "Take the knife and slice the fruit.",
        "Please cut up the apple.",
        "Chop the apple on the table.",
        "Cut the fruit into halves with the knife.",
        "Could you slice that apple for me?",
        "Divide the apple using the blade.",
        "I would like the apple in two pieces.",
        "Bring the knife down on the apple so that it is sliced.",
    ),
    "SoakingTowel": (
        "Hold the towel under the running tap until it is soaked.",
        "Soak the towel in the sink.",
        "Wet the towel with water from the tap.",
        "Take the towel to the sink and let water run over it.",
        "Make the towel wet.",
        "Please soak the towel under the faucet.",
        "Put the towel under the running water until it is wet.",
        "Bring the towel to the water so that it gets soaked.",
        "Could you drench the towel at the sink?",
        "The towel is dry. Let it take up water from the tap.",
        "Moisten the cloth under the faucet.",
        "I need a wet towel; the tap is running.",
    ),
}
"""Of the paper's activities: eight, then those that are held out."""

PATTERNS = (
    "{Clause}.",
    "Please {clause}.",
    "I need you to {clause}.",
    "Your task is to {clause}.",
    "{Clause}, please.",
    "Robot, {clause}.",
    "Could you {clause}?",
    "Now {clause}.",
    "I would like you to {clause}.",
    "Would you {clause}?",
    "Go and {clause}.",
    "Make sure to {clause}.",
)
"""Of all other tasks; the last `HELD_OUT` are held out."""


def wordings(task: TaskLike, held_out: bool = False) -> tuple[str, ...]:
    """The instructions that ask for a task, the usual one first; those that are held out, or all others."""
    own = WORDINGS.get(task.name) or tuple(
        p.format(Clause=clause[0].upper() + clause[1:], clause=clause) for clause in (_clause(task),) for p in PATTERNS
    )
    return own[-HELD_OUT:] if held_out else own[:-HELD_OUT]


def _clause(task: TaskLike) -> str:
    """What a task asks for, as an imperative in lower case without a full stop."""
    if isinstance(task, BddlTask):
        name = task.name.removeprefix(PREFIX).replace("_", " ")
        return f"finish the activity '{name}', so that {_joined(sentences(task.binding.activity.goal))}"
    goal = split_goal_name(task.name)
    if goal is not None:
        return f"see to it that {_joined(sentences([parse(goal[1])]))}"
    words = task.summary.strip().rstrip(".") or task.name
    return words[0].lower() + words[1:]


def _joined(lines: list[str]) -> str:
    """Lines of `sentences` as one: conditions are parted by semicolons, what belongs to a head follows it."""
    parts = [re.sub(r"_(\d+)\b", r" \1", line.strip()).replace("_", " ") for line in lines]
    text = "; ".join(parts)
    return text.replace(":;", ":")
