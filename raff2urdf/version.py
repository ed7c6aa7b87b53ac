"""The version of the installed distribution, which holds raff2urdf and cinegen."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("cinegen")
except PackageNotFoundError:  # run from its sources
    __version__ = "0+unknown"
