"""Opens a file of events by what it is, not by its name; what it cannot read it names."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from jeat_graph.data.errors import DataError
from jeat_graph.io.events.reader import EventReader

#: What is read, for messages and help.
FORMATS = (
    "EVT2, EVT2.1 and EVT3 (.raw), DAT, AEDAT 2 and 4, HDF5 of DSEC and of Prophesee, ROS bags with events"
)
_GZIP = b"\x1f\x8b"
_HDF5 = b"\x89HDF\r\n\x1a\n"
#: First bytes of what is often taken for events, or is events of a kind that is not read.
_OTHERS = (
    (b"Event Stream", "an Event Stream (.es) file"),
    (b"\x93NUMPY", "a NumPy array"),
    (b"PK\x03\x04", "a ZIP archive, such as .npz"),
    (b"\x1a\x45\xdf\xa3", "a Matroska or WebM video"),
    (b"RIFF", "an AVI video"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"SQLite format 3", "a data base; give the folder of the ROS 2 bag"),
    (b"\x89MCAP0", "an MCAP file; give the folder of the ROS 2 bag"),
)
_FIRST_BYTES = 64


def open_events(path: str | Path, size_px: tuple[int, int] | None = None) -> EventReader:
    """Open a file of events.

    Args:
        path: the file, or the folder of a ROS 2 bag.
        size_px: width and height of the picture, where the file does not say, or says a smaller one.

    Returns:
        A reader, to be closed.

    Raises:
        ConfigError: an extra package is needed for this format.
        DataError: no such file, or none of the formats that are read; the message says what it is instead.
            The file says a picture larger than the one given.
    """
    reader = _opened(Path(path), size_px)
    reader.size_given = size_px is not None
    return reader


def _opened(place: Path, size_px: tuple[int, int] | None) -> EventReader:
    if place.is_dir() and (place / "metadata.yaml").is_file():
        from jeat_graph.io.events.rosbag import RosbagReader

        return RosbagReader(place, size_px)
    if not place.is_file():
        raise DataError("is a folder; give a file of events" if place.is_dir() else "no such file", place)
    try:
        file = place.open("rb", buffering=0)
        start = file.read(_FIRST_BYTES) or b""
        file.seek(0)
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}", place) from None
    try:
        return _open(place, file, start, size_px)
    except BaseException:
        file.close()
        raise


def _open(place: Path, file: BinaryIO, start: bytes, size_px: tuple[int, int] | None) -> EventReader:
    if start.startswith(_HDF5):
        file.close()
        return _open_hdf5(place, size_px)
    if start.startswith(b"#!AER-DAT4") or start.startswith(b"#ROSBAG V2.0"):
        file.close()
        from jeat_graph.io.events.aedat4 import Aedat4Reader
        from jeat_graph.io.events.rosbag import RosbagReader

        return (Aedat4Reader if start.startswith(b"#!AER-DAT4") else RosbagReader)(place, size_px)
    if start.startswith(b"#!AER-DAT2"):
        from jeat_graph.io.events.aedat2 import Aedat2Reader

        return Aedat2Reader(place, file, size_px)
    if start.startswith(b"#!AER-DAT"):
        version = start[9:12].decode("latin-1")
        shown = version.strip() if version.isprintable() else repr(version)
        raise DataError(f"is AEDAT {shown}, which is not read; 2 and 4 are", place)
    if start.startswith(b"%"):
        return _open_prophesee(place, file, size_px)
    if start[4:8] == b"ftyp":
        raise DataError(f"is an MP4 video, no file of events ({FORMATS})", place)
    if start.startswith(_GZIP):
        raise DataError("is compressed with gzip; unpack it first", place)
    for magic, name in _OTHERS:
        if start.startswith(magic):
            raise DataError(f"is {name}, no file of events that is read ({FORMATS})", place)
    if not start:
        raise DataError("is empty", place)
    raise DataError(f"is none of the files of events that are read ({FORMATS})", place)


def _open_prophesee(place: Path, file: BinaryIO, size_px: tuple[int, int] | None) -> EventReader:
    """Open RAW or DAT: both begin with lines of `%`."""
    from jeat_graph.io.events.dat import DatReader
    from jeat_graph.io.events.evt2 import Evt2Reader
    from jeat_graph.io.events.evt3 import Evt3Reader
    from jeat_graph.io.events.evt21 import Evt21Reader
    from jeat_graph.io.events.raw_header import read_raw_header
    from jeat_graph.io.events.reader import agreed_size

    header = read_raw_header(file, place)
    size = agreed_size(size_px, header.size_px, place)
    if header.encoding == "EVT2":
        return Evt2Reader(place, file, size)
    if header.encoding == "EVT3":
        return Evt3Reader(place, file, size)
    if header.encoding == "EVT21":
        said = header.options.get("endianness")
        return Evt21Reader(place, file, size, None if said is None else said == "legacy")
    if header.encoding is not None:
        raise DataError(
            f"is raw data of the encoding {header.encoding!r}, which is not read; EVT2, EVT2.1 and EVT3 are",
            place,
        )
    version = header.keys.get("version", "2").strip()
    if version not in ("0", "1", "2"):
        raise DataError(f"is DAT of version {version!r}; 1 and 2 are read", place)
    return DatReader(place, file, size, int(version))


def _open_hdf5(place: Path, size_px: tuple[int, int] | None) -> EventReader:
    """Open HDF5 by the tables that it holds."""
    import h5py

    from jeat_graph.io.events.dsec import DsecReader
    from jeat_graph.io.events.prophesee_hdf5 import TABLE, PropheseeHdf5Reader
    from jeat_graph.io.hdf5_items import find_item, opening_error

    with suppress(ImportError):  # filters that some files need
        import hdf5plugin  # noqa: F401
    try:
        file: Any = h5py.File(place, "r")
    except OSError as error:
        raise opening_error(error, place) from None
    try:
        if find_item(file, TABLE, place) is not None:
            return PropheseeHdf5Reader(place, file, size_px)
        names = sorted(str(name) for name in file)
    except (OSError, RuntimeError, KeyError, ValueError) as error:  # what h5py raises of a damaged list
        file.close()
        raise opening_error(error, place) from None
    except BaseException:
        file.close()
        raise
    file.close()
    if "events" not in names:
        shown = ", ".join(names[:5]) or "nothing"
        raise DataError(
            f"is HDF5 without events: it holds {shown}; DSEC has events/x, y, p, t, Prophesee CD/events",
            place,
        )
    return DsecReader(place, size_px)
