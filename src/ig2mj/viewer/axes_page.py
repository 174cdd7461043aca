"""The page of an evaluation on axes: a plot of success and q with their intervals, and strips of images of failures."""

from __future__ import annotations

import base64
import html
import io
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.envs.environment import Environment
from ig2mj.envs.rollout import Act
from ig2mj.envs.state import EnvState
from ig2mj.errors import Ig2mjError
from ig2mj.install_hint import require_extras
from ig2mj.learn.axes import ActOf, AxisResult
from ig2mj.learn.episodes import Episodes
from ig2mj.learn.stages import Stage, stages

STRIPS, FRAMES = 2, 6
"""Failures of each axis that are shown, and images of each."""

WIDTH, HEIGHT = 256, 192
"""Pixels of an image."""

STYLE = "body{font-family:sans-serif;max-width:1100px;margin:2em auto}td,th{padding:.2em .8em;text-align:right}"
STYLE += "th:first-child,td:first-child{text-align:left}img{max-width:100%}"


def write_page(
    file: pathlib.Path,
    title: str,
    episodes: Episodes,
    results: Sequence[AxisResult],
    act_of: ActOf,
    options: Mapping[str, Any],
) -> None:
    """Writes one HTML file. Failures are played again in one world of the native engine.

    Raises:
      MissingDependencyError: matplotlib is not installed. OSError: it cannot be written there.
    """
    require_extras("demo")
    rows = [f"<h1>{html.escape(title)}</h1>", f'<img src="{_plot(results)}" alt="success and q by axis">']
    rows.append(_table(results))
    replays = _Replays(episodes, results, act_of, options)
    for result in results:
        for number, q in result.failures[:STRIPS]:
            try:
                strip = replays.strip(result.axis, number)
            except Ig2mjError as e:  # nothing renders here, or a policy server has gone
                rows.append(f"<p>{html.escape(result.axis)}, episode {number}: {html.escape(str(e))}</p>")
                continue
            rows.append(f"<h3>{html.escape(result.axis)}, episode {number}: no success, q {q:.2f}</h3>")
            rows.append(f'<img src="{strip}" alt="images from start to end of the episode">')
    head = f'<!doctype html><meta charset="utf-8"><title>{html.escape(title)}</title><style>{STYLE}</style>'
    file.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")


def _table(results: Sequence[AxisResult]) -> str:
    rows = []
    for result in results:
        found = result.as_dict()
        if found["episodes"]:
            shown = f"{found['success_rate']:.1%}", f"{found['success_low']:.1%} to {found['success_high']:.1%}"
            cells = (result.axis, *shown, f"{found['q']:.3f}", str(found["episodes"]))
            rows.append("<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in cells) + "</tr>")
    names = ("axis", "success", "95 % interval", "q", "episodes")
    return "<table><tr>" + "".join(f"<th>{n}</th>" for n in names) + "</tr>" + "".join(rows) + "</table>"


def _plot(results: Sequence[AxisResult]) -> str:
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    known = [(r.axis, r.as_dict()) for r in results if len(r.success)]
    figure, axes = plt.subplots(figsize=(9, 3.6), layout="constrained")
    places = np.arange(len(known))
    for shift, label, key in ((-0.2, "success", "success"), (0.2, "q", "q")):
        rate = np.array([d["success_rate" if key == "success" else "q"] for _, d in known], float)
        low = np.array([d[f"{key}_low"] for _, d in known], float)
        high = np.array([d[f"{key}_high"] for _, d in known], float)
        around = np.maximum([rate - low, high - rate], 0)
        axes.bar(places + shift, rate, 0.38, yerr=around, capsize=3, label=label)
    axes.set_xticks(places, [name for name, _ in known], rotation=30, ha="right")
    axes.set_ylim(0, 1.05)
    axes.legend(loc="lower left")
    with io.BytesIO() as out:
        figure.savefig(out, format="png", dpi=110)
        plt.close(figure)
        return _embedded(out.getvalue())


class _Replays:
    """Episodes that are played again in one world of the native engine. Axes share environments as when they were
    judged."""

    def __init__(self, episodes: Episodes, results: Sequence[AxisResult], act_of: ActOf, options: Mapping[str, Any]):
        axes = [result.axis for result in results]
        self._stages = stages(episodes, axes, episodes.count, options.get("robot"))
        self._act_of, self._options = act_of, {**options, "worlds": 1, "engine": "native"}
        self._made: dict[int, tuple[Environment, Act]] = {}

    def strip(self, axis: str, number: int) -> str:
        """Images of one episode, from its start to its end."""
        from PIL import Image

        stage, env, act = self._playing(axis, number)
        state = stage.start(env, axis, [stage.part.numbers.index(number)])
        images = [_image(env, state)]
        while not bool(np.asarray(state.done)[0]):
            state = env.step(state, act(state))
            images.append(_image(env, state) if len(images) % 5 == 0 or bool(np.asarray(state.done)[0]) else images[-1])
        picked = [images[k] for k in np.linspace(0, len(images) - 1, FRAMES).round().astype(int)]
        with io.BytesIO() as out:
            Image.fromarray(np.concatenate(picked, axis=1)).save(out, format="png")
            return _embedded(out.getvalue())

    def _playing(self, axis: str, number: int) -> tuple[Stage, Environment, Act]:
        """What plays an episode; made once."""
        which = next(k for k, s in enumerate(self._stages) if axis in s.axes and number in s.part.numbers)
        if which not in self._made:
            env = self._stages[which].environment(self._options)
            self._made[which] = env, self._act_of(env)
        return self._stages[which], *self._made[which]


def _image(env: Any, state: EnvState) -> np.ndarray:
    return env.render(state, width=WIDTH, height=HEIGHT)


def _embedded(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
