"""Optional packages: cinegen's extras install them; where one is missing, the error names the command to install it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from raff2urdf.errors import RaffError


class MissingExtraError(RaffError):
    """A package of an extra is not installed; the message ends with the command that installs it."""


@contextmanager
def needs(extra: str, purpose: str) -> Iterator[None]:
    """Report packages that can't be imported within the block by the extra that installs them.

    Args:
        extra: its name in pyproject.toml.
        purpose: what needs the package: the beginning of the message, a plural.

    Raises:
        MissingExtraError: a package is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        raise MissingExtraError(f"{purpose} need the package {package}: {install(extra)}") from None


def install(extra: str) -> str:
    """Return the command that installs an extra into this environment, whether cinegen is there from a wheel or from a
    clone: pip finds that cinegen is installed, and installs only what is missing."""
    pip = "pip" if find_spec("pip") else f"python3 -m pip --python {sys.executable}"  # not all environments have one
    return f'{pip} install "cinegen[{extra}]"'
