"""`node_wrench`: the wrench that given torques of the actuated joints produce at a node: inverse dynamics, inverted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.dynamics import plain
from cinegen.dynamics.inverse_dynamics import InverseDynamics
from cinegen.dynamics.loads import LoadedTree
from cinegen.dynamics.rates import Motion
from cinegen.errors import ConfigurationError
from cinegen.jit.one_thread import in_one_thread
from cinegen.singularities.singularity import SINGULAR
from raff2urdf.errors import counted

_LEAST = 1e-300  # divisor


@dataclass(frozen=True, eq=False, repr=False)
class NodeWrench:
    """A wrench that a node exerts on its surroundings.

    Attributes:
        node: its name.
        wrench: (6,) force (N), then moment (N m) about the node's origin, in the world's axes: the shortest of those
            that balance the torques (moments are compared with forces by the characteristic length).
        supported: (k, 6) independent wrenches, N and N m, that the structure supports without its actuated joints: any
            multiple may be added.
        imbalance: part of the torques and loads that no wrench on the node balances, as a fraction of them: above 0
            the mechanism accelerates even if the node is fixed.
    """

    node: str
    wrench: Array
    supported: Array
    imbalance: float

    def __repr__(self) -> str:
        numbers = ", ".join(f"{x:.4g}" for x in self.wrench)
        return f"<NodeWrench of {self.node}: {numbers} (N, N m), imbalance {self.imbalance:.2g}>"


@in_one_thread
def node_wrench(
    dynamics: InverseDynamics,
    q: ArrayLike,
    torques: ArrayLike,
    node: str | None = None,
    v: Motion | None = None,
    a: Motion | None = None,
) -> NodeWrench:
    """Return the wrench that a node exerts on its surroundings.

    Args:
        dynamics: the mechanism and its loads, which are subtracted.
        q: (nq,) loops closed.
        torques: (actuated,) of the actuated joints, N m and N.
        node: the mechanism's end by default.
        v: velocity, as `InverseDynamics.torques` takes it.
        a: acceleration, likewise.

    Raises:
        ConfigurationError, ClosureError, MotionError, MassError, UnknownNameError: as `InverseDynamics.torques`.
    """
    mechanism, tree = dynamics.mechanism, dynamics.tree
    name = mechanism.end if node is None else node
    efforts = np.asarray(torques, dtype=float)
    if efforts.shape != (len(mechanism.actuated),) or not np.isfinite(efforts).all():
        raise ConfigurationError(
            f"torques of {mechanism.name} are {counted(len(mechanism.actuated), 'finite number')}, one for each "
            f"actuated joint, not {efforts.shape}"
        )
    checked = mechanism.structure.checked(q)
    dynamics.check_closed(checked)
    balance = plain.balance(tree, checked, *dynamics.motion(checked, v, a))
    columns, lengths = plain.actuated_columns(mechanism), np.repeat([mechanism.length, 1.0], 3)
    work = balance.motions.actuated.T @ (efforts * tree.step[columns]) - balance.motions.basis.T @ balance.tau
    moves = node_motions(tree, checked, name, balance.motions.basis)
    u, sigma, vt = np.linalg.svd(moves.T)
    count = int((sigma > SINGULAR).sum())
    balanced = u[:, :count].T @ work
    wrench = vt[:count].T @ (balanced / sigma[:count]) / lengths
    largest = max(np.abs(efforts * tree.step[columns]).max(initial=0.0), np.abs(balance.tau).max(initial=0.0), _LEAST)
    rest = np.abs(work - u[:, :count] @ balanced).max(initial=0.0)
    return NodeWrench(name, wrench, vt[count:] / lengths, float(rest / largest))


def node_motions(tree: LoadedTree, q: Array, node: str, basis: Array) -> Array:
    """Return the twists (6, k) of a node in motions (n, k) of the mechanism, in the world's axes at the node's origin,
    linear above angular; dimensionless."""
    mechanism, moving = tree.mechanism, plain.columns_of(tree.mechanism)
    jacobian = mechanism.jacobian(q, node)[:, moving] * mechanism.scale[moving]
    rotation = mechanism.placement(q, node).rotation
    jacobian = pin.SE3(rotation, np.zeros(3)).toActionMatrix() @ jacobian
    return np.asarray(jacobian @ basis / np.repeat([mechanism.length, 1.0], 3)[:, None])
