"""Jacobians of loops that the kernels form, against Pinocchio's own constraint Jacobians: every robot, every kind."""

import numpy as np
import pinocchio as pin
import pytest
from elementary import document
from repository import EVERY, load
from variants import others_slow

from cinegen.loops._kernels import kinematics, residual
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.setup import set_up
from raff2urdf.raff.document import LoopKind

WITH_LOOPS = [one for one in EVERY if document(one.values[0]).robot(one.values[1]).loops]

KEPT = {
    LoopKind.RIGID: [0, 1, 2, 3, 4, 5],
    LoopKind.PRISMATIC: [0, 1, 3, 4, 5],
    LoopKind.REVOLUTE: [0, 1, 2, 3, 4],
    LoopKind.BALL: [0, 1, 2],
}
"""Rows of Pinocchio's constraint of six rows, by the kind of a loop, in the axes of its first end."""


def pinocchio_rows(system: ClosedLoops, q: np.ndarray) -> list[np.ndarray]:
    """Six rows for each loop, by all joints: the twist of its first end relative to the second, in the first's axes."""
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for first, on_first, second, on_second in system.anchors:
        ends = (first, on_first, second, on_second)
        models.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_6D, system.model, *ends, pin.LOCAL))
        datas.append(models[-1].createData())
    data = system.model.createData()
    pin.computeJointJacobians(system.model, data, q)
    for one, its_data in zip(models, datas, strict=True):
        one.calc(system.model, data, its_data)
    return np.split(pin.getConstraintsJacobian(system.model, data, models, datas), len(system.loops))


def check(system: ClosedLoops, ranks: tuple[int, ...], q: np.ndarray) -> None:
    memory = set_up(LoopMemory(), system, ranks)
    kinematics.evaluate(memory, q)
    assert residual.evaluate_loops(memory, True) <= 1e-11
    for i, (kind, rows) in enumerate(zip(system.kinds, pinocchio_rows(system, q), strict=True)):
        rows = -rows * system.scale / np.repeat([system.length, 1.0], 3)[:, None]  # of the second end, dimensionless
        if kind is LoopKind.BALL:  # the angular velocity is in the world's axes
            first, on_first = system.anchors[i][:2]
            system.evaluate(q)
            rows[3:] = (system.data.oMi[first] * on_first).rotation @ rows[3:]
        free = [row for row in range(6) if row not in KEPT[kind]]
        at, cut = memory.loop_row[i], memory.loop_cut[i]
        assert memory.jacobian[at : at + len(KEPT[kind])] == pytest.approx(rows[KEPT[kind]], abs=1e-13)
        assert pytest.approx(rows[free], abs=1e-13) == memory.cut_rates[:, cut : cut + len(free)].T


@pytest.mark.parametrize(("name", "which"), others_slow(WITH_LOOPS))
def test_every_robot(name, which):
    mechanism = load(name, which)
    for q in mechanism.random_closed(4, seed=1):
        check(mechanism.structure.system, mechanism.cluster_ranks, q)


@pytest.mark.parametrize("kind", LoopKind)
def test_every_kind_of_loop(robot, kind):
    """Where rigid loops are closed, those of any kind are."""
    mechanism = robot("delta4")
    system = mechanism.structure.system.with_kinds([kind] * len(mechanism.loops))
    for q in mechanism.random_closed(4, seed=1):
        check(system, mechanism.cluster_ranks, q)
