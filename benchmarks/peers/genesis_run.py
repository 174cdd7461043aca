"""One batch of an exported home in Genesis, pushed about by the hand: a row like those of `benchmarks/speed/batch.py`.

    python3 benchmarks/peers/genesis_run.py FOLDER --worlds 4096 --variant hibernation+performance --rows FILE

FOLDER is one of `genesis_export.py`. Genesis 1.4.5, torch and numpy must be there; ig2mj and JAX need not. A control
step is one `scene.step()` of 1/30 s in four substeps, with the hand's controls in eager torch. Variants, joined by +:
`hibernation` (bodies sleep), `performance` (kernels compiled for this scene, static arrays), `defaults`.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import pathlib
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]

from benchmarks.harness.turns import exclusive, preparing
from benchmarks.peers import genesis_absent, genesis_scene
from benchmarks.peers.genesis_hand import TorchHand

TIMESTEP, SUBSTEPS = 1 / 120, 4
STEPS, CALLS, LEAST_CALLS, CALL_SECONDS = 30, 4, 2, 10.0
"""Control steps of a timed call; calls, fewer where they would take longer than so many seconds together."""
SETTLE_SECONDS, SETTLE_STEPS = 3.0, 30
"""Before the hand begins: one second of rest, or what fits into so many seconds."""
PAIRS = 150
"""Collision pairs of a world, Genesis' default."""
CONTACTS = {"made_60": 260, "birch": 200}
"""Contacts of a world: about a fifth more than were seen. Genesis keeps a Jacobian of all constraints and degrees of
freedom of all worlds in one tensor of at most 2^31 numbers, so this bounds the worlds. Other homes: `_contacts`."""
MOVED, OUTSIDE, UNDER_FLOOR = 0.02, 50.0, -0.1
"""Metres, as in `benchmarks/harness/disturbance.py`: an object has moved; is outside the house; is below the floor."""
MOST_LOST = 1e-3
"""Share of worlds that may have lost an object in a row that counts, as in `benchmarks/speed/batch.py`."""
LEAST_TOUCHED = 0.1
"""Share of control steps in which the hand must touch an object, as in `benchmarks/harness/disturbance.py`."""

Row = dict[str, Any]


