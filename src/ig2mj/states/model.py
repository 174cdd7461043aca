"""`StateModel`: everything about states that does not change during a run. Closed over by the jitted functions."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Int

from ig2mj.process.user_warning import warn_user
from ig2mj.scene.extras import ATTACHED, ON_FIRE, names_of
from ig2mj.scene.manifest import InsideEntry, Manifest
from ig2mj.scene.tables import LinkKind, SceneTables
from ig2mj.states.added import added_states, extra_states, substance_states
from ig2mj.states.definitions import on_fire
from ig2mj.states.definitions.attached import Joints
from ig2mj.states.options import NoEffectWarning, StateOptions
from ig2mj.states.parameters import StateParameters, parameters_of_manifest
from ig2mj.states.spec import StateSpec
from ig2mj.states.substances.model import SubstanceModel

DEFAULTS = StateOptions()


@dataclasses.dataclass(frozen=True, eq=False)
class StateModel:
    """Constants of a scene's states: tables, parameters, options, and the states that not every scene has.

    Attributes:
      added: states of substances, where the scene has some, and those of plug-ins, in the order of their updates; by
        default all that are known now. substances: of the scene; None: it names none.
      extras: names of further states of the scene. joints: what can be attached in it; None: nothing.
    """

    tables: SceneTables
    parameters: StateParameters
    options: StateOptions = DEFAULTS
    added: tuple[StateSpec, ...] = dataclasses.field(default_factory=added_states)
    substances: SubstanceModel | None = None
    extras: tuple[str, ...] = ()
    joints: Joints | None = None

    @classmethod
    def of_manifest(cls, tables: SceneTables, manifest: Manifest, options: StateOptions = DEFAULTS) -> StateModel:
        """The model of a loaded scene."""
        parameters = parameters_of_manifest(manifest, tables, options.compat)
        made = cls(tables, parameters, options).with_extras(manifest)
        if not manifest.substances:
            if options.soiling:
                fix = "load it with substances=['mud'], or --substances mud"
                warn_user(f"soiling=True changes nothing in a scene without substances ({fix})", NoEffectWarning)
            return made
        insides = {o: entry.inside for o, entry in enumerate(manifest.objects) if entry.inside is not None}
        return made.with_substances(manifest.substances, insides)

    def with_extras(self, manifest: Manifest) -> StateModel:
        """The same scene with the further states that its manifest asks for."""
        names = names_of(manifest.extras)
        if not names:
            return self
        parameters = self.parameters
        if ON_FIRE in names:
            parameters = dataclasses.replace(parameters, thermal=parameters.thermal | on_fire.flammable(self))
        joints = Joints.of_manifest(self.tables, manifest) if ATTACHED in names else None
        added = (*extra_states(names), *self.added)
        return dataclasses.replace(self, parameters=parameters, added=added, extras=names, joints=joints)

    def with_substances(self, names: Sequence[str], insides: Mapping[int, InsideEntry]) -> StateModel:
        """The same scene with substances in use, and the insides of its containers, by object.

        Raises:
          UnknownNameError: a substance is not known.
        """
        substances = SubstanceModel.build(self.tables, names, insides, self.parameters)
        things = substances.things
        holds = np.isin(np.arange(self.tables.num_objects), [*insides, *things.object[things.melts >= 0]])
        thermal = self.parameters.thermal | holds  # contents have the container's temperature
        parameters = dataclasses.replace(self.parameters, thermal=thermal)
        return dataclasses.replace(
            self, parameters=parameters, added=(*substance_states(), *self.added), substances=substances
        )

    @property
    def paper(self) -> bool:
        """Whether the paper's rules are in force, not iGibson's (docs/design/rules.md#paper-and-code)."""
        return self.options.compat == "paper"

    @functools.cached_property
    def swap_objects(self) -> Int[np.ndarray, "M"]:
        """Objects that slicing moves, wholes first, and then those that rules move: the M axis of `Swap`."""
        wholes = np.unique(self.parameters.half_whole)
        sliced = np.concatenate([wholes, self.parameters.half_object]).astype(int)
        if self.substances is None:
            return sliced
        others = self.substances.things.object
        return np.concatenate([sliced, others[~np.isin(others, sliced)]])

    @functools.cached_property
    def buttons(self) -> Int[np.ndarray, "B"]:
        """Annotated links that are buttons of objects with a switch."""
        tables = self.tables
        buttons = np.flatnonzero(tables.link_kind == LinkKind.TOGGLE_BUTTON)
        return buttons[self.parameters.has("toggleable")[tables.link_object[buttons]]]
