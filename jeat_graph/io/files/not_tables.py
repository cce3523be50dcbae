"""Says what a file is that was taken for a table of text, and which option takes it."""

from __future__ import annotations

_EVENTS = "is a file of events, no table; `detect` and `track` take it as --events"
_VIDEO = "is a video, no table; `detect` and `track` take it as --frames"
_PICTURE = "is a picture, no table; `detect` and `track` take a folder of them as --frames"
_PICKLE = "is a pickle, which can run programs and is not read; save it as Parquet or CSV"
#: The message about XML, which annotation tools write in many forms.
XML = (
    "is XML (Pascal VOC, or CVAT's own), which is not read: export it as MOT 1.1, COCO or YOLO from the "
    "program that wrote it"
)
#: First bytes of what is no text, and what to do about it.
_STARTS = {
    b"\x1f\x8b": "is compressed with gzip; give it a name that ends in .gz, or unpack it",
    b"PK\x03\x04": "is a zip archive or an Excel workbook; unpack it, or save it as CSV",
    b"BZh": "is compressed with bzip2; unpack it",
    b"\xfd7zXZ": "is compressed with xz; unpack it",
    b"\x28\xb5\x2f\xfd": "is compressed with zstd; unpack it",
    b"ARROW1": "is an Arrow or Feather file; save it as Parquet or CSV",
    b"\x80\x04": _PICKLE,
    b"\x80\x05": _PICKLE,
    b"\x89HDF": "is an HDF5 file, not text; if it holds events, `detect` and `track` take it as --events",
    b"#!AER-DAT": _EVENTS,
    b"#ROSBAG": _EVENTS,
    b"\x1a\x45\xdf\xa3": _VIDEO,
    b"RIFF": _VIDEO,
    b"\x89PNG": _PICTURE,
    b"\xff\xd8\xff": _PICTURE,
    b"<?xml": XML,
    b"<annotation": XML,
}
_BOM = b"\xef\xbb\xbf"
#: RAW and DAT of Prophesee begin with lines of text.
_PROPHESEE = b"%"
#: So many bytes tell what a file is.
HEAD_BYTES = 16_384


def what_it_is(data: bytes) -> str | None:
    """Say what bytes are that are no text, and what to do about it; None where that is not known.

    Args:
        data: the first bytes of a file, or all.
    """
    head = data[:HEAD_BYTES].removeprefix(_BOM).lstrip()
    for start, text in _STARTS.items():
        if head.startswith(start):
            return text
    if data[4:8] == b"ftyp":
        return _VIDEO
    if data.startswith(_PROPHESEE) and not is_text(data[:HEAD_BYTES]):
        return _EVENTS
    return None


def is_text(head: bytes) -> bool:
    """Whether bytes can be text, but for a character that is cut off at their end."""
    if b"\0" in head:
        return False
    try:
        head[:-4].decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True
