"""The file that says what a service does: read, checked, its paths as seen from its folder."""

from __future__ import annotations

import stat
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import yaml

from jeat_graph.config.fields import Section, choice, flag, number
from jeat_graph.config.section_tree import build
from jeat_graph.config.yaml_lines import lines_of, with_line
from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.secrets import shown_url
from jeat_graph.io.files.addresses import events_address, frames_address, is_live
from jeat_graph.io.files.credentials import PASSWORD_FILE
from jeat_graph.live.transport.ends import check_addresses

STDOUT = "-"
#: Longest file (bytes).
_MOST_BYTES = 1 << 20


@dataclass(frozen=True)
class TlsConfig(Section):
    """How a broker is reached; its address ends in `+tls`."""

    ca: str | None = None
    cert: str | None = None
    key: str | None = None
    insecure: bool = flag(False, "look at no certificate; said loudly")


@dataclass(frozen=True)
class SourceConfig(Section):
    """Where scans come from: one of a broker (`url`), a camera of pictures, or one of events."""

    url: str | None = None
    frames: str | None = None
    events: str | None = None
    password_file: str | None = None
    tls: TlsConfig | None = None
    detector: str | None = None
    sensor: str | None = None
    classes: tuple[str, ...] = ()
    masks: tuple[str, ...] = ()
    set: tuple[str, ...] = ()
    embedder: str | None = None

    @property
    def given(self) -> tuple[str, str]:
        """Which of the three it is, and its address."""
        return next((name, text) for name in _KINDS if (text := getattr(self, name)) is not None)


@dataclass(frozen=True)
class SinkConfig(Section):
    """Where tracks go: a broker, or `-` for standard output."""

    url: str = STDOUT
    encoding: str = choice("json", ("json", "msgpack"), "of messages to a broker")
    password_file: str | None = None
    tls: TlsConfig | None = None


@dataclass(frozen=True)
class TrackedBy(Section):
    """How is tracked: as `--config`, `--set`, `--image`, `--rig` and `--late` of `stream` say it."""

    config: str = "default"
    set: tuple[str, ...] = ()
    image: tuple[int, int] | None = None
    rig: str | None = None
    late: str = choice("rewind", ("rewind", "skip"), "what becomes of scans that come late")


@dataclass(frozen=True)
class StateConfig(Section):
    """What is kept on the disk."""

    checkpoint: str | None = None
    every_s: float = number(10.0, "s", "time between checkpoints", open_low=True)
    smoothed: str | None = None
    of_another_version: str = choice(
        "refuse",
        ("refuse", "set-aside"),
        "a checkpoint of another version or of other settings: the end, or renamed",
    )


@dataclass(frozen=True)
class WebConfig(Section):
    """Where `/health` and `/metrics` are served."""

    host: str = "127.0.0.1"
    port: int = number(9464, "1", "0 serves nothing", 0, 65535)


@dataclass(frozen=True)
class ServiceConfig(Section):
    """All that a service does."""

    name: str = "jeat-graph"
    tracker: TrackedBy = field(default_factory=TrackedBy)
    state: StateConfig = field(default_factory=StateConfig)
    web: WebConfig = field(default_factory=WebConfig)
    silent_s: float = number(
        10.0, "s", "a sensor without a scan for so long makes it not ready", open_low=True
    )
    on_error: str = choice("skip", ("skip", "stop"), "a message that cannot be read")
    sources: tuple[SourceConfig, ...] = ()
    sinks: tuple[SinkConfig, ...] = ()


_KINDS = ("url", "frames", "events")


def read_service(path: str | Path) -> tuple[ServiceConfig, list[str]]:
    """Read and check the file of a service.

    Returns:
        It, its paths absolute and its passwords where they were: in the environment or in files; and lines
        that warn of what may not be as it was meant.

    Raises:
        ConfigError: what is wrong, with the line.
    """
    source = Path(path)
    text, tree = read_service_tree(path)
    try:
        made = resolved(built(tree), source.resolve().parent)
        check_service(made)
    except ConfigError as error:
        raise with_line(error, str(path), lines_of(text)) from None
    return made, warnings_of(made, source)


