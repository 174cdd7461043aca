#!/usr/bin/env bash
# All tests that need a GPU, where there is no `make` and no package of ours: kernels in one process, the rest in another.
# Each ends after LIMIT seconds (560), with what failed until then. One GPU; results: $OUT.
set -u
out=${OUT:-out/gpu/tests}; mkdir -p "$out"
unset XLA_PYTHON_CLIENT_MEM_FRACTION; export JAX_PLATFORMS=cuda,cpu XLA_PYTHON_CLIENT_PREALLOCATE=false

tests() {  # NAME FILE ...
  local name=$1; shift
  timeout -s INT -k 20 "${LIMIT:-560}" python3 -m pytest -m gpu -v --tb=short --durations=15 \
    -W default::DeprecationWarning "$@" >"$out/$name.txt" 2>&1
}

marked=$(grep -rl "mark.gpu" tests --include="test_*.py" --exclude-dir=engine)
tests kernels tests/engine &
tests rest $marked &
wait
tail -n 40 "$out"/kernels.txt "$out"/rest.txt
