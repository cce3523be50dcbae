"""The file of a service that follows vehicles along a corridor: several cameras, each with its road."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.config.fields import Section, choice, number
from jeat_graph.config.section_tree import build, check_keys, merge
from jeat_graph.config.yaml_lines import lines_of, with_line
from jeat_graph.corridor.corridor_file import read_learnt_gaps
from jeat_graph.corridor.handover import KnownGap, chain
from jeat_graph.corridor.learnt_gap import LearntGap
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.secrets import shown_url
from jeat_graph.live.service.config import (
    STDOUT,
    ServiceConfig,
    SinkConfig,
    StateConfig,
    WebConfig,
    built,
    check_broker,
    check_service,
    read_service_tree,
    resolved,
    warnings_of,
)
from jeat_graph.road.camera_file import read_camera
from jeat_graph.road.crossings import road_line
from jeat_graph.road.inputs import read_marks
from jeat_graph.road.lanes import given_lanes, no_lanes
from jeat_graph.road.line_watch import LineWatch, chosen_line

_NAME = "{camera}"
_KEYS = ("name", "corridor", "cameras", "each", "state", "web")
_OF_CAMERA = ("tracker", "sources", "sinks", "road", "silent_s", "on_error")
#: Standard deviation of the offset of two clocks that are one (s).
_COMMON_CLOCK_S = 0.02


@dataclass(frozen=True)
class LineConfig(Section):
    """Where vehicles of a camera pass: its calibration, and the line across the road."""

    camera: str = ""
    lines: str = ""
    line: str | None = None
    direction: str = choice("", ("left", "right"), "to which side the traffic crosses the line")


@dataclass(frozen=True)
class FollowConfig(Section):
    """How vehicles are followed from camera to camera."""

    learnt: str = ""
    clocks: str = choice("learnt", ("learnt", "common"), "offsets of the clocks: those learnt, or none")
    interval_s: float = number(300.0, "s", "length of the intervals of travel times", open_low=True)


@dataclass(frozen=True)
class FolderConfig(Section):
    """What is kept on the disk: a checkpoint of each camera, and one of who is on the way."""

    folder: str | None = None
    every_s: float = number(10.0, "s", "time between checkpoints", open_low=True)
    of_another_version: str = choice("refuse", ("refuse", "set-aside"), "as of a service of one camera")


@dataclass(frozen=True)
class CorridorConfig:
    """All that such a service does.

    Attributes:
        name: of the service.
        cameras: by name the service of each, without web.
        roads: by name where its vehicles pass.
        follow: how they are followed.
        sinks: where what is found of the corridor goes.
        state: what is kept.
        web: where `/health` and `/metrics` are served.
    """

    name: str
    cameras: Mapping[str, ServiceConfig]
    roads: Mapping[str, LineConfig]
    follow: FollowConfig
    sinks: tuple[SinkConfig, ...] = ()
    state: FolderConfig = field(default_factory=FolderConfig)
    web: WebConfig = field(default_factory=WebConfig)

    @property
    def checkpoint(self) -> Path | None:
        """The file of who is on the way, or None."""
        return None if self.state.folder is None else Path(self.state.folder) / "corridor.json"

    def gaps(self) -> list[LearntGap]:
        """Read the gaps, in the order in which traffic passes them.

        Raises:
            DataError: of the file; its cameras are not these.
        """
        path = self.follow.learnt
        gaps = read_learnt_gaps(path)
        try:
            order = chain([KnownGap(gap.first, gap.second) for gap in gaps], list(self.cameras))
        except DataError as error:
            raise DataError(f"its cameras are not those of the service: {error}", path) from None
        gaps = sorted(gaps, key=lambda gap: order.index(gap.first))
        if self.follow.clocks == "learnt":
            return gaps
        return [
            replace(gap, parameters=replace(gap.parameters, offset_s=0.0), offset_variance=_COMMON_CLOCK_S**2)
            for gap in gaps
        ]

    def check_lanes(self, gaps: Sequence[LearntGap]) -> None:
        """See that the lanes of each camera, where it has some, are those that were learnt.

        Raises:
            ConfigError: none of them is.
            DataError: a file of lines is not valid.
        """
        for gap in gaps:
            for name, known in zip((gap.first, gap.second), gap.lanes, strict=True):
                own = read_marks(self.roads[name].lines).lanes
                if known and own and not set(known) & set(own):
                    raise ConfigError(
                        f"cameras.{name}.road.lines: has the lanes {', '.join(own)}, and those learnt of "
                        f"{gap.first}-{gap.second} are {', '.join(known)}: give them the same names"
                    )

    def watch(self, name: str) -> LineWatch:
        """Return what watches the line of a camera.

        Raises:
            ConfigError, DataError: its camera or its lines are not valid.
        """
        road = self.roads[name]
        camera, marks = read_camera(road.camera), read_marks(road.lines)
        try:
            line = chosen_line(marks.lines, road.line)
        except ValueError as error:
            raise ConfigError(f"cameras.{name}.road.line: {road.lines}: {error}") from None
        ends = road_line(camera, marks.lines[line], 0.0)
        if ends is None or not np.ptp(ends, axis=0).any():
            raise ConfigError(f"cameras.{name}.road.line: {line!r} is not on the road that the camera sees")
        lanes = given_lanes(marks.lanes) if marks.lanes else no_lanes()
        return LineWatch(camera, ends, road.direction, lanes)


def read_corridor_service(path: str | Path) -> tuple[CorridorConfig, list[str]] | None:
    """Read the file of a service with several cameras; None if it has none, and is one of one rig.

    Returns:
        It, its paths absolute, and lines that warn of what may not be as it was meant.

    Raises:
        ConfigError: what is wrong, with the line.
    """
    text, tree = read_service_tree(path)
    if "cameras" not in tree and "corridor" not in tree:
        return None
    try:
        made = _made(tree, Path(path).resolve().parent)
    except ConfigError as error:
        raise with_line(error, str(path), lines_of(text)) from None
    found = [*made.cameras.values(), ServiceConfig(sinks=made.sinks)]
    return made, [*(line for one in found for line in warnings_of(one, Path(path))), *_not_described(made)]


def _not_described(config: CorridorConfig) -> list[str]:
    """Return which cameras describe nothing of what was learnt to be compared."""
    try:
        compared = {name for gap in config.gaps() if gap.numbers for name in (gap.first, gap.second)}
    except DataError:
        return []  # told of when all is checked
    return [
        f"cameras.{name}.sources[{k}]: names no embedder, and {config.follow.learnt} was learnt with one: "
        "what its vehicles look like is not compared"
        for name, one in config.cameras.items()
        for k, source in enumerate(one.sources)
        if name in compared and source.frames is not None and source.embedder is None
    ]


def _made(tree: Mapping[str, Any], folder: Path) -> CorridorConfig:
    check_keys(tree, _KEYS, "")
    follow = _mapping(tree, "corridor")
    sinks = follow.pop("sinks", None) or []
    name = str(tree.get("name", "jeat-graph"))
    state: FolderConfig = build(FolderConfig, _mapping(tree, "state"), "state.")
    if state.folder is not None:
        state = replace(state, folder=str(folder / state.folder))
    common, given = _mapping(tree, "each"), _mapping(tree, "cameras")
    check_keys(common, _OF_CAMERA, "each.")
    if len(given) < 2:
        raise ConfigError("cameras: a corridor has two or more, each with a name")
    cameras, roads = {}, {}
    for key in given:
        camera, own = str(key), _mapping(given, key, "cameras.")
        try:
            if camera == "corridor" or "/" in camera or camera.startswith("."):
                raise ConfigError("a camera cannot have this name")
            check_keys(own, _OF_CAMERA, "")
            whole = _named(merge(common, own), camera)
            roads[camera] = _road(whole.pop("road", None), folder)
            cameras[camera] = _camera(whole, camera, state, folder)
        except ConfigError as error:
            raise ConfigError(f"cameras.{camera}.{error}") from None
    found: FollowConfig = build(FollowConfig, follow, "corridor.")
    if not found.learnt:
        raise ConfigError("corridor.learnt: give the corridor.yaml that `jeat-graph handover` wrote")
    shell = resolved(built({"sinks": sinks}), folder)
    if sum(sink.url == STDOUT for sink in shell.sinks) > 1:
        raise ConfigError("corridor.sinks: standard output is named twice")
    _check_apart(cameras, shell.sinks)
    web: WebConfig = build(WebConfig, _mapping(tree, "web"), "web.")
    found = replace(found, learnt=str(folder / found.learnt))
    return CorridorConfig(name, cameras, roads, found, shell.sinks, state, web)


def _check_apart(cameras: Mapping[str, ServiceConfig], sinks: Sequence[SinkConfig]) -> None:
    """See that no camera takes what is another's: its scans, its tracks, or what is found of the corridor.

    Raises:
        ConfigError: one does.
    """
    owner: dict[str, str] = {}
    ends = [(f"cameras.{name}.sinks", one.sinks) for name, one in cameras.items()]
    for name, one in cameras.items():
        for k, source in enumerate(one.sources):
            where, (_, address) = f"cameras.{name}.sources[{k}]", source.given
            if address in owner:
                raise ConfigError(
                    f"{where}: {shown_url(address)} is that of camera {owner[address]}, too; give each "
                    f"its own ({_NAME} stands for the name)"
                )
            owner[address] = name
            for key, own in [*ends, ("corridor.sinks", sinks)]:
                for j, sink in enumerate(own):
                    check_broker(f"{where}.url, {key}[{j}]", source, sink)


def _mapping(tree: Mapping[str, Any], key: Any, where: str = "") -> dict[str, Any]:
    value = tree.get(key)
    if value is not None and not isinstance(value, Mapping):
        raise ConfigError(f"{where}{key}: must hold `key: value` lines")
    return dict(value or {})


def _named(value: Any, name: str) -> Any:
    """Put the camera's name in the place of `{camera}`, in all texts."""
    if isinstance(value, str):
        return value.replace(_NAME, name)
    if isinstance(value, Mapping):
        return {key: _named(one, name) for key, one in value.items()}
    return [_named(one, name) for one in value] if isinstance(value, list) else value


def _road(tree: Any, folder: Path) -> LineConfig:
    if not isinstance(tree, Mapping) or "direction" not in tree:
        raise ConfigError("road: give camera, lines and direction: where vehicles pass the camera")
    made: LineConfig = build(LineConfig, tree, "road.")
    for key in ("camera", "lines"):
        if not getattr(made, key):
            raise ConfigError(f"road.{key}: names no file")
    return replace(made, camera=str(folder / made.camera), lines=str(folder / made.lines))


def _camera(tree: Mapping[str, Any], name: str, state: FolderConfig, folder: Path) -> ServiceConfig:
    made = resolved(built({**tree, "name": name}), folder)
    check_service(made, needs_sinks=False)
    if any(sink.url == STDOUT for sink in made.sinks):
        raise ConfigError("sinks: standard output is for what is found of the corridor (corridor.sinks)")
    path = None if state.folder is None else str(Path(state.folder) / f"{name}.npz")
    own = StateConfig(path, state.every_s, of_another_version=state.of_another_version)
    return replace(made, state=own, web=WebConfig(port=0))
