"""Maps made by several processes: the same bytes as one makes, whatever dies meanwhile, and without a word."""

import gc
import os
import resource
import signal
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import pytest
from browsers import becomes
from distributed import Future
from folders import digest, files, over_joints

from cinegen import cluster
from cinegen.cluster import ClusterError
from cinegen.workspace import MapError, make_map, open_map
from cinegen.workspace.zarr_store import MapStore

HERE = Path(__file__).parent
MOST = 10  # cells of a chunk


@pytest.fixture(scope="module")
def client():
    """Two processes, and who asks them."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with cluster.connected(None, 2) as client:
            client.run(lambda path: sys.path.insert(0, path), str(HERE))
            yield client


@pytest.fixture(scope="module")
def address(client):
    return client.scheduler.address


@pytest.fixture(scope="module")
def spec(robot):
    return over_joints(robot("planar_3r"), 6)


@pytest.fixture(scope="module")
def whole(spec, tmp_path_factory):
    """The map that one process makes."""
    path = tmp_path_factory.mktemp("whole") / "map.zarr"
    make_map(spec, path, workers=1, most=MOST)
    return path


@pytest.fixture(autouse=True)
def small_tasks(monkeypatch):
    monkeypatch.setattr("cinegen.workspace.maps.OVER_JOINTS", MOST)
    monkeypatch.setattr("cinegen.workspace.maps._QUICK", 2)


def pids(client):
    return set(client.run(os.getpid).values())


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def children(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_two_processes_make_the_same_bytes_as_one(spec, whole, address, tmp_path, capfd):
    reports = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make_map(spec, tmp_path / "two.zarr", scheduler=address, most=MOST, report=lambda *done: reports.append(done))
    assert digest(tmp_path / "two.zarr") == digest(whole)
    assert [reports[0], reports[-1]] == [(0, spec.region.size), (spec.region.size, spec.region.size)]
    assert [done for done, _ in reports] == sorted(done for done, _ in reports)
    assert set(os.listdir(tmp_path)) == {"two.zarr"}
    assert capfd.readouterr() == ("", "")


def test_a_process_that_is_killed_is_replaced_and_its_chunks_are_made(spec, whole, client, address, tmp_path, capfd):
    before, killed = pids(client), []

    def kill(done, size):
        if 0 < done < size and not killed:
            killed.append(min(before))
            os.kill(killed[0], signal.SIGKILL)

    make_map(spec, tmp_path / "map.zarr", scheduler=address, most=MOST, report=kill)
    assert killed
    assert digest(tmp_path / "map.zarr") == digest(whole)
    assert capfd.readouterr() == ("", "")
    assert becomes(lambda: len(pids(client)) == 2, 60.0)
    assert len(pids(client) & before) == 1


def test_a_result_that_is_lost_with_its_process_is_asked_for_again(client, monkeypatch):
    """The scheduler reports a task as done, and its process dies before anybody looks."""
    status, lost = Future.status.fget, []

    def once_lost(future):
        if not lost and sys._getframe(1).f_globals["__name__"] == "cinegen.cluster":
            lost.append(future.key)
            return "lost"
        return status(future)

    monkeypatch.setattr(Future, "status", property(once_lost))
    assert sorted((task, future.result()) for task, future in cluster.each(client, abs, [-1, -2, -3])) == [
        (-3, 3), (-2, 2), (-1, 1),
    ]  # fmt: skip
    assert lost


def test_a_disk_that_is_full_for_others_is_said_here_and_what_was_finished_stays(
    spec, whole, client, address, tmp_path, capfd
):
    path, before = tmp_path / "map.zarr", {}

    def limit(size):
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

    def fill(done, _):
        if done and not before:
            before.update(files(path / "status"))
            client.run(limit, 50)

    try:
        with pytest.raises(MapError, match=r"map.zarr can't be written: File too large. Complete chunks stay"):
            make_map(spec, path, scheduler=address, most=MOST, report=fill)
    finally:
        client.run(limit, resource.RLIM_INFINITY)
    assert 0 < MapStore(path).done < spec.region.size
    make_map(spec, path, scheduler=address, most=MOST)
    assert digest(path) == digest(whole)
    assert before.items() <= files(path / "status").items()
    assert capfd.readouterr() == ("", "")


def test_few_tasks_are_under_way_however_many_there_are(client):
    begun, most = 0, 0

    def tasks():
        nonlocal begun
        for k in range(200):
            begun += 1
            yield k

    seen = set()
    for done, (task, made) in enumerate(cluster.each(client, pow, tasks(), 1)):
        most = max(most, begun - done)
        seen.add(task)
        assert made.result() == 1
    assert seen == set(range(200))
    assert most <= 3 * 2  # of each process


def test_a_task_that_fails_is_said_and_so_are_cinegen_s_own_errors(client):
    with pytest.raises(ClusterError, match=r"a task could not be done: .*division.*Finished tasks stay"):
        list(cluster.each(client, divmod, [0], 1))
    with pytest.raises(MapError, match="there is no map at /proc/nowhere"):
        list(cluster.each(client, open_map, ["/proc/nowhere"]))


def test_where_no_scheduler_answers_that_is_said_and_the_map_goes_on_later(spec, whole, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(cluster, "_PATIENCE", 0.5)
    path, threads = tmp_path / "map.zarr", set(threading.enumerate())
    gc.disable()  # which would end the thread of a client that was refused
    try:
        for wrong in ("tcp://127.0.0.1:9", "nonsense://there"):
            with pytest.raises(ClusterError, match=f"no Dask scheduler answers at {wrong}"):
                make_map(spec, path, scheduler=wrong, most=MOST)
        assert "IO loop" not in {thread.name for thread in set(threading.enumerate()) - threads}
    finally:
        gc.enable()
    assert capfd.readouterr() == ("", "")
    make_map(spec, path, workers=1)
    assert digest(path) == digest(whole)


SCRIPT = f"""
import sys
import threading
sys.path.insert(0, {str(HERE)!r})
import cinegen
from cinegen.workspace import make_map, maps
from folders import over_joints
maps.OVER_JOINTS, maps._QUICK = {MOST}, 2
def say(done, size):
    print(done, flush=True)
    if done:
        input()
make_map(over_joints(cinegen.load(sys.argv[1]), 6), sys.argv[2], workers=2, most={MOST}, report=say)
"""


def test_a_script_without_a_guard_that_is_killed_takes_its_processes_along(spec, whole, address, tmp_path, root):
    script, robot, path = tmp_path / "script.py", root / "robots/planar_3r.raff", tmp_path / "map.zarr"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), str(robot), str(path)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline() == b"0\n"
    assert int(process.stdout.readline()) > 0
    others = [pid for pid in children(process.pid) if alive(pid)]
    assert len(others) == 2
    process.kill()
    assert process.communicate()[1] == b""
    assert becomes(lambda: not any(map(alive, others)), 60.0)
    assert process.returncode == -signal.SIGKILL
    done = MapStore(path).done
    assert 0 < done < spec.region.size
    before = files(path / "status")
    make_map(spec, path, scheduler=address)
    assert digest(path) == digest(whole)
    assert before.items() <= files(path / "status").items()
    assert set(os.listdir(tmp_path)) == {"script.py", "map.zarr"}
