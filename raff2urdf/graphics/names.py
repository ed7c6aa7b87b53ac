"""Find the graphics that a robot's file names. Which of them may be read is decided here alone.

    package://robot/meshes/arm.stl    in the ROS package or the Gazebo model of that name
    model://robot/meshes/arm.stl
    package:///arm.stl, arm.stl       relative to the file's folder
    file:///home/me/arm.stl

A file from elsewhere must not have any file of the user shown. A graphic file is read if it is

- at the home of the robot's file: in the package around it (a folder with package.xml, manifest.xml or model.config),
  or without one in the file's own folder and the folder above, as `../meshes` requires;
- in a package of the name that it states: a folder around the file, or next to one of these, that holds such a mark;
  without a mark a folder at home, or one of the three above the file's own;
- in a package in ROS_PACKAGE_PATH, AMENT_PREFIX_PATH, GAZEBO_MODEL_PATH or GZ_SIM_RESOURCE_PATH;
- in a folder of RAFF2URDF_MESH_PATH, or was converted into the user's cache.

The root, the user's home folder and those above it, and folders for temporary files are no packages, and are not read
for being above the file's own folder. A symbolic link counts as the file to which it leads, except in packages that
these variables name: `colcon build --symlink-install` makes them of links.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

from raff2urdf.errors import RaffError

ALLOWED = "RAFF2URDF_MESH_PATH"
"""Environment variable with folders, separated as in PATH, in which graphics may be anywhere."""

LARGEST_MESH = 512_000_000  # bytes

_SEARCHED = ("ROS_PACKAGE_PATH", "GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH")
_MARKS = ("package.xml", "model.config", "manifest.xml")  # a folder with one of them is a package or a model
_LAYERS = 3  # folders of a package without a mark, between it and a robot's file: robots/arm/urdf
_POINTER = b"version https://git-lfs.github.com/spec/"


class _Candidate(NamedTuple):
    path: Path
    root: Path
    follows_links: bool = False  # out of the root


def find(name: str, folder: Path, owner: Path | None = None) -> Path:
    """Return the file that a name refers to.

    Args:
        name: in the robot's description.
        folder: of the description.
        owner: folder of the recording or map that holds the description, and states its folder; None unless there is
            one. It has no access to other folders.

    Raises:
        RaffError: there is no such file, it is elsewhere than in the folders that may be read, it is too large, or a
            pointer of Git LFS.
    """
    label, refused = f"mesh '{name}'", None
    if owner is not None:
        _check_place(folder, home_of(owner), label)
    candidates = list(_candidates(name, folder))
    for path, root, follows_links in candidates:
        try:
            _check_place(path, root, label, follows_links)
        except RaffError as error:
            refused = refused or error
        else:
            if os.path.isfile(path):
                _check_content(path, label)
                return Path(os.path.abspath(path))
    raise refused or RaffError(f"{label} is not found: there is no file {os.path.abspath(candidates[0].path)}")


def check_mesh(path: Path, folder: Path, label: str) -> None:
    """Refuse a file that another one names by a path, unless it may be read.

    Args:
        path: of a file.
        folder: of the file that names it.
        label: the file, in errors.

    Raises:
        RaffError: it is elsewhere than in the folders that may be read, it is too large, or a pointer of Git LFS.
        OSError: it can't be read.
    """
    _check_place(path, home_of(folder), label)
    _check_content(path, label)


def may_read(path: Path, folder: Path) -> bool:
    """Return whether a file in a folder may name a graphic file by its path."""
    try:
        _check_place(path, home_of(folder), "")
    except RaffError:
        return False
    return True


def home_of(folder: Path) -> Path:
    """Return the folder that a file of this folder may name other files of: the package, or else the folder above."""
    absolute = Path(os.path.abspath(folder))
    marked = (above for above in (absolute, *absolute.parents) if _is_marked(above))
    return next(marked, absolute if _is_shared(absolute.parent) else absolute.parent)


def cache_folder() -> Path | None:
    """Return the user's cache, `~/.cache/raff2urdf` unless XDG_CACHE_HOME names another; None without a home folder."""
    configured = os.environ.get("XDG_CACHE_HOME", "")
    try:
        # The XDG base directory specification: a relative one is invalid, to be ignored.
        home = Path(configured) if os.path.isabs(configured) else Path.home() / ".cache"
    except RuntimeError:
        return None
    return home / "raff2urdf"


