"""The pushing hand of `ig2mj.calibration.pushing`, in torch: the same rules, other random numbers.

Its numbers are read from there by `tests/benchmarks/test_peers.py`, which also drives both with the same draws.
Axes: W worlds, N objects in reach.
"""

from __future__ import annotations

import math
from typing import Any

import torch  # pyright: ignore[reportMissingImports]

TRAVEL_SPEED, PUSH_SPEED, CLOSE, PUSH_SECONDS = 1.0, 0.5, 0.25, 0.8
PAST, OVER, FOLLOW, GONE_DOWN, LEASH, ARRIVED, IMPATIENCE = 0.15, 0.06, 0.4, 0.1, 0.1, 0.02, 4
"""See `ig2mj.calibration.pushing`."""

CONTROLS = 16


class TorchHand:
    """The hands of all worlds.

    Attributes:
      ctrl: [W 16], of the last call; the first three are the hand's place from its start, m.
    """

    def __init__(self, reach: dict[str, Any], num_worlds: int, seconds: float, device: Any):
        """`reach`: of `home.json`. `seconds`: length of a control step."""

        def filled(value: int) -> torch.Tensor:
            return torch.full((num_worlds,), value, dtype=torch.long, device=device)

        def floats(name: str) -> torch.Tensor:
            return torch.tensor(reach[name], dtype=torch.float32, device=device)

        self.seconds = seconds
        self.start, self.nodes, self.over, self.choice = map(floats, ("start", "nodes", "over", "choice"))
        self.hop = torch.tensor(reach["hop"], dtype=torch.long, device=device)
        self.row = torch.arange(num_worlds, device=device)
        self.ctrl = torch.zeros((num_worlds, CONTROLS), device=device)
        self.goal, self.node = filled(int(reach["first"])), filled(int(reach["start_node"]))
        self.came, self.left = self.node.clone(), filled(1)
        self.pushes = torch.zeros(num_worlds, dtype=torch.bool, device=device)
        self.heading = torch.zeros((num_worlds, 2), device=device)

    def __call__(self, com: torch.Tensor, palm: torch.Tensor, draw: torch.Tensor | None = None) -> torch.Tensor:
        """Controls [W 16] of the next control step.

        Args:
          com: [W N 3], centres of mass of the objects in reach. palm: [W 3]. draw: [W 2] in 0..1; None: drawn here.
        """
        draw = torch.rand((len(self.row), 2), device=com.device) if draw is None else draw
        assert draw is not None
        here = self.ctrl[:, :3] + self.start
        _, near = self._place(com, self.goal)
        enough = self.pushes & ((self.left <= 0) | ~near)
        arrives = ~self.pushes & ((self.nodes[self.node] - here).norm(dim=-1) < ARRIVED)
        fails = ~self.pushes & ~arrives & (self.left <= 0)

        drawn = (draw[:, :1] > self.choice[self.goal]).sum(1).clamp_max(len(self.over) - 1)
        wants = enough | fails | (~self.pushes & ~near)
        goal = torch.where(wants & self._place(com, drawn)[1], drawn, self.goal)

        onward = self.hop[self.node, goal]
        meets = arrives & (onward == goal) & (goal == self.goal) & near
        node = torch.where(arrives & (onward >= 0), onward, self.node)
        node = torch.where(enough, self.goal, torch.where(fails, self.came, node))
        self.came = torch.where(enough | ~(arrives | fails), self.came, self.node)
        self.node, self.goal = node, goal
        self.pushes = (self.pushes & ~enough) | meets

        place, _ = self._place(com, goal)
        way = (place - here)[:, :2]
        flat = way.norm(dim=-1, keepdim=True)
        turn = 2 * math.pi * draw[:, 1]
        anywhere = torch.stack([turn.cos(), turn.sin()], dim=-1)
        toward = torch.where(flat > 0.05, way / flat.clamp_min(1e-6), anywhere)
        heading = torch.where(meets[:, None], toward, self.heading)
        self._move(place, here, palm, flat, heading, enough | fails | arrives)
        self.heading = torch.nan_to_num(heading)
        return self.ctrl

    def _place(self, com: torch.Tensor, goal: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The palm's place at an object now [W 3], and whether that is near where the ways lead [W]."""
        place = com[self.row, goal].clone()
        place[:, 2] += self.over[goal]
        moved = place - self.nodes[goal]
        return place, (moved.norm(dim=-1) < FOLLOW) & (moved[:, 2] > -GONE_DOWN)

    def _move(
        self,
        place: torch.Tensor,
        here: torch.Tensor,
        palm: torch.Tensor,
        flat: torch.Tensor,
        heading: torch.Tensor,
        begins: torch.Tensor,
    ) -> None:
        """The target goes on, at most `LEASH` ahead of the palm; patience runs out where that holds it back."""
        target = place.clone()
        target[:, :2] += torch.where(flat < OVER, PAST, 0.0) * heading
        target = torch.where(self.pushes[:, None], target, self.nodes[self.node])
        way = target - here
        distance = way.norm(dim=-1)
        slow = self.pushes & (distance < CLOSE + PAST)
        stride = torch.where(slow, PUSH_SPEED, TRAVEL_SPEED) * self.seconds
        allowed = (
            1.3 * distance / (TRAVEL_SPEED * self.seconds) + torch.where(self.pushes, PUSH_SECONDS, 0.2) / self.seconds
        )
        ahead = here + way * (stride / distance.clamp_min(1e-6)).clamp_max(1.0)[:, None]
        held = ((ahead - palm).abs() > LEASH).any(1)
        allowed = torch.nan_to_num(allowed, 0.0, 0.0, 0.0).ceil().long()
        self.left = torch.where(begins, allowed, self.left - torch.where(held, IMPATIENCE, 1)).clamp_min(0)
        ahead = torch.minimum(torch.maximum(ahead, palm - LEASH), palm + LEASH) - self.start
        sound = ahead.isfinite().all(1)[:, None]
        self.ctrl[:, :3] = torch.where(sound, ahead, self.ctrl[:, :3])
