"""What calls import: `--help` nothing that computes, and commands no packages of extras that they can do without."""

import json
import subprocess
import sys

import pytest

import cinegen
from cinegen import cluster
from cinegen.cli import app
from cinegen.cli.exports.export import FORMATS
from cinegen.cli.study.map import QUANTITIES
from cinegen.errors import CinegenWarning
from cinegen.mission import FORMATS as FORMATS_OF_MISSIONS
from cinegen.workspace.quantities import QUANTITIES as QUANTITIES_OF_MAPS
from raff2urdf.command.extras import MissingExtraError

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


# --- without the extras -----------------------------------------------------------------------------------------------
# Without the packages of the extras commands work, and those that need one say which.


WITHOUT_EXTRAS = """
import contextlib, io, json, sys

MISSING = '''matplotlib xarray zarr google_crc32c dask distributed cryptography mujoco ezdxf playwright imageio_ffmpeg
ompl pandas xacro'''
sys.modules.update(dict.fromkeys(MISSING.split()))  # None: as if it were not installed
from cinegen.cli import main
from raff2urdf.cli import main as raff2urdf
found = []
for words in json.loads(sys.argv[1]):
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = raff2urdf(words[1:]) if words[0] == "raff2urdf" else main(words)
    found.append([code, out.getvalue(), err.getvalue()])
print(json.dumps(found))
"""

WORK = {
    "info": ["info", "rx90"],
    "modes": ["modes", "four_bar"],
    "drive": ["demo", "four_bar", "--seconds", "0.2", "--no-browser"],
    "snapshot": ["drive", "four_bar", "--snapshot", "four_bar.html"],
    "plan": ["plan", "disc"],
    "convert": ["raff2urdf", "four_bar"],
    "sdf": ["raff2urdf", "delta4", "--format", "sdf"],
}
NEED = {
    "plot": ["modes", "four_bar", "--plot", "modes.png"],
    "maps": ["map", "four_bar", "--over", "joint1", "--yes"],
    "mjcf": ["info", "robot.xml"],
    "xacro": ["info", "robot.xacro"],
    "film": ["drive", "four_bar", "--video", "film.mp4", "--seconds", "1"],
    "sampling": ["plan", "disc", "--planner", "rrtconnect"],
}


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    """What commands return and print in one process that can't import the packages of the extras."""
    folder = tmp_path_factory.mktemp("without extras")
    (folder / "robot.xml").write_text("<mujoco/>")
    (folder / "robot.xacro").write_text("<robot/>")
    calls = {**WORK, **NEED, "dxf": ["raff2urdf", "rx90"]}
    command = [sys.executable, "-c", WITHOUT_EXTRAS, json.dumps(list(calls.values()))]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=True)
    return dict(zip(calls, json.loads(done.stdout), strict=True))


@pytest.mark.parametrize("name", WORK)
def test_the_core_is_enough(outcomes, name):
    code, _, err = outcomes[name]
    assert code == 0, err


@pytest.mark.parametrize("extra", NEED)
def test_a_command_says_what_to_install(outcomes, extra):
    code, _, err = outcomes[extra]
    assert code == 1
    last = err.splitlines()[-1]
    assert last.startswith("cinegen: ")
    assert " need the package " in last
    assert last.endswith(f'install "cinegen[{extra}]"')


def test_without_dask_one_process_works_and_several_are_refused(monkeypatch):
    monkeypatch.setattr(cluster.os, "cpu_count", lambda: 4)
    assert cluster.processes(None, None, 8) == 4
    assert cluster.processes(None, None, 2) == 2
    for package in ("dask", "distributed"):
        monkeypatch.setitem(sys.modules, package, None)
    with pytest.warns(CinegenWarning, match=r'for all 4 cores: .*install "cinegen\[cluster\]"'):
        assert cluster.processes(None, None, 8) == 1
    assert cluster.processes(None, None, 1) == cluster.processes(1, None, 8) == 1
    for workers, scheduler in ((2, None), (None, "tcp://node:8786")):
        with pytest.raises(MissingExtraError, match=r"several processes need the package"):
            cluster.processes(workers, scheduler, 8)


def test_graphics_that_need_an_extra_are_replaced_and_it_is_said(outcomes):
    code, _, err = outcomes["dxf"]
    assert code == 0
    assert 'install "cinegen[dxf]"' in err
