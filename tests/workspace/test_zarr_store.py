"""Maps on disk: the same bytes however often work was broken off, and plain words where files are broken."""

import errno
import json
import math
import os
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray
import zarr
from filelock import FileLock
from folders import digest, files, of_delta, over_joints
from hypothesis import given
from hypothesis import strategies as st
from mapped import mapped

from cinegen.workspace import GridAxis, MapError, MapSpecification, Region, make_map, open_map
from cinegen.workspace.checked_files import is_sound
from cinegen.workspace.chunks import chunk_cells, chunk_counts, chunk_shape
from cinegen.workspace.evaluator import ChunkEvaluator
from cinegen.workspace.zarr_store import _ENCODING, MapStore

MOST = 15  # cells of a chunk: 10 chunks, those at the end smaller


@pytest.fixture(scope="module")
def spec(robot):
    return over_joints(robot("planar_3r"))


@pytest.fixture(scope="module")
def whole(spec, tmp_path_factory):
    """A map that nothing happened to."""
    path = tmp_path_factory.mktemp("whole") / "map.zarr"
    make_map(spec, path, workers=1, most=MOST)
    return path


@pytest.fixture
def made(monkeypatch):
    """How many chunks are evaluated."""
    count = [0]
    values = ChunkEvaluator.values

    def counted(self, chunk):
        count[0] += 1
        return values(self, chunk)

    monkeypatch.setattr(ChunkEvaluator, "values", counted)
    return count


@pytest.fixture
def copied(whole, tmp_path):
    return Path(shutil.copytree(whole, tmp_path / "map.zarr"))


def again(spec, path):
    return make_map(spec, path, workers=1, most=MOST)


# --- what is there -------------------------------------------------------------------------------------------------


def test_what_is_read_is_what_was_found_in_every_cell(spec, whole):
    layers, read = mapped(spec), open_map(whole)
    assert set(read.data_vars) == set(layers)
    for name, values in layers.items():
        assert read[name].dtype == values.dtype
        np.testing.assert_array_equal(read[name].values, values)
    assert 0 < int(read["reachable"].sum()) < spec.region.size
    for axis in spec.region.axes:
        np.testing.assert_array_equal(read[axis.name].values, axis.middles())
    group = zarr.open_group(whole, mode="r")
    assert all((np.asarray(group[name]) == values).all() for name, values in layers.items() if values.dtype == bool)
    assert read["sigma_1"].attrs["units"] == "1"
    assert read.attrs["robot_sha256"] == spec.robot_hash


