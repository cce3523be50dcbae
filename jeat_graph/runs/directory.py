"""The directory of a run: its files appear together when all of them are complete, `run.json` last."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.beside import check_beside
from jeat_graph.io.files.locking import hold_folder, remove_folders
from jeat_graph.io.files.outputs import check_folder
from jeat_graph.io.formats.registry import written_formats
from jeat_graph.io.tables.scans_io import SCANS

RUN_JSON = "run.json"
#: Folder with the state of a run that is not finished (`runs/unfinished.py`).
RESUME = ".resume"
_UNFINISHED = ".unfinished-"
# A record of a thousand sensors has 1 MB; no count of a run and no side of a picture is larger than that.
_MOST_BYTES, _LARGEST = 1 << 26, 1e15
_KINDS: dict[str, type[Any]] = {
    "config": dict,
    "counts": dict,
    "files": dict,
    "frames": dict,
    "images": dict,
    "inputs": list,
    "learnt": dict,
    "overrides": list,
    "reading": dict,
    "timings": dict,
    "warnings": list,
}
_NAMES: dict[type[Any], str] = {dict: "mapping", list: "list"}
DIAGNOSTICS = "diagnostics.csv"
MEASUREMENTS = "measurements.parquet"
#: What the smoother joined (`io/tables/links_io.py`).
LINKS = "links.csv"
#: Where the model disagrees with corrected identities (`io/tables/corrected_io.py`).
DISAGREEMENTS = "disagreements.csv"
ROAD_CAUSAL, ROAD_SMOOTHED = "road_causal.csv", "road_smoothed.csv"
TABLES = ("causal", "smoothed")
SUFFIXES = {one.name: one.suffix for one in written_formats()}
_TABLE_FILES = (kind + suffix for kind in TABLES for suffix in SUFFIXES.values())
RUN_FILES = (
    *(*_TABLE_FILES, SCANS, LINKS, DISAGREEMENTS, DIAGNOSTICS, MEASUREMENTS),
    *(ROAD_CAUSAL, ROAD_SMOOTHED, RUN_JSON),
)


def read_record(folder: Path) -> dict[str, Any]:
    """Return what a run's `run.json` says; nothing where there is none.

    Raises:
        DataError: it cannot be read, or is no record.
    """
    path = folder / RUN_JSON
    if not path.is_file():
        return {}
    check_beside(path, folder)
    if path.stat().st_size > _MOST_BYTES:
        raise DataError("is too large for the record of a run", path)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", path) from None
    except (ValueError, RecursionError) as error:
        line = error.lineno if isinstance(error, json.JSONDecodeError) else None
        raise DataError("is not JSON; it should be the record of a run", path, line) from None
    if not isinstance(content, dict):
        raise DataError("is not the record of a run", path)
    for key, kind in _KINDS.items():
        if not isinstance(content.get(key, kind()), kind):
            raise DataError(f"is not the record of a run: {key!r} is no {_NAMES[kind]}", path)
    _check_numbers(content, path)
    return content


def _check_numbers(record: dict[str, Any], path: Path) -> None:
    """Refuse a picture without a size, a rate that is none, and counts that are no numbers."""
    image = record.get("config", {}).get("image", {})
    wrong = [] if isinstance(image, dict) else ["config.image"]
    sides = {} if wrong else {key: image[key] for key in ("width", "height") if key in image}
    wrong += [f"config.image.{key}" for key, value in sides.items() if not _is_number(value, above=0.0)]
    rate = record.get("reading", {}).get("rate_hz")
    wrong += [] if rate is None or _is_number(rate, above=0.0) else ["reading.rate_hz"]
    counts = {key: one for key, one in record.get("counts", {}).items() if not isinstance(one, dict)}
    wrong += [f"counts.{key}" for key, value in counts.items() if not _is_number(value)]
    wrong += [f"inputs[{k}]" for k, one in enumerate(record.get("inputs", [])) if not isinstance(one, dict)]
    wrong += [f"files.{key}" for key, one in record.get("files", {}).items() if not isinstance(one, dict)]
    if wrong:
        raise DataError(f"is not the record of a run: {wrong[0]} cannot be that", path)


def _is_number(value: Any, above: float = -1.0) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and above < value < _LARGEST


class RunDirectory:
    """A context manager that puts the files of a run into a folder, all of them or none.

    Write each file to `path(name)`. They stand in a hidden folder until the `with` block ends without an
    error, and then take their places. Files of an earlier run in the same folder are replaced, and removed
    where this run has none of that name; any other file there is left alone. After an error the folder is as
    it was before.

    Args:
        folder: where the run shall stand; made if it is missing.
        inputs: files the run is made from, which it must not replace.

    Raises:
        DataError: `folder` is a file, or an input is one of the files that would be replaced; on entering,
            if another process is writing a run there.
    """

    def __init__(self, folder: str | Path, inputs: Iterable[str | Path] = ()) -> None:
        self.folder = Path(folder)
        check_folder(folder)
        own = {(self.folder / name).resolve() for name in RUN_FILES}
        for path in inputs:
            if Path(path).resolve() in own:
                raise DataError(
                    f"would be replaced by a file of the run; choose another --out than {folder}", path
                )
        self._staging: Path | None = None
        self._hold = ExitStack()
        self._made: list[Path] = []

    def path(self, name: str) -> Path:
        """Where to write the file that shall be called `name`."""
        if self._staging is None:
            raise RuntimeError("the run directory must be entered with `with` before files are written")
        return self._staging / name

    def __enter__(self) -> Self:
        missing = self.folder
        while not missing.exists():
            self._made.append(missing)
            missing = missing.parent
        self.folder.mkdir(parents=True, exist_ok=True)
        try:
            if self._hold.enter_context(hold_folder(self.folder)):
                remove_folders(self.folder, _UNFINISHED + "*")  # of runs that were killed
            self._staging = Path(tempfile.mkdtemp(dir=self.folder, prefix=_UNFINISHED))
        except BaseException:
            self._hold.close()
            self._remove_made()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        assert self._staging is not None
        try:
            if error is None:
                self._publish(self._staging)
        finally:
            shutil.rmtree(self._staging, ignore_errors=True)
            self._hold.close()
            if error is not None:
                self._remove_made()

    def _publish(self, staging: Path) -> None:
        # Without run.json the folder holds no run: it goes first and comes last.
        (self.folder / RUN_JSON).unlink(missing_ok=True)
        new = sorted((p.name for p in staging.iterdir()), key=lambda name: (name == RUN_JSON, name))
        for name in RUN_FILES:
            if name not in new:
                (self.folder / name).unlink(missing_ok=True)
        for name in new:
            (staging / name).replace(self.folder / name)
        remove_folders(self.folder, RESUME)

    def _remove_made(self) -> None:
        for folder in self._made:
            try:
                folder.rmdir()
            except OSError:
                return
