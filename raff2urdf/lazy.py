"""Public names of a package that are imported when they are first used."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.abc import InspectLoader


def lazy_names(package: str) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """Return `__all__`, `__getattr__` and `__dir__` of a package that imports its public names lazily.

    The public names are those that the package's source imports as `from module import name as name`: below
    `if TYPE_CHECKING:`, where type checkers find them, or, if that can't wait, at its top.

    Args:
        package: its `__name__`.
    """
    module = sys.modules[package]
    loader = module.__loader__
    source = loader.get_source(package) if isinstance(loader, InspectLoader) else None
    if source is None:
        raise ImportError(f"{package} is installed without its source, which lists its public names", name=package)
    homes = {
        alias.name: str(node.module)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == alias.name
    }

    def get(name: str) -> object:
        if f"{package}.{name}" in homes.values():
            return import_module(f"{package}.{name}")
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(homes[name]), name)
        setattr(module, name, value)
        return value

    return sorted(homes), get, lambda: sorted({*vars(module), *homes})
