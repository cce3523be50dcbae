"""The kinds of event cameras that there are."""

from __future__ import annotations

from functools import cache

from jeat_graph.data.records import records_in
from jeat_graph.io.event_cameras.record import EventCameraKind


@cache
def event_cameras() -> dict[str, EventCameraKind]:
    """Return the records of all kinds, by the scheme of their addresses."""
    found: list[EventCameraKind] = records_in("jeat_graph.io.event_cameras", "EVENT_CAMERA")
    return {one.scheme: one for one in found}


def address_forms() -> str:
    """Return all their addresses, for help and messages."""
    forms = [form for one in event_cameras().values() for form in one.forms]
    return " or ".join(filter(None, (", ".join(forms[:-1]), forms[-1])))