class Batch:
    """A built scene with its hand."""

    def __init__(self, folder: pathlib.Path, worlds: int, variant: str, cpu: bool, row: Row):
        """Loads and builds; what is known goes into `row`."""
        genesis_absent.put_in_place()
        import genesis as gs  # pyright: ignore[reportMissingImports]

        self.gs, self.worlds, self.cpu = gs, worlds, cpu
        flags = variant.split("+")
        gs.init(
            backend=gs.cpu if cpu else gs.cuda,  # not gs.gpu, which falls back to the CPU
            precision="32",
            logging_level="warning",
            performance_mode="performance" in flags,
            seed=0,
        )
        row |= {"genesis": gs.__version__, "torch": torch.__version__}
        row["device"] = "cpu" if cpu else torch.cuda.get_device_name()
        self.memory_before = self.memory()
        home = genesis_scene.read_home(folder)
        written = home.written
        row |= {"objects": written["objects"], "left_out": home.left_out}
        began = time.time()
        self.scene = self._scene(written, worlds, "hibernation" in flags)
        entities = {part.name: self._add(part) for part in home.parts}
        row["load_s"] = round(time.time() - began, 1)
        began = time.time()
        self.scene.build(n_envs=worlds)
        self.wait()
        row["build_s"] = round(time.time() - began, 1)
        self.solver = self.scene.sim.rigid_solver
        self.hand = entities["hand"]
        links = {link.name: link.idx for entity in entities.values() for link in entity.links}
        self.hand_links = torch.tensor(sorted(link.idx for link in self.hand.links), device=gs.device)
        self.loose = torch.tensor([links[name] for name in written["loose"]], device=gs.device)
        self.in_reach = torch.tensor([links[name] for name in written["in_reach"]], device=gs.device)
        self.palm = links["hand"]
        dofs = [self.hand.get_joint(name).dofs_idx_local for name in written["hand_joints"]]
        self.dofs = [dof if isinstance(dof, int) else dof[0] for dof in dofs]
        self.pusher = TorchHand(written["reach"], worlds, TIMESTEP * SUBSTEPS, gs.device)
        row |= self._as_in_mujoco(written, links)

    def _scene(self, written: Row, worlds: int, hibernation: bool) -> Any:
        options = self.gs.options
        return self.gs.Scene(
            sim_options=options.SimOptions(dt=TIMESTEP * SUBSTEPS, substeps=SUBSTEPS, gravity=(0.0, 0.0, -9.8)),
            rigid_options=options.RigidOptions(
                max_contacts=CONTACTS.get(written["home"]) or _contacts(written, worlds),
                max_collision_pairs=PAIRS,
                enable_self_collision=False,  # the homes exclude pairs within an object
                constraint_timeconst=0.02,  # MuJoCo's default, which the homes use
                use_hibernation=hibernation,
                iterations=25,
            ),
            show_viewer=False,
        )

    def _add(self, part: genesis_scene.Part) -> Any:
        gs = self.gs
        # No pair needs a signed distance field (all geoms are convex); at the default resolution they would take
        # gigabytes and minutes. MJCF's `gravcomp` is not read, so the hand's is set here.
        material = gs.materials.Rigid(
            gravity_compensation=1.0 if part.name == "hand" else 0.0, needs_coup=False, sdf_min_res=16, sdf_max_res=16
        )
        no_pieces = float("inf")
        morph = gs.morphs.MJCF(
            file=part.xml,
            visualization=False,
            convexify=True,
            decimate=False,
            decompose_object_error_threshold=no_pieces,
            decompose_robot_error_threshold=no_pieces,
        )
        return self.scene.add_entity(morph, material=material)

    def _as_in_mujoco(self, written: Row, links: dict[str, int]) -> Row:
        """How far what was read is from what MuJoCo has."""
        mass = [
            abs(float(link.get_mass()) / written["mass"][link.name] - 1.0)
            for link in self.solver.links
            if link.name in written["mass"]
        ]
        com = self.com()[0].cpu().numpy()
        places = written["centre_of_mass"]
        away = [float(np.abs(com[links[n]] - np.array(places[n])).max()) for n in places if n in links]
        return {"mass_off_share": round(max(mass), 5), "placed_off_m": round(max(away), 5)}

    def com(self) -> torch.Tensor:
        """Centres of mass of all links [W L 3]."""
        return self.solver.get_links_pos(ref=self.gs.link_ref_frame.link_COM)

    def steps(self, count: int, push: bool = True) -> float:
        """Makes control steps; seconds."""
        began = time.time()
        for _ in range(count):
            if push:
                com = self.com()
                self.hand.control_dofs_position(self.pusher(com[:, self.in_reach], com[:, self.palm]), self.dofs)
            self.scene.step()
        self.wait()
        return time.time() - began

    def wait(self) -> None:
        """Until the device has done everything."""
        if not self.cpu:
            torch.cuda.synchronize()

    def touched(self) -> float:
        """Share of worlds whose hand touches a loose object now."""
        contacts = self.solver.collider.get_contacts(as_tensor=True, to_torch=True)
        a, b = contacts["link_a"], contacts["link_b"]
        of_hand, of_thing = ((lambda x, w=which: torch.isin(x, w)) for which in (self.hand_links, self.loose))
        pair = (of_hand(a) & of_thing(b)) | (of_hand(b) & of_thing(a))
        return float(pair.reshape(self.worlds, -1).any(1).float().mean())

    def memory(self) -> float:
        """MB in use on the device, of all processes."""
        if self.cpu:
            return 0.0
        free, total = torch.cuda.mem_get_info()
        return (total - free) / 1e6

    def outcome(self, settled: torch.Tensor) -> Row:
        """What became of the objects."""
        end = self.com()[:, self.loose]
        lost = ((end.abs() > OUTSIDE).any(-1) | (end[..., 2] < UNDER_FLOOR)).any(1)
        return {
            "moved_objects_per_world": round(float(((end - settled).norm(dim=-1) > MOVED).sum(1).float().mean()), 2),
            "capacity_overflows": int(self.solver.get_error_envs_mask().sum()),
            "non_finite": int((~self.solver.get_qpos().isfinite().all(-1)).sum()),
            "lost_object_worlds": int(lost.sum()),
            "peak_device_MB_per_world": round((self.memory() - self.memory_before) / self.worlds, 3),
        }


