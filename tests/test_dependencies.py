"""What is imported is declared, what is declared is imported and pinned, and modules of one system are optional."""

import ast
import re
import sys
import tomllib
from collections import Counter
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
OWN = {"cinegen", "raff2urdf"}
SHIPPED = ROOT / "raff2urdf" / "shipped.py"
POSIX = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
UNTOLD = {"pinocchio": {"pin"}, "coal": {"coal"}}
"""Distributions of packages whose metadata don't name them: cmeel puts them in a folder of its own."""

EXTRAS = ("plot", "maps", "cluster", "mjcf", "xacro", "dxf", "robots", "film", "sampling", "https", "pink")


installed = cache(packages_distributions)


@cache
def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def normal(name: str) -> str:
    """A distribution's name without version, as package indexes compare them."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", name)[0]).lower()


def required() -> set[str]:
    return {normal(entry) for entry in project()["dependencies"]}


def optional(*extras: str) -> set[str]:
    entries = {entry for extra in extras for entry in project()["optional-dependencies"][extra]}
    return {normal(entry) for entry in entries if not entry.startswith("cinegen[")}


def imported(path: Path, indent: str = r"[ \t]*") -> list[str]:
    """Modules that a file imports, on lines with such an indentation: parsing a thousand files takes half a minute."""
    text = path.read_text(encoding="utf-8")
    pairs = re.findall(
        rf"^{indent}(?:from ([A-Za-z_][\w.]*) import\b|import ([\w., ]+?) *(?:[#;].*)?$)", text, re.MULTILINE
    )
    return [name.split()[0] for pair in pairs for name in "".join(pair).split(",")]


@cache
def imports(*folders: str) -> dict[str, set[str]]:
    """For each top-level package that files of these folders import, those files."""
    importers: dict[str, set[str]] = {}
    for path in (path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))):
        for name in imported(path):
            importers.setdefault(name.split(".")[0], set()).add(str(path.relative_to(ROOT)))
    return {name: files for name, files in importers.items() if name not in sys.stdlib_module_names | OWN}


@cache
def distributions(package: str) -> frozenset[str]:
    """Those that a package may come from."""
    return frozenset(map(normal, UNTOLD.get(package) or installed().get(package) or {package}))


def undeclared(importers: dict[str, set[str]], declared: set[str]) -> dict[str, list[str]]:
    return {package: sorted(files) for package, files in importers.items() if not distributions(package) & declared}


def test_what_the_packages_import_is_declared():
    assert undeclared(imports(*OWN), required() | optional(*EXTRAS)) == {}


def test_what_the_tests_import_is_declared():
    folders = ("tests", "examples", "benchmarks", "docs")
    local = {path.stem for folder in folders for path in (ROOT / folder).rglob("*.py")}
    local |= {path.parent.name for folder in ("tests", "ros2") for path in (ROOT / folder).rglob("__init__.py")}
    importers = {package: files for package, files in imports("tests").items() if package not in local}
    assert undeclared(importers, required() | optional("test", *EXTRAS)) == {}


def test_what_is_declared_is_imported():
    used = set().union(*(distributions(package) for package in imports(*OWN)))
    read = {name for name in optional("robots") if f'distribution("{name}")' in SHIPPED.read_text(encoding="utf-8")}
    assert (required() | optional(*EXTRAS)) - used - read == set()


def test_the_core_requires_nothing_that_an_extra_installs():
    assert required() & optional(*EXTRAS) == set()


def test_the_extra_all_is_every_extra():
    (everything,) = project()["optional-dependencies"]["all"]
    named = set(re.search(r"\[(.*)\]", everything)[1].split(","))
    assert named == set(EXTRAS) - {"maps"}  # which cluster includes
    assert set(project()["optional-dependencies"]) == {*EXTRAS, "all", "test"}


def pinned(*locks: str) -> set[str]:
    text = "\n".join((ROOT / "requirements" / f"{lock}.txt").read_text(encoding="utf-8") for lock in locks)
    return {normal(line) for line in text.splitlines() if "==" in line}


def test_what_is_declared_is_pinned():
    assert required() | {"hatchling"} <= pinned("core")
    assert optional("test", *EXTRAS) <= pinned("core", "test")
    assert pinned("core") & pinned("test") == set()


@pytest.mark.parametrize("lock", sorted((ROOT / "requirements").iterdir()), ids=lambda path: path.name)
def test_every_pin_has_hashes_and_none_names_where_it_comes_from(lock):
    text = lock.read_text(encoding="utf-8").replace(" \\\n", "")
    assert all(re.fullmatch(r"[a-z0-9-]+==[\w.]+( +--hash=sha256:[0-9a-f]{64})+", line) for line in text.splitlines())


def test_locked_packages_are_installed_by_their_hashes():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert re.search(r"^LOCKED := .*--require-hashes", makefile, re.MULTILINE)
    installing = [line for line in makefile.splitlines() if "-r requirements/" in line and "audit" not in line]
    assert len(installing) >= 5
    assert all("$(LOCKED)" in line or "$(INSTALL)" in line for line in installing if "patsubst" not in line)


@pytest.mark.parametrize("package", ["lxml", "umsgpack"])
def test_an_import_that_is_not_declared_is_found(package):
    declared = (required() | optional(*EXTRAS)) - distributions(package)
    assert set(undeclared(imports(*OWN), declared)) == {package}


def test_modules_that_not_every_system_has_are_imported_where_that_may_fail():
    files = [path for folder in OWN for path in sorted((ROOT / folder).rglob("*.py"))]
    unguarded = [f"{path.relative_to(ROOT)}: {name}" for path in files for name in imported(path, "") if name in POSIX]
    assert unguarded == []


# --- sizes of modules -------------------------------------------------------------------------------------------------
# No folder of the packages is longer than a page, no file longer than a walk through it, no function than a screen.
#
# Complexity is bounded by ruff (C901, `tool.ruff.lint.mccabe` in pyproject.toml).


FOLDER, FILE, FUNCTION = 25, 400, 60
"""Modules of a folder, lines of a file, lines of a function without its docstring."""


@pytest.fixture(scope="module")
def modules(root):
    """All modules of both packages, relative to the clone, with their texts."""
    paths = (path for package in ("cinegen", "raff2urdf") for path in (root / package).rglob("*.py"))
    return {path.relative_to(root): path.read_text(encoding="utf-8") for path in paths}


def test_a_folder_is_read_at_a_glance(modules):
    counts = Counter(path.parent for path in modules)
    assert {folder: count for folder, count in counts.items() if count > FOLDER} == {}


def test_a_file_is_one_module_and_not_two(modules):
    assert {path.as_posix() for path, text in modules.items() if text.count("\n") > FILE} == set()


def test_a_function_is_one_idea(modules):
    too_long = {}
    for path, text in modules.items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                described = node.body[0].end_lineno - node.body[0].lineno + 1 if ast.get_docstring(node) else 0
                if node.end_lineno - node.lineno + 1 - described > FUNCTION:
                    too_long[f"{path}: {node.name}"] = node.end_lineno - node.lineno + 1 - described
    assert {name for name in too_long if "cinegen/proof/" not in name} == set()
