"""`jeat-graph conflicts`: near misses between vehicles on the road, with intervals."""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.cli.count_output import clock_s, with_clock
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import not_negative, positive
from jeat_graph.data.errors import ConfigError

if TYPE_CHECKING:
    from jeat_graph.road.conflicts.encounters import Encounter
    from jeat_graph.road.conflicts.film import FilmFromAbove, FilmInPicture
    from jeat_graph.road.conflicts.poses import Poses

WRITES_INTO = ("out",)
HELP = "find near misses on the road (TTC, DRAC, PET, headways), each with its interval and its doubt"
#: A film shows so much before and after (s).
_AROUND_S = 4.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add("source", metavar="ROAD", help="folder that `road` wrote from boxes, or its road.csv")
    add("--ttc", type=positive, metavar="S", help="time to collision below which it is a conflict (1.5)")
    add("--drac", type=positive, metavar="A", help="deceleration to avoid a crash above which it is (3.35)")
    add(
        "--pet",
        type=positive,
        metavar="S",
        help="post-encroachment time below which it is, where paths cross (1)",
    )
    add(
        "--doubt",
        type=not_negative,
        metavar="P",
        help="list only what is none with this probability at most (0.05)",
    )
    add("--begin", metavar="DATE", help="date and time of the recording's time 0, for a column of dates")
    add("--camera", metavar="CAMERA.yaml", help="draw the heat map in the camera's picture, not from above")
    add("--picture", metavar="FILE.png", help="a picture of the camera to draw it over (needs --camera)")
    add(
        "--films",
        action="store_true",
        help="also draw a film of each conflict: in the camera's picture with --camera, else from above",
    )
    add(
        "--frames",
        metavar="VIDEO|DIR",
        help="write the films from this video (needs --run)",
    )
    add("--run", dest="tracks", metavar="RUN", help="the run whose tracks the films show")
    add("--rate", type=positive, metavar="HZ", help="rate of frames that count only")
    add(
        "--out",
        required=True,
        metavar="DIR",
        help="folder for conflicts.csv, doubtful.csv, conflicts.png and films",
    )


def run(args: argparse.Namespace) -> int:
    """Find the conflicts and write tables, heat map and films."""
    from jeat_graph.io.files.outputs import check_folder
    from jeat_graph.io.tables.table_writer import write_columns
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.conflicts.drawing import draw_heat
    from jeat_graph.road.conflicts.encounters import ConflictConfig, encounters, sure
    from jeat_graph.road.conflicts.film import FilmFromAbove, FilmInPicture
    from jeat_graph.road.conflicts.poses import read_poses
    from jeat_graph.road.conflicts.tables import encounter_columns

    if args.picture is not None and args.camera is None:
        raise ConfigError("--picture says nothing without --camera: where the road is in it")
    if (args.frames is None) != (args.tracks is None):
        raise ConfigError(
            "films from a video need both --frames and --run; --films draws them without a video"
        )
    given = {"ttc_s": args.ttc, "drac": args.drac, "pet_s": args.pet, "most_doubt": args.doubt}
    config = ConflictConfig(**{name: value for name, value in given.items() if value is not None})
    later_s = clock_s(args.begin)
    out = Path(args.out)
    check_folder(out)
    camera = None if args.camera is None else read_camera(args.camera)
    vehicles, unknown = read_poses(args.source)
    if unknown:
        say("conflicts", f"{unknown} tracks stand all the time, or have no size or speed, and are left out")
    found = encounters(vehicles, config)
    surely = [one for one in found if sure(one, config)]
    doubtful = [one for one in found if not sure(one, config)]
    for name, own in (("conflicts.csv", surely), ("doubtful.csv", doubtful)):
        write_columns(with_clock(encounter_columns(own, later_s), args.begin), out / name)
    draw_heat(surely, vehicles, out / "conflicts.png", camera, args.picture)
    if args.frames is not None or args.films:
        view = FilmInPicture(camera, args.picture) if camera is not None else FilmFromAbove()
        _films(args, surely, vehicles, out, view)
    if doubtful:
        say("conflicts", f"{len(doubtful)} more may be conflicts, with more doubt (doubtful.csv)")
    print(f"{len(surely)} conflicts among {len(vehicles)} vehicles: {out}")
    return 0


def _films(
    args: argparse.Namespace,
    found: list[Encounter],
    vehicles: list[Poses],
    out: Path,
    view: FilmInPicture | FilmFromAbove,
) -> None:
    from tqdm import tqdm

    from jeat_graph.road.conflicts.film import write_film

    hidden = not sys.stderr.isatty()
    for one in tqdm(found, desc="films", unit="film", disable=hidden, leave=False):
        path = out / f"conflict-{one.first}-{one.second}.webm"
        if args.frames is None:
            write_film(one, vehicles, path, _AROUND_S, view)
        else:
            _from_video(args, one, path)


def _from_video(args: argparse.Namespace, one: Encounter, path: Path) -> None:
    from jeat_graph.drawing.movie.film import MovieWriter
    from jeat_graph.drawing.movie.sources import Request, open_movie

    request = Request(
        run=Path(args.tracks),
        frames=Path(args.frames),
        frame_rate_hz=args.rate,
        start_s=one.t - _AROUND_S,
        end_s=one.t + _AROUND_S,
    )
    with ExitStack() as stack:
        movie, rate_hz, _ = open_movie(request, stack)
        with MovieWriter(path, movie.size_px, rate_hz) as writer:
            for k in range(len(movie.times)):
                writer.append(movie.picture(k))
