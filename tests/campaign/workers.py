"""Run cases in processes with limits of memory and time. A process that dies or hangs is a finding, and replaced."""

from __future__ import annotations

import ctypes
import faulthandler
import gc
import multiprocessing
import os
import resource
import signal
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from typing import Any

from campaign import judge
from campaign.judge import Finding, limit_memory

MEMORY = 6 << 30
"""Bytes of address space of a process, besides that of its parent."""

WALL = 120.0
"""Seconds after which a case that uses no CPU is ended."""

_KEPT = 3  # findings of one cause that are kept


class Campaign:
    """Cases by their numbers."""

    name = ""
    """Of its cases."""

    limit = 120.0
    """CPU seconds of a case."""

    def begin(self, worker: int) -> None:
        """Begin in a process of its own."""

    def end(self) -> None:
        """End there."""

    def evidence(self, number: int) -> tuple[str, dict[str, bytes]]:
        """Return the name of a case, and its files."""
        return f"{self.name}:{number}", {}

    def run(self, number: int) -> tuple[dict[str, int], dict[str, Any], list[Finding]]:
        """Run a case; return what is counted, the largest of what is measured, and the findings."""
        raise NotImplementedError


@dataclass
class Result:
    """What a campaign did.

    Attributes:
        counts: sums over all cases.
        worst: the largest of what was measured; a value may be a list that begins with it.
        findings: some of each cause.
        causes: number of findings of each cause.
        seconds: time.
        workers: number of processes.
    """

    counts: Counter[str] = field(default_factory=Counter)
    worst: dict[str, Any] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    causes: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0
    workers: int = 1

    def add(self, counts: dict[str, int], worst: dict[str, Any], findings: list[Finding]) -> None:
        """Add what a case, or a worker, did."""
        self.counts.update(counts)
        for name, value in worst.items():
            self.worst[name] = max(self.worst.get(name, value), value)
        self.causes.update(finding.key for finding in findings)
        for finding in findings:
            if sum(finding.key == kept.key for kept in self.findings) < _KEPT:
                self.findings.append(finding)

    def merge(self, other: Result) -> None:
        """Add what another process did."""
        self.add(dict(other.counts), other.worst, other.findings)
        self.causes.update(other.causes)
        self.causes.subtract(finding.key for finding in other.findings)


@dataclass
class _Worker:
    process: Any
    pipe: Connection
    trace: Any
    index: int
    number: int = -1
    alive_at: float = 0.0


def run(
    campaign: Campaign,
    cases: int,
    seconds: float = float("inf"),
    workers: int = 0,
    progress: Callable[[Result, float], None] = lambda *_: None,
    wall: float = WALL,
) -> Result:
    """Run the cases 0, 1, ... of a campaign.

    Args:
        campaign: the campaign, which is made before the processes are.
        cases: number of cases.
        seconds: time after which no case is begun.
        workers: number of processes; as many as cores unless given.
        progress: called about once a second with what is done, and the fraction of it.
        wall: seconds after which a case that uses no CPU is ended.
    """
    workers = workers or os.cpu_count() or 1
    context, began, result = multiprocessing.get_context("fork"), time.monotonic(), Result(workers=workers)
    running = {i: _start(context, campaign, i, i, workers, cases, began + seconds) for i in range(workers)}
    done = dict.fromkeys(running, 0)
    reported = began
    while running:
        ready = wait([worker.pipe for worker in running.values()], 1.0)
        now = time.monotonic()
        for i, worker in list(running.items()):
            dead = False
            if worker.pipe in ready:
                try:
                    message = worker.pipe.recv()
                    worker.alive_at = now
                    if message is None:
                        worker.process.join()
                        del running[i]
                        continue
                    if isinstance(message, Result):
                        result.merge(message)
                        done[i] = worker.number
                    else:
                        worker.number = message
                except (EOFError, OSError):
                    dead = True
            if not dead and now - worker.alive_at > wall:
                os.kill(worker.process.pid, signal.SIGABRT)
                worker.process.join(5.0)
                dead = True
            if dead:
                worker.process.join(10.0)
                worker.process.kill()
                _bury(result, campaign, worker)
                following = worker.number + workers
                if following < cases and now < began + seconds:
                    running[i] = _start(context, campaign, i, following, workers, cases, began + seconds)
                else:
                    del running[i]
        if now - reported > 1.0:
            reported, result.seconds = now, now - began
            progress(result, max(max(done.values()) / cases, (now - began) / seconds))
    result.seconds = time.monotonic() - began
    return result


def _start(context: Any, campaign: Campaign, index: int, first: int, step: int, cases: int, end: float) -> _Worker:
    receiver, sender = context.Pipe(duplex=False)
    trace = tempfile.TemporaryFile()  # noqa: SIM115 (read when the process has died)
    process = context.Process(target=_work, args=(sender, trace, campaign, index, range(first, cases, step), end))
    process.start()
    sender.close()
    return _Worker(process, receiver, trace, index, first, time.monotonic())


def _work(pipe: Connection, trace: Any, *arguments: Any) -> None:
    signal.signal(signal.SIGINT, lambda *_: None)  # commands that are started would inherit SIG_IGN
    die_with_parent()
    try:
        _run_all(pipe, trace, *arguments)
    except BaseException:
        trace.write(traceback.format_exc().encode())
        trace.flush()
        os._exit(1)
    os._exit(0)


def _run_all(pipe: Connection, trace: Any, campaign: Campaign, index: int, numbers: range, end: float) -> None:
    gc.freeze()  # else a collection copies all pages of the parent, out of the CPU that a case may take
    judge.capture()
    faulthandler.enable(trace)
    faulthandler.register(signal.SIGXCPU, trace, chain=True)
    campaign.begin(index)
    limit_memory(MEMORY)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    for number in numbers:
        if time.monotonic() > end:
            break
        limit = int(time.process_time() + campaign.limit) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (limit, hard))
        pipe.send(number)
        result = Result()
        result.add(*campaign.run(number))
        pipe.send(result)
    campaign.end()
    pipe.send(None)


def die_with_parent() -> None:
    """Have this process killed when the one that started it ends."""
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def _bury(result: Result, campaign: Campaign, worker: _Worker) -> None:
    worker.trace.seek(0)
    trace = worker.trace.read().decode(errors="replace")
    code = worker.process.exitcode
    kind = {-signal.SIGXCPU: "hang", -signal.SIGABRT: "abort or deadlock"}.get(code, "crash")
    frames = [line.strip() for line in trace.splitlines() if "/cinegen/" in line or "/raff2urdf/" in line]
    inner = frames[0].rpartition("/")[2] if frames else f"exit code {code}"
    name, files = campaign.evidence(worker.number)
    result.add({"cases": 1, "died": 1}, {}, [Finding(name, kind, inner, trace, files)])
