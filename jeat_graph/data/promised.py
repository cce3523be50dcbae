"""A table that is made when it is looked at: most steps of a tracker are taken for a few of their tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

from jeat_graph.data.trajectories import Trajectories


def promised(make: Callable[[], Trajectories]) -> Trajectories:
    """Return a table that is made by its first look, and is an ordinary one from then on.

    Args:
        make: makes it, from what does not change later. Threads that look at the same time may call it twice.
    """
    table = object.__new__(_Promised)
    vars(table)[_MAKE] = make
    return table


_MAKE = "_make"


class _Promised(Trajectories):
    """A table that nobody has looked at."""

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Copy and pickle the table itself."""
        return _made(self).__reduce_ex__(protocol)


def _made(table: Trajectories) -> Trajectories:
    """Make a table, which is no other object then."""
    make = vars(table).get(_MAKE)
    if make is not None:
        vars(table).update(vars(make()))
        object.__setattr__(table, "__class__", Trajectories)
        vars(table).pop(_MAKE, None)
    return table


def _passed_on(name: str) -> property:
    return property(lambda table: vars(_made(table))[name])


for _field in fields(Trajectories):
    setattr(_Promised, _field.name, _passed_on(_field.name))
