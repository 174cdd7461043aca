#!/usr/bin/env bash
# `gpu_tests.py` with its folder in $OUT and $LIMIT seconds (560): all tests that need a GPU, or those of the files given.
exec python3 "$(dirname "$0")/gpu_tests.py" --out "${OUT:-out/gpu-tests}" --minutes "$(awk "BEGIN { print ${LIMIT:-560} / 60 }")" "$@"
