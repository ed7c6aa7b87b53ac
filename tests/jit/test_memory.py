"""Memory of kernels: the same fields in Python and in compiled functions, and memory of others."""

import numpy as np
import pinocchio as pin
import pytest
from numba import types
from numba.core.caching import NullCache

import cinegen
from cinegen.jit import foreign
from cinegen.jit.compiled import Array, Table, compiled, entry, prepare
from cinegen.jit.memory import Memory, array, parameter, state, view
from cinegen.jit.memory import foreign as declare_foreign


class Points(Memory):
    """Some points."""

    count: int = parameter(0)
    factor: float = parameter(2.0)
    sum: float = state(0.0)
    calls: int = state(0)
    point: Array = array("count", 3)
    label: Table = array("count", dtype=int)
    other: Array = declare_foreign("count")
    first: Array = array(2, block="record")
    last: Array = array("count", block="record")


class Weighted(Points):
    """Points with weights."""

    weight: Array = array("count")


class Masses(Points, part=True):
    """Masses of points: a part of larger declarations."""

    heaviest: float = state(0.0)
    mass: Array = array("count")


class Bodies(Masses, Weighted):
    """Points with masses and weights."""

    radius: Array = array("count")


points_at = view(Points)


@compiled
def total(memory: Points) -> float:
    s = 0.0
    for i in range(memory.count):
        for k in range(3):
            s += memory.point[i, k] * memory.label[i]
    return s * memory.factor


@entry
def add_up(memory: Weighted) -> int:
    memory.calls += 1
    memory.sum = total(memory)
    for i in range(memory.count):
        memory.point[i, 0] = memory.weight[i]
        memory.last[i] = memory.other[i]
    return memory.calls


@entry
def sum_of(handles: Table) -> float:
    s = 0.0
    for handle in handles:
        s += points_at(handle).sum
    return s


for function in (add_up, sum_of):
    function._cache = NullCache()


def weighted(count: int) -> Weighted:
    memory = Weighted(count=count)
    memory.point[:] = np.arange(3.0 * count).reshape(count, 3)
    memory.label[:], memory.weight[:] = np.arange(count), -1.0
    memory.point_at("other", np.arange(count) + 0.5)
    return memory


def test_a_kernel_and_python_see_the_same():
    memory = weighted(4)
    expected = 2.0 * (memory.point.sum(axis=1) * memory.label).sum()
    run = prepare(add_up, Weighted)
    assert run(memory.handle) == 1
    assert memory.sum == expected
    assert all(buffer.ctypes.data % 64 == 0 for buffer in (memory.point, memory.label, memory.weight, memory.first))
    assert memory.point[:, 0].tolist() == [-1.0] * 4
    assert memory.last.tolist() == [0.5, 1.5, 2.5, 3.5]
    memory.factor = 0.0
    assert run(memory.handle) == memory.calls == 2
    assert memory.sum == 0.0


def test_only_what_changes_its_shape_begins_anew():
    memory = weighted(3)
    memory.sum, first = 7.0, memory.point
    memory.resize(count=3)
    assert memory.point is first
    memory.resize(count=5)
    assert memory.point.shape == (5, 3)
    assert not memory.point.any()
    assert (memory.sum, memory.handle) == (7.0, memory.words.ctypes.data)


@compiled
def find_heaviest(memory: Masses) -> None:
    memory.heaviest = 0.0
    for i in range(memory.count):
        memory.heaviest = max(memory.heaviest, memory.mass[i])


def test_a_kernel_for_a_part_sees_that_part_of_the_whole():
    @entry
    def weigh(memory: Bodies) -> float:
        find_heaviest(memory)
        memory.radius[0] = total(memory)
        return memory.heaviest

    weigh._cache = NullCache()
    bodies = Bodies(count=3)
    bodies.mass[:], bodies.weight[:], bodies.point[:], bodies.label[:] = (1.0, 4.0, 2.0), 9.0, 1.0, 1
    assert prepare(weigh, Bodies)(bodies.handle) == bodies.heaviest == 4.0
    assert (bodies.radius.tolist(), bodies.weight.tolist()) == ([18.0, 0.0, 0.0], [9.0] * 3)


def test_a_kernel_for_a_part_does_not_see_the_rest():
    @compiled
    def peep(memory: Masses) -> float:
        return memory.radius[0]

    @entry
    def look(memory: Bodies) -> float:
        return peep(memory)

    look._cache = NullCache()
    with pytest.raises(Exception, match="Unknown attribute 'radius'"):
        prepare(look, Bodies)


