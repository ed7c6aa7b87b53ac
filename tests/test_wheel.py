"""The wheel and the source distribution are complete; the installed wheel drives a robot without the clone."""

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pinocchio
import pytest
from variants import slow

ROOT = Path(__file__).resolve().parent.parent
SITE = Path(pytest.__file__).parent.parent
PIP = [getattr(sys, "_base_executable", sys.executable), "-m", "pip", "--disable-pip-version-check"]
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> tuple[Path, Path]:
    """The wheel and the source distribution."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder), "-t", "wheel", "-t", "sdist"]
    subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, check=True, capture_output=True, timeout=120)
    return next(folder.glob("*.whl")), next(folder.glob("*.tar.gz"))


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory):
    """`installed("cinegen", ...)`: runs a command of the wheel in an empty folder. Its environment has the packages of
    this one, but not the clone."""
    folder = tmp_path_factory.mktemp("installed")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True, timeout=60)
    python = folder / "venv" / "bin" / "python"
    command = [*PIP, "--python", python, "install", "--quiet", "--no-deps", "--no-index", built[0]]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, timeout=120)
    if "No module named pip" in done.stderr:
        pytest.skip("the base interpreter has no pip")
    assert done.returncode == 0, done.stderr
    packages = next((folder / "venv").glob("lib/python*/site-packages"))
    # paths that are added this way are not searched for .pth files: that of the editable installation has no effect
    (packages / "others.pth").write_text(f"{SITE}\n{Path(pinocchio.__file__).parent.parent}\n")
    (folder / "empty").mkdir()

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        command = [str(python.parent / words[0]), *words[1:]]
        return subprocess.run(
            command, cwd=folder / "empty", env=ENVIRONMENT, capture_output=True, text=True, timeout=300
        )

    return run


def test_the_wheel_has_the_packages_their_data_and_the_licences(built):
    names = set(zipfile.ZipFile(built[0]).namelist())
    shipped = [*ROOT.glob("robots/**/*.*"), *ROOT.glob("examples/**/*.py")]
    homes = {"robots": "raff2urdf", "examples": "cinegen"}
    expected = {f"{homes[path.parts[0]]}/{path}" for path in (path.relative_to(ROOT) for path in shipped)}
    expected |= {str(path.relative_to(ROOT)) for folder in homes.values() for path in (ROOT / folder).rglob("*.py")}
    expected |= {"raff2urdf/constraints.schema.json", "cinegen/cockpit/static/index.html", "cinegen/py.typed"}
    assert expected - names == set()
    assert {name.split("/")[0].split("-")[0] for name in names} == {"cinegen", "raff2urdf"}
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not [name for name in names if "__pycache__" in name]


def test_the_source_distribution_is_the_whole_project(built):
    with tarfile.open(built[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {
        "Makefile", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "README.md", "SECURITY.md",
        "pyproject.toml", "requirements/core.txt", "requirements/test.txt", "robots/delta4.raff",
        "generated/delta4.urdf", "examples/01_load_and_close.py", "docs/tutorial.md", "tests/test_wheel.py",
        "benchmarks/tick.py", ".ci/run",
    } <= names  # fmt: skip
    assert not [name for name in names if name.startswith((".venv", "node_modules", ".git/", "build/", "dist/"))]


def test_the_installed_wheel_is_what_runs(installed):
    done = installed("python", "-c", "import cinegen, raff2urdf; print(cinegen.__file__, raff2urdf.__file__)")
    assert done.stdout.count("site-packages") == 2
    assert str(ROOT) not in done.stdout


@pytest.mark.parametrize("words", slow("demo", "drive five_bar", "drive --scene disc"))
def test_the_installed_wheel_drives_a_robot(installed, words):
    done = installed("cinegen", *words.split(), "--seconds", "1", "--no-browser")
    assert done.returncode == 0, done.stderr
    assert "page: http://127.0.0.1:" in done.stdout
    assert "loops closed to" in done.stdout


def test_the_installed_wheel_converts_a_robot_and_runs_an_example(installed):
    assert installed("raff2urdf", "gough").returncode == 0
    done = installed("cinegen", "demo", "write_a_robot")
    assert done.returncode == 0, done.stderr
    assert "slide at" in done.stdout
