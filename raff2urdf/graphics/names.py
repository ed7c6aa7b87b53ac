"""Find the graphics that a robot's file names. Which of them may be read is decided here alone.

    package://robot/meshes/arm.stl    in the ROS package or the Gazebo model of that name
    model://robot/meshes/arm.stl
    package:///arm.stl, arm.stl       relative to the file's folder
    file:///home/me/arm.stl
    solid://plate/0.45,1.7,...        a solid of `raff2urdf.graphics.solids`, which is no file

A file from elsewhere must not have any file of the user shown. A graphic file is read if it is

- at the home of the robot's file: in the package around it (a folder with package.xml, manifest.xml or model.config),
  or without one in the file's own folder and the folder above, as `../meshes` requires;
- in a package of the name that it states, see `Packages`: one that the user names (`--package`); a folder around the
  file, next to one of these, or in or next to its repository, that holds such a mark; without a mark a folder at home,
  or one of the three above the file's own;
- in a package in ROS_PACKAGE_PATH, AMENT_PREFIX_PATH, GAZEBO_MODEL_PATH or GZ_SIM_RESOURCE_PATH;
- in a folder of RAFF2URDF_MESH_PATH, or was converted into the user's cache.

The root, the user's home folder and those above it, and folders for temporary files are no packages, and are not read
for being above the file's own folder. A symbolic link counts as the file to which it leads, except in packages that
these variables name: `colcon build --symlink-install` makes them of links.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple
from urllib.parse import unquote

from raff2urdf.errors import RaffError
from raff2urdf.escape import shell_word
from raff2urdf.files import note
from raff2urdf.graphics.solids import SCHEME, stl_of

ALLOWED = "RAFF2URDF_MESH_PATH"
"""Environment variable with folders, separated as in PATH, in which graphics may be anywhere."""

LARGEST_MESH = 512_000_000  # bytes
_LARGEST_MARK = 100_000  # bytes of a package.xml in which its name is looked for

_SEARCHED = ("ROS_PACKAGE_PATH", "GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH")
_MARKS = ("package.xml", "model.config", "manifest.xml")  # a folder with one of them is a package or a model
_NO_PACKAGES = ("", ".", "..")
_LAYERS = 3  # folders of a package without a mark, between it and a robot's file: robots/arm/urdf
_DEEP = 3  # folders down from the one in which a repository is, to a package: arms/robots/arm_description
_MOST_FOLDERS = 5000  # that are searched for packages
_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
_POINTER = b"version https://git-lfs.github.com/spec/"


class MissingFileError(RaffError):
    """There is no file of a name: neither one that may be read, nor one that may not."""


class _Candidate(NamedTuple):
    path: Path
    root: Path
    follows_links: bool = False  # out of the root


class Packages:
    """The search for ROS packages and Gazebo models, by name.

    A package is searched, in this order:

    - in the folder that the user gives;
    - around the file that names it, and next to one of the folders around it;
    - in the environment: ROS_PACKAGE_PATH, GAZEBO_MODEL_PATH, GZ_SIM_RESOURCE_PATH, AMENT_PREFIX_PATH;
    - below the folder three above the file's package, then below the one that holds its repository (a folder with
      .git): `_DEEP` folders down.

    Its name is its folder's, or the one in its package.xml, as if the repository was cloned under another name.

    Args:
        folders: by the name of the package.
        can_be_given: whether an error may propose that.
    """

    def __init__(self, folders: Mapping[str, Path] = MappingProxyType({}), can_be_given: bool = True) -> None:
        self.folders, self.can_be_given = dict(folders), can_be_given
        self._below: dict[Path, dict[str, list[Path]]] = {}

    def find(self, package: str, folder: Path) -> Path:
        """Return the folder of a package.

        Args:
            package: its name.
            folder: of the file that names it.

        Raises:
            RaffError: it is not found.
        """
        for root, _ in self.candidates(package, folder):
            return root
        raise MissingFileError(self.missing(package))

    def missing(self, package: str) -> str:
        """Return the error for a package that is not found."""
        if package in _NO_PACKAGES:
            return f"'{package}' is not found: it is no name of a package"
        where = self.folders.get(package)
        if where is not None:
            return f"it is not in {where}, the folder of the package '{package}'"
        remedy = "add the folder above it to ROS_PACKAGE_PATH"
        if self.can_be_given:
            option = f"--package {shell_word(f'{package}=FOLDER')} (in Python packages={{{package!r}: FOLDER}})"
            remedy = f"name its folder by {option}, or {remedy}"
        return f"the package '{package}' is not found: {remedy}"

    def candidates(self, package: str, folder: Path) -> Iterator[tuple[Path, bool]]:
        """Yield the folders that may be the package of that name, and whether the user names them."""
        if package in self.folders:
            yield self.folders[package], True
        if package in self.folders or package in _NO_PACKAGES:
            return
        absolute, home = Path(os.path.abspath(folder)), home_of(folder)
        for height, above in enumerate((absolute, *absolute.parents)):
            near = above.name == package and height <= _LAYERS and not _is_shared(above)
            if near or (_is_marked(above) and package in _names(above)):
                yield above, False
            beside = above / package
            if beside.is_dir() and (_is_marked(beside) or beside.is_relative_to(home)):
                yield beside, False
        yield from ((root, True) for root in _in_environment(package))
        for top in _tops(home):
            if top not in self._below:
                self._below[top] = _marked_below(top)
            yield from ((root, False) for root in self._below[top].get(package, ()))


def _in_environment(package: str) -> Iterator[Path]:
    """Yield the folders of a package that environment variables name."""
    for entry in (Path(entry) for variable in _SEARCHED for entry in _entries(variable)):
        for root in (entry / package, entry):
            if root.is_dir() and package in _names(root):
                yield root
    for root in (Path(entry) / "share" / package for entry in _entries("AMENT_PREFIX_PATH")):
        if root.is_dir():
            yield root


def _tops(home: Path) -> list[Path]:
    """Return the folders below which packages are searched, for a file's home; the nearest first."""
    around: list[Path] = []
    beside: list[Path] = []
    for above in (home, *home.parents):
        if _is_shared(above):
            break
        around.append(above)
        if (above / ".git").exists():
            beside += [] if _is_shared(above.parent) else [above.parent]
            break
    return [*around[: _LAYERS + 1][-1:], *beside]


