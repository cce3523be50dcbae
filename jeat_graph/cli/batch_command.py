"""`jeat-graph batch`: a table of recordings in, a run directory for each and one table of all out."""

from __future__ import annotations

import argparse
import sys

from jeat_graph.cli.options import add_config, add_formats, add_image, add_smoother, extra_formats, overrides
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import counting, natural

HELP = "track many recordings in parallel, each once; failures are collected in a table"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add(
        "manifest",
        metavar="MANIFEST",
        help="CSV or Parquet with one recording per row: detections (files joined by ;), or frames, events "
        "or both to detect in; optional: name, config, set (settings joined by ;), gt, rate, camera, "
        "detector_frames, detector_events, class, mask; paths are relative to the manifest's folder",
    )
    add(
        "--out",
        required=True,
        metavar="DIR",
        help="folder for runs/NAME, recordings.csv and, with ground truth, scores.json; repeat to resume",
    )
    add("--engine", choices=("local", "ray"), default="local", help="where to run (default: local)")
    add("--workers", type=counting, metavar="N", help="recordings in parallel (default: one per core)")
    add(
        "--retries",
        type=natural,
        default=1,
        metavar="N",
        help="further attempts if a worker dies (default: 1)",
    )
    add("--address", metavar="ADDRESS", help="ray: a running cluster, for example auto (default: a new one)")
    add_config(parser)
    add_image(parser)
    add_smoother(parser)
    add_formats(parser)


def run(args: argparse.Namespace) -> int:
    """Work on all recordings; 1 if any of them failed."""
    from jeat_graph.eval.judge import summary_table
    from jeat_graph.live.batch import TABLE, BatchOptions, run_batch
    from jeat_graph.live.manifest import read_manifest
    from jeat_graph.runs.run_options import RunOptions

    recordings = read_manifest(args.manifest)
    options = BatchOptions(
        config=args.config,
        overrides=tuple(overrides(args)),
        options=RunOptions(
            formats=extra_formats(args),
            diagnostics=args.diagnostics,
        ),
        engine=args.engine,
        workers=args.workers,
        retries=args.retries,
        address=args.address,
        progress=sys.stderr.isatty(),
    )
    result = run_batch(recordings, args.out, options)
    if result.judged:
        sys.stdout.write(summary_table(result.judged).render())
    counts = {status: sum(one.status == status for one in result.outcomes) for status in ("done", "kept")}
    print(
        f"{len(result.outcomes)} recordings: {counts['done']} tracked, {counts['kept']} kept, "
        f"{len(result.failed)} failed"
    )
    print(f"wrote {args.out}: see {TABLE}")
    for one in result.failed:
        say("batch", f"{one.name}: {one.error}")
    return 1 if result.failed else 0
