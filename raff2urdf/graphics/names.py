"""Find the graphics that a URDF, an SDF or an MJCF names.

    package://robot/meshes/arm.stl    in the ROS package of that name: a folder around the file's own folder, or next
    model://robot/meshes/arm.stl      to one of these, or in ROS_PACKAGE_PATH, AMENT_PREFIX_PATH or GAZEBO_MODEL_PATH
    package:///arm.stl, arm.stl       relative to the file's folder
    file:///home/me/arm.stl

A file from elsewhere must not make programs read arbitrary files: a name must not lead out of its package, nor out of
the folder above the file's own (so that `../meshes` is allowed), or out of the ROS package or Gazebo model around it.
Nor must a symbolic link, unless it leads into one of the folders in RAFF2URDF_MESH_PATH.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

from raff2urdf.errors import RaffError
from raff2urdf.files import note

ALLOWED = "RAFF2URDF_MESH_PATH"
"""Environment variable with folders, separated as in PATH, into which symbolic links may lead."""

LARGEST_MESH = 512_000_000  # bytes

_SEARCHED = ("ROS_PACKAGE_PATH", "GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH")
_MARKS = ("package.xml", "model.config", "manifest.xml")  # a folder with one of them is a package or a model


def find(name: str, folder: Path) -> Path:
    """Return the file that a name refers to.

    Args:
        name: in the robot's description.
        folder: of the description.

    Raises:
        RaffError: there is no such file, or the name leads out of the folders that may be read.
    """
    scheme, found, rest = name.partition("://")
    if not found or scheme == "file":
        root = home_of(folder)
        candidates = [(_inside(folder / (unquote(rest) if found else name), root, name), root)]
    elif scheme in ("package", "model"):
        package, _, inner = rest.partition("/")
        if not package:
            return find(inner, folder)
        roots = list(_packages(package, folder))
        if not roots:
            raise RaffError(
                f"mesh '{name}': the package '{package}' is not found: add its parent folder to ROS_PACKAGE_PATH"
            )
        candidates = [(_inside(root / inner, root, name), root) for root in roots]
    else:
        raise RaffError(f"mesh '{name}': '{scheme}://' can't be read: name a file")
    for path, root in candidates:
        note(path)
        if path.is_file():
            check_mesh(path, root, f"mesh '{name}'")
            return path
    raise RaffError(f"mesh '{name}' is not found: there is no file {candidates[0][0]}")


def check_mesh(path: Path, root: Path, label: str) -> None:
    """Refuse a mesh that is too large, or to which a name or a symbolic link leads out of a folder.

    Args:
        path: of a file.
        root: the folder in which it must be, or else in one of those that the environment allows.
        label: the file, in errors.

    Raises:
        RaffError: it is refused.
    """
    note(path)
    real = Path(os.path.realpath(path))
    allowed = [str(root), *filter(None, os.environ.get(ALLOWED, "").split(os.pathsep))]
    if not any(real.is_relative_to(os.path.realpath(one)) for one in allowed):
        raise RaffError(
            f"{label} leads out of {root}, to {real}: copy the file, or allow its folder by the "
            f"environment variable {ALLOWED}={real.parent}"
        )
    if (size := real.stat().st_size) > LARGEST_MESH:
        raise RaffError(f"{label} has {size / 1e6:.0f} MB, and is not read: the most is {LARGEST_MESH / 1e6:.0f} MB")


def _packages(package: str, folder: Path) -> Iterator[Path]:
    """Yield folders that may be the package of that name."""
    if package in ("..", "."):
        return
    absolute = Path(os.path.abspath(folder))
    for above in (absolute, *absolute.parents):
        if above.name == package:
            yield above
        if (above / package).is_dir():
            yield above / package
    for variable in _SEARCHED:
        for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            for root in (Path(entry) / package, Path(entry)):
                if root.name == package and root.is_dir():
                    yield root
    for entry in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        if (Path(entry) / "share" / package).is_dir():
            yield Path(entry) / "share" / package


def home_of(folder: Path) -> Path:
    """Return the folder that names in a file of this folder must not leave."""
    absolute = Path(os.path.abspath(folder))
    for above in (absolute, *absolute.parents):
        if any((above / mark).is_file() for mark in _MARKS):
            return above
    return absolute.parent


def _inside(path: Path, root: Path, name: str) -> Path:
    plain = Path(os.path.abspath(path))
    if not plain.is_relative_to(os.path.abspath(root)):
        raise RaffError(f"mesh '{name}' leads out of {root}: only files in it are read")
    return plain
