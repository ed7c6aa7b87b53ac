"""The robots of the repository, each loaded once in a process, and one of each kind of them."""

import importlib.util
import sys
import warnings
from functools import cache
from types import ModuleType

import pytest
from elementary import ROBOTS, document
from variants import FEWER

import cinegen

EVERY = [
    pytest.param(name, robot.name, id=f"{name}-{robot.name}")
    for name in sorted(path.stem for path in ROBOTS.glob("*.raff"))
    for robot in document(name).robots
]
"""All robots of the repository, by file and name."""

one_of_each_kind = pytest.mark.parametrize(("name", "which"), [param for param in EVERY if param.values[0] in FEWER])


@cache
def load(name: str, which: str | None = None) -> cinegen.Mechanism:
    """A robot of the repository; none of them loads with a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        return cinegen.load(ROBOTS / f"{name}.raff", which)


def module_of(path: str) -> ModuleType:
    """Import a file of the repository that belongs to no package."""
    spec = importlib.util.spec_from_file_location(path.removesuffix(".py").replace("/", "_"), ROBOTS.parent / path)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
