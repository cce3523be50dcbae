"""A folder is private if nobody else can put anything there or in its place."""

from __future__ import annotations

import os

import pytest

from jeat_graph.data.private_folder import is_private

POSIX = pytest.mark.skipif(not hasattr(os, "getuid"), reason="owners and modes of POSIX")


@POSIX
def test_a_folder_is_private_if_nobody_else_can_put_anything_there_or_in_its_place(tmp_path):
    folder = tmp_path / "home" / "cache"
    folder.mkdir(parents=True)
    folder.chmod(0o755)
    (tmp_path / "home").chmod(0o755)
    assert is_private(folder)
    folder.chmod(0o777)
    assert not is_private(folder)
    folder.chmod(0o1777)  # /tmp: others cannot replace files, but put new ones beside them
    assert not is_private(folder)
    folder.chmod(0o700)
    (tmp_path / "home").chmod(0o777)  # others can put another folder in its place
    assert not is_private(folder)
    (tmp_path / "home").chmod(0o1777)
    assert is_private(folder)
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "home")
    (tmp_path / "home").chmod(0o777)
    assert not is_private(link / "cache")
    assert not is_private(tmp_path / "missing")
