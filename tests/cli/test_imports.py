"""Nobody waits for what a call does not need: `import cinegen` and every `--help` import nothing that computes."""

import json
import subprocess
import sys

import pytest

import cinegen
from cinegen.cli import app
from cinegen.cli.exports.export import FORMATS
from cinegen.cli.study.map import QUANTITIES
from cinegen.mission import FORMATS as FORMATS_OF_MISSIONS
from cinegen.workspace.quantities import QUANTITIES as QUANTITIES_OF_MAPS

LIGHT = {
    "__main__", "annotated_doc", "annotated_types", "attr", "cinegen", "cmeel_pth", "markdown_it", "mdurl", "pydantic",
    "pydantic_core", "pygments", "raff2urdf", "rich", "shellingham", "typer", "typing_extensions", "typing_inspection",
}  # fmt: skip
"""What the library of command lines needs."""

COMMANDS = [command.name for command in app.registered_commands]

# Several calls in one process, since each only adds modules; the first that adds a heavy one is named.
PROGRAM = """
import contextlib, io, json, sys
import cinegen
found = {"import cinegen": sorted(sys.modules)}
dir(cinegen), cinegen.__version__, cinegen.CinegenError
found["names of cinegen"] = sorted(sys.modules)
from cinegen.cli import main
for words in json.loads(sys.argv[1]):
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        main(words)
    found["cinegen " + " ".join(words)] = sorted(sys.modules)
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def imported(root):
    """The packages that are imported after each of several calls in one process."""
    calls = [["--version"], ["--help"], [], ["nonsense"], *([name, "--help"] for name in COMMANDS)]
    command = [sys.executable, "-c", PROGRAM, json.dumps(calls)]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=60, check=True)
    standard = set(sys.stdlib_module_names)
    return {
        call: {top for top in (name.split(".")[0] for name in names) if top not in standard and "sysconfig" not in top}
        for call, names in json.loads(done.stdout).items()
    }


def test_import_cinegen_imports_no_other_package(imported):
    assert imported["import cinegen"] <= {"__main__", "cinegen", "cmeel_pth", "raff2urdf"}
    assert imported["names of cinegen"] <= {"__main__", "cinegen", "cmeel_pth", "raff2urdf"}


HEAVY = {
    "asyncio", "cinegen.assembly", "cinegen.cockpit", "cinegen.collision", "cinegen.hexapod", "flint", "matplotlib",
    "meshcat", "networkx", "pydantic", "scipy.linalg", "scipy.optimize", "scipy.spatial", "scipy.special", "trimesh",
    "typer", "unittest.mock", "websockets", "xarray", "yourdfpy", "zarr",
}  # fmt: skip
"""Modules that no solver needs until it moves, and most programs never."""


def test_load_and_solver_import_numpy_pinocchio_and_numba_alone(root):
    program = "import json, sys\nimport cinegen\nfrom cinegen import Solver, load\nprint(json.dumps(list(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], cwd=root, capture_output=True, timeout=60, check=True)
    modules = set(json.loads(done.stdout))
    assert {"numpy", "pinocchio", "numba"} <= modules
    assert modules & HEAVY == set()


def test_help_of_every_command_imports_nothing_that_computes(imported):
    assert len(COMMANDS) == 24
    assert {call: sorted(names - LIGHT) for call, names in imported.items() if names - LIGHT} == {}
    assert not imported["cinegen --version"] & {"pydantic", "rich"}


def test_choices_are_those_of_the_library():
    assert set(FORMATS) == set(FORMATS_OF_MISSIONS)
    assert tuple(QUANTITIES_OF_MAPS) == QUANTITIES


def test_all_public_names_are_there_when_they_are_asked_for():
    assert set(cinegen.__all__) <= set(dir(cinegen))
    for name in cinegen.__all__:
        assert getattr(cinegen, name) is getattr(cinegen, name)
    assert cinegen.model.Mechanism is cinegen.Mechanism
    assert cinegen.ik.IKSolutions.__module__ == "cinegen.ik.solutions"  # a package of packages, lazy itself
    with pytest.raises(AttributeError, match="'nonsense'"):
        _ = cinegen.nonsense
