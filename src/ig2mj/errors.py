"""Errors a user can cause.

Every message is one line and names the file, the element in it and what would fix it.
The command line prints that line and exits with status 2.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable


class Ig2mjError(Exception):
    """Base of all errors that a user can cause."""


class InputError(Ig2mjError):
    """A file the user gave is missing, broken or not what it claims to be.

    Attributes:
      file: path of the file, as the user would find it.
      element: what in the file is wrong (a link, a joint, a line), or ''.
      fix: what would put it right, or ''.
    """

    def __init__(self, file: object, problem: str, *, element: str = "", fix: str = ""):
        self.file, self.problem, self.element, self.fix = str(file), problem, element, fix
        where = f"{self.file}: {element}" if element else self.file
        text = f"{where}: {problem}" + (f" ({fix})" if fix else "")
        super().__init__(" ".join(text.split()))

    def __reduce__(self):
        """So that it survives the way back from a worker process."""
        fields = {"file": self.file, "problem": self.problem, "element": self.element, "fix": self.fix}
        return (_rebuild_input_error, (type(self), fields))


def _rebuild_input_error(kind: type[InputError], fields: dict[str, str]) -> InputError:
    file, problem = fields.pop("file"), fields.pop("problem")
    return kind(file, problem, **fields)


class ManifestError(InputError):
    """A scene's manifest.json does not fit its schema or its scene.xml."""


class PolicyServerError(Ig2mjError):
    """A policy server cannot be reached, takes too long, or answers with something that is not an action."""


class PolicyMismatch(InputError):
    """A policy is for another task, robot, way of grasping, list of actions or observations; names the pair."""


def without_lines(message: object) -> str:
    """A compiler's message without line numbers, for a text that ig2mj generated and the user does not have."""
    return re.sub(r",? line -?\d+", "", " ".join(str(message).split()))


class UnknownNameError(Ig2mjError):
    """A name (object, state, predicate, scene, ...) that does not exist; lists near matches, else what there is."""

    FEW = 20
    """So many names are listed where none is near."""

    EXAMPLES = 6
    """So many are listed where there are more."""

    def __init__(self, kind: str, name: str, known: Iterable[str], *, meant: str | None = None, also: str = ""):
        """`meant`: the one of `known` that is named instead of near matches. `also`: what ends the message."""
        name = str(name)  # whatever else was given in a name's place
        self.kind, self.name = kind, name
        names = list(dict.fromkeys(k for k in known if k))
        near = [meant] if meant else difflib.get_close_matches(name, names, n=3, cutoff=0.5)
        if near:
            hint = f"; near matches: {', '.join(near)}"
        elif names and len(names) <= self.FEW:
            hint = f" (there is {', '.join(names)})"
        elif names:
            hint = f" (there is {', '.join(names[: self.EXAMPLES])} and {len(names) - self.EXAMPLES} more)"
        else:
            hint = " (there is none)"
        super().__init__(f"no {kind} is named '{name}'{hint}{also and '; '}{also}")


class PluginError(Ig2mjError):
    """Something from outside the package cannot be used: its code cannot be imported, it is not what is expected, or
    its name is taken."""


class AbilityError(Ig2mjError):
    """A state or predicate was asked of an object whose category does not have it."""


class EngineError(Ig2mjError):
    """An engine cannot run the scene, or a step of it went wrong."""


class LostWorldError(EngineError):
    """A world's positions or velocities are no longer finite. It stays as it is until it is loaded or reset."""


class StaleStateError(Ig2mjError):
    """A state of worlds that a later step, reset, write or load reused: its worlds have moved on, or its buffers were
    donated to a compiled program."""

    def __init__(self, what: str = "this state"):
        super().__init__(
            f"{what} is stale: a later step, reset, write or load reused its buffers; continue with the state that the "
            "last call returned, or copy it before that call with fork(state)"
        )


class ClusterError(Ig2mjError):
    """Processes or machines that are to work together cannot: out of reach, of other versions, or one has died."""


class PoseError(Ig2mjError):
    """A pose or joint position that cannot be set: not finite, no rotation, or of something that cannot move."""


class StateError(Ig2mjError):
    """A state, predicate or option of states that cannot be set, or not to this value."""


class ActionError(Ig2mjError):
    """An action that does not fit its environment: another shape, or not of numbers."""


class MissingDependencyError(Ig2mjError):
    """An optional package or system library is absent; the message gives the command that installs it."""