def read_service_tree(path: str | Path) -> tuple[str, dict[str, Any]]:
    """Return the text of a service's file, and its tree of keys.

    Raises:
        ConfigError: it cannot be read, or is no such tree.
    """
    source = Path(path)
    try:
        if source.stat().st_size > _MOST_BYTES:
            raise ConfigError(f"{path}: is larger than any such file")
        text = source.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "is no text"
        raise ConfigError(f"{path}: {why}") from None
    try:
        tree = load_yaml(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{path}:{mark.line + 1}" if mark is not None else str(path)
        raise ConfigError(f"{place}: not valid YAML: {getattr(error, 'problem', None) or error}") from None
    if not isinstance(tree, dict):
        raise ConfigError(f"{path}: must hold `key: value` lines")
    return text, tree


def built(tree: Mapping[str, Any]) -> ServiceConfig:
    """Make it of the tree; lists of sections are made one by one, for their numbers to be in messages."""
    lists = {"sources": SourceConfig, "sinks": SinkConfig}
    made: ServiceConfig = build(ServiceConfig, {k: v for k, v in tree.items() if k not in lists}, "")
    found: dict[str, Any] = {}
    for name, kind in lists.items():
        entries = tree.get(name) or []
        if not isinstance(entries, list):
            raise ConfigError(f"{name}: must be a list")
        found[name] = tuple(build(kind, entry, f"{name}[{k}].") for k, entry in enumerate(entries))
    return replace(made, **found)


def resolved(config: ServiceConfig, folder: Path) -> ServiceConfig:
    """Take paths as seen from the folder of the file."""

    def at(path: str | None) -> str | None:
        return None if path is None else str(folder / path)

    def tls(given: TlsConfig | None) -> TlsConfig | None:
        if given is None:
            return None
        return replace(given, ca=at(given.ca), cert=at(given.cert), key=at(given.key))

    def file_if_there(name: str) -> str:
        return str(folder / name) if (folder / name).is_file() else name

    tracker, state = config.tracker, config.state
    return replace(
        config,
        tracker=replace(tracker, config=file_if_there(tracker.config), rig=at(tracker.rig)),
        state=replace(state, checkpoint=at(state.checkpoint), smoothed=at(state.smoothed)),
        sources=tuple(
            replace(
                one,
                password_file=at(one.password_file),
                tls=tls(one.tls),
                detector=None if one.detector is None else file_if_there(one.detector),
                embedder=None if one.embedder is None else file_if_there(one.embedder),
                masks=tuple(file_if_there(mask) for mask in one.masks),
            )
            for one in config.sources
        ),
        sinks=tuple(
            replace(one, password_file=at(one.password_file), tls=tls(one.tls)) for one in config.sinks
        ),
    )


def check_service(config: ServiceConfig, *, needs_sinks: bool = True) -> None:
    """See that sources and sinks go together.

    Raises:
        ConfigError: what is wrong, with its key.
    """
    if not config.sources:
        raise ConfigError("sources: names none; give the url of a broker, frames or events")
    if needs_sinks and not config.sinks:
        raise ConfigError("sinks: names none; give the url of a broker, or '-' for standard output")
    if sum(sink.url == STDOUT for sink in config.sinks) > 1:
        raise ConfigError("sinks: standard output is named twice")
    sensors: set[str] = set()
    for k, source in enumerate(config.sources):
        where = f"sources[{k}]"
        _check_source(source, where)
        name = sensor_of(source)
        if name is not None and name in sensors:
            raise ConfigError(f"{where}.sensor: {name!r} is another camera's, too; give each its own")
        sensors |= {name} if name is not None else set()
    for k, sink in enumerate(config.sinks):
        check_broker(f"sinks[{k}].url", None, sink)
        for j, source in enumerate(config.sources):
            check_broker(f"sources[{j}].url", source, sink)


def sensor_of(source: SourceConfig) -> str | None:
    """Return the name of a camera's sensor; None for a broker, whose messages name theirs."""
    if source.url is not None:
        return None
    return source.sensor or ("rgb" if source.frames is not None else "evt")


def _check_source(source: SourceConfig, where: str) -> None:
    given = [name for name in _KINDS if getattr(source, name) is not None]
    if len(given) != 1:
        raise ConfigError(
            f"{where}: names {' and '.join(given) or 'nothing'}; give one of {', '.join(_KINDS)}"
        )
    kind = given[0]
    for name in ("detector", "sensor", "classes", "masks", "set", "embedder") if kind == "url" else ("tls",):
        if getattr(source, name):
            raise ConfigError(
                f"{where}.{name}: says nothing of {'a broker' if kind == 'url' else 'a camera'}"
            )
    if kind == "events" and source.embedder:
        raise ConfigError(f"{where}.embedder: describes boxes in pictures; a camera of events has none")
    try:
        if kind == "url":
            return
        if not is_live(getattr(source, kind)):
            raise ConfigError("is no camera that is on; recordings are for `track` and `batch`")
        if kind == "frames":
            frames_address(full_url(source.frames or "", source.password_file, None))
        else:
            events_address(source.events or "")
    except ConfigError as error:
        raise ConfigError(f"{where}.{kind}: {error}") from None


def check_broker(where: str, source: SourceConfig | None, sink: SinkConfig) -> None:
    """Refuse addresses that are none, or that are in each other's way."""
    one = to = None
    if source is not None and source.url is not None:
        one = full_url(source.url, source.password_file, source.tls)
    if sink.url != STDOUT:
        to = full_url(sink.url, sink.password_file, sink.tls)
    try:
        check_addresses(one, to)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None


def full_url(url: str, password_file: str | None, tls: TlsConfig | None) -> str:
    """Return an address with what stands beside it in the file as its options."""
    options = {PASSWORD_FILE: password_file}
    if tls is not None:
        options |= {"ca": tls.ca, "cert": tls.cert, "key": tls.key}
        options["insecure"] = "yes" if tls.insecure else None
    given = [f"{name}={quote(value, safe='/')}" for name, value in options.items() if value is not None]
    if not given:
        return url
    return f"{url}{'&' if '?' in url else '?'}{'&'.join(given)}"


def warnings_of(config: ServiceConfig, path: Path) -> list[str]:
    """Return what may not be as it was meant: a password in a file that others may read."""
    urls = [source.given[1] for source in config.sources] + [sink.url for sink in config.sinks]
    open_to_others = path.stat().st_mode & stat.S_IROTH
    return [
        f"{path}: anybody may read this file, and {shown_url(url)} has a password in it; chmod o-r, or take "
        "password_file or ${NAME}"
        for url in urls
        if open_to_others and _password_in(url)
    ]


def _password_in(url: str) -> bool:
    login = url.partition("://")[2].rpartition("@")[0]
    password = login.partition(":")[2]
    return bool(password) and not password.startswith("${")
