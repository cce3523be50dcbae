"""What is declared to the tracker of a network: a file beside it, which holds what was measured of its boxes.

Beside `NAME.onnx` it is `NAME.tracking.yaml`, with the section `sensor` (keys as of `sensors.NAME` in a
configuration: `rate_hz`, `even_score`). Of a foreign network of pictures without such a file, the layout of
its outputs tells what its scores mean (`even_score` of `models.layouts`). What the sensor is (`kind`) tells
what it is read from: pictures or events.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from jeat_graph.config.section_tree import build, read_tree
from jeat_graph.config.sensors import CAMERA, EVENT, OTHER, SensorConfig
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.detection.detecting import EVENTS_SENSOR, FRAMES_SENSOR, FUSED_SENSOR
from jeat_graph.detection.models.engine import open_engine
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import CARD, read_onnx_head
from jeat_graph.detection.models.recognising import layout_of, network_of, recognised
from jeat_graph.detection.named import EVENTS, FRAMES, FUSED, MOTION, network_file
from jeat_graph.detection.request import DetectRequest
from jeat_graph.io.tables.sensor_columns import Declared, as_settings

_SUFFIX = ".tracking.yaml"
_KINDS = {FRAMES_SENSOR: FRAMES, EVENTS_SENSOR: EVENTS, FUSED_SENSOR: FUSED}
#: What a sensor is, by what its detector reads.
_SENSOR_KINDS = {FRAMES: CAMERA, EVENTS: EVENT, FUSED: OTHER}


@dataclass(frozen=True)
class _Declared:
    sensor: SensorConfig = field(default_factory=SensorConfig)


def known_of(request: DetectRequest, say: Callable[[str], object] = lambda _: None) -> Declared:
    """Return what is known of the networks that detect, as settings of the tracker by sensor and key.

    Of pictures in which what moves is found without weights nothing is known: not what stands, either.

    Args:
        request: what detects.
        say: called with a line for each network of which something is known.

    Raises:
        ConfigError: a detector that is not known, or a file that cannot be read or holds something else.
    """
    given = {
        FRAMES_SENSOR: request.detector_frames if request.frames is not None else None,
        EVENTS_SENSOR: request.detector_events if request.events is not None else None,
    }
    if request.detector_fused is not None:
        given = {FUSED_SENSOR: request.detector_fused}
    networks = {sensor: by for sensor, by in given.items() if by is not None}
    return known_of_networks(networks, say, request.settings.model_frames)


def declared_settings(request: DetectRequest, say: Callable[[str], object] = lambda _: None) -> list[str]:
    """Return the same as `key=value` texts; args and errors as of `known_of`."""
    return as_settings(known_of(request, say))


def known_of_networks(
    detectors: Mapping[str, str],
    say: Callable[[str], object] = lambda _: None,
    reading: ModelSettings | None = None,
) -> Declared:
    """Return the same of detectors whose boxes come from elsewhere, from a file or a pipe.

    Args:
        detectors: by sensor (`rgb`, `evt` or `fused`) what makes its boxes, `motion` or a network.
        say: called with a line for each network of which something is known.
        reading: how a network of pictures is read.

    Raises:
        ConfigError: a detector that is not known, or a file that cannot be read or holds something else.
    """
    found: Declared = {}
    for sensor, detector in detectors.items():
        if detector == MOTION:
            found |= {sensor: {"kind": EVENT}} if _KINDS[sensor] == EVENTS else {}
            continue
        found[sensor] = {"kind": _SENSOR_KINDS[_KINDS[sensor]]}
        network = network_file(detector, _KINDS[sensor])
        beside = network.with_name(network.name.removesuffix(network.suffix) + _SUFFIX)
        if not beside.is_file():
            if _KINDS[sensor] == FRAMES:
                even = _even_by_layout(sensor, network, reading or ModelSettings(), say)
                found[sensor] |= {} if even is None else {"even_score": even}
            continue
        tree = read_tree(str(beside), (), str, "file of what a network's boxes are like")
        try:
            build(_Declared, tree, "")
        except ConfigError as error:
            raise ConfigError(f"{beside}: {error}") from None
        found[sensor] |= tree.get("sensor") or {}
        say(f"sensor {sensor!r}: its boxes are taken for what {beside.name} says (any other --config: not)")
    return found


def _even_by_layout(
    sensor: str, network: Path, reading: ModelSettings, say: Callable[[str], object]
) -> float | None:
    """Return the even score of a foreign network of pictures; None where that is not known."""
    try:
        head = read_onnx_head(network)
        if CARD in head.notes:
            return None
        engine = cache(lambda: open_engine(network, head, reading.backend, reading.threads))
        found = recognised(network, head, reading, lambda inputs: engine().run(inputs))
        layout, _ = layout_of(
            network_of(found.outputs, found.side, head.notes, network), reading.layout, network
        )
    except DataError:  # who detects says what is wrong with it
        return None
    even = layout.even_score
    say(
        f"sensor {sensor!r}: a box of score {even:g} is taken to be as likely real as not, as of the layout "
        f"{layout.name} (--set sensors.{sensor}.even_score=… says otherwise; any other --config: not)"
    )
    return even
