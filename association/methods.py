"""The ways of associating detections with tracks, by name and by number."""

from __future__ import annotations

#: Names, in the order of their numbers.
METHODS = ("slots", "joint", "sequential")
#: One joint problem with a slot for each track and sensor.
SLOTS = METHODS.index("slots")
#: The paper's joint problem: one detection a track, and a second pass.
JOINT = METHODS.index("joint")
#: Sensor after sensor in a fixed order.
SEQUENTIAL = METHODS.index("sequential")
