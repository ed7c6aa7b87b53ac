"""Maps on disk: the same bytes however often work was broken off, and plain words where files are broken."""

import errno
import fcntl
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import zarr
from folders import digest, files, of_delta, of_motors
from hypothesis import given
from hypothesis import strategies as st
from mapped import mapped

from cinegen.workspace import MapError, make_map, open_map, work
from cinegen.workspace.make import piece_size
from cinegen.workspace.region import pieces
from cinegen.workspace.storage import chunk, store
from cinegen.workspace.storage.chunk import is_sound, packed

MOST = 15  # cells of a piece: 10 pieces, those at the end smaller


@pytest.fixture(scope="module")
def spec(robot):
    return of_motors(robot("planar_3r"))


@pytest.fixture(scope="module")
def whole(spec, tmp_path_factory):
    """A map that nothing happened to."""
    path = tmp_path_factory.mktemp("whole") / "map.zarr"
    make_map(spec, path, workers=1, most=MOST)
    return path


@pytest.fixture
def made(monkeypatch):
    """How many pieces are computed."""
    count = [0]
    values = work.Surveyor.values

    def counted(self, piece):
        count[0] += 1
        return values(self, piece)

    monkeypatch.setattr(work.Surveyor, "values", counted)
    return count


@pytest.fixture
def copied(whole, tmp_path):
    return Path(shutil.copytree(whole, tmp_path / "map.zarr"))


def again(spec, path):
    return make_map(spec, path, workers=1, most=MOST)


# --- what is there -------------------------------------------------------------------------------------------------


def test_what_is_read_is_what_was_found_in_every_cell(spec, whole):
    found, read = mapped(spec), open_map(whole)
    assert set(read.data_vars) == set(found)
    for name, values in found.items():
        assert read[name].dtype == values.dtype
        np.testing.assert_array_equal(read[name].values, values)
    assert 0 < int(read["reachable"].sum()) < spec.region.size
    for axis in spec.region.axes:
        np.testing.assert_array_equal(read[axis.name].values, axis.middles())
    assert read["sigma_1"].attrs["units"] == "1"
    assert read.attrs["robot_sha256"] == spec.robot_hash


def test_zarr_alone_reads_it(spec, whole):
    group = zarr.open_group(whole, mode="r")
    for name, values in mapped(spec).items():
        np.testing.assert_array_equal(np.asarray(group[name]), values)


def test_a_coordinate_of_one_cell_at_0_is_there(robot, tmp_path):
    mechanism = robot("planar_3r")
    spec = of_motors(mechanism)
    axes = (type(spec.region.axes[0])(mechanism.actuated[0], -1.0, 1.0, 1),)
    read = make_map(type(spec)(mechanism, type(spec.region)(axes)), tmp_path / "map.zarr")
    np.testing.assert_array_equal(read[mechanism.actuated[0]].values, [0.0])


@given(st.integers(0, 2**32), st.sampled_from(["float32", "float64", "uint8", "bool", "int32"]))
def test_a_chunk_with_any_bit_wrong_or_any_byte_missing_is_not_sound(seed, dtype):
    rng = np.random.default_rng(seed)
    data = packed(rng.integers(0, 2, (3, 4)).astype(dtype), (4, 5), 0)
    assert is_sound(data)
    at = int(rng.integers(len(data)))
    assert not is_sound(data[:at] + bytes([data[at] ^ (1 << int(rng.integers(8)))]) + data[at + 1 :])
    assert not is_sound(data[:at])


@pytest.mark.parametrize(("name", "of"), [("delta4", of_delta), ("delta4", of_motors), ("planar_3r", of_motors)])
def test_a_piece_comes_to_the_same_whatever_was_made_before(robot, name, of):
    spec = of(robot(name))
    chunks = spec.region.blocks(40)
    cells = [store.piece(index, spec.region.shape, chunks) for index in pieces(spec.region.shape, chunks)]
    one, other = work.Surveyor(spec), work.Surveyor(spec)
    forth = [one.values(piece) for piece in cells]
    back = [other.values(piece) for piece in reversed(cells)][::-1]
    for values, others in zip(forth, back, strict=True):
        assert {key: value.tobytes() for key, value in values.items()} == {
            key: value.tobytes() for key, value in others.items()
        }


