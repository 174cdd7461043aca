"""Every ability: its parameters' defaults, the extended states it needs, the annotated links it needs.

An ability is a property of an object category, under the taxonomy's name. Sources: paper tables A.2 (states) and A.3
(links); the defaults are those of iGibson's state constructors, which are the paper's where it gives one (tables A.1
and A.4).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping


@dataclasses.dataclass(frozen=True)
class Ability:
    """What an ability brings along.

    Attributes:
      predicate: the logical predicate it makes meaningful, or None.
      states: extended states an object with it carries (table A.2).
      links: kinds of annotated links a model of such a category is to have (table A.3).
      defaults: parameters and their values where neither the taxonomy nor an override gives one.
    """

    predicate: str | None = None
    states: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    defaults: Mapping[str, float | bool] = dataclasses.field(default_factory=dict)


#: Parameters of both kinds of heat source: degrees Celsius, 1/s, metres, three conditions (iGibson's
#: object_states/heat_source_or_sink.py).
_HEAT = {
    "temperature": 200.0,
    "heating_rate": 0.04,
    "distance_threshold": 0.2,
    "requires_toggled_on": False,
    "requires_closed": False,
    "requires_inside": False,
}

ABILITIES: dict[str, Ability] = {
    "burnable": Ability("burnt", ("max_temperature", "temperature"), (), {"burn_temperature": 200.0}),  # Celsius
    "cookable": Ability("cooked", ("max_temperature", "temperature"), (), {"cook_temperature": 70.0}),  # Celsius
    "freezable": Ability("frozen", ("temperature",), (), {"freeze_temperature": 0.0}),  # Celsius
    # Droplets absorbed at which the object is soaked (table A.1: one).
    "soakable": Ability("soaked", ("wetness",), (), {"wetness_soaked": 1.0}),
    # Fraction of the placed particles that must be exceeded (table A.1: one half).
    "dustyable": Ability("dusty", ("dust",), (), {"dusty_threshold": 0.5}),
    "stainable": Ability("stained", ("stain",), (), {"stained_threshold": 0.5}),
    "toggleable": Ability("toggled_on", ("toggled_on",), ("toggle_button",)),
    # Newtons on the blade that must be exceeded (table A.4: ten).
    "sliceable": Ability("sliced", ("sliced",), (), {"slice_force": 10.0}),
    "slicer": Ability(None, (), ("slicer",)),
    "cleaningTool": Ability(None, (), ("cleaning_tool_area",)),
    # Part of a joint's range beyond which it counts as open (table A.1: five per cent).
    "openable": Ability("open", ("open",), (), {"open_fraction": 0.05}),
    "heatSource": Ability(None, ("toggled_on",), ("heat_source",), _HEAT),
    "coldSource": Ability(None, ("toggled_on",), ("heat_source",), _HEAT),
    "waterSource": Ability(None, ("toggled_on",), ("water_source",)),
    # The paper's DropletSink. No category of the taxonomy has it: `overrides.json` gives it to those with a drain.
    "waterSink": Ability(None, (), ("water_sink",)),
    # In the taxonomy, with no state behind them.
    "breakable": Ability(),
    "liquid": Ability(),
    "perishable": Ability(),
    "screwable": Ability(),
    "timeSetable": Ability(),
}
