"""What must not matter: the unit of length and the size of a robot, and which joint of a loop was cut."""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from elementary import ROBOTS, document, one_of_each_kind, within_limits
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from making import (
    Mechanism,
    bennett,
    planar,
    ring,
)

import cinegen
import raff2urdf
from raff2urdf.raff.document import Document, DriveKind, JointType, RaffLink, RaffParameters

DT = 1 / 60


def loaded(text: str, which: str | None = None) -> cinegen.Mechanism:
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROBOTS / "graphics", Path(folder) / "graphics")
        path = Path(folder) / "any.raff"
        path.write_text(text, encoding="utf-8")
        return cinegen.load(path, which)


# --- size --------------------------------------------------------------------------------------------------------


def larger(text: Document, factor: float, units: str) -> Document:
    """All lengths of a document by a factor, its limits and speeds of slides too, in another unit; without masses."""

    def longer(p: RaffParameters) -> RaffParameters:
        return replace(p, r=factor * p.r, d=factor * p.d, epsilon=factor * p.epsilon)

    def part(p):
        p = replace(p, parameters=longer(p.parameters), inertial=None)
        if isinstance(p, RaffLink) and p.type is JointType.PRISMATIC:
            limits = None if p.limits is None else tuple(factor * limit for limit in p.limits)
            p = replace(p, limits=limits, velocity=None if p.velocity is None else factor * p.velocity)
        return p

    def coupling(one):
        slides = {p.number for p in text.robots[0].parts if isinstance(p, RaffLink) and p.type is JointType.PRISMATIC}
        assert all(drive.kind is not DriveKind.POLYNOMIAL for drive in one.drives)
        drives = [
            drive if drive.kind is DriveKind.RATIO else replace(drive, numbers=(factor * drive.numbers[0],))
            for drive in one.drives
        ]
        offset = factor * one.offset if one.follower in slides else one.offset
        return replace(one, drives=tuple(drives), offset=offset)

    robots = tuple(
        replace(
            robot,
            base=replace(robot.base, parameters=longer(robot.base.parameters), inertial=None),
            parts=tuple(part(p) for p in robot.parts),
            couplings=tuple(coupling(one) for one in robot.couplings),
        )
        for robot in text.robots
    )
    return replace(text, units=units, robots=robots)


@cache
def of_size(name: str, which: str, factor: float, units: str) -> cinegen.Mechanism:
    return loaded(raff2urdf.dumps(larger(document(name), factor, units)), which)


def reachable(mechanism: cinegen.Mechanism, rng: np.random.Generator) -> list[np.ndarray]:
    """Closed configurations inside the limits, home among them."""
    found = [q for q in mechanism.random_closed(60, int(rng.integers(1000))) if within_limits(mechanism, q)]
    return [mechanism.q_home, *found[:12]]


@one_of_each_kind
@pytest.mark.parametrize(("factor", "units"), [(1.0, "um"), (7e3, "m")])
def test_a_robot_of_micrometres_or_kilometres_moves_like_its_twin(name, which, factor, units):
    """Dragged from one reachable pose to the next, at once; some joints against their limits."""
    one, other = of_size(name, which, 1.0, "mm"), of_size(name, which, factor, units)
    size = other.length / one.length
    assert other.q_home / _of_q(other) == pytest.approx(one.q_home / _of_q(one), abs=1e-9)
    rng = np.random.default_rng(0)
    poses = [one.placement(q, one.nodes[-1]) for q in reachable(one, rng)]
    begin = one.q_home / _of_q(one)
    solvers = [cinegen.Solver(one, DT), cinegen.Solver(other, DT, q=other.close(begin * _of_q(other)))]
    tasks = [solver.add_task(one.nodes[-1], rotation=3) for solver in solvers]
    moved = 0.0
    for tick in range(160):
        if tick % 16 == 0:
            pose = poses[int(rng.integers(len(poses)))]
            tasks[0].target, tasks[1].target = pose, pin.SE3(pose.rotation, size * pose.translation)
        first, second = (solver.step() for solver in solvers)
        assert second.q / _of_q(other) == pytest.approx(first.q / _of_q(one), abs=1e-9), tick
        assert second.status is first.status
        assert second.saturated == first.saturated
        moved += float(np.abs(first.v / one.scale).max()) * DT
    assert moved > 0.5


def _of_q(mechanism: cinegen.Mechanism) -> np.ndarray:
    """What one dimensionless step is in each number of q; none of these robots has a free base."""
    return np.array(mechanism.scale)


# --- cuts --------------------------------------------------------------------------------------------------------

RINGS = {  # how to make them, and a task that determines their motion: translations, rotations
    "four-bar": (lambda rng: planar(rng.normal(size=(4, 2))), (1, 0)),
    "Bennett": (bennett, (1, 0)),
}


def exactly(mechanism: Mechanism) -> cinegen.Mechanism:
    return loaded(f"RAFF any\n{mechanism.text(joint_digits=None)}")


def poses_along(mechanism: cinegen.Mechanism, rng: np.random.Generator, far: float) -> list[pin.SE3] | None:
    """Of the tool, on the way along a free motion from home: what any twin can reach."""
    q, poses = mechanism.q_home, []
    motion = rng.normal(size=mechanism.mobility)
    for _ in range(20):
        _, sigma, vt = np.linalg.svd(mechanism.system.evaluate(q)[1])
        if sigma[mechanism.loop_rank - 1] < 0.1:
            return None
        free = vt[mechanism.loop_rank :]
        step = free.T @ motion
        q = mechanism.close(q + far / 20 * step / np.abs(step).max() * mechanism.scale)
        poses.append(mechanism.placement(q, "tool"))
        _, _, after = np.linalg.svd(mechanism.system.evaluate(q)[1])
        motion = after[mechanism.loop_rank :] @ step  # straight on
    return poses


def tool_path(mechanism: cinegen.Mechanism, poses: list[pin.SE3], task: tuple[int, int]) -> tuple[np.ndarray, float]:
    """Where the tool is at every tick, and the smallest singular value on the way."""
    solver = cinegen.Solver(mechanism, 1.0)
    hand = solver.add_task("tool", None, *task, axes="world")
    path, smallest = [], np.inf
    for pose in poses:
        hand.target = pose
        for _ in range(5):
            step = solver.step()
            smallest = min(smallest, float(step.singular_values[-1]), float(step.loop_singular_values[-1]))
            if step.speed_scale < 1.0:
                smallest = 0.0
            path.append(mechanism.placement(step.q, "tool").homogeneous)
    return np.array(path), smallest


@pytest.mark.parametrize("name", RINGS)
@settings(max_examples=3, deadline=None, derandomize=True, database=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_where_a_loop_is_cut_does_not_matter(name, seed):
    """Each pose is approached in five ticks, that need not reach it: where tasks determine the motion, and away from
    singularities, every tick of it is the same."""
    make, task = RINGS[name]
    rng = np.random.default_rng(seed)
    axes = make(rng)
    sigma = ring(axes).singular_values()
    assume(not ((sigma > 1e-9) & (sigma < 0.1)).any())
    one = exactly(ring(axes))
    poses = poses_along(one, rng, 0.3)
    assume(poses is not None)
    expected, smallest = tool_path(one, poses, task)
    assume(smallest > 0.1)
    for cut in range(len(axes)):
        path, _ = tool_path(exactly(ring(axes, None, cut, ("joint", "rigid")[cut % 2])), poses, task)
        assert path == pytest.approx(expected, abs=1e-9 * max(1.0, one.length)), cut
    assert np.abs(expected[-1] - expected[0]).max() > 1e-3  # it did move
