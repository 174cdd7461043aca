"""Categories of ig2mj's own that iGibson does not have: objects that BEHAVIOR-1K's activities name.

`further_categories.json` lists them in groups that have the same abilities. Their names are those of BEHAVIOR-1K's
synsets without number. They have no synset in the taxonomy, and are a kind of nothing.
"""

from __future__ import annotations

import functools
import json
import pathlib
from collections.abc import Mapping
from typing import Any

FILE = pathlib.Path(__file__).with_name("further_categories.json")


@functools.cache
def further_categories() -> Mapping[str, Mapping[str, Mapping[str, Any]]]:
    """Category -> its abilities, with the parameters that differ from the defaults."""
    groups = json.loads(FILE.read_text(encoding="utf-8")).values()
    return {category: group["abilities"] for group in groups for category in group["categories"]}
