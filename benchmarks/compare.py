"""Compare a step of cinegen with one of placo, pink and mink: same robots, targets, rate, gain and limits.

    make bench
    python benchmarks/compare.py [--scenes panda delta ...] [--peers placo ...] [--rounds 30] [--steps 100] [--qp daqp]

Every library is a process of its own, with one thread (peers/worker.py); peers run in .venv-bench, which `make bench`
makes. The libraries take turns, a few steps each, many rounds, so that a slow moment of the machine affects all.

A step is what a user writes: set the target, update the kinematics, solve, integrate. Printed are:

    solves     for one target. Peers close loops only to first order: one solve leaves them open by micrometres. So
               they appear twice in scenes with loops: with one solve, and with as many as close them to 1e-11 (m, rad).
               cinegen always closes its loops within its one step.
    us, 99 %   median of all steps, and what 99 of 100 steps stay below
    ratio      median over all rounds of cinegen's median to this one's in the same round: below 1 cinegen is faster
    errors     from the target of the same step, after it (computed by Pinocchio from the joint values of each); of the
               orientation only if it is constrained
    open       the largest loop residual, m or rad
    limits     whether all joints' values and speeds stayed within theirs
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import IO, Any

import numpy as np
import pinocchio as pin
from scenes import SCENES

import cinegen
from cinegen.arrays import Array

HERE = Path(__file__).parent
PEERS = ("placo", "pink", "mink")
CLOSED = 1e-11  # m, rad: what peers' loops are to be closed to
MOST_SOLVES = 5
WARM = 10  # steps of every round that are not timed


class FailedError(Exception):
    """A library can't run this scene."""


