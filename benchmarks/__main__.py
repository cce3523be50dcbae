"""`python -m benchmarks`: reproduce the tables of accuracy, smoothing, real detectors, speed and more."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from jeat_graph.api.beside import HOW_TO_GET
from jeat_graph.cli.main import carry_out
from jeat_graph.cli.options import Parser
from jeat_graph.cli.terminal import say
from jeat_graph.data.errors import ConfigError

WRITES = ("checkpoint",)
HELP = "Reproduce the tables: accuracy, ablation, smoothing, real, detection, raw, speed or events."
_KINDS = {
    "accuracy": "our tracker and others' on simulated and real data",
    "ablation": "from the paper's tracker to the default, one change a row",
    "smoothing": "what smoothing gains over the causal estimates",
    "real": "real detectors that nothing was made for, and simulated odd ones",
    "detection": "how well detectors find vehicles in raw pictures and raw events",
    "raw": "from raw pictures and raw events to tracks",
    "road": "place and speed on the road, simulated and against laser gates, and whether intervals hold",
    "speed": "time per step, against others",
    "endurance": "a day of input through the live path: memory, latency and counts, hour by hour",
    "worlds": "what nets that were trained on varied or on one fixed world find in worlds they never saw",
    "rigs": "pictures and clocks of two cameras brought together by the traffic they saw",
    "events": "noise of the event cameras, what tames it, and what vehicles give",
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


def build_parser() -> argparse.ArgumentParser:
    """Build the parser of all benchmarks."""
    parser = Parser(prog="python -m benchmarks", description=HELP)
    kinds = parser.add_subparsers(
        dest="kind", metavar="|".join(_KINDS), required=True, parser_class=_LateParser
    )
    for name, text in _KINDS.items():
        sub = kinds.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        sub.module_name = f"benchmarks.{name}"
    parser.set_defaults(command="benchmarks", run=run)
    return parser


def run(args: argparse.Namespace) -> int:
    """Run the benchmark that was asked for."""
    if getattr(args, "quick", False) and getattr(args, "readme", None):
        raise ConfigError("--quick is to see that it runs: leave out --readme, which holds full ones")
    module = import_module(f"benchmarks.{args.kind}")
    return int(module.run(args) or 0)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one benchmark; exit codes are those of `jeat-graph`."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        return carry_out("benchmarks", lambda: build_parser().parse_args(arguments))
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "jeat_graph_sehn":
            raise
        say("benchmarks", f"this one simulates: the simulator {HOW_TO_GET}")
        return 2


if __name__ == "__main__":
    sys.exit(main())