# --- broken off ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("written", [0, 1, 3, 5, 6, 17, 29])
def test_a_full_disk_costs_no_piece_that_was_finished(spec, whole, tmp_path, monkeypatch, made, written):
    path, put, left = tmp_path / "map.zarr", chunk.put, [written]

    def full(*arguments):
        if left[0] == 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        left[0] -= 1
        put(*arguments)

    monkeypatch.setattr(store, "put", full)
    with pytest.raises(MapError, match=r"No space left on device.*What was finished stays"):
        again(spec, path)
    assert made[0] == written // 5 + 1
    done = {index for index, there in store.Store(path).look() if there}
    assert len(done) == written // 5
    before = {name: file for name, file in files(path / "settled").items() if name != "zarr.json"}
    read = open_map(path)
    assert int((read["settled"].values > 0).sum()) == sum(map(store.Store(path).size, done))
    monkeypatch.setattr(store, "put", put)
    again(spec, path)
    assert made[0] == 1 + store.Store(path).pieces  # that which was broken off, twice
    assert before.items() <= files(path / "settled").items()
    assert digest(path) == digest(whole)
    assert os.listdir(tmp_path) == ["map.zarr"]


def test_a_limit_of_the_system_is_said_and_leaves_nothing_half_written(spec, whole, tmp_path):
    path = tmp_path / "map.zarr"
    again(spec, path)
    store.Store(path).forget((0, 0, 0))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
        with pytest.raises(MapError, match="File too large"):
            again(spec, path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert os.listdir(tmp_path) == ["map.zarr"]
    again(spec, path)
    assert digest(path) == digest(whole)


def test_ctrl_c_anywhere_leaves_a_map_that_goes_on(spec, whole, tmp_path, made):
    def impatient(done, _):
        if done > 60:
            raise KeyboardInterrupt

    path = tmp_path / "map.zarr"
    with pytest.raises(KeyboardInterrupt):
        make_map(spec, path, workers=1, most=MOST, say=impatient)
    before = made[0]
    assert 0 < before < store.Store(path).pieces
    told = []
    make_map(spec, path, workers=1, most=MOST, say=lambda *done: told.append(done))
    assert told[0][0] > 60
    assert told[-1] == (spec.region.size, spec.region.size)
    assert made[0] == store.Store(path).pieces
    assert digest(path) == digest(whole)


SCRIPT = """
import sys
import cinegen
sys.path.insert(0, sys.argv[1])
from folders import of_motors
from cinegen.workspace import make_map
specification = of_motors(cinegen.load(sys.argv[2]))
make_map(specification, sys.argv[3], workers=1, most=15, say=lambda *_: (print(flush=True), input()))
"""


def test_killed_between_two_pieces_or_in_one_it_goes_on(spec, whole, tmp_path, root, made):
    path = tmp_path / "map.zarr"
    command = [sys.executable, "-c", SCRIPT, str(Path(__file__).parent), str(root / "robots/planar_3r.raff"), str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        for _ in range(3):  # what is to be done, and two pieces
            process.stdout.readline()
            process.stdin.write(b"\n")
            process.stdin.flush()
        process.send_signal(signal.SIGKILL)
    (tmp_path / ".map.zarr.new").mkdir(exist_ok=True)
    (tmp_path / ".map.zarr.new" / "half").write_bytes(b"of a chunk")
    done = sum(there for _, there in store.Store(path).look())
    assert done >= 2
    again(spec, path)
    assert made[0] == store.Store(path).pieces - done
    assert digest(path) == digest(whole)
    assert os.listdir(tmp_path) == ["map.zarr"]


def test_a_clock_that_jumps_changes_nothing(spec, whole, tmp_path, monkeypatch):
    jump = random.Random(0)
    monkeypatch.setattr(time, "time", lambda: jump.uniform(-1e9, 4e9))
    again(spec, tmp_path / "map.zarr")
    assert digest(tmp_path / "map.zarr") == digest(whole)


def test_what_is_finished_is_never_touched_again(spec, copied, made):
    before = files(copied)
    again(spec, copied)
    assert made[0] == 0
    assert files(copied) == before


# --- damaged -------------------------------------------------------------------------------------------------------


def cut(path):
    path.write_bytes(path.read_bytes()[:-7])


def rubbish(path):
    path.write_bytes(np.random.default_rng(0).bytes(300))


def emptied(path):
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [cut, rubbish, emptied, Path.unlink])
@pytest.mark.parametrize("name", ["sigma_1/c.1.1.0", "configuration/c.1.1.0.0", "reachable/c.1.1.0"])
def test_a_damaged_chunk_is_said_when_read_and_made_again_when_gone_on(spec, whole, copied, made, damage, name):
    damage(copied / name)
    read = open_map(copied)
    with pytest.raises(MapError, match=rf"{name} is not .*delete .*settled/c\.1\.1\.0"):
        read[name.partition("/")[0]].values  # noqa: B018
    again(spec, copied)
    assert made[0] == 1
    assert digest(copied) == digest(whole)


@pytest.mark.parametrize("damage", [cut, rubbish, emptied])
def test_so_is_that_which_says_that_a_piece_is_finished(spec, whole, copied, made, damage):
    damage(copied / "settled/c.0.1.0")
    with pytest.raises(MapError, match=r"settled/c\.0\.1\.0 is not as it was written"):
        open_map(copied)["settled"].values  # noqa: B018
    again(spec, copied)
    assert made[0] == 1
    assert digest(copied) == digest(whole)


def edit(path, change):
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))


