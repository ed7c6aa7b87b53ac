"""No command listens beyond this machine unless `--host` asks for it, and no stranger runs code in its processes."""

import json
import os
import shutil
import socket
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
import pytest
from distributed import LocalCluster
from test_wrong_arguments import CALLS
from variants import slow

from cinegen import cluster

PATIENCE = 120.0  # s, on a busy machine
LOOPBACK = ("127.", "::1")
MAP = ("delta4", "--over", "x=-1..1:30,y=-1..1:30,z=-2..-1:10", "--yes")
PAGE = ("--seconds", "0.5", "--no-browser")
ELSEWHERE = ("drive", "five_bar", "--host", "0.0.0.0", *PAGE)
PAGES = [("drive", "five_bar", "--sensor", "tool=tcp://127.0.0.1:0", "--record", "run.jsonl", *PAGE), ELSEWHERE]
OTHER_PAGES = (
    ("map", "planar_3r", "--over", "xy", "--grid", "10", "--view", *PAGE),
    ("sensors", "--monitor", "tcp://127.0.0.1:0", "--seconds", "0.5"),
    ("drive", "five_bar", "--record", "run.jsonl", *PAGE),
    ("replay", "run.jsonl", *PAGE),
    ("demo", "disc", *PAGE),
    ("modes", "four_bar", "--view", *PAGE),
    ("plan", "disc", "--view", *PAGE),
    ELSEWHERE,
)


def sockets(pid):
    """(process, address, port) of each socket of a process tree that anybody may connect or send to."""
    opened = set()
    try:
        processes = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
    except psutil.NoSuchProcess:
        return opened
    for process in processes:
        try:
            for conn in process.net_connections("inet"):
                if conn.laddr and (conn.status == psutil.CONN_LISTEN or conn.type == socket.SOCK_DGRAM):
                    opened.add((process.pid, conn.laddr.ip, conn.laddr.port))
            for conn in process.net_connections("unix"):  # without a name nobody else reaches it
                if conn.laddr:
                    opened.add((process.pid, conn.laddr, 0))
        except (psutil.NoSuchProcess, psutil.ZombieProcess):
            continue
    return opened


# Commands one after the other in one process: each is announced on standard output before it begins.
PROGRAM = """
import json, os, sys
from cinegen.cli import main
codes = []
for words in json.loads(sys.argv[1]):
    os.write(1, b"#")
    codes.append(main(words))
os._exit(any(codes))
"""


@pytest.fixture
def watched(root, tmp_path):
    """`watched(("drive", "delta4"), ...)`: for each of several commands, which must be right, all sockets that it
    listened on."""

    def run(*calls):
        log, opened, end = tmp_path / "log", [set() for _ in calls], time.monotonic() + PATIENCE * len(calls)
        with log.open("wb") as out:
            process = subprocess.Popen(
                [sys.executable, "-c", PROGRAM, json.dumps(calls)], cwd=tmp_path, stdin=subprocess.DEVNULL,
                stdout=out, stderr=subprocess.STDOUT, env=os.environ | {"PYTHONPATH": str(root)},
            )  # fmt: skip
        try:
            while process.poll() is None:
                assert time.monotonic() < end, log.read_text()
                begun = log.read_bytes().count(b"#")
                current = sockets(process.pid)
                if begun and begun == log.read_bytes().count(b"#"):
                    opened[begun - 1] |= current
                time.sleep(0.1)
        finally:
            process.kill()
        assert process.returncode == 0, log.read_text()
        return opened

    return run


def sys_path():
    return sys.path


def beyond(opened):
    """Those sockets that other machines reach."""
    return {(address, port) for _, address, port in opened if not address.startswith(LOOPBACK)}


@pytest.mark.parametrize("commands", [PAGES, *slow((OTHER_PAGES,))])
def test_pages_and_sensors_listen_on_this_machine_only(watched, commands):
    *local, elsewhere = watched(*commands)
    for command, listened in zip(commands, local, strict=False):
        assert listened, command
        assert not beyond(listened), command
    assert beyond(elsewhere)  # a page for other machines is seen here


