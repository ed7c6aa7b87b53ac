"""Writing files: symbolic links are followed, devices and FIFOs written through, all files are written or none."""

import os
import socket
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from raff2urdf.files import write_all


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_link_stays_a_link_and_its_file_is_written(tmp_path: Path) -> None:
    real = tmp_path / "elsewhere" / "real"
    real.parent.mkdir()
    real.write_bytes(b"old")
    (tmp_path / "link").symlink_to("elsewhere/real")
    (tmp_path / "link to link").symlink_to("link")
    with real.open("rb") as before:  # it is replaced by a rename
        write_all({tmp_path / "link to link": b"new"})
        assert before.read() == b"old"
    assert real.read_bytes() == b"new"
    assert os.readlink(tmp_path / "link") == "elsewhere/real"
    assert os.readlink(tmp_path / "link to link") == "link"
    assert names(tmp_path) == ["elsewhere", "link", "link to link"]
    assert names(real.parent) == ["real"]


def test_a_dangling_link_creates_its_target(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("made/target")
    write_all({tmp_path / "link": b"new"})
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "made" / "target").read_bytes() == b"new"


def test_a_ring_of_links_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(OSError, match="symbolic links") as raised:
        write_all({tmp_path / "a": b"new"})
    assert raised.value.filename == str(tmp_path / "a")
    assert names(tmp_path) == ["a", "b"]


def test_a_fifo_is_written_through(tmp_path: Path, fifo: Callable[[], tuple[Path, Callable[[], bytes]]]) -> None:
    path, read = fifo()
    content = bytes(range(256)) * 1000  # more than it holds at once
    write_all({path: content})
    assert read() == content
    assert stat.S_ISFIFO(path.lstat().st_mode)
    assert names(tmp_path) == [path.name]


def test_a_folder_and_a_socket_are_errors(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "socket"))
        (tmp_path / "folder").mkdir()
        for name, why in (("folder", "Is a directory"), ("socket", "No such device or address")):
            with pytest.raises(OSError, match=why) as raised:
                write_all({tmp_path / name: b"new"})
            assert raised.value.filename == str(tmp_path / name)
    assert names(tmp_path) == ["folder", "socket"]
    assert stat.S_ISSOCK((tmp_path / "socket").stat().st_mode)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may give files away")
def test_a_file_that_is_replaced_keeps_its_owner(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    os.chown(path, 12345, 23456)
    write_all({path: b"new"})
    assert (path.stat().st_uid, path.stat().st_gid) == (12345, 23456)


def test_a_write_protected_file_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"mine")
    path.chmod(0o400)
    access = os.access
    monkeypatch.setattr(os, "access", lambda where, how: how != os.W_OK and access(where, how))  # as of who isn't root
    with pytest.raises(PermissionError):
        write_all({path: b"new"})
    assert path.read_bytes() == b"mine"


def test_nothing_is_left_where_it_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", stop)
    with pytest.raises(KeyboardInterrupt):
        write_all({tmp_path / "folder" / "file": b"new"})
    assert names(tmp_path) == []


def test_what_a_killed_process_left_is_removed_later_and_nothing_else(tmp_path: Path) -> None:
    program = "import os, sys; from pathlib import Path; from raff2urdf import files; "
    program += "files.os.replace = lambda *_: os.kill(os.getpid(), 9); files.write_all({Path(sys.argv[1]): b'half'})"
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path / "arm.urdf")], check=False)
    assert done.returncode == -9
    (left,) = tmp_path.iterdir()
    others = [".arm.urdf.20260101", "arm.urdf.abcdefgh.unfinished", ".a.abcdefghi.unfinished", ".unfinished"]
    for other in others:
        (tmp_path / other).write_bytes(b"mine")
    others.append(".b.abcdefgh.unfinished")
    (tmp_path / others[-1]).mkdir()
    for other in others:
        os.utime(tmp_path / other, (0, 0))
    write_all({tmp_path / "scene.toml": b"new"})
    assert names(tmp_path) == sorted([*others, left.name, "scene.toml"])  # a process may still rename it
    os.utime(left, (0, 0))
    write_all({tmp_path / "scene.toml": b"newer"})
    assert names(tmp_path) == sorted([*others, "scene.toml"])


# --- standard output ---------------------------------------------------------------------------------------------

PROGRAM = "import sys; from pathlib import Path; from raff2urdf.files import write_all; print('before'); "
PROGRAM += "write_all({Path(sys.argv[1]): b'content\\n'}); print('after')"


@pytest.fixture
def stdout(tmp_path: Path) -> Path:
    """A link as /dev/stdout is one."""
    if not os.path.exists("/proc/self/fd/1"):
        pytest.skip("no /proc here")
    path = tmp_path / "stdout"
    path.symlink_to("/proc/self/fd/1")
    return path


def program(path: Path, **options: object) -> subprocess.CompletedProcess[str]:
    package = str(Path(sys.modules["raff2urdf"].__file__ or "").parents[1])
    command = [sys.executable, "-c", PROGRAM, str(path)]
    environment = os.environ | {"PYTHONPATH": package}
    return subprocess.run(command, env=environment, stderr=subprocess.PIPE, text=True, timeout=60, **options)  # type: ignore[call-overload,no-any-return]


def test_standard_output_that_is_a_pipe_or_a_file(stdout: Path, tmp_path: Path) -> None:
    """It goes on where it was, as for `cat`; the file is not replaced under what is printed."""
    done = program(stdout, stdout=subprocess.PIPE)
    assert (done.returncode, done.stdout) == (0, "before\ncontent\nafter\n")
    assert stdout.is_symlink()
    with (tmp_path / "out").open("wb") as out:
        out.write(b"first\n")
        out.flush()
        assert program(stdout, stdout=out).returncode == 0
    assert (tmp_path / "out").read_text() == "first\nbefore\ncontent\nafter\n"
