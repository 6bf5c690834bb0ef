"""Whose folder is it? Machine code is run unseen, so nobody else may have written it.

As secure shells ask it of their keys: a folder and all above it belong to this user or to the
system's, and others can put nothing there. Where others may write, as in `/tmp`, but can
neither rename nor remove what is not theirs (the sticky bit), what lies below is asked.
"""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

if sys.platform != "win32":
    import grp
    import pwd

_SYSTEM = 0  # uid


def only_ours_beneath(folder: Path) -> bool:
    """Tell whether nobody but this user and the system can put a file into a folder.

    One that is not there yet is asked for what it would be made in.
    """
    if sys.platform == "win32":  # a profile's folders are its user's there
        return True
    place = Path(os.path.realpath(folder))
    try:
        if place.exists() and not is_ours(place.stat()):
            return False
        return all(_is_kept(above.stat()) for above in place.parents if above.exists())
    except OSError:
        return False


def is_ours(state: os.stat_result) -> bool:
    """Tell whether a file or folder is this user's or the system's, and others cannot write it."""
    if sys.platform == "win32":
        return True
    if state.st_uid not in (os.geteuid(), _SYSTEM) or state.st_mode & stat.S_IWOTH:
        return False
    return not state.st_mode & stat.S_IWGRP or _is_alone_in(state.st_gid)


def _is_kept(state: os.stat_result) -> bool:
    """Tell whether nobody else can put another folder in the place of one that is in this one."""
    if state.st_mode & stat.S_ISVTX:
        return state.st_uid in (os.geteuid(), _SYSTEM)
    return is_ours(state)


def _is_alone_in(group: int) -> bool:
    """Tell whether a group is this user's own, as many systems make one for each user."""
    try:
        user, known = pwd.getpwuid(os.geteuid()), grp.getgrgid(group)
    except KeyError:
        return False
    return known.gr_name == user.pw_name and set(known.gr_mem) <= {user.pw_name}