def _contacts(written: Row, worlds: int) -> int:
    """A home's contacts at rest and a fifth, within what one tensor holds at four rows a contact."""
    expected = 1.2 * written["contacts_at_rest"] + 60
    return int(min(expected, 2**31 / (4.2 * written["dofs"] * worlds)))


def run(args: argparse.Namespace, row: Row, keep: Callable[[], None]) -> None:
    """Fills a row; `keep` is called when there is a speed in it."""
    began = time.time()
    with preparing(args.lock, args.patience):
        batch = Batch(args.folder, args.worlds, args.variant, args.cpu, row)
        still = torch.zeros((args.worlds, len(batch.dofs)), device=batch.gs.device)
        batch.hand.control_dofs_position(still, batch.dofs)
        batch.steps(1, push=False)  # compiles
    row["compile_s"] = round(time.time() - began, 1)
    with exclusive(args.lock, args.patience):
        began, rested = time.time(), 1
        while rested < SETTLE_STEPS and time.time() - began < SETTLE_SECONDS:
            batch.steps(1, push=False)
            rested += 1
        settled = batch.com()[:, batch.loose].clone()
        batch.steps(2)  # the hand's first steps compile, too
        row["first_call_s"] = round(batch.steps(args.steps), 2)
        times, touched = [], []
        while len(times) < LEAST_CALLS or (len(times) < CALLS and sum(times) + times[-1] < CALL_SECONDS):
            times.append(batch.steps(args.steps))
            touched.append(batch.touched())
        median = float(np.median(times))
        row |= {
            "control_steps_per_s": round(args.worlds * args.steps / median),
            "ms_per_control_step": round(1e3 * median / args.steps, 3),
            "spread": round((max(times) - min(times)) / median, 3),
            "simulated_s": round((rested + 2 + (1 + len(times)) * args.steps) * TIMESTEP * SUBSTEPS, 2),
            "hand_contact_share": round(float(np.mean(touched)), 3),
        }
        keep()
        row |= batch.outcome(settled)
    batch.solver.check_errno()  # raises where a buffer was too small
    sound = not (row["capacity_overflows"] or row["non_finite"])
    few_lost = row["lost_object_worlds"] <= MOST_LOST * args.worlds
    row["counts"] = bool(sound and few_lost and row["hand_contact_share"] >= LEAST_TOUCHED)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--worlds", type=int, default=4096)
    parser.add_argument("--variant", default="hibernation+performance")
    parser.add_argument("--steps", type=int, default=STEPS, help="control steps of a timed call")
    parser.add_argument("--cpu", action="store_true", help="on the processor, to try it")
    parser.add_argument("--label", default="", help="a remark for the row")
    parser.add_argument("--lock", type=pathlib.Path, help="file to lock while timing")
    parser.add_argument("--patience", type=float, default=0.0, help="seconds to wait for others, as of throughput.py")
    parser.add_argument("--rows", type=pathlib.Path, help="the row is added to this file, as a JSON line")
    args = parser.parse_args()
    row: Row = {"engine": "genesis", "variant": args.variant, "scene": args.folder.name, "worlds": args.worlds}
    row |= {"case": "disturbed", "what": "physics", "label": args.label, "counts": False}
    try:
        run(args, row, lambda: print("timed", json.dumps(row), flush=True))
    except BaseException as error:  # Genesis raises its own for an overflow
        row["error"] = f"{type(error).__name__}: {error}"[:400]
    line = json.dumps(row)
    print(line, flush=True)
    if args.rows and ("error" not in row or "control_steps_per_s" in row):
        with args.rows.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
    if "genesis" in sys.modules:
        with contextlib.suppress(BaseException):
            sys.modules["genesis"].destroy()  # writes compiled kernels to its cache
    sys.stdout.flush()
    os._exit(1 if "error" in row else 0)


if __name__ == "__main__":
    main()
