"""The equality constraints by which hands hold objects: compiled with the scene, switched off."""

from __future__ import annotations

import mujoco

from ig2mj.scene.manifest import AgentEntry, Manifest

TIME_CONSTANT = 0.02
"""Seconds in which a grasp takes back what it was pulled apart: MuJoCo's default, 2.4 physics steps."""

IMPEDANCE = (0.98, 0.995, 0.001)
"""MuJoCo's solimp. With its default, 0.9 to 0.95, a constraint yields as much as its lighter body would: a knife of
0.1 kg turned by 0.2 rad in the hand for each N m, and its blade could not press with the 10 N that cut."""


def equality_name(hand: str, body: str) -> str:
    """Of the constraint between two bodies."""
    return f"{hand}/grasp/{body}"


def add_grasp_equalities(spec: mujoco.MjSpec, manifest: Manifest, agents: list[AgentEntry]) -> None:
    """Adds the constraints of each hand of `assisted` agents.

    These are a weld to the main body of every movable object that allows grasps, and a connect to the moving link of
    every openable joint of fixed objects.

    Switched off they cost nothing.
    """
    movable = [entry.bodies[0] for entry in manifest.objects if entry.assisted_grasp and not entry.fixed]
    moving = [
        spec.joint(opens.joint).parent.name for entry in manifest.objects if entry.fixed for opens in entry.openable
    ]
    for hand in (name for agent in agents if agent.assisted for name in agent.hands):
        for bodies, kind in ((movable, mujoco.mjtEq.mjEQ_WELD), (dict.fromkeys(moving), mujoco.mjtEq.mjEQ_CONNECT)):
            for body in bodies:
                spec.add_equality(
                    name=equality_name(hand, body),
                    type=kind,
                    objtype=mujoco.mjtObj.mjOBJ_BODY,
                    name1=hand,
                    name2=body,
                    active=False,
                    solref=[TIME_CONSTANT, 1.0],
                    solimp=[*IMPEDANCE, 0.5, 2.0],
                )
