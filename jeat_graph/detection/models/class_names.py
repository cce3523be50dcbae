"""What the classes of a network are called, and which of them are looked for.

A network numbers its classes. Their names stand in the file's notes (Ultralytics' exports), or follow from
their number: 80 are those of COCO, 91 and 92 are COCO's own numbering.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence

from jeat_graph.data.errors import ConfigError

#: The 80 classes of COCO in the order in which networks number them. Source: cocodataset.org.
COCO = re.split(
    r",\s+",
    """person, bicycle, car, motorcycle, airplane, bus, train, truck, boat, traffic light, fire hydrant,
    stop sign, parking meter, bench, bird, cat, dog, horse, sheep, cow, elephant, bear, zebra, giraffe,
    backpack, umbrella, handbag, tie, suitcase, frisbee, skis, snowboard, sports ball, kite,
    baseball bat, baseball glove, skateboard, surfboard, tennis racket, bottle, wine glass, cup, fork,
    knife, spoon, bowl, banana, apple, sandwich, orange, broccoli, carrot, hot dog, pizza, donut, cake,
    chair, couch, potted plant, bed, dining table, toilet, tv, laptop, mouse, remote, keyboard,
    cell phone, microwave, oven, toaster, sink, refrigerator, book, clock, vase, scissors, teddy bear,
    hair drier, toothbrush""",
)
# COCO's own numbers count from 1 and leave these out.
_LEFT_OUT = {12, 26, 29, 30, 45, 66, 68, 69, 71, 83}
_COCO_COUNTS = (91, 92)
_VEHICLES = {"car", "motorcycle", "motorbike", "bus", "truck", "van", "vehicle", "trailer", "lorry"}
_ANY = {"vehicle", "vehicles", "object", "item"}
_PERSONS = {"person", "pedestrian", "rider"}
#: What stands for every class.
ALL = "all"


def class_names(notes: Mapping[str, str]) -> dict[int, str]:
    """Return the names in the notes of a file, `{0: 'car', …}` or `['car', …]`; none without them."""
    try:
        names = ast.literal_eval(notes.get("names", "{}"))
        pairs = dict(names).items() if isinstance(names, Mapping) else enumerate(names)
        return {int(number): str(name) for number, name in pairs}
    except (ValueError, SyntaxError, TypeError):
        return {}


def known_names(names: Mapping[int, str], count: int | None) -> dict[int, str]:
    """Return the names of a network's classes by number; none where nobody knows them.

    Args:
        names: what its file says.
        count: how many classes it has, if known.
    """
    if names:
        return dict(names)
    if count == len(COCO):
        return dict(enumerate(COCO))
    if count in _COCO_COUNTS:
        numbers = (number for number in range(1, _COCO_COUNTS[0]) if number not in _LEFT_OUT)
        return dict(zip(numbers, COCO, strict=True))
    return {}


def wanted_classes(
    asked: Sequence[str], count: int | None, names: Mapping[int, str]
) -> tuple[frozenset[int] | None, str]:
    """Return the numbers of the classes that are kept, None for all, and a few words that say so.

    Args:
        asked: names or numbers that the user gave; `all` for all; nothing for vehicles.
        count: how many classes the network has, if known.
        names: their names, if the file says them.

    Raises:
        ConfigError: a name that is not known.
    """
    known = known_names(names, count)
    if tuple(asked) == (ALL,):
        return None, "all classes"
    if asked:
        by_name = {name.lower(): number for number, name in known.items()}
        numbered = {str(number) for number in (*known, *range(count or 0))}
        taken = {*by_name, *numbered}
        unknown = [one for one in asked if one.lower() not in taken and not (one.isdecimal() and not count)]
        if unknown:
            raise ConfigError(
                f"classes: {unknown[0]!r} is none of the network's; give its number, or one of "
                f"{', '.join(sorted(by_name)) or 'none: the file has no names'}"
            )
        numbers = frozenset(int(one) if one.isdecimal() else by_name[one.lower()] for one in asked)
        return numbers, f"classes {', '.join(known.get(number, str(number)) for number in sorted(numbers))}"
    vehicles = {number: name for number, name in known.items() if name.lower() in _VEHICLES}
    if not vehicles:
        return None, "all classes"
    return frozenset(vehicles), f"classes {', '.join(vehicles.values())}"


def persons(names: Mapping[int, str]) -> frozenset[int]:
    """Return the numbers of the classes that are people: on a vehicle, they are not that vehicle."""
    return frozenset(number for number, name in names.items() if name.lower() in _PERSONS)


def says_nothing(names: Mapping[int, str], count: int | None) -> bool:
    """Whether all boxes of a network are of one class that has no name, or is any vehicle whatever.

    Beside a network that tells cars from trucks it would only outvote it.
    """
    if len(names) == 1:
        return next(iter(names.values())).lower() in _ANY
    return not names and count == 1
