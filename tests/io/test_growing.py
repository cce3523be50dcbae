"""Files that grow: where the disk is full they end with a whole line."""

from __future__ import annotations

import errno

import pytest

from jeat_graph.io.files.growing import GrowingFile


class _Full:
    """A file for which the disk has room for some bytes more."""

    def __init__(self, file, room):
        self._file, self._room = file, room

    def write(self, data):
        if not self._room:
            raise OSError(errno.ENOSPC, "No space left on device")
        part = data[: self._room]
        self._room -= len(part)
        return self._file.write(part)

    def __getattr__(self, name):
        return getattr(self._file, name)


def test_on_a_full_disk_no_line_is_left_half_written(tmp_path):
    path = tmp_path / "rows.csv"
    file = GrowingFile(path)
    file.begin(b"t\n")
    file.write(b"1\n2\n")
    file._file = _Full(file._file, 3)
    with pytest.raises(OSError, match="No space left") as error:
        file.write(b"33\n44\n55\n")
    assert error.value.filename == str(path)
    file.close()
    assert path.read_bytes() == b"t\n1\n2\n"
