"""How long an exchange of gradients takes by itself: an all-reduce in a loop, as a learner's update has it.

    python benchmarks/all_reduce.py [--gpus 2] [--limit 40] [--rows FILE] [--logs FOLDER] [--cpu]

With one process for each GPU and with one for all of them (`processes`), inside XLA's CUDA graphs and outside of them
(`graphs`), for as many numbers as the gradients of SAC's critics and of its actor have, and for few. `us` is the time
of one of 200 that follow each other, less that of the same loop without it. `transport` is what NCCL says that it uses
(P2P over NVLink or PCIe, SHM through the host's memory, NET).
"""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import re
import socket
import statistics
import sys
import time
from typing import Annotated, Any

import results
import tyro
from waiting import Process, end_all

HERE = pathlib.Path(__file__).resolve().parent

SIZES = (1_000, 266_500, 1_241_290)

ROUNDS = 200
"""All-reduces of a loop."""

COMMANDS = "FUSION,CUBLAS,CUBLASLT,CUSTOM_CALL,CUDNN,COLLECTIVES"
"""What XLA puts into CUDA graphs, with collectives."""

VIA = re.compile(r"Channel \S+ : \S+ -> \S+(?: \[\w+\])? via (\S+)")


@dataclasses.dataclass
class Args:
    """What to measure."""

    gpus: int = 2
    limit: float = 40.0
    """Seconds for everything; rows are kept as they come, the last of them says what was not ready."""
    rows: pathlib.Path | None = None
    """Rows are added to this file, as JSON lines."""
    logs: pathlib.Path = HERE.parent / "out" / "benchmarks" / "all_reduce"
    """Folder for what the processes and NCCL say."""
    cpu: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """On CPU devices, to try the benchmark itself."""


def transports(folder: pathlib.Path, pattern: str) -> list[str]:
    """What NCCL's logs say of the ways between GPUs, each once."""
    return sorted({way for file in folder.glob(pattern) for way in VIA.findall(file.read_text(errors="replace"))})


def start(processes: int, args: Args) -> list[Process]:
    """As many processes, all GPUs shared out to them."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    found = []
    for k in range(processes):
        own = range(args.gpus) if processes == 1 else [k]
        environment = {
            "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
            "CUDA_VISIBLE_DEVICES": ",".join(map(str, own)),
            "NCCL_DEBUG": "INFO",
            "NCCL_DEBUG_FILE": str(args.logs.resolve() / f"nccl-{processes}-{k}"),
        }
        if args.cpu:
            flag = f"--xla_force_host_platform_device_count={len(own)}"
            environment |= {"JAX_PLATFORMS": "cpu", "XLA_FLAGS": f"{os.environ.get('XLA_FLAGS', '')} {flag}"}
        words = [str(HERE / "all_reduce.py"), "worker", str(processes), str(k), str(port)]
        found.append(Process(words, args.logs / f"{processes}-{k}.log", environment))
    return found


def worker(processes: int, rank: int, port: int) -> None:
    """One process: says READY, then answers every line of its input with DONE and microseconds."""
    import jax
    import jax.numpy as jnp
    import numpy as np
    from jax.sharding import Mesh, NamedSharding, PartitionSpec

    if processes > 1:
        jax.distributed.initialize(f"127.0.0.1:{port}", processes, rank, local_device_ids=[0])
    mesh = Mesh(np.array(jax.devices()), ("d",))
    sharded, count = PartitionSpec("d"), jax.device_count()

    def loop(size: int, graphs: bool, exchange: bool) -> float:
        """Microseconds of a round."""

        def body(held: Any, _: None) -> tuple[Any, None]:
            held = jnp.sin(held) * 1.0001
            return (jax.lax.psum(held, "d") / count if exchange else held), None

        def rounds(held: Any) -> Any:
            return jax.lax.scan(body, held, None, length=ROUNDS)[0]

        options = {"xla_gpu_enable_command_buffer": COMMANDS, "xla_gpu_graph_min_graph_size": "1"} if graphs else None
        mapped = jax.shard_map(rounds, mesh=mesh, in_specs=sharded, out_specs=sharded, check_vma=False)
        program = jax.jit(mapped, compiler_options=options)
        place = NamedSharding(mesh, sharded)
        held = jax.make_array_from_callback((count * size,), place, lambda _: np.ones(size, np.float32))
        jax.block_until_ready(program(held))
        times = []
        for _ in range(5):
            began = time.perf_counter()
            jax.block_until_ready(program(held))
            times.append(time.perf_counter() - began)
        return 1e6 * statistics.median(times) / ROUNDS

    print("READY " + json.dumps({"device": jax.devices()[0].device_kind, "jax": jax.__version__}), flush=True)
    for line in sys.stdin:
        wish = json.loads(line)
        with_it, without = (loop(wish["size"], wish["graphs"], exchange) for exchange in (True, False))
        print("DONE " + json.dumps({"us": with_it - without, "loop_us": with_it}), flush=True)


def main(args: Args) -> None:
    """Measures; rows go to standard output and to the file."""
    until = time.monotonic() + args.limit
    args.logs.mkdir(parents=True, exist_ok=True)
    groups = {processes: start(processes, args) for processes in (args.gpus, 1)}
    every = [process for group in groups.values() for process in group]
    try:
        for process in every:
            process.wait_until_ready(until)
        for graphs in (False, True):
            for size in reversed(SIZES):
                for processes, group in groups.items():
                    row: dict[str, Any] = {"gpus": args.gpus, "processes": processes, "floats": size, "graphs": graphs}
                    for process in group:
                        process.tell({"size": size, "graphs": graphs})
                    done = [process.hear("DONE", until) for process in group]
                    answers = [d for d in done if d is not None]
                    if len(answers) < len(group):
                        silent = next(p for p, d in zip(group, done, strict=True) if d is None)
                        results.keep_row({**row, "error": silent.trouble()}, args.rows)
                        return
                    row |= {name: round(max(d[name] for d in answers), 2) for name in ("us", "loop_us")}
                    row["transport"] = transports(args.logs, f"nccl-{processes}-*")
                    results.keep_row({**row, **(group[0].ready or {})}, args.rows)
    finally:
        end_all(every)


if __name__ == "__main__":
    if sys.argv[1:2] == ["worker"]:
        worker(*map(int, sys.argv[2:5]))
    else:
        main(tyro.cli(Args, description=__doc__))
