"""How the cost of one tick grows with a robot's joints and loops.

    OMP_NUM_THREADS=1 python benchmarks/scaling.py

Three families, made here as RAFF:

    chain      n joints in a row, 1 m long in all
    tower      n parallelograms, each on top of the one below and turned by 90 degrees: 3 n joints, mobility n
    platform   n + 1 legs under one plate: 6 + 3 n joints, mobility 6 (a Gough platform has n = 5)

Each is pulled by the pose of its end along a path that it can follow. What is printed is the median of all ticks, in
microseconds, and per joint; "grows" is the exponent from the row above (1: in proportion to the joints). Sizes take
turns, so that a slow moment of the machine meets them all. "off" is the largest distance from a target after its tick.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import cinegen
from raff2urdf.raff.kleinfinger import parameters

CHAINS = (5, 10, 20, 50, 100, 200)
LOOPS = range(1, 11)
DT = 1e-3  # s
PATH = 200  # ticks once around
SWING = 0.05  # rad, or characteristic lengths: of every motor along the path
ROUNDS, TICKS = 10, 20

Matrix = NDArray[np.float64]


# --- robots --------------------------------------------------------------------------------------------------------


def chain(joints: int) -> str:
    """Axes that turn by 90 degrees from link to link, bent a little everywhere; the bends shrink with the links."""
    bend, length = 200.0 / joints, 1000.0 / joints
    links = [
        f"link {i} {{ parameters {{ theta {bend} d {length if i > 1 else 0.0} alpha {90 if i % 2 else -90} }} "
        f"type 2 pred {i - 1} actuated 1 }}"
        for i in range(1, joints + 1)
    ]
    return _robot([*links, f'frame {joints + 1} {{ name "end" parameters {{ d {length} }} pred {joints} }}'])


def tower(loops: int) -> str:
    """Cranks of 300 mm, 400 mm apart, leaning by 80 and 110 degrees in turn."""
    lines, below = [], 0
    for storey in range(loops):
        left, coupler, right, one_end, other_end = range(5 * storey + 1, 5 * storey + 6)
        lean, turn = (80, 0) if storey == 0 else (110, 90) if storey % 2 else (80, -90)
        lines += [
            f"link {left} {{ parameters {{ theta {lean} alpha {turn} }} type 2 pred {below} actuated 1 }}",
            f"link {coupler} {{ parameters {{ theta {-lean} d 300 }} type 2 pred {left} }}",
            f"link {right} {{ parameters {{ theta {lean} alpha {turn} d 400 }} type 2 pred {below} }}",
            f"frame {one_end} {{ parameters {{ d 400 }} pred {coupler} }}",
            f"frame {other_end} {{ parameters {{ d 300 }} pred {right} }}",
            f"constraint {{ frame {one_end} frame {other_end} type 2 }}",
        ]
        below = coupler
    return _robot([*lines, f'frame {5 * loops + 1} {{ name "end" parameters {{ d 200 }} pred {below} }}'])


def platform(loops: int) -> str:
    """Legs: two revolute joints at the foot and a slide; the first carries the plate by three more revolute joints,
    the others meet it in balls."""
    lines: list[str] = []
    world = {0: np.eye(4)}

    def add(number: int, pred: int, place: Matrix, kind: int | None = None, more: str = "") -> int:
        world[number] = place
        p = parameters(np.linalg.inv(world[pred]) @ place)
        six = f"theta {math.degrees(p.theta)!r} r {1e3 * p.r!r} d {1e3 * p.d!r} alpha {math.degrees(p.alpha)!r} "
        six += f"gamma {math.degrees(p.gamma)!r} epsilon {1e3 * p.epsilon!r}"
        word, of_kind = ("frame", "") if kind is None else ("link", f"type {kind}")
        lines.append(f"{word} {number} {{ {more} parameters {{ {six} }} {of_kind} pred {pred} }}")
        return number

    plate = 0
    for leg in range(loops + 1):
        about = math.tau * leg / (loops + 1)
        foot = np.array([0.5 * math.cos(about), 0.5 * math.sin(about), 0.0])
        about += 0.5 if leg % 2 else -0.5  # legs cross over, else the plate could turn about its middle
        head = np.array([0.3 * math.cos(about), 0.3 * math.sin(about), 0.7 + 0.02 * (leg % 3)])
        along = (head - foot) / np.linalg.norm(head - foot)
        first = np.cross(along, [0.0, 0.0, 1.0])
        second = np.cross(along, first)
        number = 10 * leg
        one = add(number + 1, 0, _axis(foot, first), 2)
        two = add(number + 2, one, _axis(foot, second), 2)
        slide = add(number + 3, two, _axis(head, along), 1, "actuated 1")
        if leg == 0:
            four = add(4, slide, _axis(head, first), 2)
            five = add(5, four, _axis(head, second), 2)
            plate = add(6, five, _axis(head, along), 2)
            add(7, plate, _axis((0.0, 0.0, 0.7), (0.0, 0.0, 1.0)), more='name "end"')
        else:
            add(number + 4, slide, _axis(head, along))
            add(number + 5, plate, _axis(head, along))
            lines.append(f"constraint {{ frame {number + 4} frame {number + 5} type 3 }}")
    return _robot(lines)


def _robot(lines: Sequence[str]) -> str:
    return "\n".join(["RAFF scaling", "robot r {", "base { }", *lines, "}", ""])


def _axis(point: Sequence[float] | Matrix, along: Sequence[float] | Matrix) -> Matrix:
    """A placement at a point, its z along a direction."""
    z = np.asarray(along) / np.linalg.norm(along)
    y = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    y /= np.linalg.norm(y)
    place = np.eye(4)
    place[:3, :3] = np.column_stack([np.cross(y, z), y, z])
    place[:3, 3] = point
    return place


# --- ticks ---------------------------------------------------------------------------------------------------------


class Run:
    """A robot on its path."""

    def __init__(self, text: str, folder: Path) -> None:
        file = folder / "robot.raff"
        file.write_text(text)
        self.mechanism = cinegen.load(file)
        self.targets = self._path()
        self.solver = cinegen.Solver(self.mechanism, DT)
        self.task = self.solver.add_task("end")
        self.at, self.off = 0, 0.0
        self.spent: list[int] = []
        self.round(TICKS)
        self.spent.clear()

    def _path(self) -> list[pin.SE3]:
        """Where the end is while all motors swing, each in its own rhythm, and the loops follow."""
        mechanism = self.mechanism
        motors = mechanism.actuated[: mechanism.mobility]
        q, targets = mechanism.q_home, []
        for k in range(1, PATH + 1):
            values = {}
            for i, motor in enumerate(motors):
                size = SWING * (mechanism.length if mechanism.is_prismatic(motor) else 1.0)
                swing = size * math.sin(math.tau * k / PATH * (1 + i % 2)) / max(1.0, len(motors) / 6.0)
                values[motor] = float(mechanism.q_home[mechanism.q_index(motor)]) + swing
            q = mechanism.configuration(values, q)
            q = mechanism.close(q, locked=motors) if mechanism.loops else q
            targets.append(mechanism.placement(q, "end"))
        return targets

    def round(self, ticks: int) -> None:
        """The next ticks, timed."""
        for _ in range(ticks):
            target = self.targets[self.at]
            self.at = (self.at + 1) % PATH
            began = time.perf_counter_ns()
            self.task.target = target
            step = self.solver.step()
            self.spent.append(time.perf_counter_ns() - began)
            self.off = max(self.off, step.errors[0][0])


def main() -> None:
    families: list[tuple[Callable[[int], str], Sequence[int]]] = [(chain, CHAINS), (tower, LOOPS), (platform, LOOPS)]
    print(f"{'family':<10}{'joints':>7}{'loops':>6}{'rows':>6}{'mobility':>9}{'tick us':>10}", end="")
    print(f"{'/ joint':>9}{'grows':>7}{'off m':>10}")
    with tempfile.TemporaryDirectory() as folder:
        for make, sizes in families:
            runs = [Run(make(size), Path(folder)) for size in sizes]
            for _ in range(ROUNDS):
                for run in runs:
                    run.round(TICKS)
            before: tuple[int, float] | None = None
            for run in runs:
                mechanism, tick = run.mechanism, median(run.spent) * 1e-3
                joints, rows = len(mechanism.joints), sum(loop.rows for loop in mechanism.loops)
                grows = f"{math.log(tick / before[1]) / math.log(joints / before[0]):7.2f}" if before else f"{'-':>7}"
                print(
                    f"{make.__name__:<10}{joints:>7}{len(mechanism.loops):>6}{rows:>6}{mechanism.mobility:>9}"
                    f"{tick:>10.1f}{tick / joints:>9.2f}{grows}{run.off:>10.1e}"
                )
                before = joints, tick


if __name__ == "__main__":
    main()