def _check_place(path: Path, root: Path, label: str, follows_links: bool = False) -> None:
    real = Path(os.path.abspath(path) if follows_links else os.path.realpath(path))
    if not any(real.is_relative_to(os.path.realpath(one)) for one in (root, *_entries(ALLOWED), cache_folder()) if one):
        where = real if os.path.isdir(real) else real.parent
        raise RaffError(
            f"{label} leads out of {root}, to {real}: copy the file, or allow its folder by the "
            f"environment variable {ALLOWED}={where}"
        )


def _check_content(path: Path, label: str) -> None:
    if (size := path.stat().st_size) > LARGEST_MESH:
        raise RaffError(f"{label} has {size / 1e6:.0f} MB, and is not read: the most is {LARGEST_MESH / 1e6:.0f} MB")
    if is_pointer(path):
        raise RaffError(f"{label} is a Git LFS pointer: run `git lfs pull` in {path.absolute().parent}")


def is_pointer(path: Path) -> bool:
    """Return whether a file is what Git LFS puts in the place of one that it has not downloaded."""
    with open(path, "rb") as file:
        return file.read(len(_POINTER)) == _POINTER


def _candidates(name: str, folder: Path) -> Iterator[_Candidate]:
    """Yield where a file of that name may be, the likeliest place first.

    Raises:
        RaffError: there is no such package, or no such scheme.
    """
    scheme, found, rest = name.partition("://")
    if not found or scheme == "file":
        yield _Candidate(_joined(folder, unquote(rest) if found else name), home_of(folder))
    elif scheme not in ("package", "model"):
        raise RaffError(f"mesh '{name}': '{scheme}://' can't be read: name a file")
    elif rest.startswith("/"):
        yield from _candidates(rest[1:], folder)
    else:
        package, _, inner = rest.partition("/")
        roots = list(_packages(package, folder))
        if not roots:
            hint = "add its parent folder to ROS_PACKAGE_PATH"
            raise RaffError(f"mesh '{name}': the package '{package}' is not found: {hint}")
        yield from (_Candidate(_joined(root, inner), root, named) for root, named in roots)


def _joined(folder: Path, name: str) -> Path:
    return folder / name.replace("\0", "�")  # which no name of a file may contain


def _packages(package: str, folder: Path) -> Iterator[tuple[Path, bool]]:
    """Yield the folders that may be the package of that name, and whether the environment names them."""
    if package in ("..", "."):
        return
    absolute, home = Path(os.path.abspath(folder)), home_of(folder)
    for height, above in enumerate((absolute, *absolute.parents)):
        if above.name == package and (_is_marked(above) or (height <= _LAYERS and not _is_shared(above))):
            yield above, False
        beside = above / package
        if beside.is_dir() and (_is_marked(beside) or beside.is_relative_to(home)):
            yield beside, False
    for entry in (Path(entry) for variable in _SEARCHED for entry in _entries(variable)):
        yield from ((root, True) for root in (entry / package, entry) if root.name == package and root.is_dir())
    for root in (Path(entry) / "share" / package for entry in _entries("AMENT_PREFIX_PATH")):
        if root.is_dir():
            yield root, True


def _entries(variable: str) -> list[str]:
    return [entry for entry in os.environ.get(variable, "").split(os.pathsep) if entry]


def _is_marked(folder: Path) -> bool:
    return any((folder / mark).is_file() for mark in _MARKS) and not _is_shared(folder)


def _is_shared(folder: Path) -> bool:
    """Return whether a folder holds what does not belong together: the root, the home folder and those above it, and
    folders in which everybody may write files of their own, such as /tmp."""
    real = Path(os.path.realpath(folder))
    if real == real.parent or Path(os.path.realpath(os.path.expanduser("~"))).is_relative_to(real):
        return True
    try:
        return bool(real.stat().st_mode & stat.S_ISVTX)
    except OSError:
        return True
