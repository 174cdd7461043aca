#!/usr/bin/env bash
# All tests that need a GPU, where there is no `make` and no package of ours: navigation and lasers first. Whoever ends a
# file before its time (LIMIT, 270 s each) sees what failed until then. One GPU; results: $OUT.
set -u
out=${OUT:-out/gpu/tests}; mkdir -p "$out"
unset XLA_PYTHON_CLIENT_MEM_FRACTION; export JAX_PLATFORMS=cuda,cpu XLA_PYTHON_CLIENT_PREALLOCATE=false
for file in envs/test_navigation_on_a_gpu sensors/test_lasers_on_a_gpu worlds/test_batches_on_a_gpu envs/test_array_faces \
  engine/test_engines_come_and_go docs/test_code_blocks sensors/test_batch_camera; do
  timeout -s INT -k 20 "${LIMIT:-270}" python3 -m pytest -m gpu -v --tb=short -W default::DeprecationWarning \
    "tests/$file.py" 2>&1 | tee "$out/${file##*/}.txt" | tail -25
done
