from pathlib import Path

import pytest
from command import Done, Run, run_apart, run_here


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs `raff2urdf ARGUMENTS` in the test's own folder, in this process."""

    def run(*arguments: str) -> Done:
        monkeypatch.chdir(tmp_path)
        return run_here(arguments, capsys)

    return run


@pytest.fixture
def command(tmp_path: Path) -> Run:
    """Runs `python -m raff2urdf ARGUMENTS` in the test's own folder."""

    def run(*arguments: str, **environment: str) -> Done:
        return run_apart(arguments, tmp_path, environment)

    return run
