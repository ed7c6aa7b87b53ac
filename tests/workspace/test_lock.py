"""The lock of a map: held by one process at a time, whatever its path is called, and gone afterwards."""

from __future__ import annotations

import subprocess
import sys

import pytest

from cinegen.workspace.errors import MapError
from cinegen.workspace.zarr_store import _locked


@pytest.fixture
def folder(tmp_path):
    """A map's folder."""
    path = tmp_path / "map.zarr"
    path.mkdir()
    return path


def test_another_one_is_refused_while_it_is_held(folder):
    with _locked(folder):
        with pytest.raises(MapError, match=r"another process makes .*map\.zarr"), _locked(folder):
            pytest.fail("held twice")
        assert list(folder.iterdir()) == []
    with _locked(folder):
        pass
    assert [path.name for path in folder.parent.iterdir()] == ["map.zarr"]


def test_another_process_is_kept_out_too_until_this_one_ends(folder, root):
    program = """if True:
        import sys
        from pathlib import Path
        from cinegen.workspace.zarr_store import MapError, _locked
        try:
            with _locked(Path(sys.argv[1])):
                print("held", flush=True)
                sys.stdin.read(1)
        except MapError as error:
            print("refused")
        """

    def start():
        return subprocess.Popen(
            [sys.executable, "-c", program, str(folder)], cwd=root, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    with _locked(folder), start() as other:
        assert other.communicate()[0] == b"refused\n"
    with start() as other:
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(MapError), _locked(folder):
            pytest.fail("held twice")
        other.kill()
    with _locked(folder):
        pass
    assert [path.name for path in folder.parent.iterdir()] == ["map.zarr"]
