#!/usr/bin/env bash
# What the humanoid's hands lose: CookingMeat, random grasps, 100 million physics steps or SOAK seconds of each mode of
# MODES (SOAK=0: none); then throughput with the humanoid in the hand's place, one home after the other (a crash costs
# its own rows and names its line). One GPU, at most 24 minutes; results: $OUT.
set -u
out=${OUT:-out/gpu/robots}; mkdir -p "$out"
unset XLA_PYTHON_CLIENT_MEM_FRACTION; export XLA_PYTHON_CLIENT_PREALLOCATE=false PYTHONFAULTHANDLER=1
python3 -c "
import pathlib, sys; sys.path.insert(0, 'benchmarks')
from made_home import write_home; write_home(pathlib.Path('out/benchmarks/made_60'), 60)"
soak=${SOAK:-240}
for mode in ${MODES:-sticky mitten}; do
  [ "$soak" = 0 ] || timeout -k 10 $(( soak + 110 )) python3 benchmarks/soak_grasping.py CookingMeat --grasping "$mode" \
    --world-steps "${STEPS:-1e8}" --seconds "$soak" --worlds "${WORLDS:-4096}" --rows "$out/soak_grasping.jsonl" \
    > "$out/soak_$mode.log" 2>&1 || tail -30 "$out/soak_$mode.log"
done
while read -r home worlds what; do
  timeout -k 10 "${LIMIT:-240}" python3 benchmarks/throughput.py "$home" --worlds "${WORLDS:-$worlds}" --what $what --robot humanoid \
    --rows "$out/throughput.jsonl" > "$out/${home##*/}.log" 2>&1 || tail -30 "$out/${home##*/}.log"
done << HOMES
birch 8192 physics
spruce 4096 physics camera
out/benchmarks/made_60 16384 physics
HOMES
