"""Whose a folder is: whether others than this user could put files into it."""

from __future__ import annotations

import os
import stat
from pathlib import Path


def is_private(folder: Path) -> bool:
    """Whether only this user and the administrator can put files into a folder, or another in its place.

    Where the system knows no users, it is.
    """
    if not hasattr(os, "getuid"):
        return True
    place = Path(os.path.realpath(folder))
    try:
        for path in (place, *place.parents):
            found = path.stat()
            if found.st_uid not in (os.getuid(), 0):
                return False
            # In a folder like /tmp everybody may make files, but nobody may replace another's.
            sticky = path != place and found.st_mode & stat.S_ISVTX
            if not sticky and open_to_others(found):
                return False
    except OSError:
        return False
    return True


def open_to_others(found: os.stat_result) -> bool:
    """Whether others may write there; a group that is the user's alone is no other."""
    if found.st_mode & stat.S_IWOTH:
        return True
    return bool(found.st_mode & stat.S_IWGRP) and not _is_own_group(found.st_gid)


def _is_own_group(gid: int) -> bool:
    import grp
    import pwd

    try:
        group, user = grp.getgrgid(gid), pwd.getpwuid(os.getuid())
    except KeyError:
        return False
    return group.gr_name == user.pw_name and set(group.gr_mem) <= {user.pw_name}