class Library:
    """A library with a scene, in its own process.

    Attributes:
        rounds: for every round the nanoseconds of its steps.
        qs: the joints' values after every step of all rounds.
    """

    def __init__(self, name: str, scene: Path, solves: int = 1) -> None:
        script = "ours" if name == "cinegen" else f"{name}_"
        python = sys.executable if name == "cinegen" else str(bench_python())
        self.name, self.solves = name, solves
        self.rounds: list[list[int]] = []
        self.qs: list[list[float]] = []
        self.log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - `close` closes it
        self.process = subprocess.Popen(
            [python, str(HERE / "peers" / f"{script}.py"), str(scene)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.log,
            text=True,
            env=alone() | ({"PYTHONPATH": str(HERE.parent)} if name == "cinegen" else {}),  # this folder's cinegen
        )
        self.version = str(self._answer()["version"])
        self.ask(repeat=solves)

    def _answer(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            self.process.wait()
            self.log.seek(0)
            report = self.log.read().decode(errors="replace").strip().splitlines() or ["it ended"]
            raise FailedError(f"{self.name}: {' '.join(report[-2:])}")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def ask(self, **command: Any) -> dict[str, Any]:
        """Send a command, see peers/worker.py; return the answer."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(json.dumps(command) + "\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            pass  # why it ended is read with the answer
        return self._answer()

    def round(self, steps: int) -> None:
        """Run the next steps; keep times and configurations."""
        answer = self.ask(steps=steps, warm=WARM)
        self.rounds.append(answer["ns"])
        self.qs += answer["q"]

    def close(self) -> None:
        """End the process."""
        if self.process.stdin is not None:
            self.process.stdin.close()
        self.process.wait()
        self.log.close()


class Yardstick:
    """Judges the joint values of all libraries by the same computation."""

    def __init__(self, scene: Path) -> None:
        self.scene = json.loads(scene.read_text())
        self.mechanism = cinegen.load(self.scene["urdf"])
        joints = self.scene["joints"]
        self.indices = [self.mechanism.q_index(joint["name"]) for joint in joints]
        self.home = np.array([joint["home"] for joint in joints])
        self.low = np.array([joint["low"] for joint in joints])
        self.high = np.array([joint["high"] for joint in joints])
        self.fastest = np.array([np.inf if joint["velocity"] is None else joint["velocity"] for joint in joints])
        self.targets = [pin.SE3(np.array(target)) for target in self.scene["targets"]]

    def _whole(self, values: Sequence[float]) -> Array:
        q = self.mechanism.q_home.copy()
        q[self.indices] = values
        return q

    def errors(self, qs: Sequence[Sequence[float]]) -> tuple[Array, Array]:
        """Return distances (m) and angles (rad) from the targets, step by step."""
        metres, radians = np.zeros(len(qs)), np.zeros(len(qs))
        for k, values in enumerate(qs):
            target = self.targets[k % len(self.targets)]
            pose = self.mechanism.placement(self._whole(values), self.scene["node"])
            metres[k] = np.linalg.norm(target.translation - pose.translation)
            radians[k] = np.linalg.norm(pin.log3(target.rotation.T @ pose.rotation))
        return metres, radians

    def open(self, qs: Sequence[Sequence[float]]) -> float:
        """Return the largest loop residual, m or rad."""
        if not self.mechanism.loops:
            return 0.0
        return max(float(np.abs(self.mechanism.loop_residual(self._whole(values))).max()) for values in qs)

    def kept(self, qs: Sequence[Sequence[float]]) -> bool:
        """Return whether values and speeds stayed within their limits."""
        values = np.array(qs)
        speeds = np.abs(np.diff(np.vstack([self.home, values]), axis=0)) / self.scene["dt"]
        within = ((values >= self.low - 1e-9) & (values <= self.high + 1e-9)).all()
        return bool(within and (speeds <= self.fastest * (1.0 + 1e-6)).all())


def bench_python() -> Path:
    return HERE.parent / ".venv-bench" / "bin" / "python"


def alone() -> dict[str, str]:
    """Return the environment of a library: one thread, only its own packages."""
    one_thread = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMBA", "VECLIB")}
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | one_thread


def contenders(names: Sequence[str], scene: Path, yardstick: Yardstick) -> list[Library]:
    """Return cinegen, and every peer with one solve per target and, with loops, with as many as it needs."""
    libraries = [Library("cinegen", scene)]
    for name in names:
        try:
            peer = Library(name, scene)
            solves = _solves(peer, yardstick)
            libraries += [peer] if solves == 1 else [peer, Library(name, scene, solves)]
        except FailedError as error:
            print(f"  {error}: left out")
    for library in libraries:
        library.ask(steps=100)  # compiled, and caches are warm
        library.ask(home=True)
    return libraries


def _solves(library: Library, yardstick: Yardstick) -> int:
    """Return the number of solves per target that close the loops to `CLOSED` along the whole path, at most
    `MOST_SOLVES`."""
    for solves in range(1, MOST_SOLVES + 1):
        library.ask(home=True, repeat=solves)
        if yardstick.open(library.ask(steps=len(yardstick.targets))["q"]) <= CLOSED:
            break
    library.ask(repeat=1)
    return solves


def compare(name: str, scene: Path, peers: Sequence[str], rounds: int, steps: int) -> None:
    yardstick = Yardstick(scene)
    content = yardstick.scene
    constrained = "pose" if content["rotation"] else "position"
    print(
        f"\n{name}: {len(content['joints'])} joints, {len(content['loops'])} loops, "
        f"{constrained} of {content['node']}, {len(content['targets'])} targets "
        f"at {1.0 / content['dt']:.0f} Hz, gain {content['gain']:g}, limits on"
    )
    libraries = contenders(peers, scene, yardstick)
    for turn in range(rounds):
        first = turn % len(libraries)  # none is always first
        for library in libraries[first:] + libraries[:first]:
            library.round(steps)
    print(
        f"  {'':<30}{'solves':>6}{'us':>9}{'99 %':>9}{'ratio':>8}"
        f"{'max m':>10}{'rms m':>10}{'max rad':>10}{'rms rad':>10}{'open':>10}  limits"
    )
    ours = [median(spent) for spent in libraries[0].rounds]
    for library in libraries:
        library.close()
        theirs = [median(spent) for spent in library.rounds]
        every = np.concatenate(library.rounds) * 1e-3
        metres, radians = yardstick.errors(library.qs)
        cells = [metres.max(), _rms(metres)] + [radians.max(), _rms(radians)] * bool(content["rotation"])
        text = "".join(f"{cell:10.1e}" for cell in cells) + f"{'-':>10}" * (4 - len(cells))
        opening = f"{yardstick.open(library.qs):10.1e}" if content["loops"] else f"{'-':>10}"
        ratio = median(a / b for a, b in zip(ours, theirs, strict=True))
        print(
            f"  {library.version:<30}{library.solves:>6}{np.median(every):9.1f}{np.percentile(every, 99):9.1f}"
            f"{ratio:8.3g}{text}{opening}  {'kept' if yardstick.kept(library.qs) else 'BROKEN'}"
        )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def main() -> None:
    parser = argparse.ArgumentParser(description="cinegen beside its peers, step by step")
    parser.add_argument("--scenes", nargs="*", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--peers", nargs="*", default=list(PEERS), choices=PEERS)
    parser.add_argument("--qp", help="another QP solver for pink and mink: daqp, proxqp")
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--steps", type=int, default=100, help="in a round")
    chosen = parser.parse_args()
    if chosen.peers and not (HERE.parent / ".venv-bench" / "installed").exists():
        sys.exit("*** there is no .venv-bench, where the peers live: `make bench` makes it (bare --peers: do without)")
    with tempfile.TemporaryDirectory() as folder:
        for name in chosen.scenes:
            scene = SCENES[name](Path(folder))
            if chosen.qp:
                scene.write_text(json.dumps(json.loads(scene.read_text()) | {"qp": chosen.qp}))
            compare(name, scene, chosen.peers, chosen.rounds, chosen.steps)


if __name__ == "__main__":
    main()
