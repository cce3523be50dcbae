"""What the MOTChallenge calls its classes."""

from __future__ import annotations

#: The class that is judged.
PEDESTRIAN = "pedestrian"
#: The labels of the 2016 and later challenges, from 1.
CHALLENGE = (
    PEDESTRIAN,
    "person_on_vehicle",
    "car",
    "bicycle",
    "motorbike",
    "non_motorized_vehicle",
    "static_person",
    "distractor",
    "occluder",
    "occluder_on_the_ground",
    "occluder_full",
    "reflection",
    "crowd",
)
