"""What the tracker is told of a network: a file beside it, which holds what was measured of its boxes.

Beside `NAME.onnx` it is `NAME.tracking.yaml`, with the section `sensor` (keys as of `sensors.NAME` in a
configuration: `kind`, `even_score`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from jeat_graph.config.section_tree import build, read_tree
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.detecting import EVENTS_SENSOR, FRAMES_SENSOR, FUSED_SENSOR
from jeat_graph.detection.named import EVENTS, FRAMES, FUSED, MOTION, network_file
from jeat_graph.detection.request import DetectRequest

_SUFFIX = ".tracking.yaml"
_KINDS = {FRAMES_SENSOR: FRAMES, EVENTS_SENSOR: EVENTS, FUSED_SENSOR: FUSED}


@dataclass(frozen=True)
class _Declared:
    sensor: SensorConfig = field(default_factory=SensorConfig)


def declared_settings(request: DetectRequest, say: Callable[[str], object] = lambda _: None) -> list[str]:
    """Return what files beside the networks say of them, as `key=value` settings of the tracker.

    A network without such a file, and the detectors without weights, say nothing.

    Args:
        request: what detects.
        say: called with a line for each file that was found.

    Raises:
        ConfigError: a detector that is not known, or a file that cannot be read or holds something else.
    """
    looking = {
        FRAMES_SENSOR: request.detector_frames if request.frames is not None else None,
        EVENTS_SENSOR: request.detector_events if request.events is not None else None,
    }
    if request.detector_fused is not None:
        looking = {FUSED_SENSOR: request.detector_fused}
    return declared_of({sensor: by for sensor, by in looking.items() if by is not None}, say)


def declared_of(detectors: Mapping[str, str], say: Callable[[str], object] = lambda _: None) -> list[str]:
    """Return the same of detectors whose boxes come from elsewhere, from a file or a pipe.

    Args:
        detectors: by sensor (`rgb`, `evt` or `fused`) what makes its boxes, `motion` or a network.
        say: called with a line for each file that was found.

    Raises:
        ConfigError: a detector that is not known, or a file that cannot be read or holds something else.
    """
    found: list[str] = []
    for sensor, detector in detectors.items():
        if detector == MOTION:
            continue
        network = network_file(detector, _KINDS[sensor])
        beside = network.with_name(network.name.removesuffix(network.suffix) + _SUFFIX)
        if not beside.is_file():
            continue
        tree = read_tree(str(beside), (), str, "file of what a network's boxes are like")
        try:
            build(_Declared, tree, "")
        except ConfigError as error:
            raise ConfigError(f"{beside}: {error}") from None
        found.append(f"sensors.{sensor}={json.dumps(tree.get('sensor', {}))}")
        say(f"sensor {sensor!r}: its boxes are taken for what {beside.name} says (any other --config: not)")
    return found
