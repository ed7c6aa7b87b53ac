"""Locks, with what the system has for them and without."""

from __future__ import annotations

import importlib
import subprocess
import sys
import threading
import time

import pytest

from cinegen.workspace.errors import MapError
from cinegen.workspace.storage import lock


@pytest.fixture(params=["fcntl", "no fcntl"])
def locked(request, monkeypatch):
    """`locked` as it is here, and as it is where there is no module fcntl."""
    if request.param == "no fcntl":
        with monkeypatch.context() as without:
            without.setitem(sys.modules, "fcntl", None)
            importlib.reload(lock)
        assert not lock.SYSTEM_LOCKS
    yield lock.locked
    importlib.reload(lock)
    assert lock.SYSTEM_LOCKS


@pytest.fixture
def file(tmp_path):
    """A file in a map's folder."""
    path = tmp_path / "map.zarr" / "zarr.json"
    path.parent.mkdir()
    path.write_text("{}", encoding="utf-8")
    return path


def test_who_does_not_wait_is_refused_while_another_holds_it(locked, file):
    with locked(file):
        with pytest.raises(MapError, match=r"map.zarr is being made by another process"), locked(file):
            pytest.fail("held twice")
        assert [path.name for path in file.parent.iterdir()] == ["zarr.json"]
    with locked(file):
        pass
    assert [path.name for path in file.parent.parent.iterdir()] == ["map.zarr"]


@pytest.mark.parametrize("folder", [False, True])
def test_who_waits_gets_it_when_the_other_lets_go(locked, file, folder):
    path, order = file.parent if folder else file, []

    def second():
        with locked(path, wait=True):
            order.append("second")

    with locked(path):
        thread = threading.Thread(target=second)
        thread.start()
        time.sleep(0.2)
        order.append("first")
    thread.join(20)
    assert order == ["first", "second"]


def test_an_error_lets_go(locked, file):
    with pytest.raises(ZeroDivisionError), locked(file):
        raise ZeroDivisionError
    with locked(file):
        pass


def test_by_another_name_it_is_the_same_file(locked, file, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    link = tmp_path / "elsewhere" / "link.zarr"
    link.symlink_to(file.parent)
    with locked(file), pytest.raises(MapError), locked(link / "zarr.json"):
        pytest.fail("held twice")


def test_where_nothing_can_be_written_that_is_an_error_of_the_system(locked):
    with pytest.raises(OSError, match="nowhere"), locked(lock.Path("/proc/nowhere/map.zarr/zarr.json")):
        pytest.fail("held")


def test_another_process_is_kept_out_too(locked, file, root):
    program = f"""if True:
        import sys
        if {not lock.SYSTEM_LOCKS}:
            sys.modules["fcntl"] = None
        import importlib.util
        from pathlib import Path
        import cinegen.workspace.storage.lock as lock
        try:
            with lock.locked(Path(sys.argv[1])):
                print("held")
        except lock.MapError as error:
            print("refused")
        """

    def other():
        done = subprocess.run(
            [sys.executable, "-c", program, str(file)], cwd=root, capture_output=True, text=True, check=False
        )
        return done.stdout.strip() or done.stderr

    with locked(file):
        assert other() == "refused"
    assert other() == "held"
