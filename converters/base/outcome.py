"""Result of a conversion. Imports nothing heavy: a conversion out of the cache needs no more."""

from __future__ import annotations

import dataclasses
import json
from typing import Any


@dataclasses.dataclass
class CheckResult:
    """One check.

    Attributes:
      name: "compiles", "bounding_box", "mass", "penetration", "settle", "joint_sweep", "self_contact",
        "joint_clearance".
      passed: nothing to complain about.
      summary: one line for people.
      failures: one dict per failing object, with the key "object" where it is about one.
      measured: per object name (or joint name) what was measured.
      seconds: it took.
      advisory: worth knowing, but no fault of the conversion.
    """

    name: str
    passed: bool
    summary: str
    failures: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    measured: dict[str, Any] = dataclasses.field(default_factory=dict)
    seconds: float = 0.0
    advisory: bool = False


@dataclasses.dataclass
class ConversionOutcome:
    """What a conversion did.

    Attributes:
      objects: how many. skipped: missing models that were left out, one line each.
      checks: of the finished model; [] without a report. warnings: how many there are.
      timings: stage -> seconds.
      provisional: why another run might do better (a decomposition ran out of time, nothing could render), one line
        each; such a result is not kept in the cache.
      manifest_hash: SHA-256 of the manifest that was written.
      shared: files outside the output's folder that it uses (see `ConvertOptions.assets`), relative to the folder.
      cached: the result came out of the cache.
      first_warnings: the first few, one line each.
    """

    objects: int
    skipped: list[str]
    checks: list[CheckResult]
    warnings: int
    timings: dict[str, float]
    provisional: list[str] = dataclasses.field(default_factory=list)
    manifest_hash: str = ""
    shared: list[str] = dataclasses.field(default_factory=list)
    cached: bool = False
    first_warnings: list[str] = dataclasses.field(default_factory=list)

    def to_json(self) -> str:
        """As text; numpy numbers become plain ones."""
        return json.dumps(dataclasses.asdict(self), default=lambda value: value.tolist())

    @classmethod
    def from_json(cls, text: str) -> ConversionOutcome:
        """Raises ValueError, KeyError or TypeError for text that `to_json` did not write."""
        fields = json.loads(text)
        return cls(**{**fields, "checks": [CheckResult(**check) for check in fields["checks"]]})
