#!/usr/bin/env bash
# Throughput with the humanoid in the hand's place, one home after the other (a crash costs its own rows and names its
# line), and with SOAK=150 so many seconds of random grasps with mittens. One GPU; results: $OUT.
set -u
out=${OUT:-out/gpu/robots}; mkdir -p "$out"
unset XLA_PYTHON_CLIENT_MEM_FRACTION; export XLA_PYTHON_CLIENT_PREALLOCATE=false PYTHONFAULTHANDLER=1
python3 -c "
import pathlib, sys; sys.path.insert(0, 'benchmarks')
from made_home import write_home; write_home(pathlib.Path('out/benchmarks/made_60'), 60)"
while read -r home worlds what; do
  timeout -k 10 "${LIMIT:-240}" python3 benchmarks/throughput.py "$home" --worlds "${WORLDS:-$worlds}" --what $what --robot humanoid \
    --rows "$out/throughput.jsonl" > "$out/${home##*/}.log" 2>&1 || tail -30 "$out/${home##*/}.log"
done << HOMES
birch 8192 physics
spruce 4096 physics camera
out/benchmarks/made_60 16384 physics
HOMES
if [ "${SOAK:-0}" != 0 ]; then
  timeout -k 10 $(( SOAK + 110 )) python3 benchmarks/soak_grasping.py CookingMeat --grasping mitten --seconds "$SOAK" \
    --rows "$out/soak_grasping.jsonl"
fi
