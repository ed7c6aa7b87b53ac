"""What the scripts beside this one share: a child process that steps one library through one scene.

    python benchmarks/peers/LIBRARY.py SCENE.json

It answers commands, one JSON object a line on stdin, by one JSON object a line on stdout:

    {"home": true}             go back to the start -> {}
    {"repeat": 2}              from now on, solve this often for every target -> {}
    {"steps": 100, "warm": 5}  follow the next 105 targets -> {"ns": [...], "q": [[...], ...]}

`ns` is what each step took: set the target, update the kinematics, solve, move on. The first `warm` steps are not
timed: while others had the processor its caches forgot this process. Targets are in the library's own type beforehand,
and q is read between two steps, outside of what is timed.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Scene = dict[str, Any]


class Peer(Protocol):
    """One library with one scene loaded.

    Attributes:
        version: of the library, and of the solver it uses.
        targets: in the library's own type.
        repeat: how often `step` solves for one target.
    """

    version: str
    targets: list[Any]
    repeat: int

    def home(self) -> None:
        """Back to the start."""

    def step(self, target: Any) -> None:
        """One step as a user would write it: this is timed."""

    def q(self) -> list[float]:
        """The joints' values, in the scene's order."""


def poses(scene: Scene) -> list[NDArray[np.float64]]:
    """The targets, as (4, 4)."""
    return [np.array(target) for target in scene["targets"]]


def serve(make: Callable[[Scene], Peer]) -> None:
    """Loads the scene and answers until stdin ends."""
    # All on one core, where the system has such a thing: they take turns, and a core that is busier, or just warmer,
    # than another would be counted for or against the library that happened to be there.
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with open(sys.argv[1]) as file:
        scene: Scene = json.load(file)
    out = os.fdopen(os.dup(1), "w")  # what libraries print themselves goes to stderr
    os.dup2(2, 1)
    peer = make(scene)
    at = 0

    def answer(content: dict[str, Any]) -> None:
        out.write(json.dumps(content) + "\n")
        out.flush()

    answer({"version": peer.version})
    clock = time.perf_counter_ns
    for line in sys.stdin:
        command = json.loads(line)
        if command.get("home"):
            peer.home()
            at = 0
        if "repeat" in command:
            peer.repeat = command["repeat"]
        if "steps" not in command:
            answer({})
            continue
        spent, qs = [], []
        warm = command.get("warm", 0)
        for _ in range(warm + command["steps"]):
            target = peer.targets[at]
            began = clock()
            peer.step(target)
            spent.append(clock() - began)
            qs.append(peer.q())
            at = (at + 1) % len(peer.targets)
        answer({"ns": spent[warm:], "q": qs})
