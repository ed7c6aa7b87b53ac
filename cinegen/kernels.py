"""All kernels, and how to compile them: `python -m cinegen.kernels`, or `cinegen compile`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator

import numpy as np

from cinegen.assembly import assembly_modes
from cinegen.collision.clearance import prepare_clearance
from cinegen.design._kernels.evaluate import evaluate_designs
from cinegen.design._kernels.memory import DesignMemory
from cinegen.dynamics._kernels.masses import find_masses
from cinegen.dynamics._kernels.memory import DynamicsMemory
from cinegen.dynamics._kernels.torques import find_torques
from cinegen.hexapod import Hexapod
from cinegen.ik._kernels.batch import measure_all
from cinegen.ik._kernels.local_ik import solve
from cinegen.ik._kernels.memory import BatchMemory, LocalIKMemory, SolverMemory
from cinegen.ik._kernels.tick import tick
from cinegen.jit.compiled import prepare, together
from cinegen.loops._kernels.closure import close_from_trial
from cinegen.loops._kernels.follow import follow
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.model.load import load
from cinegen.planning.vortices import prepare_vortices
from cinegen.proof._kernels.boxes import evaluate_boxes
from cinegen.proof._kernels.memory import BoxMemory


def _assembly_modes() -> None:
    assembly_modes(load("four_bar"))


def _platforms() -> None:
    base, platform = np.random.default_rng(0).normal(size=(2, 6, 3))
    Hexapod(base, platform).modes(np.full(6, 4.0))


_KERNELS: dict[str, Callable[[], object]] = {
    "close": lambda: prepare(close_from_trial, LoopMemory),
    "follow": lambda: prepare(follow, LoopMemory),
    "tick": lambda: prepare(tick, SolverMemory),
    "solve": lambda: prepare(solve, LocalIKMemory),
    "measure": lambda: prepare(measure_all, BatchMemory),
    "torques": lambda: prepare(find_torques, DynamicsMemory),
    "masses": lambda: prepare(find_masses, DynamicsMemory),
    "designs": lambda: prepare(evaluate_designs, DesignMemory),
    "clearance": prepare_clearance,
    "vortices": prepare_vortices,
    "boxes": lambda: prepare(evaluate_boxes, BoxMemory),
    "modes": _assembly_modes,
    "platforms": _platforms,
}
_TOGETHER = 7  # of them, which share helpers


def compile_kernels() -> Iterator[tuple[str, int, int]]:
    """Compile all kernels that are not cached on disk, those that move a robot first.

    Yields:
        before each kernel its name, how many are done, and how many there are; in the end "", and all are done.
    """
    names = list(_KERNELS)
    with together():
        for done, name in enumerate(names[:_TOGETHER]):
            yield name, done, len(names)
            _KERNELS[name]()
    for done, name in enumerate(names[_TOGETHER:], _TOGETHER):
        yield name, done, len(names)
        _KERNELS[name]()
    yield "", len(names), len(names)


if __name__ == "__main__":
    for _, *counts in compile_kernels():
        try:
            sys.stdout.write("{} {}\n".format(*counts))
            sys.stdout.flush()
        except BrokenPipeError:  # the process that asked has ended: the next one finds the kernels
            sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
