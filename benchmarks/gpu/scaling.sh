#!/usr/bin/env bash
# Weak scaling on 1 and 2 GPUs with equal work (230 s), what runs on them while a learner learns, an all-reduce by itself
# (40 s), and with SUCCESS=1 seconds until 95 % succeed (300 s more). WAYS: of a learner on two GPUs, see scaling.py;
# CASES="learner" alone takes 190 s, with WAYS="processes graphs" 150. Run in the repository's root with nothing else on
# the GPUs; results: $OUT.
set -u
out=${OUT:-out/gpu/scaling}; mkdir -p "$out"
unset XLA_PYTHON_CLIENT_MEM_FRACTION; export XLA_PYTHON_CLIENT_PREALLOCATE=false
timeout -k 5 45 python3 benchmarks/all_reduce.py --gpus 2 --limit 40 --rows "$out/all_reduce.jsonl" --logs "$out/all_reduce"
seconds=${SECONDS_IN_ALL:-240}
timeout -k 10 "$seconds" python3 benchmarks/scaling.py --gpus 1 2 --cases ${CASES:-learner made_60 birch_pictures} \
  --ways ${WAYS:-processes graphs together} --seconds ${EACH:-5} --limit $(( seconds - 15 )) --rows "$out/rows.jsonl" \
  --logs "$out/logs" --kernels "$out/kernels"
python3 benchmarks/learner_kernels.py "$out"/kernels/*.json | tee "$out/kernels.txt"
if [ "${SUCCESS:-0}" = 1 ]; then
  for task in CookingMeat GraspingBook; do python3 -m ig2mj sample-task $task; done
  timeout -k 10 300 python3 benchmarks/time_to_success.py --gpus 1 2 --tasks GraspingBook CookingMeat --seconds 100 --limit 280 \
    --rows "$out/time_to_success.jsonl" --out "$out/runs"
fi