WRONG = {
    "an array is missing": (lambda p: shutil.rmtree(p / "sigma_1"), "sigma_1 is not there"),
    "an array's description is cut": (lambda p: cut(p / "sigma_1/zarr.json"), "sigma_1 is not there, or is something"),
    "an array has another shape": (
        lambda p: edit(p / "margin/zarr.json", lambda d: d.update(shape=[1, 2, 3])),
        "margin is not there, or is something else",
    ),
    "the description is cut": (lambda p: cut(p / "zarr.json"), "no zarr group that can be read"),
    "the description is gone": (lambda p: (p / "zarr.json").unlink(), "no zarr group that can be read"),
    "the specification is cut": (
        lambda p: edit(p / "zarr.json", lambda d: d["attributes"].update(specification="{")),
        "its description can't be read",
    ),
    "the specification is gone": (
        lambda p: edit(p / "zarr.json", lambda d: d["attributes"].pop("specification")),
        "can't be read",
    ),
    "pieces make no sense": (
        lambda p: edit(p / "zarr.json", lambda d: d["attributes"].update(chunks=[1])),
        "pieces of",
    ),
    "a coordinate's description is gone": (lambda p: (p / "joint1/zarr.json").unlink(), "joint1 is not there"),
    "a coordinate's description is empty": (lambda p: (p / "joint1/zarr.json").write_bytes(b""), "joint1 is not there"),
    "numbers are said to be the other way round": (
        lambda p: (p / "sigma_1/zarr.json").write_text((p / "sigma_1/zarr.json").read_text().replace("little", "big")),
        "sigma_1 is not there, or is something else",
    ),
    "a coordinate is cut": (lambda p: cut(p / "joint1/c.0"), "values of joint1 are not there, or broken"),
    "it is another's group": (
        lambda p: edit(p / "zarr.json", lambda d: d.update(attributes={})),
        "no map of cinegen's",
    ),
    "it is of another version": (
        lambda p: edit(p / "zarr.json", lambda d: _version(d["attributes"])),
        "version 0, and 4 is read here",
    ),
}


