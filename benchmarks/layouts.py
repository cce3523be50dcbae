"""Finds recordings with detections and truth in the layouts of published data sets, and in ours.

A layout tells where a recording's truth lies, where its detections lie, and what the files leave open: frame
rate and size of the picture. Nothing is downloaded. Detections that a data set does not hold come from a
folder with one file a recording (`--detections`), in any format that `jeat-graph track` reads.

Sources of the layouts: MOTChallenge (Dendorfer et al., 2021) and, in the same layout, DanceTrack, SportsMOT
and FEMOT; KITTI tracking (Geiger et al., 2012); MEVDT (El Shair and Rawashdeh, 2024); eTraM (Verma et al.,
2024), boxes in Prophesee's arrays; DSEC-Det (Gehrig and Scaramuzza, 2024), boxes in Prophesee's arrays;
DSEC-MOT (Wang et al., SpikeMOT, arXiv:2309.16987, 2023); TUMTraf (Creß et al., 2024).
"""

from __future__ import annotations

import configparser
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.recordings import JudgedRecording, RecordingSet
from benchmarks.truth_files import is_dsec_mot, is_openlabel, read_dsec_mot, read_openlabel
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth

#: Endings of a detector's file in the folder of `--detections`, in the order in which they are looked for.
_ENDINGS = (".csv", ".csv.gz", ".parquet", ".txt", ".json", ".npy")
_KITTI_RATE_HZ, _KITTI_IMAGE = 10.0, (1242.0, 375.0)
_MEVDT_IMAGE, _ETRAM_IMAGE, _DSEC_IMAGE = (346.0, 260.0), (1280.0, 720.0), (640.0, 480.0)
#: A scan lies on the truth's clock if it is no further from one of its ticks, in periods.
_ON_THE_CLOCK = 0.05
_MOT17_DETECTOR = re.compile(r"^(MOT\d+-\d+)-(DPM|FRCNN|SDP)$")
_MEVDT_RATE = re.compile(r"(\d+)\s*-?_?\s*hz", re.IGNORECASE)


@dataclass(frozen=True)
class FoundRecording:
    """Where a recording lies.

    Attributes:
        group: name of its set.
        name: of the recording.
        truth: file of the truth.
        detections: files of detections that the data set holds, by name of the sensor; "" where the file
            names them.
        rate_hz: frame rate, None where times are in the files.
        image: width and height (px), None where not known.
        forms: formats of truth and detections, None where the files show them.
        reader: of the truth, where `jeat-graph` itself does not read its format.
    """

    group: str
    name: str
    truth: Path
    detections: dict[str, Path] = field(default_factory=dict)
    rate_hz: float | None = None
    image: tuple[float, float] | None = None
    forms: tuple[str | None, str | None] = (None, None)
    reader: Callable[[Path], GroundTruth] | None = None


def mot(root: Path) -> Iterator[FoundRecording]:
    """Recordings in MOTChallenge's layout (`gt/gt.txt`, `det/det.txt`, `seqinfo.ini`) or in ours.

    Ours is `gt.csv`, `detections.csv` and, optional, `meta.json` with `width`, `height`, `rate_hz`. Text
    files may also lie side by side (`gt.txt`, `det.txt`). Folders without truth are test sets, and are passed
    over.
    """
    for folder in sorted({root, *(path for path in root.rglob("*") if path.is_dir())}):
        ours = folder / "gt.csv"
        if ours.is_file():
            facts = _meta(folder / "meta.json")
            files = {"": folder / "detections.csv"}
            found = FoundRecording(
                _group(root, folder), folder.name, ours, files, facts.get("rate_hz"), _image(facts)
            )
        else:
            truth = next((p for p in (folder / "gt" / "gt.txt", folder / "gt.txt") if p.is_file()), None)
            if truth is None or folder.name == "gt":
                continue
            facts = _seqinfo(folder / "seqinfo.ini")
            split = _MOT17_DETECTOR.match(folder.name)  # MOT17 has each sequence three times, once a detector
            group = _group(root, folder) + (f" {split[2]}" if split else "")
            files = {
                "rgb": next((p for p in (folder / "det/det.txt", folder / "det.txt") if p.is_file()), folder)
            }
            form = ("motchallenge", "motchallenge")
            found = FoundRecording(
                group, folder.name, truth, files, facts.get("rate_hz"), _image(facts), form
            )
        yield replace(found, detections={name: p for name, p in files.items() if p.is_file()})


