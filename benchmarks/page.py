"""One Markdown page of a benchmark: how it was made, the sets, a plot, a table for each set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.judging import CAUSAL, SMOOTHED
from jeat_graph.io.files.atomic import open_atomic

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

#: Recordings that were looked at while the constants of the model were chosen: sequences of KITTI, and the
#: beginnings of other names.
KITTI_IN_VIEW = [
    "0001",
    "0002",
    "0004",
    "0005",
    "0006",
    "0008",
    "0010",
    "0011",
    "0012",
    "0013",
    "0014",
    "0015",
    "0018",
]
OTHERS_IN_VIEW = (
    *("MOT17-02", "MOT17-05", "MOT17-10", "ADL-Rundle-6", "ETH-Pedcross2", "ETH-Sunnyday", "PETS09-S2L1"),
    *("dancetrack0004", "dancetrack0010", "dancetrack0026", "dancetrack0065", "TUD-"),
    *("day/", "night-nolight/"),
)
#: Published results: tracker, data set, HOTA, MOTA, IDF1, source.
PUBLISHED: tuple[tuple[Cell, ...], ...] = (
    ("FEMOTR", "FEMOT, test", 48.9, 52.0, 62.0, "Wang et al., FEMOT, arXiv:2606.14094, 2026"),
    ("McByte", "MOT17", 64.1, None, None, "documentation of `trackers` 2.6, 2026"),
    ("McByte", "DanceTrack", 67.2, None, None, "documentation of `trackers` 2.6, 2026"),
    ("MCTrack, online", "KITTI cars, test", 80.8, 89.8, None, "Wang et al., arXiv:2409.16149, 2024"),
    ("MCTrack, offline", "KITTI cars, test", 82.5, 91.5, None, "Wang et al., arXiv:2409.16149, 2024"),
)
_TITLES = {
    "mot": "Recordings in MOTChallenge's layout",
    "real": "Real recordings",
    "kitti": "KITTI tracking",
    "mevdt": "MEVDT",
    "etram": "eTraM",
    "dsec-det": "DSEC-Det",
    "dsec-mot": "DSEC-MOT",
    "tumtraf": "TUMTraf",
    "simulated": "Simulated recordings",
}
_HOW = """Scores are those of `jeat-graph eval`, pooled over the recordings of a set: MOTA and MOTP
(CLEAR), HOTA, DetA and AssA, IDF1, in per cent, at the frames of the truth. The challenges' servers
differ in details: they count tracks on some ignored classes as false, and KITTI's leaves out small and
occluded objects. *Causal* rows use past data only, *smoothed* rows later data, too, and the whole
recording for who is who (`smoother.identities=auto`, as `track` does).
ANEES is the normalised estimation error squared of the position, averaged, per degree of freedom: 1 if
the variances are right. The next column is the share of errors inside the 95 % ellipses.

Our tracker has the settings of its preset, and the other trackers have the defaults of their packages.
They get no images: BoT-SORT and McByte run without camera-motion compensation and without masks. Of
several detectors the slowest sets their frames, and non-maximum suppression merges the boxes.

A tracker should not be judged on a set that its constants were chosen on. The column *in view* counts the
recordings that were looked at while ours were chosen."""


def write_page(path: Path, result: Mapping[str, Any], tables: Mapping[str, Table]) -> None:
    """Write a page, and its plot beside it.

    Args:
        path: of the page.
        result: what was measured.
        tables: of it, by marker.
    """
    from jeat_graph.eval.tables import Table

    picture = path.with_suffix(".svg")
    _plot(picture, result)
    kind = result["benchmark"]
    packages = ", ".join(f"{name} {found}" for name, found in result["packages"].items() if found)
    sets = Table.from_records([_set_row(one) for one in result["sets"]])
    published = Table(
        ("tracker", "set", "HOTA", "MOTA", "IDF1", "source"),
        PUBLISHED,
        digits=dict.fromkeys(("HOTA", "MOTA", "IDF1"), 1),
    )
    parts = [
        f"# {_TITLES[kind]}",
        f"Made by `{result['settings']['command']} --page {path.as_posix()}` at {result['commit']}, "
        f"jeat-graph {result['jeat_graph']}; {packages}.",
        _HOW,
        sets.render("markdown").strip(),
        f"![HOTA and IDF1 of each tracker on each set, with all detectors]({picture.name})",
        *(table.render("markdown").strip() for table in tables.values()),
        "## Published results",
        "For orientation: other splits and other detectors, so do not compare line by line.",
        published.render("markdown").strip(),
    ]
    if kind == "simulated":
        parts = parts[:-3]
    with open_atomic(path) as file:
        file.write("\n\n".join(parts) + "\n")


def _set_row(one: Mapping[str, Any]) -> dict[str, Cell]:
    count = sum(name in KITTI_IN_VIEW or name.startswith(OTHERS_IN_VIEW) for name in one["recordings"])
    return {
        "set": one["name"],
        "recordings": len(one["recordings"]),
        "frames": one["frames"],
        "boxes": one["boxes"],
        "detectors": ", ".join(one["sensors"]),
        "in view": f"{count} of {len(one['recordings'])}",
    }


def _plot(path: Path, result: Mapping[str, Any]) -> None:
    """Draw HOTA and IDF1 of each tracker with all detectors; the same result gives the same bytes."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    names = [one["name"] for one in result["sets"]]
    whole = {one["name"]: one["sensors"] for one in result["sets"]}
    points: dict[str, dict[str, Mapping[str, Any]]] = {}
    for record in result["records"]:
        for kind in (CAUSAL, SMOOTHED):
            if kind in record and record["sensors"] == whole[record["set"]]:
                label = record["row"] + (f", {kind}" if record["ours"] else "")
                points.setdefault(label, {})[record["set"]] = record[kind]
    figure = Figure(figsize=(10.0, 1.6 + 0.45 * len(names)), layout="constrained")
    axes: Sequence[Any] = figure.subplots(1, 2, sharey=True)
    for axis, metric in zip(axes, ("HOTA", "IDF1"), strict=True):
        for k, (label, by_set) in enumerate(points.items()):
            ours = any(r["row"] in label and r["ours"] for r in result["records"])
            there = [name for name in names if name in by_set]
            axis.plot(
                [by_set[name][metric] for name in there],
                [names.index(name) for name in there],
                linestyle="none",
                marker="D" if ours else "o",
                markersize=8 if ours else 5,
                color=f"C{k % 10}",
                label=label,
            )
        axis.set_xlabel(f"{metric} (%)")
        axis.grid(axis="x", alpha=0.3)
    axes[0].set_yticks(range(len(names)), names)
    axes[0].invert_yaxis()
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5, frameon=False, fontsize="small")
    path.parent.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context({"svg.hashsalt": "jeat-graph", "svg.fonttype": "none"}):
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(str(path), metadata={"Date": None, "Creator": None})
