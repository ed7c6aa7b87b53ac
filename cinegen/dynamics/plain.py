"""Inverse dynamics of mechanisms with loops, in plain numpy and Pinocchio: the reference of the kernels.

Let J be the Jacobian of all loops and couplings, N a basis of its null space (the motions that keep loops closed), S
the matrix that picks the actuated joints, tau what the tree alone would need. The torques tau_a of the actuated joints
and the multipliers lambda of the loops fulfil

    tau = S^T tau_a + J^T lambda,      so that      (S N)^T tau_a = N^T tau.

The second equation has no lambda. It is solved first: solving for both at once would not give the shortest tau_a.
Y. Nakamura and M. Ghodoussi, "Dynamics computation of closed-link robot mechanisms with nonredundant and redundant
actuators", IEEE Trans. Robotics and Automation 5, 1989.

All here is dimensionless but for the unit of energy: lengths are divided by the characteristic length, so a torque, a
force times that length, and a multiplier are in J.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cinegen.arrays import Array
from cinegen.dynamics.loads import LoadedTree
from cinegen.loops.motions import orthonormal
from cinegen.model import Mechanism
from cinegen.singularities.singularity import SINGULAR
from raff2urdf.closure import rank

_LEAST = 1e-300  # divisor


@dataclass(frozen=True, eq=False)
class Motions:
    """Motions that keep the loops closed at a configuration, those of the actuated joints among them; dimensionless.

    Attributes:
        jacobian: (rows, n) J of all loops and couplings, without the columns of a floating base, which is held.
        inverse: (n, rows) its pseudoinverse; singular values that count as 0 are left out.
        basis: (n, mobility) N; a singular configuration has more than the mechanism's mobility.
        stresses: (rows, rows - rank) multipliers that no joint notices: a basis of the null space of J^T.
        actuated: (actuated, mobility) S N, for the actuated joints' steps of `LoadedTree.step`.
    """

    jacobian: Array
    inverse: Array
    basis: Array
    stresses: Array
    actuated: Array

    @cached_property
    def _decomposition(self) -> tuple[Array, Array, Array, int]:
        u, sigma, vt = np.linalg.svd(self.actuated)
        return u, sigma, vt, int((sigma > SINGULAR).sum())

    @property
    def prestress(self) -> Array:
        """(k, actuated) torques that do no work on any motion; orthonormal, dimensionless."""
        u, _, _, count = self._decomposition
        return np.asarray(u[:, count:].T)

    @property
    def uncontrolled(self) -> Array:
        """(k, n) motions with all actuated joints at rest; orthonormal with those of the joints that were cut."""
        _, _, vt, count = self._decomposition
        return np.asarray(vt[count:] @ self.basis.T)

    def efforts(self, work: Array) -> Array:
        """Return the shortest torques (actuated,) that do the work (mobility,) on the motions of `basis`; what is done
        on uncontrolled motions is left out."""
        u, sigma, vt, count = self._decomposition
        return np.asarray(u[:, :count] @ (vt[:count] @ work / sigma[:count]))

    def coordinates(self, rates: Array) -> tuple[Array, float]:
        """Return the motion (mobility,) in `basis` at which the actuated joints have rates (actuated,), and by how much
        these contradict each other, as a fraction of the largest."""
        u, sigma, vt, count = self._decomposition
        y = vt[:count].T @ (u[:, :count].T @ rates / sigma[:count])
        rest = np.abs(rates - self.actuated @ y).max(initial=0.0)
        return np.asarray(y), float(rest / max(np.abs(rates).max(initial=0.0), _LEAST))


@dataclass(frozen=True, eq=False)
class Balance:
    """The balance of a mechanism at a configuration and motion.

    Attributes:
        motions: there.
        tau: (n,) dimensionless torques of the tree alone, J.
        efforts: (actuated,) dimensionless torques of the actuated joints, J.
        unsupported: (k,) work that the load does on each uncontrolled motion, J, as a fraction of the largest of `tau`.
    """

    motions: Motions
    tau: Array
    efforts: Array
    unsupported: Array

    @property
    def is_held(self) -> bool:
        """True if some torques of the actuated joints hold the load."""
        return bool(np.abs(self.unsupported).max(initial=0.0) <= SINGULAR)


def columns_of(mechanism: Mechanism) -> slice:
    """Return the columns of v that move while a floating base is held."""
    return slice(6 if mechanism.floating else 0, None)


def actuated_columns(mechanism: Mechanism) -> list[int]:
    """Return the columns of v of the actuated joints, in their order."""
    return [mechanism.v_index(name) for name in mechanism.actuated]


def motions_at(tree: LoadedTree, q: Array) -> Motions:
    """Return the motions at q (nq,), loops closed."""
    mechanism = tree.mechanism
    system, moving = mechanism.structure.system, columns_of(mechanism)
    jacobian = system.evaluate(q)[1][:, moving]
    u, sigma, vt = np.linalg.svd(jacobian)
    count = rank(jacobian)
    inverse = (vt[:count].T / sigma[:count]) @ u[:, :count].T
    basis = vt[count:].T
    if count:
        basis = orthonormal(basis, system.cut_rates()[:, moving])
    columns = actuated_columns(mechanism)
    actuated = np.zeros((len(columns), mechanism.model.nv))
    actuated[np.arange(len(columns)), columns] = (system.scale / tree.step)[columns]
    return Motions(jacobian, inverse, basis, u[:, count:], actuated[:, moving] @ basis)


def balance(tree: LoadedTree, q: Array, v: Array, a: Array, motions: Motions | None = None) -> Balance:
    """Return the balance at q (nq,), loops closed, for v and a (nv,), which keep them closed."""
    motions = motions_at(tree, q) if motions is None else motions
    moving = columns_of(tree.mechanism)
    tau = tree.torques(q, v, a)[moving] * tree.mechanism.scale[moving]
    unsupported = motions.uncontrolled @ tau / max(np.abs(tau).max(initial=0.0), _LEAST)
    return Balance(motions, tau, motions.efforts(motions.basis.T @ tau), unsupported)


def multipliers(mechanism: Mechanism, balanced: Balance, step: Array) -> Array:
    """Return the shortest multipliers (rows,) of loops and couplings, J, for the torques of a balance.

    Args:
        mechanism: any.
        balanced: its balance.
        step: (nv,) of `LoadedTree`.
    """
    columns, rest = actuated_columns(mechanism), np.zeros(mechanism.model.nv)
    rest[columns_of(mechanism)] = balanced.tau
    rest[columns] -= balanced.efforts * (mechanism.scale / step)[columns]
    return np.asarray(balanced.motions.inverse.T @ rest[columns_of(mechanism)])


def complete(tree: LoadedTree, q: Array, v: Array, a: Array, motions: Motions) -> tuple[Array, Array, float, float]:
    """Return the velocity and acceleration (nv,) of the closed mechanism at which its actuated joints move as in v and
    a (nv,), and by how much both contradict each other, see `Motions.coordinates`."""
    mechanism, moving = tree.mechanism, columns_of(tree.mechanism)
    columns, scale = actuated_columns(mechanism), mechanism.scale
    all_v, all_a = v.copy(), a.copy()
    y, gap_v = motions.coordinates((v / tree.step)[columns])
    all_v[moving] = scale[moving] * (motions.basis @ y)
    particular = np.zeros(len(v))
    particular[moving] = -motions.inverse @ mechanism.structure.system.drift(q, all_v) * scale[moving]
    y, gap_a = motions.coordinates(((a - particular) / tree.step)[columns])
    all_a[moving] = particular[moving] + scale[moving] * (motions.basis @ y)
    return all_v, all_a, gap_v, gap_a


def openings(tree: LoadedTree, q: Array, v: Array, a: Array, motions: Motions) -> tuple[float, float]:
    """Return the largest velocity and acceleration with which v and a (nv,) open loops, as fractions of the largest of
    the joints; dimensionless."""
    mechanism, moving = tree.mechanism, columns_of(tree.mechanism)
    if not mechanism.is_constrained:
        return 0.0, 0.0
    rates, lack = (v / mechanism.scale)[moving], mechanism.structure.system.drift(q, v)
    gap = np.abs(motions.jacobian @ rates).max(initial=0.0) / max(np.abs(rates).max(initial=0.0), _LEAST)
    rates = (a / mechanism.scale)[moving]
    largest = max(np.abs(rates).max(initial=0.0), np.abs(lack).max(initial=0.0), _LEAST)
    return float(gap), float(np.abs(motions.jacobian @ rates + lack).max(initial=0.0) / largest)