def kitti(root: Path) -> Iterator[FoundRecording]:
    """KITTI tracking: `label_02/SEQ.txt`, and `det_02/SEQ.txt` where there are public detections."""
    for labels in sorted(root.rglob("label_02")):
        for truth in sorted(labels.glob("*.txt")):
            beside = labels.parent / "det_02" / truth.name
            held = {"rgb": beside} if beside.is_file() else {}
            form = ("kitti", "kitti")
            yield FoundRecording("KITTI", truth.stem, truth, held, _KITTI_RATE_HZ, _KITTI_IMAGE, form)


def mevdt(root: Path) -> Iterator[FoundRecording]:
    """MEVDT: `labels/tracking_labels/SPLIT/SCENE/SEQ/…-mot.txt`, one file a rate of 24 to 384 Hz."""
    for truth in sorted(root.rglob("tracking_labels/**/*mot.txt")):
        rate = _MEVDT_RATE.search(truth.name)
        if rate is None:
            raise DataError("its name does not say the rate of its labels (…24Hz…-mot.txt)", truth)
        group = f"MEVDT {truth.parent.parent.name} {rate[1]} Hz"
        form = ("motchallenge", None)
        yield FoundRecording(group, truth.parent.name, truth, {}, float(rate[1]), _MEVDT_IMAGE, form)


def etram(root: Path) -> Iterator[FoundRecording]:
    """Boxes of eTraM: `SEQ_bbox.npy`, structured arrays with `t` in µs and `track_id`."""
    for truth in sorted(root.rglob("*_bbox.npy")):
        name = truth.name.removesuffix("_bbox.npy")
        yield FoundRecording(
            f"eTraM {_group(root, truth.parent)}", name, truth, {}, None, _ETRAM_IMAGE, ("prophesee", None)
        )


def dsec(root: Path) -> Iterator[FoundRecording]:
    """DSEC-Det: `SEQ/object_detections/left/tracks.npy`, structured arrays with `t` in µs and `track_id`."""
    for truth in sorted(root.rglob("object_detections/left/tracks.npy")):
        name = truth.parents[2].name
        group = f"DSEC-Det {_group(root, truth.parents[2])}"
        yield FoundRecording(group, name, truth, {}, None, _DSEC_IMAGE, ("prophesee", None))


def dsec_mot(root: Path) -> Iterator[FoundRecording]:
    """DSEC-MOT: a text file a sequence (`zurich_city_00_b.txt`) with seven numbers a line."""
    for truth in filter(is_dsec_mot, sorted(root.rglob("*.txt"))):
        group = f"DSEC-MOT {_group(root, truth.parent)}"
        yield FoundRecording(group, truth.stem, truth, {}, None, _DSEC_IMAGE, reader=read_dsec_mot)


def tumtraf(root: Path) -> Iterator[FoundRecording]:
    """TUMTraf: folders of OpenLABEL files with boxes in the picture, one file a picture."""
    for folder in sorted({path.parent for path in root.rglob("*.json")}):
        if is_openlabel(folder):
            group = f"TUMTraf {_group(root, folder)}"
            yield FoundRecording(group, folder.name, folder, reader=read_openlabel)


LAYOUTS: dict[str, Callable[[Path], Iterator[FoundRecording]]] = {
    "mot": mot,
    "kitti": kitti,
    "mevdt": mevdt,
    "etram": etram,
    "dsec-det": dsec,
    "dsec-mot": dsec_mot,
    "tumtraf": tumtraf,
}


@dataclass(frozen=True)
class LayoutOptions:
    """What the user says of the files.

    Attributes:
        detections: folders of detections, by the name of the detector.
        rate_hz: frame rate where a data set does not say it.
        classes: objects to be found, the others are ignored; all if empty.
        most: read the first recordings of each set only; None for all.
        sets: read these only; all if empty.
    """

    detections: tuple[tuple[str, Path], ...] = ()
    rate_hz: float | None = None
    classes: tuple[str, ...] = ()
    most: int | None = None
    sets: tuple[str, ...] = ()


