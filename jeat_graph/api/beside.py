"""What `jeat-graph-sehn`, a distribution of its own, adds: the simulator and training, found by entry points.

Two groups of entry points hold it: in `jeat_graph.commands` modules of commands, in `jeat_graph.functions`
functions that commands and `jeat_graph` itself call.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

from jeat_graph.data.errors import ConfigError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints

COMMAND_GROUP = "jeat_graph.commands"
FUNCTION_GROUP = "jeat_graph.functions"
HOW_TO_GET = (
    "comes with jeat-graph-sehn, which is not installed: `pip install ./sehn` in a checkout of jeat-graph"
)


def find(group: str, name: str, asked: str) -> Any:
    """Load what a distribution beside this one offers.

    Args:
        group: `COMMAND_GROUP` or `FUNCTION_GROUP`.
        name: of the entry point.
        asked: what needs it, in the user's words.

    Raises:
        ConfigError: it is not installed, or cannot be loaded.
    """
    from importlib.metadata import entry_points  # takes longer to load than most commands' own modules

    found = list(entry_points(group=group, name=name)) or _newer_command(name, entry_points(group=group))
    for point in found:
        try:
            return point.load()
        except (ImportError, AttributeError) as error:
            raise ConfigError(f"{asked} cannot be loaded from {point.value}: {error}") from None
    raise ConfigError(f"{asked} {HOW_TO_GET}")


def _newer_command(name: str, others: EntryPoints) -> list[EntryPoint]:
    """Return the entry point that a command would have, if it lies beside others; else nothing.

    Who installed a checkout as editable and updated it later has commands that its entry points do not name.
    """
    from importlib.metadata import EntryPoint
    from importlib.util import find_spec

    for package in sorted(
        {point.value.rpartition(".")[0] for point in others if point.group == COMMAND_GROUP}
    ):
        module = f"{package}.{name}_command"
        with suppress(ModuleNotFoundError):  # the package itself is gone
            if find_spec(module) is not None:
                return [EntryPoint(name, module, COMMAND_GROUP)]
    return []
