"""Benchmarks are scripts in a folder of their own; their tests import them from there."""

from __future__ import annotations

import sys
from pathlib import Path

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
sys.path += [str(BENCHMARKS), str(BENCHMARKS / "peers"), str(BENCHMARKS / "gpu")]