def read_sets(layout: str, root: Path, how: LayoutOptions) -> list[RecordingSet]:
    """Read all recordings below a folder, by set.

    Args:
        layout: key of `LAYOUTS`.
        root: the folder.
        how: what the files leave open.

    Raises:
        DataError: no folder, no recording with truth, a recording without detections or without a frame rate,
            or a file that cannot be read.
    """
    if not root.is_dir():
        raise DataError("is no folder", root)
    groups: dict[str, list[FoundRecording]] = {}
    for one in LAYOUTS[layout](root):
        groups.setdefault(one.group, []).append(one)
    if not groups:
        raise DataError(f"holds no recording with truth in the layout {layout!r}", root)
    unknown = [name for name in how.sets if name not in groups]
    if unknown:
        raise DataError(f"holds no set {unknown[0]!r}; there are: {', '.join(groups)}", root)
    return [
        RecordingSet(name, tuple(_read(one, how) for one in found[: how.most]))
        for name, found in groups.items()
        if not how.sets or name in how.sets
    ]


def _read(one: FoundRecording, how: LayoutOptions) -> JudgedRecording:
    from jeat_graph.eval.load import restrict_classes
    from jeat_graph.io.tables.detections_io import read_detections
    from jeat_graph.io.tables.truth_io import read_truth

    rate = one.rate_hz or how.rate_hz
    if rate is None and "motchallenge" in one.forms:
        raise DataError("no seqinfo.ini beside it says its frame rate: give --rate HZ", one.truth)
    options: dict[str, Any] = {} if rate is None else {"rate_hz": rate}
    if one.reader is not None:
        truth = one.reader(one.truth)
    else:
        of_truth: dict[str, Any] = {} if one.truth.suffix == ".csv" else options
        truth = read_truth(one.truth, fmt=one.forms[0], **of_truth)
    if how.classes:
        truth = restrict_classes(truth, how.classes)
    parts: list[Detections] = []
    for name, path in (*one.detections.items(), *_given(one, how)):
        plain = name == ""
        form = None if path not in one.detections.values() else one.forms[1]
        given = {} if plain or path.suffix in (".csv", ".parquet", ".gz") else options
        found = read_detections(path, sensor=None if plain else name, fmt=form, **given)
        if how.classes and found.classes is not None:
            found = found.where(np.isin(found.classes, [*how.classes, ""]))
        parts.append(found)
    if not parts:
        raise DataError("has no detections: give --detections [NAME=]DIR", one.truth)
    detections = parts[0] if len(parts) == 1 else Detections.concatenate(parts)
    return JudgedRecording(one.name, detections, _with_empty_frames(truth, detections), one.image)


def _with_empty_frames(truth: GroundTruth, detections: Detections) -> GroundTruth:
    """Count scans without objects as frames where detectors and truth have one clock."""
    frames, scans = truth.frame_times(), np.unique(detections.scan_t)
    if len(frames) < 2:
        return truth
    counted = (scans - frames[0]) / np.median(np.diff(frames))
    if np.abs(counted - np.round(counted)).max(initial=0.0) > _ON_THE_CLOCK:
        return truth
    return replace(truth, frames=np.unique(np.concatenate([frames, scans])))


def _given(one: FoundRecording, how: LayoutOptions) -> Iterator[tuple[str, Path]]:
    for name, folder in how.detections:
        choices = [folder / f"{one.name}{ending}" for ending in _ENDINGS] + [
            folder / one.name / "detections.csv"
        ]
        path = next((path for path in choices if path.is_file()), None)
        if path is None:
            raise DataError(f"holds no detections of {one.name} ({one.name}.csv, .txt, …)", folder)
        yield name, path


def _group(root: Path, folder: Path) -> str:
    """Name of a recording's set: the folder that it lies in, with the one above where that is a split."""
    parent = folder.parent if folder != root else folder
    name = parent.name if parent != root else root.resolve().name
    return f"{parent.resolve().parent.name} {name}" if name in ("train", "val", "test") else name


def _seqinfo(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    parser = configparser.ConfigParser()
    try:
        parser.read(path, encoding="utf-8")
        section = parser["Sequence"]
        sizes = {key: float(section[own]) for key, own in (("width", "imWidth"), ("height", "imHeight"))}
        return {"rate_hz": float(section["frameRate"]), **sizes}
    except (configparser.Error, KeyError, ValueError, UnicodeDecodeError) as error:
        raise DataError(f"cannot be read: {' '.join(str(error).split())}", path) from None


def _meta(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DataError(f"cannot be read: {error}", path) from None
    if not isinstance(found, dict):
        raise DataError("holds no JSON object with width, height and rate_hz", path)
    return found


def _image(facts: dict[str, Any]) -> tuple[float, float] | None:
    width, height = facts.get("width"), facts.get("height")
    if isinstance(width, int | float) and isinstance(height, int | float):
        return float(width), float(height)
    return None