def test_xarray_opens_a_map_without_a_warning_and_finds_a_name_a_unit_and_a_coordinate(robot, tmp_path):
    """Attributes as the CF conventions have them."""
    mechanism = robot("gough")
    axes = (GridAxis(mechanism.actuated[0], -0.01, 0.01, 3),)
    quantities = ("sigma_1", "velocity", "force", "condition", "margin", "manipulability")
    make_map(MapSpecification(mechanism, Region(axes), quantities, limits=False), tmp_path / "map.zarr", workers=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with xarray.open_zarr(tmp_path / "map.zarr") as read:
            read.load()
        zarr.open_group(tmp_path / "map.zarr", mode="r")["configuration"][:]
    assert read.attrs["Conventions"].startswith("CF-")
    assert set(read.sizes) <= set(read.coords)
    names = [n for n, joint in zip(mechanism.model.names[1:], mechanism.model.joints[1:], strict=True) if joint.nq == 1]
    assert set(names) <= set(read["joint"].values)
    assert read["configuration"].sizes["joint"] == mechanism.model.nq == len(set(read["joint"].values))
    assert "joint_unit" in read["configuration"].coords
    for joint in names:
        coordinate = read["configuration"].sel(joint=joint)
        assert coordinate["joint_unit"].item() == ("m" if mechanism.is_prismatic(joint) else "rad")
        np.testing.assert_array_equal(coordinate.values, read["configuration"].values[..., mechanism.q_index(joint)])
    for variable in read.variables:
        attributes = read[variable].attrs
        assert attributes["long_name"]
        assert attributes.get("units", "none") in {"m", "rad", "1", "m s-1", "N"} or "joint" in read[variable].dims
    assert len(read["status"].attrs["flag_values"]) == len(read["status"].attrs["flag_meanings"].split())


@given(st.integers(0, 2**32), st.sampled_from(["float32", "float64", "uint8", "bool", "int32"]))
def test_a_chunk_with_any_bit_wrong_or_any_byte_missing_is_not_sound(seed, dtype):
    rng = np.random.default_rng(seed)
    array = zarr.create_array(zarr.storage.MemoryStore(), shape=(3, 4), chunks=(4, 5), dtype=dtype, **_ENCODING)
    array[:] = rng.integers(0, 2, (3, 4)).astype(dtype)
    data = array.store._store_dict["c.0.0"].to_bytes()
    assert is_sound(data)
    at = int(rng.integers(len(data)))
    assert not is_sound(data[:at] + bytes([data[at] ^ (1 << int(rng.integers(8)))]) + data[at + 1 :])
    assert not is_sound(data[:at])


@pytest.mark.parametrize(("name", "of"), [("delta4", of_delta), ("planar_3r", over_joints)])
def test_a_chunk_comes_to_the_same_whatever_was_made_before(robot, name, of):
    spec = of(robot(name))
    shape = spec.region.shape
    chunks = chunk_shape(shape, 40, cube=True)
    cells = [chunk_cells(chunk, shape, chunks) for chunk in range(math.prod(chunk_counts(shape, chunks)))]
    forward, other = ChunkEvaluator(spec), ChunkEvaluator(spec)
    forth = [forward.values(chunk) for chunk in cells]
    back = [other.values(chunk) for chunk in reversed(cells)][::-1]
    for values, others in zip(forth, back, strict=True):
        first, second = ({key: value.tobytes() for key, value in some.items()} for some in (values, others))
        assert first == second


# --- broken off ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("written", [0, 6])
def test_a_full_disk_costs_no_chunk_that_was_finished(spec, whole, tmp_path, monkeypatch, made, written):
    path, put, left = tmp_path / "map.zarr", zarr.storage._local._put, [written]

    def full(file, *arguments, **more):
        if file.name.startswith("c.") and file.parent.parent == path:
            if left[0] == 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            left[0] -= 1
        return put(file, *arguments, **more)

    with monkeypatch.context() as disk:
        disk.setattr(zarr.storage._local, "_put", full)
        with pytest.raises(MapError, match=r"No space left on device.*Complete chunks stay"):
            again(spec, path)
    assert made[0] == written // 5 + 1
    assert MapStore(path).complete().sum() == written // 5
    before = {name: file for name, file in files(path / "status").items() if name != "zarr.json"}
    read = open_map(path)
    assert int((read["status"].values > 0).sum()) == MapStore(path).done
    again(spec, path)
    assert made[0] == 1 + len(MapStore(path).complete())  # that which was broken off, twice
    assert before.items() <= files(path / "status").items()
    assert digest(path) == digest(whole)
    assert os.listdir(tmp_path) == ["map.zarr"]


def test_broken_off_between_two_chunks_it_goes_on_and_removes_what_a_kill_leaves(spec, whole, tmp_path, made):
    path, reports = tmp_path / "map.zarr", []

    def impatient(done, _):
        if done > 60:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_map(spec, path, workers=1, most=MOST, report=impatient)
    cells = MapStore(path).done
    assert made[0] == MapStore(path).complete().sum() > 1
    (tmp_path / ".map.zarr.new").mkdir()
    (tmp_path / ".map.zarr.new" / "half").write_bytes(b"of a map")
    (path / "status" / "c.1.1.0123.partial").write_bytes(b"half of a chunk")  # as zarr leaves it
    make_map(spec, path, workers=1, most=MOST, report=lambda *counts: reports.append(counts))
    assert [reports[0], reports[-1]] == [(cells, spec.region.size), (spec.region.size, spec.region.size)]
    assert made[0] == len(MapStore(path).complete())
    assert digest(path) == digest(whole)
    assert os.listdir(tmp_path) == ["map.zarr"]


# --- damaged -------------------------------------------------------------------------------------------------------


def cut(path):
    path.write_bytes(path.read_bytes()[:-7])


def rubbish(path):
    path.write_bytes(np.random.default_rng(0).bytes(300))


@pytest.mark.parametrize(
    ("damage", "name"), [(cut, "sigma_1/c.1.1.0"), (rubbish, "reachable/c.1.1.0"), (Path.unlink, "sigma_1/c.1.1.0")]
)
def test_a_damaged_chunk_is_said_when_read_and_made_again_when_gone_on(spec, whole, copied, made, damage, name):
    damage(copied / name)
    read = open_map(copied)
    with pytest.raises(MapError, match=rf"{name} is (missing|damaged): repeat .*delete .*status/c\.1\.1\.0"):
        read[name.partition("/")[0]].values  # noqa: B018
    again(spec, copied)
    assert made[0] == 1
    assert digest(copied) == digest(whole)


def edited(name, change):
    def spoil(path):
        document = json.loads((path / name).read_text())
        change(document)
        (path / name).write_text(json.dumps(document))

    return spoil


def attribute(name, change):
    return edited("zarr.json", lambda d: d["attributes"].update({name: change(d["attributes"][name])}))


WRONG = {
    "an array is missing": (lambda p: shutil.rmtree(p / "sigma_1"), "sigma_1 is missing"),
    "an array has another shape": (edited("margin/zarr.json", lambda d: d.update(shape=[1, 2, 3])),
        "margin is missing, or its description is wrong"),
    "the description is gone": (lambda p: (p / "zarr.json").unlink(), "is not a zarr group"),
    "the specification is a number": (attribute("specification", lambda _: "7"),
        "map.zarr: the map is damaged: its description is invalid"),
    "the URDF lacks a joint": (attribute("source", lambda s: s.replace('joint name=\\"joint1', 'joint name=\\"oint1')),
        r"map\.zarr: the map is damaged: its description is invalid \(.*joint1"),
    "a coordinate's description is empty": (lambda p: (p / "joint1/zarr.json").write_bytes(b""), "joint1 is missing"),
    "a coordinate is cut": (lambda p: cut(p / "joint1/c.0"), "the values of joint1 are missing or wrong"),
    "it is another's group": (edited("zarr.json", lambda d: d.update(attributes={})), "not a map of cinegen"),
    "it is of another version": (attribute("specification", lambda s: json.dumps({**json.loads(s), "version": 0})),
        "has version 0; this program reads version 8"),
}  # fmt: skip


@pytest.mark.filterwarnings("error")
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
    for path, said in ((file, "is a file"), (folder, "not a zarr group"), (array, "not a zarr group"),
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
    MapStore(copied).discard(0)
    again(spec, link)
    assert digest(copied) == digest(whole)
    assert os.listdir(link.parent) == ["link.zarr"]


def test_a_map_of_something_else_is_not_overwritten(robot, copied):
    before = digest(copied)
    with pytest.raises(MapError, match=r"is another map: quantities is .*margin, not sigma_1"):
        again(over_joints(robot("planar_3r"), quantities=("sigma_1",)), copied)
    with pytest.raises(MapError, match=r"robot is .*, not "):
        again(over_joints(robot("rx90")), copied)
    assert digest(copied) == before


def test_where_nothing_can_be_written_that_is_said(spec):
    with pytest.raises(MapError, match="can't be written"):
        again(spec, "/proc/nowhere/map.zarr")


def test_two_processes_do_not_make_the_same_map(spec, copied, whole):
    MapStore(copied).discard(0)
    with FileLock(copied.with_name(".map.zarr.lock")):
        with pytest.raises(MapError, match=r"another process makes .*map\.zarr"):
            again(spec, copied)
        assert open_map(copied)["status"].values.min() == 0  # reading is free
    again(spec, copied)
    assert digest(copied) == digest(whole)
