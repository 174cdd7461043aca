"""Texts of the panels: the states of an object, and the goal as a tree, as HTML. All names are escaped."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ig2mj.predicates.compile import CompiledExpression
from ig2mj.predicates.registry import OF_SUBSTANCES, PREDICATES
from ig2mj.predicates.tree import GoalPart, tree
from ig2mj.states.definitions import from_physics
from ig2mj.states.model import StateModel
from ig2mj.states.registry import SPECS
from ig2mj.web.planning import PlanReport
from ig2mj.web.shots import Shot

_SLOW = (from_physics.ABOVE, from_physics.BELOW, from_physics.BESIDE)
"""States that look through the whole home; a table that is made four times a second leaves them out."""
_LONG = (from_physics.CONTACTS, from_physics.JOINT_STATES, from_physics.POSE, from_physics.AABB)
"""States of many numbers or names: they come last."""
MOST_PARTS = 200
"""Lines of a goal; a quantifier over a large home has thousands."""

_CELL = "padding:1px 8px 1px 0;vertical-align:top"
_FONT = "font-size:12.5px;line-height:1.45"
GOOD, BAD, SOFT = "#1b7f3b", "#b3261e", "#6b7280"
_COLOURS = {"done": GOOD, "now": "#2c5f8a"}


def object_rows(model: StateModel, shot: Shot, index: int) -> list[tuple[str, str]]:
    """Name and value of every state of an object, then its predicates that are true or false by states alone."""
    rows: list[tuple[str, str]] = []
    for spec in (*(s for s in SPECS if s not in (*_SLOW, *_LONG)), *model.added, *_LONG):
        if spec.belongs_to(model, index):
            value = _text(spec.get(model, shot.states, shot.view, index, shot.row))
            rows.append((spec.name.replace("_", " "), f"{value} {spec.unit}".strip() if value != "-" else value))
    long = sum(spec.belongs_to(model, index) for spec in _LONG)
    named = {name for name, _ in rows}
    for predicate in PREDICATES.values():
        name, of_states = predicate.name.replace("_", " "), predicate.per_object
        able = predicate.ability is None or bool(model.parameters.has(predicate.ability)[index])
        of_substances = predicate.name in OF_SUBSTANCES and model.substances is None
        if of_states is None or name in named or not able or of_substances:
            continue
        true = bool(np.asarray(of_states(model, shot.states))[shot.row, index])
        rows.insert(len(rows) - long, (name, _text(true)))
    return rows


def object_table(model: StateModel, shot: Shot, index: int) -> str:
    """The states of an object."""
    tables = model.tables
    kind = f"{tables.object_categories[index]}, {'fixed' if tables.object_fixed[index] else 'movable'}"
    title = f"<b>{html.escape(tables.object_names[index])}</b> <span style='color:{SOFT}'>{html.escape(kind)}</span>"
    return f"<div style='padding:0 12px 8px'>{title}{table(object_rows(model, shot, index))}</div>"


def table(rows: Sequence[tuple[str, str]]) -> str:
    """Two columns."""
    body = "".join(
        f"<tr><td style='{_CELL};color:{SOFT};white-space:nowrap'>{html.escape(name)}</td>"
        f"<td style='{_CELL};overflow-wrap:anywhere'>{_coloured(value)}</td></tr>"
        for name, value in rows
    )
    return f"<table style='border-collapse:collapse;{_FONT}'>{body}</table>"


def status(rows: Sequence[tuple[str, str]], trouble: str) -> str:
    """Clock and the like, and what went wrong."""
    what = f"<div style='color:{BAD}'>{html.escape(trouble)}</div>" if trouble else ""
    return f"<div style='padding:0 12px 4px'>{table(rows)}{what}</div>"


def goal_tree(goal: CompiledExpression, shot: Shot) -> str:
    """The goal with truth values, and why a literal is not as it should be."""
    whole = tree(goal, shot.states, shot.view, shot.row)
    leaves = list(_leaves(whole))
    fine = sum(part.fine for part in leaves)
    state = "holds" if whole.holds else f"does not hold yet: {fine} of {len(leaves)} literals are as they should be"
    lines = [f"<div style='color:{GOOD if whole.holds else BAD};padding-bottom:2px'><b>The goal {state}.</b></div>"]
    _lines(whole, 0, lines)
    if len(lines) > MOST_PARTS:
        lines[MOST_PARTS:] = [f"<div style='color:{SOFT}'>... and {len(lines) - MOST_PARTS} more lines</div>"]
    return f"<div style='padding:0 12px 8px;{_FONT}'>{''.join(lines)}</div>"


def plan_table(report: PlanReport) -> str:
    """The steps of a plan with their states, what the robot holds, and how the last request ended."""
    rows = "".join(_step(*row) for row in report.rows)
    held = f"in its hands: {', '.join(report.held)}" if report.held else "its hands are empty"
    notes = [held, *([report.note] if report.note else [])]
    below = "".join(f"<div style='color:{SOFT};{_FONT}'>{html.escape(note)}</div>" for note in notes)
    return f"<div style='padding:0 12px 6px'>{rows}{below}</div>"


def _step(number: int, text: str, state: str, more: str) -> str:
    """One step: what is done on the left, how it went on the right, and the reason of a failure below."""
    failed = state not in ("", *_COLOURS)
    how = html.escape(state if failed else f"{state} {more}".strip())
    right = f"<span style='color:{_COLOURS.get(state, BAD)};white-space:nowrap'>{how}</span>"
    left = f"<span><span style='color:{SOFT}'>{number}</span> {html.escape(text)}</span>"
    line = f"<div style='display:flex;justify-content:space-between;gap:8px'>{left}{right}</div>"
    why = f"<div style='color:{SOFT};padding-left:16px'>{html.escape(more)}</div>" if failed and more else ""
    return f"<div style='{_FONT}'>{line}{why}</div>"


def _leaves(part: GoalPart):
    if part.literal:
        yield part
    for inner in part.parts:
        yield from _leaves(inner)


def _lines(part: GoalPart, depth: int, lines: list[str]) -> None:
    colour = GOOD if part.fine else BAD
    mark = "&#10003;" if part.fine else "&#10007;"
    text = html.escape(part.text) if part.literal else f"<i>{html.escape(part.text)}</i>"
    why = f"<div style='color:{SOFT};padding-left:16px'>{html.escape(part.why)}</div>" if part.why else ""
    lines.append(
        f"<div style='margin-left:{14 * depth}px'><span style='color:{colour};font-weight:600'>{mark}</span> "
        f"{text}{why}</div>"
    )
    for inner in part.parts:
        _lines(inner, depth + 1, lines)


def _coloured(value: str) -> str:
    if value in ("yes", "no"):
        return f"<span style='color:{GOOD if value == 'yes' else SOFT}'>{value}</span>"
    return html.escape(value)


def _text(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (float, np.floating)):
        return f"{value:.3g}" if math.isfinite(value) else "-"
    if isinstance(value, (list, tuple)):
        return ", ".join(_text(v) for v in value) if value else "-"
    return str(value)