def _marked_below(top: Path) -> dict[str, list[Path]]:
    """Return the packages at most `_DEEP` folders below a folder, by name."""
    packages: dict[str, list[Path]] = {}
    level, seen = [top], 0
    for _ in range(_DEEP + 1):
        below: list[Path] = []
        for folder in level:
            seen += 1
            if seen > _MOST_FOLDERS:
                return packages
            if _is_marked(folder):
                for name in _names(folder):
                    packages.setdefault(name, []).append(folder)
            try:
                with os.scandir(folder) as entries:
                    inner = [e.name for e in entries if e.name[0] != "." and e.is_dir(follow_symlinks=False)]
            except OSError:
                continue
            below += [folder / name for name in sorted(inner)]
        level = below
    return packages


def _names(folder: Path) -> set[str]:
    """Return the names of a package: its folder's, and the one that its package.xml states."""
    try:
        with open(folder / _MARKS[0], encoding="utf-8", errors="replace") as file:
            stated = _NAME.search(file.read(_LARGEST_MARK))
    except OSError:
        stated = None
    return {folder.name, *([] if stated is None else [stated[1]])}


def find(name: str, folder: Path, owner: Path | None = None, packages: Packages | None = None) -> Path:
    """Return the file that a name refers to.

    Args:
        name: in the robot's description.
        folder: of the description.
        owner: folder of the recording or map that holds the description, and states its folder; None unless there is
            one. It has no access to other folders.
        packages: the search for packages.

    Raises:
        RaffError: there is no such file, it is elsewhere than in the folders that may be read, it is too large, or a
            pointer of Git LFS.
    """
    scheme, _, recipe = name.partition("://")
    if scheme == SCHEME:
        from raff2urdf.graphics.meshes import keep

        return keep(stl_of(recipe), ".stl")
    label, refused, first = f"mesh '{name}'", None, None
    if owner is not None:
        _check_place(folder, home_of(owner), label)
    for path, root, follows_links in _candidates(name, folder, packages or Packages()):
        first = first or path
        try:
            _check_place(path, root, label, follows_links)
        except RaffError as error:
            refused = refused or error
        else:
            note(path)
            if os.path.isfile(path):
                _check_content(path, label)
                return Path(os.path.abspath(path))
    raise refused or MissingFileError(f"{label} is not found: there is no file {os.path.abspath(first or name)}")


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
    note(path)
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
    if not any(real.is_relative_to(os.path.realpath(top)) for top in (root, *_entries(ALLOWED), cache_folder()) if top):
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


def _candidates(name: str, folder: Path, packages: Packages) -> Iterator[_Candidate]:
    """Yield where a file of that name may be, the likeliest place first.

    Raises:
        RaffError: there is no such package, or no such scheme.
    """
    scheme, mark, rest = name.partition("://")
    if not mark or scheme == "file":
        yield _Candidate(_joined(folder, unquote(rest) if mark else name), home_of(folder))
    elif scheme not in ("package", "model"):
        raise RaffError(f"mesh '{name}': '{scheme}://' can't be read: name a file")
    elif rest.startswith("/"):
        yield from _candidates(rest[1:], folder, packages)
    else:
        package, _, inner = rest.partition("/")
        missing = True
        for root, named in packages.candidates(package, folder):
            missing = False
            yield _Candidate(_joined(root, inner), root, named)
        if missing:
            raise MissingFileError(f"mesh '{name}': {packages.missing(package)}")


def _joined(folder: Path, name: str) -> Path:
    return folder / name.replace("\0", "�")  # which no name of a file may contain


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
