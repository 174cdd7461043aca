#!/usr/bin/env bash
# All tests that need a GPU, or those of the files given, where there is no `make`: a process for each file, eight at a
# time. Each ends after LIMIT seconds (560), with what failed until then. One GPU; results: $OUT, and a line for each file
# at the end.
set -u
out=${OUT:-out/gpu/tests}; mkdir -p "$out"; export out LIMIT="${LIMIT:-560}"
unset XLA_PYTHON_CLIENT_MEM_FRACTION; export JAX_PLATFORMS=cuda,cpu XLA_PYTHON_CLIENT_PREALLOCATE=false

test_file() {
  timeout -s INT -k 20 "$LIMIT" python3 -m pytest -m gpu -v --timeout 1800 --tb=short --durations=5 -p no:cacheprovider \
    -W default::DeprecationWarning "$1" >"$out/$(basename "$1" .py).txt" 2>&1
}
export -f test_file

files() {
  if [ $# -gt 0 ]; then printf '%s\n' "$@"; return; fi
  { grep -rlE "mark.gpu" tests --include="test_*.py"; grep -rl "kernel_device" tests --include="test_*.py"; } | sort -u
}

began=$SECONDS
files "$@" | xargs -P 8 -I{} bash -c 'test_file {}'
for file in "$out"/test_*.txt; do echo "$(basename "$file" .txt): $(tail -n 1 "$file")"; grep -E "^(FAILED|ERROR)" "$file"; done
echo "$((SECONDS - began)) s"
