"""Kernels that nobody has compiled yet: Python computes, until another process has compiled them."""

import importlib
import logging
import os
import subprocess
import sys
from functools import partial

import pytest
from numba.core import caching

from cinegen.jit import compiled, starting

KERNEL = """
from cinegen.jit.compiled import Array, entry
from cinegen.jit.memory import Memory, array, parameter, state

class Numbers(Memory):
    count: int = parameter(0)
    total: float = state(0.0)
    numbers: Array = array("count")

@entry
def add(memory: Numbers) -> int:
    memory.total = 0.0
    for i in range(memory.count):
        memory.total += memory.numbers[i]
    return memory.count
"""
COMPILER = """
import sys, time
from pathlib import Path
from {kernel} import Numbers, add
from cinegen.jit.compiled import prepare

if Path("slow").exists():
    time.sleep(2.0)
if Path("broken").exists():
    sys.exit("no compiler here")
prepare(add, Numbers)
print(1, 1, flush=True)
"""


@pytest.fixture
def kernel(tmp_path, monkeypatch, request):
    """A module with a kernel that no process has compiled; and a compiler of its own."""
    name = f"kernel_{abs(hash(request.node.name)) % 10**6}"
    (tmp_path / f"{name}.py").write_text(KERNEL)
    (tmp_path / f"{name}_compiler.py").write_text(COMPILER.format(kernel=name))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.getcwd()]))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(starting, "COMPILER", f"{name}_compiler")
    monkeypatch.setattr(starting, "COMPILATION", starting.Compilation())
    yield importlib.import_module(name)
    starting.COMPILATION.wait()
    del sys.modules[name]


class Owner:
    """What calls a kernel, as a solver does."""

    def __init__(self, kernel):
        self.memory = kernel.Numbers(count=3)
        self.memory.numbers[:] = 1.0, 2.0, 4.0
        self.add = starting.start(kernel.add, kernel.Numbers, install=partial(setattr, self, "add"))

    def call(self):
        return self.add(self.memory.handle), self.memory.total


def test_a_kernel_runs_at_once_and_machine_code_takes_over_between_two_calls(kernel, tmp_path, caplog):
    (tmp_path / "slow").touch()
    owner = Owner(kernel)
    first = owner.add
    assert isinstance(first, starting.InterpretedKernel)
    assert owner.call() == (3, 7.0)
    assert owner.add is first
    assert starting.COMPILATION.is_running
    assert "compiling kernels" in caplog.text
    starting.COMPILATION.wait()
    assert (starting.COMPILATION.done, starting.COMPILATION.count) == (1, 1)
    assert owner.call() == (3, 7.0)
    assert not isinstance(owner.add, starting.InterpretedKernel)  # now it is machine code, without anything between
    assert owner.call() == (3, 7.0)


def test_a_compiled_kernel_is_loaded_without_another_process(kernel):
    compiled.prepare(kernel.add, kernel.Numbers)
    owner = Owner(kernel)
    assert not isinstance(owner.add, starting.InterpretedKernel)
    assert starting.COMPILATION.done is None
    assert owner.call() == (3, 7.0)


def test_where_kernels_cannot_be_compiled_python_goes_on_and_the_reason_is_reported(kernel, tmp_path, caplog):
    (tmp_path / "broken").touch()
    owner = Owner(kernel)
    starting.COMPILATION.wait()
    assert "no compiler here" in caplog.text
    assert "no compiler here" in starting.COMPILATION.error
    assert owner.call() == (3, 7.0)
    assert isinstance(owner.add, starting.InterpretedKernel)


def test_two_processes_do_not_compile_the_same_kernel(kernel, tmp_path):
    program = (
        f"import logging, sys\nlogging.basicConfig(stream=sys.stdout)\nfrom {kernel.__name__} import Numbers, add\n"
        "from cinegen.jit.compiled import prepare\n"
        "print(prepare(add, Numbers)(Numbers(count=2).handle))\n"
    )
    running = [subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    printed = [process.communicate(timeout=120)[0] for process in running]
    assert all(text.endswith("2\n") for text in printed)
    assert sum("compiling add" in text for text in printed) == 1


def test_a_change_of_what_a_kernel_does_not_use_leaves_it_compiled(kernel):
    used = compiled._stamp_files(compiled.Path(kernel.__file__))
    names = {path.name for path in used}
    assert {"compiled.py", "memory.py"} <= names
    assert not names & {"starting.py", "interpreted.py", "solver.py"}


def test_a_kernel_without_a_place_on_disk_is_compiled_in_this_process(kernel, monkeypatch, caplog):
    monkeypatch.setattr(kernel.add, "_cache", caching.NullCache())
    assert compiled.is_cached(kernel.add, kernel.Numbers)
    caplog.set_level(logging.WARNING)
    assert Owner(kernel).call() == (3, 7.0)
    assert starting.COMPILATION.done is None


def test_where_the_package_cannot_be_written_machine_code_is_kept_for_the_user(kernel, tmp_path, monkeypatch):
    def refuse(locator):
        raise PermissionError("read-only")

    monkeypatch.setattr(caching.InTreeCacheLocator, "ensure_cache_path", refuse)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    add = compiled.entry(kernel.add.py_func)
    compiled.prepare(add, kernel.Numbers)
    assert compiled.is_cached(add, kernel.Numbers)
    assert list((tmp_path / "cache").rglob("*.nbi"))
    assert not list(tmp_path.glob("__pycache__/*.nbi"))


def test_the_compiler_goes_on_when_nobody_reads_its_progress():
    """The process that started it may end before; all kernels are compiled here, so that this takes seconds."""
    command = [sys.executable, "-m", starting.COMPILER]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    assert (process.stderr.read(), process.wait(120)) == (b"", 0)
