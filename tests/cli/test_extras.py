"""Without the packages of the extras commands work, and those that need one say which."""

import json
import subprocess
import sys

import pytest

from cinegen import cluster
from cinegen.errors import CinegenWarning
from raff2urdf.command.extras import MissingExtraError

PROGRAM = """
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
    command = [sys.executable, "-c", PROGRAM, json.dumps(list(calls.values()))]
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
