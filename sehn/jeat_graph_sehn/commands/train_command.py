"""`jeat-graph train`: data sets in, a network that finds vehicles out."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.cli.options import add_settings
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import counting, natural, picture_size, positive
from jeat_graph.data.errors import ConfigError

if TYPE_CHECKING:
    from jeat_graph_sehn.training.procedure import TrainRequest

WRITES = ("out",)
HELP = "train a network that finds vehicles in pictures, in events or in both, and write it as ONNX"
_KINDS = ("frames", "events", "fused")
_NETS = ("tiny", "small", "medium", "large")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add("kind", choices=_KINDS, help="input of the network (fused: both); networks of events have a memory")
    add(
        "data",
        nargs="+",
        metavar="DATA",
        help="folders that `simulate --sensors pictures` wrote; for frames also COCO (FILE.json); for events "
        "also recordings with boxes beside them, as of Gen1, 1 Megapixel, eTraM (--set labels.classes=1mpx)",
    )
    add(
        "--out",
        required=True,
        metavar="FILE.onnx",
        help="the network; log (.csv), plot (.png) and checkpoint are written beside it",
    )
    add(
        "--test",
        nargs="+",
        default=[],
        metavar="DATA",
        help="data sets to test the finished network on, each separately",
    )
    add(
        "--pictures",
        metavar="DIR",
        help="folder of the pictures that COCO files name (default: beside the files)",
    )
    add(
        "--net",
        choices=_NETS,
        default="medium",
        help="size: about 0.04, 0.15, 0.6 (default) or 1.3 million parameters; of both sensors twice as many",
    )
    add(
        "--size",
        type=picture_size,
        metavar="WxH",
        help="input of the network (default: the first picture's, rounded up to 16 px)",
    )
    add(
        "--crop",
        type=picture_size,
        metavar="WxH",
        help="size of the cut-outs to learn from (default 320x192)",
    )
    add(
        "--start",
        nargs="+",
        default=[],
        metavar="NAME|FILE",
        help="networks of `train` that give the initial weights: of the same kind, and as wide or "
        "narrower by a whole factor; for fused one of frames and one of events; a NAME comes "
        "with the package",
    )
    add(
        "--int8",
        metavar="NAME|FILE",
        help="instead of training, quantise this network of `train` to 8-bit numbers, calibrated on "
        "DATA: half of the time with ONNX Runtime; --size gives it another input",
    )
    add("--batch", type=counting, metavar="N", help="cut-outs, or sequences of events, per step (default 8)")
    length = parser.add_mutually_exclusive_group()
    length.add_argument(
        "--epochs", type=positive, metavar="N", help="how often all data are seen (default 30)"
    )
    length.add_argument(
        "--minutes",
        type=positive,
        metavar="M",
        help="train for this time in minutes instead; the result is not reproducible",
    )
    add("--force", action="store_true", help="write the network even if it learned nothing (AP50 0)")
    add("--seed", type=natural, default=0, metavar="N", help="seed (default 0)")
    add(
        "--device",
        choices=("auto", "cpu", "cuda"),
        default="auto",
        help="auto (default): a GPU if there is one",
    )
    add("--threads", type=counting, metavar="N", help="threads of PyTorch (default: its own choice)")
    add_settings(parser, "learning_rate=0.001 or events.drop_share=0.3")


def run(args: argparse.Namespace) -> int:
    """Train, and write network, log and plot; 1 where nothing was learned."""
    try:
        import torch
    except ImportError:
        raise ConfigError("training needs PyTorch: pip install './sehn[train]' in a checkout") from None
    from tqdm import tqdm

    from jeat_graph.io.files.atomic import check_writable
    from jeat_graph_sehn.training.procedure import train

    request = _request(args)
    check_writable(request.out)
    if args.int8:
        from jeat_graph_sehn.training.procedure import bring_to_int8

        looks = bring_to_int8(_start(args.kind, [args.int8])[0], request, partial(say, "train"))
        print(f"wrote {request.out}, by {looks} {'pictures' if args.kind == _KINDS[0] else 'windows'}")
        return 0
    if args.threads:
        torch.set_num_threads(args.threads)

    form = "{desc} {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}] {postfix}"
    hidden = not sys.stderr.isatty()
    with tqdm(total=1.0, desc="train", bar_format=form, disable=hidden, leave=False) as bar:

        def on_progress(share: float, words: str) -> None:
            bar.set_postfix_str(words, refresh=False)
            bar.update(share - bar.n)

        done = train(request, partial(say, "train"), on_progress)
    if not done.files:
        boxes = done.card["judged"]["all"]["boxes"]
        say(
            "train",
            f"learned nothing, AP50 0 by {boxes} boxes; nothing is written: train longer, or begin with a "
            "network (--start); the same command with --force writes it from the checkpoint",
        )
        return 1
    for name in ("judged", "tested"):
        for source, found in done.card.get(name, {}).items():
            if found["boxes"]:
                values = f"AP50 {found['AP50']:.1f}, AP {found['AP']:.1f}, {found['boxes']} boxes"
                print(f"{name}, {source}: {values}")
    print(f"wrote {', '.join(str(path) for path in done.files)}")
    return 0


def _request(args: argparse.Namespace) -> TrainRequest:
    """Return what the arguments ask for.

    Raises:
        ConfigError: settings that are not valid.
    """
    from jeat_graph.config.section_tree import build, tree_of_changes
    from jeat_graph_sehn.training.making import settings_of
    from jeat_graph_sehn.training.procedure import TrainRequest
    from jeat_graph_sehn.training.settings import BY_TIME, WIDTHS, NetSettings, TrainSettings

    out = Path(args.out)
    if out.suffix.lower() != ".onnx":
        raise ConfigError(f"--out: {args.out} must end in .onnx")
    tree = tree_of_changes(args.overrides)
    start = _start(args.kind, args.start)
    net = {"kind": args.kind, "width": WIDTHS[args.net]}
    if isinstance(tree.get("net"), dict):
        net = tree.pop("net") | net
    # Who goes on with a network that remembers by time has no other choice.
    if any(settings_of(path).by_time for path in start):
        net = {"memory": BY_TIME} | net
    given = {
        "crop_px": args.crop and list(args.crop),
        "batch": args.batch,
        "epochs": args.epochs,
        "minutes": args.minutes,
        "seed": args.seed,
    }
    tree |= {key: value for key, value in given.items() if value is not None}
    return TrainRequest(
        data=tuple(Path(path) for path in args.data),
        out=out,
        net=build(NetSettings, net, "net."),
        settings=build(TrainSettings, tree, ""),
        tested=tuple(Path(path) for path in args.test),
        pictures=Path(args.pictures) if args.pictures else None,
        side=args.size,
        device=args.device,
        start=start,
        force=args.force,
    )


def _start(kind: str, names: Sequence[str]) -> tuple[Path, ...]:
    """Return the files whose weights are the first ones; a name means all kinds that are of use."""
    from jeat_graph.detection.named import network_file, networks

    found: list[Path] = []
    for name in names:
        kinds = [one for one in (_KINDS[:2] if kind == _KINDS[2] else (kind,)) if name in networks(one)]
        found += [network_file(name, one) for one in kinds or (kind,)]
    return tuple(found)
