"""Plug-ins: states, predicates, sensors, robots, commands and overlays from outside the package.

They are registered by a call (`ig2mj.register`), by a file or module that `IG2MJ_PLUGINS` names, or by an installed
package with entry points in the group `ig2mj.plugins`. An entry point is named after its kind and its name:

    [project.entry-points."ig2mj.plugins"]
    "state.age" = "my_package:AGE"

Names are read from the metadata of installed packages, without importing them. The code of a plug-in is imported when
something of its kind and name is first used, and runs with the user's rights.
"""

from ig2mj.plugins.entry_points import GROUP, KINDS, VARIABLE, Plugin
from ig2mj.plugins.registering import register, registry_of
from ig2mj.plugins.registry import Registry, source_of_caller

__all__ = ["GROUP", "KINDS", "VARIABLE", "Plugin", "Registry", "register", "registry_of", "source_of_caller"]
