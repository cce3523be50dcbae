"""`jeat-graph serve`: cameras or brokers tracked for months, as one file describes it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jeat_graph.live.service.config import ServiceConfig
    from jeat_graph.live.service.corridor_config import CorridorConfig
    from jeat_graph.live.service.log import Log

HELP = (
    "run a service described by one file: sources, detectors, tracker, sinks, health and metrics, of one rig "
    "or of several cameras along a road"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.description = HELP + (
        ". It says what happens as lines of JSON on stderr, and ends on SIGTERM with all in order. Example: "
        "jeat-graph serve --set-aside-damaged gantry7.yaml"
    )
    parser.add_argument("service", metavar="CONFIG.yaml", help="the file; docs/guides/service.md explains it")
    parser.add_argument(
        "--check",
        action="store_true",
        help="only say whether a start would succeed: build all that it would build (settings, detectors, "
        "keys, folders) and ask nobody",
    )
    parser.add_argument(
        "--connect",
        action="store_true",
        help="with --check: also connect to the brokers and cameras; a service that runs is not disturbed",
    )
    parser.add_argument(
        "--set-aside-damaged",
        action="store_true",
        help="rename a checkpoint that is damaged (FILE.damaged-1, …), warn, and start over, as the unit of "
        "systemd does (default: refuse it, exit code 2)",
    )


def run(args: argparse.Namespace) -> int:
    """Serve until a signal comes."""
    from jeat_graph.data.errors import ConfigError
    from jeat_graph.live.service.config import read_service
    from jeat_graph.live.service.corridor_config import CorridorConfig, read_corridor_service
    from jeat_graph.live.service.corridor_run import CorridorService
    from jeat_graph.live.service.log import WARNING, Log
    from jeat_graph.live.service.run import Service

    config, warnings = read_corridor_service(args.service) or read_service(args.service)
    log = Log(config.name)
    for text in warnings:
        log.write(WARNING, text)
    if args.connect and not args.check:
        raise ConfigError("--connect goes with --check: a start connects anyway")
    if args.check:
        return _check(args, config, log)
    if isinstance(config, CorridorConfig):
        return CorridorService(config, log, sets_aside_damaged=args.set_aside_damaged).run()
    return Service(config, log, sets_aside_damaged=args.set_aside_damaged).run()


def _check(args: argparse.Namespace, config: ServiceConfig | CorridorConfig, log: Log) -> int:
    """Build what a start would build, and connect where that is asked for."""
    from jeat_graph.live.interrupts import Interrupts
    from jeat_graph.live.service.checking import ask_others, check_corridor, check_start
    from jeat_graph.live.service.config import ServiceConfig

    cameras = ""
    with Interrupts() as interrupts, log.of_libraries():
        if isinstance(config, ServiceConfig):
            parts = [config]
            check_start(config, detectors=True)
        else:
            parts = [*config.cameras.values(), ServiceConfig(config.name, sinks=config.sinks)]
            cameras = f"{len(config.cameras)} cameras, "
            check_corridor(config, detectors=True)
        if args.connect:
            for one in parts:
                ask_others(one, log, lambda: interrupts.seen is not None)
    if interrupts.seen is not None:
        return 128 + interrupts.seen
    sources, sinks = sum(len(one.sources) for one in parts), sum(len(one.sinks) for one in parts)
    print(f"{args.service}: valid: {cameras}{sources} sources, {sinks} sinks")
    return 0
