"""Check that no other user may write the cache: machine code that is loaded from there runs as the user."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from cinegen.errors import CinegenError
from raff2urdf.escape import shell_word

_FOLDER = "NUMBA_CACHE_DIR"
"""Environment variable that names another folder of numba's cache."""


def check_private(path: Path, source: Path) -> None:
    """Refuse a folder or file of the cache that other users may write, or replace by write access to a parent folder.

    The user, root and who owns the source may write it: they can change the code anyway. So may a group of which the
    user is the only member. A parent with the sticky bit keeps others from replacing what is in it. Parents of the
    source are left out, since there others can replace the source; owners of parents, since a container may show root's
    as another user's.

    Args:
        path: folder or file; one that does not exist is no fault.
        source: the kernel's source.

    Raises:
        CinegenError: others may write it; with the command that mends it.
    """
    if not hasattr(os, "geteuid"):
        return
    try:
        entry, owner = path.stat(), source.stat().st_uid
    except OSError:
        return
    folder = path if stat.S_ISDIR(entry.st_mode) else path.parent
    named = shell_word(str(folder))
    instead = f"or name a folder of your own: export {_FOLDER}=~/.cache/cinegen-kernels"
    if entry.st_uid not in (os.geteuid(), 0, owner):
        raise CinegenError(
            f"{path}: compiled kernels are not loaded from there, since it belongs to another user, who could run code "
            f"as you: rm -r {named}, {instead}"
        )
    if _is_open(entry):
        raise CinegenError(
            f"{path}: compiled kernels are not loaded from there, since other users may write it and could run code as "
            f"you: chmod -R go-w {named}, {instead}"
        )
    for parent in (*folder.absolute().parents, *folder.resolve().parents):
        above, is_of_source = parent.stat(), parent in source.resolve().parents
        if _is_open(above) and not above.st_mode & stat.S_ISVTX and not is_of_source:
            raise CinegenError(
                f"{path}: compiled kernels are not loaded from there, since other users may write {parent}, replace it "
                f"and run code as you: chmod go-w {shell_word(str(parent))}, {instead}"
            )


def _is_open(entry: os.stat_result) -> bool:
    """Return whether other users may write a folder or file."""
    return bool(entry.st_mode & stat.S_IWOTH or (entry.st_mode & stat.S_IWGRP and not _is_own_group(entry.st_gid)))


def _is_own_group(group: int) -> bool:
    """Return whether the user is the only member of a group, as of the one that many systems give to each user."""
    import grp
    import pwd

    try:
        name = pwd.getpwuid(os.geteuid()).pw_name
        members = {*grp.getgrgid(group).gr_mem, *(user.pw_name for user in pwd.getpwall() if user.pw_gid == group)}
    except KeyError:
        return False
    return members <= {name}
