"""Every command that writes a file: where its target is a link, a device, a FIFO or a folder."""

import errno
import importlib
import io
import json
import os
import re
import stat
import subprocess
import tempfile
from pathlib import Path

import imageio_ffmpeg
import pytest
from PIL import Image

import cinegen.cli
import raff2urdf.urdf2raff.cli
from cinegen.cockpit.film import FilmError, _encoded, _frames_of, _write
from cinegen.devices import Reading, ReadingRecorder, RecordError
from cinegen.devices.replay import load_readings
from raff2urdf.files import write_all


def _is_png(content):
    return Image.open(io.BytesIO(content)).format == "PNG"


# A name for the target, the command (TARGET is where it writes), what it writes.
COMMANDS = {
    "singular -o": ("t.json", "singular five_bar --over x,y --grid 5 --plot p.png -o TARGET", json.loads),
    "modes --plot, no suffix": ("t", "modes four_bar --plot TARGET", _is_png),
    "plan -o": ("t.jsonl", "plan disc -o TARGET", re.compile(rb'{"cinegen".*\n.*\n.').match),
    "urdf2raff -o": ("t.raff", "urdf2raff arm.urdf --no-graphics -o TARGET", lambda text: text.startswith(b"RAFF")),
}


# Other commands write by the functions of one of these.
every_command = pytest.mark.parametrize("name", COMMANDS)


RESULTS: dict[str, object] = {}


def once(function):
    """A function that is called only once: what is written is the same each time, where it goes differs."""
    module, _, name = function.rpartition(".")
    compute = getattr(importlib.import_module(module), name)

    def remembered(*arguments, **options):
        if function not in RESULTS:
            RESULTS[function] = compute(*arguments, **options)
        return RESULTS[function]

    return remembered


@pytest.fixture
def command(robot, tmp_path, monkeypatch):
    """`command("plan -o", target)`: its exit code."""
    for name in ("assembly.assembly_modes", "planning.plan", "singularities.loci.singular_loci"):
        monkeypatch.setattr(f"cinegen.{name}", once(f"cinegen.{name}"))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    (tmp_path / "here/arm.urdf").write_text(robot("planar_3r").source.urdf)

    def run(name, target, *options):
        program, *words = [str(target) if word == "TARGET" else word for word in COMMANDS[name][1].split()]
        if program == "urdf2raff":
            return raff2urdf.urdf2raff.cli.main([*words, *options])
        return cinegen.cli.main([program, *words, *options])

    return run


@every_command
def test_a_link_stays_a_link(command, name, tmp_path):
    file, _, is_right = COMMANDS[name]
    link = tmp_path / file
    link.symlink_to("target")
    assert command(name, link) == 0  # it dangles
    assert link.is_symlink()
    assert is_right((tmp_path / "target").read_bytes())
    (tmp_path / "target").write_bytes(b"old")
    (tmp_path / "target").chmod(0o640)
    assert command(name, link) == 1
    assert (tmp_path / "target").read_bytes() == b"old"
    assert command(name, link, "--force") == 0
    assert link.is_symlink()
    assert is_right((tmp_path / "target").read_bytes())
    assert stat.S_IMODE((tmp_path / "target").stat().st_mode) == 0o640
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(["here", file, "target"])


@every_command
def test_a_device_is_never_replaced_and_a_full_one_is_an_error(command, name, device, capsys):
    full = device("full")
    assert command(name, full) == 1
    assert stat.S_ISCHR(full.lstat().st_mode)
    said = capsys.readouterr().err
    assert "device full: can't be written: " in said
    assert "no space left on device" in said.lower() or "the disk is full" in said
    null = device("null")
    assert command(name, null) == 0
    assert stat.S_ISCHR(null.lstat().st_mode)


@every_command
def test_a_fifo_is_written_through(command, name, fifo):
    path, read = fifo()
    assert command(name, path) == 0
    assert stat.S_ISFIFO(path.lstat().st_mode)
    is_right = _is_png if "--plot" in name else COMMANDS[name][2]  # without a suffix
    assert is_right(read())


