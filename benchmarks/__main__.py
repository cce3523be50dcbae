"""`python -m benchmarks`: the tables of the documentation, one kind each."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from jeat_graph.api.beside import HOW_TO_GET
from jeat_graph.cli.ending import end_with
from jeat_graph.cli.main import carry_out
from jeat_graph.cli.options import Parser
from jeat_graph.cli.terminal import say
from jeat_graph.data.errors import ConfigError

WRITES = ("checkpoint",)
HELP = "Judge trackers on published data sets, and measure speed, detection, the road and more."
_TABLES = "benchmarks.tables"
#: By kind: the module that does it, and what it is.
KINDS = {
    "mot": (
        _TABLES,
        "trackers on folders in MOTChallenge's layout (MOT15 to MOT20, DanceTrack, SportsMOT, FEMOT) or ours",
    ),
    "kitti": (_TABLES, "trackers on KITTI tracking"),
    "mevdt": (_TABLES, "trackers on MEVDT: vehicles seen by a DAVIS camera"),
    "etram": (_TABLES, "trackers on eTraM: traffic seen by an event camera"),
    "dsec-det": (_TABLES, "trackers on DSEC-Det: events and frames of a driving car"),
    "dsec-mot": (_TABLES, "trackers on DSEC-MOT: events of a driving car"),
    "tumtraf": (_TABLES, "trackers on TUMTraf: cameras over a road, boxes in OpenLABEL"),
    "real": (_TABLES, "trackers on all recordings of a folder"),
    "unions": ("benchmarks.unions", "drawn detectors joined, against the best of them alone"),
    "simulated": (
        "benchmarks.simulated",
        "trackers on simulated highways, streets, squares, and with odd detectors",
    ),
    "ablation": ("benchmarks.ablation", "what each term of the model gains, over all sets"),
    "constants": (
        "benchmarks.constants",
        "which constants of the model matter, and what they reach on a set that they were chosen without",
    ),
    "detection": ("benchmarks.detection", "how well detectors find vehicles in raw pictures and raw events"),
    "raw": ("benchmarks.raw", "from raw pictures and raw events to tracks"),
    "road": ("benchmarks.road", "place and speed on simulated roads"),
    "road-real": ("benchmarks.road_real", "speeds on real highways against laser gates"),
    "handover": (
        "benchmarks.handover",
        "vehicles followed from camera to camera, on simulated roads and real highways",
    ),
    "corridor": (
        "benchmarks.corridor",
        "memory and processor time of many cameras in one service, in real time",
    ),
    "speed": ("benchmarks.speed", "time per step, against others"),
    "endurance": (
        "benchmarks.endurance",
        "a day of input through the live path: memory, latency and counts by hour",
    ),
    "worlds": (
        "benchmarks.worlds",
        "what networks that were trained on varied or on one fixed world find in others",
    ),
    "rigs": (
        "benchmarks.rigs",
        "pictures and clocks of two cameras brought together by the traffic they saw",
    ),
    "clocks": ("benchmarks.clocks", "live streams in which the clock of one sensor steps or drifts"),
    "joint": (
        "benchmarks.joint",
        "two sensors at one time, associated scan by scan or in one joint problem",
    ),
    "stale": ("benchmarks.stale", "which tables were made by code that has changed since"),
    "events": ("benchmarks.events", "decoding and representations of events beside other packages"),
    "decoders": ("benchmarks.decoders", "decoding sparse and dense files of events beside other packages"),
    "event-cameras": (
        "benchmarks.event_cameras",
        "noise of simulated event cameras, and the events of vehicles",
    ),
}


class _LateParser(Parser):
    """Imports its benchmark only when it is asked for: the others' libraries need not be there."""

    module_name: str | None = None

    def parse_known_args(self, *args: Any, **kwargs: Any) -> Any:
        """Add the arguments, then parse."""
        if self.module_name is not None:
            name, self.module_name = self.module_name, None
            import_module(name).add_arguments(self)
        return super().parse_known_args(*args, **kwargs)


#: Options that say where a result is read or written, and not what it is.
_PLACES = ("--out", "--readme", "--page", "--from", "--keep", "--jobs", "--cache")


def build_parser(words: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Build the parser of all benchmarks; `words` are the command line that results will name."""
    parser = Parser(prog="python -m benchmarks", description=HELP)
    kinds = parser.add_subparsers(
        dest="kind", metavar="|".join(KINDS), required=True, parser_class=_LateParser
    )
    for name, (module, text) in KINDS.items():
        sub = kinds.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        sub.module_name = module
    parser.set_defaults(command="benchmarks", run=run, words=_command(words))
    return parser


def _command(words: Sequence[str]) -> str:
    """Return a command line without what says where its result is written."""
    kept: list[str] = []
    passed = False
    for word in words:
        if not passed and word.partition("=")[0] not in _PLACES:
            kept.append(word)
        passed = word in _PLACES
    return shlex.join(["python", "-m", "benchmarks", *kept])


def run(args: argparse.Namespace) -> int:
    """Run the benchmark that was asked for."""
    if getattr(args, "quick", False) and getattr(args, "readme", None):
        raise ConfigError("--quick is to see that it runs: leave out --readme, which holds full ones")
    module = import_module(KINDS[args.kind][0])
    return int(module.run(args) or 0)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one benchmark; exit codes are those of `jeat-graph`."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        return carry_out("benchmarks", lambda: build_parser(arguments).parse_args(arguments))
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "jeat_graph_sehn":
            raise
        say("benchmarks", f"this one simulates: the simulator {HOW_TO_GET}")
        return 2


if __name__ == "__main__":
    end_with(main)
