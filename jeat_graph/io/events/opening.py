"""Opens a file of events by what it is, not by its name; what it cannot read it names."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from jeat_graph.data.errors import DataError
from jeat_graph.io.events.layout import EventLayout
from jeat_graph.io.events.reader import EventReader
from jeat_graph.io.files.addresses import is_live

if TYPE_CHECKING:
    from jeat_graph.io.events.raw_header import RawHeader

#: What is read, for messages and help.
FORMATS = (
    "EVT2, EVT2.1 and EVT3 (.raw), DAT, AEDAT 2 and 4, HDF5, ROS bags and MCAP, text and CSV (also in zip), "
    "NumPy and MATLAB arrays"
)
_GZIP, _ZIP = b"\x1f\x8b", b"PK\x03\x04"
_HDF5, _MATLAB_HDF5 = b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3 MAT-file"
_ROS_1, _ROS_2 = b"#ROSBAG V2.0", (b"SQLite format 3", b"\x89MCAP0")
#: First bytes of what is often taken for events, or is events of a kind that is not read.
_OTHERS = (
    (b"Event Stream", "an Event Stream (.es) file"),
    (_ZIP, "a ZIP archive without text or arrays of events"),
    (b"\x1a\x45\xdf\xa3", "a Matroska or WebM video"),
    (b"RIFF", "an AVI video"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
)
_FIRST_BYTES = 64
#: Text of Metavision begins like a header of RAW.
_GEOMETRY_OF_TEXT = re.compile(rb"%\s*geometry\s*:")


def open_events(
    path: str | Path, size_px: tuple[int, int] | None = None, layout: EventLayout | None = None
) -> EventReader:
    """Open a file of events.

    Args:
        path: the file, or the folder of a ROS 2 bag.
        size_px: width and height of the picture, where the file does not say, or says a smaller one.
        layout: columns, unit of time, and which recording of several, where the file leaves that open.

    Returns:
        A reader, to be closed.

    Raises:
        ConfigError: an extra package is needed for this format.
        DataError: no such file, or none of the formats that are read; the message says what it is instead.
            The file says a picture larger than the one given. Columns, times or the recording are unclear;
            the message names the option that says it.
    """
    layout = layout or EventLayout()
    reader = _opened(Path(path), size_px, layout)
    reader.size_given = size_px is not None
    for name in ("columns", "time_unit", "stream", "clock"):
        if getattr(layout, name) is not None and name not in reader.understands:
            reader.close()
            option = f"--event-{name.replace('_', '-')}"
            raise DataError(f"is {reader.format_name}, where {option} says nothing; leave it out", Path(path))
    return reader


def _opened(place: Path, size_px: tuple[int, int] | None, layout: EventLayout) -> EventReader:
    if is_live(place):
        raise DataError("is a camera that is on: `detect`, `track` and `stream` take it", place)
    if place.is_dir() and (place / "metadata.yaml").is_file():
        from jeat_graph.io.events.rosbag import RosbagReader

        return RosbagReader(place, size_px, layout)
    if not place.is_file():
        raise DataError("is a folder; give a file of events" if place.is_dir() else "no such file", place)
    try:
        file = place.open("rb", buffering=0)
        start = file.read(_FIRST_BYTES) or b""
        file.seek(0)
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", place) from None
    try:
        if start.startswith((_HDF5, _MATLAB_HDF5)):
            file.close()
            return _open_hdf5(place, size_px, layout)
        reader = _open_camera(place, file, start, size_px, layout)
        if reader is not None:
            return reader
        file.close()
        return _open_table(place, start, size_px, layout)
    except BaseException:
        file.close()
        raise


def _open_camera(
    place: Path, file: BinaryIO, start: bytes, size_px: tuple[int, int] | None, layout: EventLayout
) -> EventReader | None:
    """Open what cameras and their programs record; None if it is nothing of that."""
    if start.startswith((_ROS_1, *_ROS_2)):
        file.close()
        from jeat_graph.io.events.rosbag import RosbagReader

        return RosbagReader(place, size_px, layout)
    if start.startswith(b"#!AER-DAT4"):
        file.close()
        from jeat_graph.io.events.aedat4 import Aedat4Reader

        return Aedat4Reader(place, size_px)
    if start.startswith(b"#!AER-DAT2"):
        from jeat_graph.io.events.aedat2 import Aedat2Reader

        return Aedat2Reader(place, file, size_px)
    if start.startswith(b"#!AER-DAT"):
        version = start[9:12].decode("latin-1")
        shown = version.strip() if version.isprintable() else repr(version)
        raise DataError(f"is AEDAT {shown}, which is not read; 2 and 4 are", place)
    if start.startswith(b"%") and not _GEOMETRY_OF_TEXT.match(start):
        return _open_prophesee(place, file, size_px)
    return None


def _open_table(
    place: Path, start: bytes, size_px: tuple[int, int] | None, layout: EventLayout
) -> EventReader:
    """Open text and arrays, or say what the file is instead."""
    from jeat_graph.io.events.array_tables import array_table
    from jeat_graph.io.events.tables import TableReader
    from jeat_graph.io.events.text_tables import text_table

    for others, name in _OTHERS:
        if start.startswith(others) and others != _ZIP:
            raise DataError(f"is {name}, no file of events that is read ({FORMATS})", place)
    if start[4:8] == b"ftyp":
        raise DataError(f"is an MP4 video, no file of events ({FORMATS})", place)
    if not start:
        raise DataError("is empty", place)
    table = array_table(place, layout, start) or text_table(place, layout, start)
    if table is not None:
        return TableReader(place, table, size_px, layout)
    if start.startswith(_GZIP):
        raise DataError("is compressed with gzip; unpack it first", place)
    if start.startswith(_ZIP):
        raise DataError(f"is {dict(_OTHERS)[_ZIP]}, no file of events that is read ({FORMATS})", place)
    raise DataError(f"is none of the files of events that are read ({FORMATS})", place)


def _open_prophesee(place: Path, file: BinaryIO, size_px: tuple[int, int] | None) -> EventReader:
    """Open RAW or DAT: both begin with lines of `%`."""
    from jeat_graph.io.events.raw_header import origin_of, read_raw_header
    from jeat_graph.io.events.reader import agreed_size

    header = read_raw_header(file, place)
    reader = _reader_of(place, file, header, agreed_size(size_px, header.size_px, place))
    reader.t_offset_us = origin_of(header, place)
    return reader


def _reader_of(place: Path, file: BinaryIO, header: RawHeader, size: tuple[int, int] | None) -> EventReader:
    """Choose the decoder by the header."""
    from jeat_graph.io.events.dat import DatReader
    from jeat_graph.io.events.evt2 import Evt2Reader
    from jeat_graph.io.events.evt3 import Evt3Reader
    from jeat_graph.io.events.evt21 import Evt21Reader

    if header.encoding == "EVT2":
        return Evt2Reader(place, file, size)
    if header.encoding == "EVT3":
        return Evt3Reader(place, file, size)
    if header.encoding == "EVT21":
        endianness = header.options.get("endianness")
        return Evt21Reader(place, file, size, None if endianness is None else endianness == "legacy")
    if header.encoding is not None:
        raise DataError(
            f"is raw data of the encoding {header.encoding!r}, which is not read; EVT2, EVT2.1 and EVT3 are",
            place,
        )
    version = header.keys.get("version", "2").strip()
    if version not in ("0", "1", "2"):
        raise DataError(f"is DAT of version {version!r}; 1 and 2 are read", place)
    return DatReader(place, file, size, int(version))


def _open_hdf5(place: Path, size_px: tuple[int, int] | None, layout: EventLayout) -> EventReader:
    """Open HDF5 by the tables that it holds."""
    import h5py

    from jeat_graph.io.events.dsec import DsecReader
    from jeat_graph.io.events.hdf5_items import find_item, opening_error
    from jeat_graph.io.events.hdf5_tables import hdf5_table
    from jeat_graph.io.events.prophesee_hdf5 import TABLE, PropheseeHdf5Reader
    from jeat_graph.io.events.tables import TableReader

    with suppress(ImportError):  # filters that some files need
        import hdf5plugin  # noqa: F401
    try:
        file: Any = h5py.File(place, "r")
    except OSError as error:
        raise opening_error(error, place) from None
    try:
        if layout == EventLayout():
            if find_item(file, TABLE, place) is not None:
                return PropheseeHdf5Reader(place, file, size_px)
            if _is_indexed(file, place):
                file.close()
                return DsecReader(place, size_px)
        return TableReader(place, hdf5_table(place, file, layout), size_px, layout)
    except (OSError, RuntimeError, KeyError, ValueError) as error:  # what h5py raises of a damaged list
        file.close()
        raise opening_error(error, place) from None
    except BaseException:
        file.close()
        raise


def _is_indexed(file: Any, place: Path) -> bool:
    """Whether HDF5 has the layout of DSEC with its index by time; times in s have no such index."""
    from jeat_graph.io.events.hdf5_items import find_item

    if find_item(file, "ms_to_idx", place) is None or find_item(file, "events", place) is None:
        return False
    times = find_item(file, "events/t", place)
    return getattr(getattr(times, "dtype", None), "kind", "u") in "uib"
