"""Whether homes that were converted here are those that ship: `python -m ig2mj_homes.comparison MADE SHIPPED`.

Files are equal byte for byte. Numbers of MJCF and manifests may differ by `SAME`: loose objects are let down in a
simulation when a home is converted, and contacts round differently on different kinds of processor. An orientation of
MJCF that rounds to none may be written or left out.
"""

from __future__ import annotations

import fnmatch
import pathlib
import re
import sys

SAME = 1e-4
"""Metres, radians and units of quaternions within which a number is the same."""

MEASURED = "engine_profile*.json"
"""Files next to the scenes that are measured, not converted."""

QUAT = re.compile(r' quat="([^"]*)"')

NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])")


def differences(made: pathlib.Path, shipped: pathlib.Path) -> tuple[list[str], list[str]]:
    """Lines about files that differ, and about those that differ by rounding only."""
    files = {root: {p.relative_to(root) for p in root.rglob("*") if p.is_file()} for root in (made, shipped)}
    one, other = ({f for f in found if not fnmatch.fnmatch(f.name, MEASURED)} for found in files.values())
    differ = [f"{f}: only in {shipped}" for f in sorted(other - one)] + [
        f"{f}: only in {made}" for f in sorted(one - other)
    ]
    rounded = []
    for file in sorted(one & other):
        here, there = (made / file).read_bytes(), (shipped / file).read_bytes()
        if here == there:
            continue
        gap = greatest_gap(here.decode(), there.decode()) if file.suffix in (".xml", ".json") else None
        if gap is None or gap > SAME:
            differ.append(f"{file}: differs" + ("" if gap is None else f", numbers by up to {gap:.2g}"))
        else:
            rounded.append(f"{file}: numbers differ by up to {gap:.2g}")
    return differ, rounded


def greatest_gap(one: str, other: str) -> float | None:
    """The largest difference between corresponding numbers of two texts; None: they differ in more than numbers."""
    one, other = (QUAT.sub(_turned, text) for text in (one, other))
    if NUMBER.sub("#", one) != NUMBER.sub("#", other):
        return None
    pairs = zip(NUMBER.findall(one), NUMBER.findall(other), strict=True)
    return max((abs(float(a) - float(b)) for a, b in pairs), default=0.0)


def _turned(quat: re.Match[str]) -> str:
    """An orientation of MJCF; nothing where it is none, which MuJoCo writes if it is not exactly so."""
    w, *axis = map(float, quat[1].split())
    return "" if abs(abs(w) - 1.0) < SAME and all(abs(x) < SAME for x in axis) else quat[0]


def main() -> int:
    """Prints what differs; 1 if anything does by more than rounding."""
    made, shipped = map(pathlib.Path, sys.argv[1:3])
    differ, rounded = differences(made, shipped)
    print("\n".join([*rounded, *differ]) or "the same, byte for byte")
    return int(bool(differ))


if __name__ == "__main__":
    sys.exit(main())