TASK = """
starts = 2
parameters = { "link2.d" = "200..400mm" }
reach = { x = "-50..50mm", y = "350..400mm" }
objective = [{ minimise = "condition" }]
"""


@pytest.mark.slow
@pytest.mark.parametrize("command", [("map", *MAP), ("synthesize", "five_bar", "--task", "task.toml")])
def test_processes_that_share_work_listen_on_this_machine_only_and_serve_no_http(watched, tmp_path, command):
    (tmp_path / "task.toml").write_text(TASK)
    (opened,) = watched((*command, "--workers", "2"))
    assert len({pid for pid, *_ in opened}) == 3  # the scheduler and both workers
    # One socket each: another one would be an HTTP server's. A process that begins holds its parent's for a moment.
    assert len({(address, port) for _, address, port in opened}) == 3
    assert not beyond(opened)


LISTENING = {f"cinegen {name}" for name in ("demo", "drive", "replay", "synthesize")}


@pytest.mark.slow
def test_all_other_commands_listen_nowhere(watched, inputs, tmp_path):
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    names = [name for name in CALLS if name.startswith("cinegen ") and name not in LISTENING]
    arguments = CALLS | {"cinegen plan": "disc -o way.jsonl"}
    calls = [*(f"{name} {arguments[name]}" for name in names), "cinegen drive four_bar.raff --snapshot page.html"]
    quiet = [call.split()[1:] for call in calls]
    assert watched(*quiet) == [set()] * len(quiet)


STRANGER = """
import asyncio, os, sys
from distributed.core import rpc
from distributed.protocol.pickle import dumps
from distributed.security import Security

security = Security.temporary()

async def ask(address, name):
    certificate = security.get_connection_args("client") if address.startswith("tls") else {}
    there = rpc(address, timeout=10, connection_args=certificate)
    try:
        return (await getattr(there, name)(function=dumps(os.getpid)))["result"]
    except Exception as error:
        return f"refused: {error}"
    finally:
        await there.close_rpc()

async def ask_all():
    print(*await asyncio.gather(*map(ask, sys.argv[1::2], sys.argv[2::2])), sep="\\n")

asyncio.run(ask_all())
"""


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="permissions of POSIX")
def test_who_knows_the_addresses_of_those_that_make_a_map_can_neither_run_nor_place_anything_in_them(
    root, tmp_path, monkeypatch
):
    """Dask puts its working folder in front of `sys.path`: nobody else may have made it, or write into it."""
    (tmp_path / "dask-scratch-space").mkdir(mode=0o777)  # a stranger was here before
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with cluster.connected(None, 1) as client:
        ((address, worker),) = client.scheduler_info(n_workers=-1)["workers"].items()
        local_paths = [path for path in sys.path if "scratch" in path]
        worker_paths = client.submit(sys_path).result()
        for path in (*local_paths, worker["local_directory"], worker_paths[0]):
            parents = [Path(path), *Path(path).parents]
            assert tmp_path / "dask-scratch-space" not in parents
            private = parents[parents.index(tmp_path) - 1]
            assert stat.S_IMODE(private.stat().st_mode) == 0o700
            assert private.stat().st_uid == os.getuid()
        places = ((client.scheduler.address.partition("://")[2], "run_function"), (address.partition("://")[2], "run"))
        asked = [word for at, name in places for scheme in ("tcp", "tls") for word in (f"{scheme}://{at}", name)]
        unsafe = LocalCluster(n_workers=0, processes=False, protocol="tcp", host="127.0.0.1", dashboard_address=None)
        with unsafe:
            command = [sys.executable, "-c", STRANGER, unsafe.scheduler_address, "run_function", *asked]
            done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=PATIENCE, check=True)
        assert client.submit(pow, 2, 3).result() == 8  # while this process may
    answer, *answers = done.stdout.splitlines()
    assert answer.isdecimal()  # where nothing keeps a stranger from that
    assert len(answers) == 4
    assert all(answer.startswith("refused: ") for answer in answers), answers
    assert [path.name for path in tmp_path.iterdir()] == ["dask-scratch-space"]