def test_a_part_has_no_memory_and_one_whole():
    with pytest.raises(TypeError, match=r"Masses is a part .*: make a memory of that one"):
        Masses(count=1)
    with pytest.raises(TypeError, match="Others: its parts are those of another declaration"):
        type("Others", (Masses,), {"__module__": __name__, "__qualname__": "Others"})


def test_handles_lead_to_other_memory():
    several = [weighted(1), weighted(2)]
    several[0].sum, several[1].sum = 1.5, 2.0
    assert prepare(sum_of, types.int64[::1])(np.array([memory.handle for memory in several])) == 3.5


def test_a_name_is_declared_once():
    with pytest.raises(TypeError, match=r"Again\.sum is taken"):
        type("Again", (Points,), {"sum": state(0.0), "__module__": __name__, "__qualname__": "Again"})


@pytest.mark.parametrize("name", ["factor", "point"])
def test_a_kernel_sets_states_only(name):
    @entry
    def set_it(memory: Points) -> None:
        if name == "factor":
            memory.factor = 1.0
        else:
            memory.point = memory.point

    set_it._cache = NullCache()
    with pytest.raises(Exception, match=f"{name} of .*Points is not a state: a kernel can't set it"):
        prepare(set_it, Points)


@pytest.mark.parametrize("wrong", [np.zeros(2), np.zeros(3, dtype=int), np.zeros(6)[::2]])
def test_memory_of_others_must_fit(wrong):
    with pytest.raises(ValueError, match=r"other is \(3,\) of float64"):
        weighted(3).point_at("other", wrong)


# --- memory of others ------------------------------------------------------------------------------------------------


def test_this_build_of_pinocchio_is_read_in_place():
    assert foreign.SE3_DISTANCE is not None
    kinematics = foreign.JointKinematics(pin.buildSampleModelHumanoidRandom().createData())
    assert (kinematics.frames_in_place, kinematics.screws_in_place) == (True, True)


def follow_targets(arm) -> np.ndarray:
    """The records of ticks that follow a target, changed in place and replaced in turn."""
    solver = cinegen.Solver(arm, 0.01)
    task, records = solver.add_task("tool"), []
    for i in range(40):
        if i % 2:
            task.target.translation[2] -= 1e-3  # in place
        else:
            task.target = task.target * pin.SE3(pin.exp3(np.array([0.0, 0.0, 1e-2])), np.zeros(3))
        records.append(solver.step()._record)
        wanted, reached = task.target, arm.placement(solver.q, "tool")
        assert np.linalg.norm(wanted.translation - reached.translation) < 1e-4
        assert wanted.rotation == pytest.approx(reached.rotation, abs=1e-3)
    return np.array(records)


def test_targets_that_are_copied_are_followed_as_those_in_place(robot, monkeypatch):
    in_place = follow_targets(robot("arm7"))
    for module in ("cinegen.ik.task", "cinegen.ik.solver"):
        monkeypatch.setattr(f"{module}.SE3_DISTANCE", None)
    assert np.array_equal(follow_targets(robot("arm7")), in_place)


def test_frames_and_screws_are_copied_where_they_can_not_be_read_in_place(monkeypatch):
    model = pin.buildSampleModelHumanoidRandom()
    data, shift = model.createData(), iter(range(10**6))
    monkeypatch.setattr(foreign, "address", lambda values, of=foreign.address: of(values) + 8 * next(shift))
    copied = foreign.JointKinematics(data)
    monkeypatch.undo()
    usual = foreign.JointKinematics(data)
    assert (usual.frames_in_place, usual.screws_in_place) == (True, True)
    assert (copied.frames_in_place, copied.screws_in_place) == (False, False)
    for seed in range(3):
        pin.seed(seed)
        pin.computeJointJacobians(model, data, pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)))
        usual.read()
        copied.read()
        assert np.array_equal(usual.frames, copied.frames)
        assert np.array_equal(usual.screws, copied.screws)
        assert np.array_equal(usual.screws, data.J.T)


def test_the_distance_of_a_copy_is_only_believed_if_its_numbers_are_there(monkeypatch):
    monkeypatch.setattr(foreign, "frame_of", lambda placement: np.zeros((4, 3)))
    assert foreign._distance() is None
