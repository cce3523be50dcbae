"""A file is whole or not there."""

from __future__ import annotations

import os

import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import atomic_path, open_atomic


def test_the_file_appears_with_its_content_and_leaves_nothing_beside(tmp_path):
    with open_atomic(tmp_path / "a.txt") as file:
        file.write("één\n")
        assert not (tmp_path / "a.txt").exists()
    assert (tmp_path / "a.txt").read_bytes() == "één\n".encode()
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_an_error_leaves_the_old_file_and_nothing_beside(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(TypeError, match="must be str"), open_atomic(path) as file:
        file.writelines(["new", b"!"])
    assert path.read_text(encoding="utf-8") == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("place", ["folder", "file/a.txt"])
def test_what_cannot_be_written_is_named_as_it_was_asked_for(tmp_path, place):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("here", encoding="utf-8")
    with pytest.raises(DataError, match="cannot be written") as found, open_atomic(tmp_path / place) as file:
        file.write("new")
    assert str(tmp_path / place) in str(found.value)
    assert "unfinished" not in str(found.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]


def test_missing_folders_are_made(tmp_path):
    with open_atomic(tmp_path / "x" / "y" / "a.txt") as file:
        file.write("!")
    assert (tmp_path / "x" / "y" / "a.txt").read_text(encoding="utf-8") == "!"


def test_the_temporary_file_keeps_the_suffix_that_writers_go_by(tmp_path):
    with atomic_path(tmp_path / "a.parquet") as temporary:
        assert temporary.suffix == ".parquet"
        assert temporary.parent == tmp_path


@pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")
def test_the_file_has_the_permissions_of_any_new_file(tmp_path):
    with open_atomic(tmp_path / "a.txt") as file:
        file.write("!")
    (tmp_path / "b.txt").write_text("!", encoding="utf-8")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "b.txt").stat().st_mode


def test_a_device_is_refused_and_stays_what_it_is(tmp_path):
    """Renaming a file over it would take it away; a pipe of our own stands for /dev/null."""
    device = tmp_path / "pipe"
    os.mkfifo(device)
    with pytest.raises(DataError, match="give the name of a file"), open_atomic(device) as file:
        file.write("x")
    assert device.is_fifo()
