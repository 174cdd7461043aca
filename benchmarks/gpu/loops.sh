#!/usr/bin/env bash
# Birch with all states and a goal, as it is and with XLA's loops inside CUDA graphs, and then the kernels of both. One
# GPU, four runs of about 80 s (the first compiles); results: $OUT.
set -u
out=${OUT:-out/gpu/loops}; mkdir -p "$out"
unset XLA_PYTHON_CLIENT_MEM_FRACTION; export XLA_PYTHON_CLIENT_PREALLOCATE=false PYTHONFAULTHANDLER=1
run() {  # name, flags of XLA, other arguments
  XLA_FLAGS="${XLA_FLAGS:-} $2" timeout -k 10 "${LIMIT:-200}" python3 benchmarks/throughput.py birch --worlds "${WORLDS:-8192}" \
    --what full --label "$1" --rows "$out/birch.jsonl" "${@:3}" > "$out/$1.txt" 2>&1 || tail -30 "$out/$1.txt"
}
run as_is ""
run loops_in_graphs --xla_gpu_enable_command_buffer=+WHILE
run as_is_kernels "" --kernels 80 --timeline "$out/as_is.csv"
run loops_kernels "--xla_gpu_enable_command_buffer=+WHILE --xla_enable_command_buffers_during_profiling=true" --kernels 80 \
  --timeline "$out/loops.csv"