def _version(attributes):
    attributes["specification"] = json.dumps({**json.loads(attributes["specification"]), "version": 0})


@pytest.mark.parametrize("what", WRONG)
def test_what_is_no_map_or_no_longer_one_is_left_as_it_is(spec, copied, what):
    spoil, said = WRONG[what]
    spoil(copied)
    before = digest(copied)
    for function in (lambda: open_map(copied), lambda: again(spec, copied)):
        with pytest.raises(MapError, match=said) as raised:
            function()
        assert str(copied) in str(raised.value)
    assert digest(copied) == before


def test_other_things_at_the_path_are_left_as_they_are(spec, tmp_path):
    file, folder, array = tmp_path / "a.zarr", tmp_path / "b.zarr", tmp_path / "c.zarr"
    file.write_text("mine")
    folder.mkdir()
    (folder / "thesis.tex").write_text("mine")
    zarr.create_array(array, shape=(3,), dtype="float32")[:] = 1.0
    (tmp_path / "link.zarr").symlink_to(tmp_path / "nowhere")
    before = digest(tmp_path)
    for path, said in ((file, "is a file"), (folder, "no zarr group"), (array, "no zarr group"),
                       (tmp_path / "link.zarr", "there is no map")):  # fmt: skip
        with pytest.raises(MapError, match=said):
            again(spec, path)
    with pytest.raises(MapError, match="there is no map at"):
        open_map(tmp_path / "none.zarr")
    assert digest(tmp_path) == before


def test_a_map_behind_a_link_is_gone_on_with_where_it_is(spec, copied, whole, tmp_path):
    """It may be on another disk, and only within one a file is put in its place whole."""
    link = tmp_path / "elsewhere" / "link.zarr"
    link.parent.mkdir()
    link.symlink_to(copied)
    assert store.beside(link).parent == copied.parent
    store.Store(copied).forget((0, 0, 0))
    again(spec, link)
    assert digest(copied) == digest(whole)
    assert os.listdir(link.parent) == ["link.zarr"]


def test_a_map_of_something_else_is_not_overwritten(robot, copied):
    before = digest(copied)
    with pytest.raises(MapError, match=r"map of something else: quantities is .*margin, not sigma_1"):
        again(of_motors(robot("planar_3r"), quantities=("sigma_1",)), copied)
    with pytest.raises(MapError, match="another robot"):
        again(of_motors(robot("rx90")), copied)
    assert digest(copied) == before


def test_where_nothing_can_be_written_that_is_said(spec):
    with pytest.raises(MapError, match="can't be written"):
        again(spec, "/proc/nowhere/map.zarr")


def test_two_processes_do_not_make_the_same_map(spec, copied, whole):
    store.Store(copied).forget((0, 0, 0))
    with (copied / "zarr.json").open("r+b") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(MapError, match=r"map.zarr is being made by another process"):
            again(spec, copied)
        assert open_map(copied)["settled"].values.min() == 0  # reading is free
    again(spec, copied)
    assert digest(copied) == digest(whole)


@pytest.mark.parametrize("given", [{"workers": 0}, {"most": 0}, {"workers": -1}])
def test_numbers_that_make_no_sense_are_refused(spec, tmp_path, given):
    with pytest.raises(MapError, match="must be 1 or more"):
        make_map(spec, tmp_path / "map.zarr", **given)
    assert os.listdir(tmp_path) == []


def test_large_maps_have_larger_pieces_but_not_beyond_measure():
    sizes = [piece_size(10**k, 20_000) for k in range(19)]
    assert sizes == sorted(sizes)
    assert sizes[9] == 20_000  # as small as tasks
    assert sizes[12] == sizes[18] == 200_000
