"""What the tracker is told of a network: a file beside it, which holds what was measured of its boxes.

Beside `NAME.onnx` it is `NAME.tracking.yaml`, with the section `sensor` (keys as of `sensors.NAME` in a
configuration) and, if wanted, `birth: {max_overlap: …}`, `merge: {apart_overlap: …}`,
`output: {position_scale: …, lasting_error: …}`, `smoother: {max_gap_s: …}`, `lifecycle: {least_move: …}`,
`together: {SENSOR: {…}}`, keys of this sensor where that one looks too, and `beside: SENSOR`: without that
sensor only what its scores say of boxes and of tracks counts, and the sections `merge`, `output` and
`smoother`. A network without such a file has that of its layout, `layouts/LAYOUT.tracking.yaml`, if any.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path

from jeat_graph.config.fields import LARGEST, Section, number
from jeat_graph.config.reading import load_config
from jeat_graph.config.section_tree import build, read_tree
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.detection.detecting import EVENTS_SENSOR, FRAMES_SENSOR, FUSED_SENSOR
from jeat_graph.detection.models.layouts import recognise
from jeat_graph.detection.models.model_settings import OPEN_SIDE
from jeat_graph.detection.models.onnx_head import CARD, read_onnx_head
from jeat_graph.detection.named import EVENTS, FRAMES, FUSED, MOTION, network_file
from jeat_graph.detection.request import DetectRequest

_SUFFIX = ".tracking.yaml"
_LAYOUTS = Path(__file__).parent / "layouts"
_RAW = "-raw"
# What scores say of how exact boxes are, and how tracks fit, was measured of each sensor alone.
_ALWAYS = ("score_noise", "score_fit")
# Which of two files' values counts outside of the sensors. Without the sensor that a file names under
# `beside`, of these sections only `_ALONE` count.
_CHOSEN: dict[str, Callable[[float, float], float]] = {
    "lifecycle": max,
    "birth": min,
    "merge": min,
    "output": min,
    "smoother": min,
}
_ALONE = ("merge", "output", "smoother")
_KINDS = {FRAMES_SENSOR: FRAMES, EVENTS_SENSOR: EVENTS, FUSED_SENSOR: FUSED}


@dataclass(frozen=True)
class _Birth(Section):
    max_overlap: float = number(1.0, "1", "a box that overlaps a track by more begins none", 0.0, 1.0)


@dataclass(frozen=True)
class _Merge(Section):
    apart_overlap: float = number(
        1.0, "1", "what was seen with an IoU of no more stays two; 0: its boxes may be two of one", 0.0, 1.0
    )


@dataclass(frozen=True)
class _Output(Section):
    position_scale: float = number(1.0, "1", "factor on the variances of positions as written", 1e-3, 1.0)
    lasting_error: float = number(1.0, "1", "what boxes are off by as long as seen, per height", 0.0, 1.0)


@dataclass(frozen=True)
class _Smoother(Section):
    max_gap_s: float = number(LARGEST, "s", "`smoother.max_gap_s`", open_low=True)


@dataclass(frozen=True)
class _Lifecycle(Section):
    least_move: float = number(0.0, "1", "`lifecycle.least_move`", 0.0)


@dataclass(frozen=True)
class _Together(Section):
    rgb: SensorConfig = field(default_factory=SensorConfig)
    evt: SensorConfig = field(default_factory=SensorConfig)


@dataclass(frozen=True)
class _Declared:
    beside: str = ""
    sensor: SensorConfig = field(default_factory=SensorConfig)
    together: _Together = field(default_factory=_Together)
    lifecycle: _Lifecycle = field(default_factory=_Lifecycle)
    birth: _Birth = field(default_factory=_Birth)
    merge: _Merge = field(default_factory=_Merge)
    output: _Output = field(default_factory=_Output)
    smoother: _Smoother = field(default_factory=_Smoother)


def declared_settings(request: DetectRequest, say: Callable[[str], object] = lambda _: None) -> list[str]:
    """Return what files beside the networks say of them, as `key=value` settings of the tracker.

    Of several values outside of the sensors the smallest counts, but of `least_move` the greatest: tracks are
    as exact as the more exact of their sensors. A network without such a file, and the detectors without
    weights, say nothing.

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


def _of_layout(network: Path, sensor: str) -> Path | None:
    """Return the file of what networks of pictures with outputs of a layout are like, if there is one."""
    if sensor != FRAMES_SENSOR or not network.is_file():
        return None
    with suppress(DataError):  # said where the network is opened
        head = read_onnx_head(network)
        shape = head.inputs[0].shape
        if CARD in head.notes or len(shape) != len("NCHW"):
            return None
        layout = recognise(head.outputs, (shape[3] or OPEN_SIDE, shape[2] or OPEN_SIDE), head.notes) or ""
        path = _LAYOUTS / f"{layout.removesuffix(_RAW)}{_SUFFIX}"
        return path if path.is_file() else None
    return None


def declared_of(detectors: Mapping[str, str], say: Callable[[str], object] = lambda _: None) -> list[str]:
    """Return the same of detectors whose boxes come from elsewhere, from a file or a pipe.

    Args:
        detectors: by sensor (`rgb`, `evt` or `fused`) what makes its boxes, `motion` or a network.
        say: called with a line for each file that was found.

    Raises:
        ConfigError: a detector that is not known, or a file that cannot be read or holds something else.
    """
    found: list[str] = []
    said: dict[str, float] = {}
    for sensor, detector in detectors.items():
        if detector == MOTION:
            continue
        network = network_file(detector, _KINDS[sensor])
        beside = network.with_name(network.name.removesuffix(network.suffix) + _SUFFIX)
        path = beside if beside.is_file() else _of_layout(network, sensor)
        if path is None:
            continue
        tree = read_tree(str(path), (), str, "file of what a network's boxes are like")
        try:
            declared = build(_Declared, tree, "")
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}") from None
        assert isinstance(declared, _Declared)
        facts, sections = tree.get("sensor", {}), tuple(_CHOSEN)
        if declared.beside and declared.beside not in detectors:
            facts = {key: value for key, value in facts.items() if key in _ALWAYS}
            if not facts:
                continue
            sections = _ALONE
        for other, more in tree.get("together", {}).items():
            facts = {**facts, **more} if other in detectors else facts
        for section in sections:
            for key, value in asdict(getattr(declared, section)).items():
                name = f"{section}.{key}"
                said[name] = _CHOSEN[section](said.get(name, value), value)
        if sensor == FUSED_SENSOR:
            # The preset has no such sensor that could be changed key by key; it says what any other is like.
            any_other = load_config("default").input.of_any_sensor()
            found.append(f"sensors.{sensor}={json.dumps({**any_other, **facts})}")
        else:
            found += [f"sensors.{sensor}.{key}={json.dumps(value)}" for key, value in facts.items()]
        say(f"sensor {sensor!r}: its boxes are taken for what {path.name} says (any other --config: not)")
    silent = asdict(_Declared())
    for name, value in said.items():
        section, key = name.split(".")
        if value != silent[section][key]:
            found.append(f"{name}={value}")
            if section == "smoother":
                say(
                    f"the smoothed table has no rows where nobody sees a vehicle for more than {value:g} s "
                    f"(--set {name}=0: it has)"
                )
    return found
