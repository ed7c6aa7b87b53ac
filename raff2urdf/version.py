"""The version of the installed distribution, which holds raff2urdf and cinegen."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def installed_version() -> str:
    """Return the version, or `0+unknown` where the packages are run from their sources."""
    try:
        return version("cinegen")
    except PackageNotFoundError:
        return "0+unknown"