@every_command
def test_a_folder_gets_an_output_but_no_picture(command, name, tmp_path, capsys):
    (tmp_path / "folder").mkdir()
    code = command(name, tmp_path / "folder")
    if "--plot" not in name and "--snapshot" not in name:
        (file,) = (tmp_path / "folder").iterdir()
        assert code == 0
        assert COMMANDS[name][2](file.read_bytes())
        return
    assert code == 1
    assert "folder: can't be written: is a directory" in capsys.readouterr().err.lower()
    assert not list((tmp_path / "folder").iterdir())


def test_a_full_device_keeps_the_files_that_are_written_with_it(device, tmp_path):
    (tmp_path / "file").write_bytes(b"older")
    with pytest.raises(OSError, match="No space left on device"):
        write_all({tmp_path / "file": b"new", device("full"): b"new"})
    assert (tmp_path / "file").read_bytes() == b"older"  # all or none


# --- what is written while it comes ----------------------------------------------------------------------------------


def _write_readings(path):
    with ReadingRecorder(path) as recorder:
        for k in range(20):
            recorder.write(Reading(0.1 * k, (0.1, 0, 0, 0, 0, 0)))


def test_recordings_follow_links_and_write_through_fifos(fifo, tmp_path):
    (tmp_path / "link").symlink_to("real")
    _write_readings(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert len(load_readings(tmp_path / "real")[0]) == 20
    path, read = fifo()
    _write_readings(path)
    (tmp_path / "copy").write_bytes(read())
    assert len(load_readings(tmp_path / "copy")[0]) == 20
    assert stat.S_ISFIFO(path.lstat().st_mode)


def test_readings_that_are_there_are_lost_only_where_others_can_be_written(tmp_path, monkeypatch):
    path = tmp_path / "run.jsonl"
    path.write_bytes(b"old")
    path.chmod(0o640)
    with monkeypatch.context() as full:
        full.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(errno.ENOSPC, "No space left on device")))
        with pytest.raises(RecordError, match="the disk is full"):
            ReadingRecorder(path)
    assert path.read_bytes() == b"old"
    ReadingRecorder(path).close()
    assert path.read_bytes().startswith(b'{"cinegen":"readings"')
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


# --- films -----------------------------------------------------------------------------------------------------------


def _written(path, folder):
    _write(path, _encoded(_frames_of(folder), folder, path, imageio_ffmpeg.get_ffmpeg_exe()))


def _filmed(path):
    with tempfile.TemporaryDirectory() as folder:
        for number in range(1, 6):
            Image.new("RGB", (64, 48), "red").save(Path(folder, f"{number:05d}.png"))
        _written(path, Path(folder))


def test_a_film_follows_links_and_keeps_devices(device, tmp_path):
    (tmp_path / "link.mp4").symlink_to("real")
    _filmed(tmp_path / "link.mp4")
    assert (tmp_path / "link.mp4").is_symlink()
    assert b"ftyp" in (tmp_path / "real").read_bytes()[:16]
    full = device("full").rename(tmp_path / "full.mp4")
    with pytest.raises(FilmError, match=r"full\.mp4: can't be written: No space left on device"):
        _filmed(full)
    assert stat.S_ISCHR(full.lstat().st_mode)


def test_a_film_through_a_fifo_is_whole(fifo, tmp_path):
    """An MP4 can't be written from its beginning to its end: what stands first is known last."""
    path, read = fifo()
    (tmp_path / "fifo.mp4").symlink_to(path)
    _filmed(tmp_path / "fifo.mp4")
    (tmp_path / "copy.mp4").write_bytes(read())
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", tmp_path / "copy.mp4", "-f", "null", "-"]
    said = subprocess.run(command, capture_output=True, text=True)
    assert said.returncode == 0
    assert "frame=    5" in said.stderr


def test_a_film_that_fails_leaves_what_was_there(tmp_path):
    (tmp_path / "film.mp4").write_bytes(b"older")
    (frames := tmp_path / "frames").mkdir()
    (frames / "00001.png").write_bytes(b"no picture")
    with pytest.raises(FilmError, match="can't write it"):
        _written(tmp_path / "film.mp4", frames)
    assert (tmp_path / "film.mp4").read_bytes() == b"older"
