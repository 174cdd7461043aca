"""Options of states are checked where they are made."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from ig2mj.errors import StateError, UnknownNameError
from ig2mj.states import StateModel, StateOptions
from ig2mj.states.options import NoEffectWarning


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("timestep", 0.0), ("timestep", float("nan")), ("image_aspect", -1.0), ("drying_rate", -0.1),
        ("drying_rate", float("inf")), ("drying_rate", "0.1"), ("contact_heat_rate", True), ("soiling", "yes"),
        ("occlusion", 1),
    ],
)  # fmt: skip
def test_a_value_that_an_option_cannot_have_is_refused_by_its_name(name, value):
    with pytest.raises(StateError, match=name):
        StateOptions(**{name: value})


def test_numbers_and_switches_of_numpy_are_taken():
    options = StateOptions(drying_rate=np.float32(0.5), timestep=1, soiling=np.bool_(True))
    assert options.drying_rate == 0.5 and options.soiling


def test_misspelt_rules_are_refused_with_near_matches():
    with pytest.raises(UnknownNameError, match="near matches: igibson"):
        StateOptions(compat="ibigson")


def test_dirt_that_spreads_warns_where_no_substance_is_in_use(tiny_home):
    with pytest.warns(NoEffectWarning, match="--substances mud"):
        StateModel.of_manifest(tiny_home.tables, tiny_home.manifest, StateOptions(soiling=True))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        StateModel.of_manifest(tiny_home.tables, tiny_home.manifest, StateOptions(drying_rate=1.0))
