"""Public names of a package that are imported when they are first used."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from importlib import import_module

# Only what Python has imported by itself, or nearly: this runs before a command can handle Ctrl-C.
_PUBLIC = re.compile(r"^\s*from ([\w.]+) import (\w+) as \2$", re.MULTILINE)
_DUNDER = re.compile("__.*__$")


def lazy_names(package: str) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """Return `__all__`, `__getattr__` and `__dir__` of a package that imports its public names lazily.

    The public names are those that the package's source imports as `from module import name as name`: below
    `if TYPE_CHECKING:`, where type checkers find them, or, if that can't wait, at its top.

    Args:
        package: its `__name__`.
    """
    module = sys.modules[package]
    try:
        with open(str(module.__file__).removesuffix("c"), encoding="utf-8") as file:
            source = file.read()
    except OSError:
        message = f"{package} is installed without its source, which lists its public names"
        raise ImportError(message, name=package) from None
    homes = {name: home for home, name in _PUBLIC.findall(source)}

    def get(name: str) -> object:
        if f"{package}.{name}" in homes.values():
            return import_module(f"{package}.{name}")
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(homes[name]), name)
        setattr(module, name, value)
        return value

    return sorted(homes), get, lambda: sorted({*homes, *filter(_DUNDER.match, vars(module))})
