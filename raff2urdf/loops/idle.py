"""Idle motions: spins of rods about themselves, which move nothing else.

A rod between two ball joints turns about the line through their centres while everything else is at rest. Such a motion
is a null vector of the loops' Jacobian that belongs to one rod: a body, or bodies that slide or turn on its line. The
rod has two ends, each of axes that meet in one point, such as a ball joint, or the three revolute joints that stand for
it. The spin is the twist that both ends allow.

A body on a hinge whose axis leads through its other joint, such as the tip that both arms of a five-bar are pinned to,
turns likewise, but about its hinge, not about itself: its angle matters, and it is not idle. Joints that a file states
to be actuated, and coupled joints, take no part in idle motions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import islice, pairwise, product
from typing import NamedTuple

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.residual import skew

_LONGEST = 4  # bodies of a rod, which slide or turn on its line
_MOST = 6  # joints of an end
_ROUNDING = 1e-7  # of dimensionless screws: lines that are nearer meet


class Edge(NamedTuple):
    """A joint between two bodies, or one that was cut, at a configuration.

    Attributes:
        first: a body by its number; 0 is the root.
        second: the other body.
        screws: (6, k) its unit twists: the velocity of the point at the origin above the angular velocity, in
            characteristic lengths and rad.
        columns: (k,) their indices in a step; none for a joint that was cut.
    """

    first: int
    second: int
    screws: Array
    columns: tuple[int, ...] = ()


class Spin(NamedTuple):
    """An idle motion.

    Attributes:
        bodies: that turn about their common line.
        edges: indices of the joints that let them.
    """

    bodies: tuple[int, ...]
    edges: tuple[int, ...]


def spins(configurations: Sequence[Sequence[Edge]], fixed: Collection[int] = ()) -> list[Spin]:
    """Return the idle motions that exist at all configurations.

    Args:
        configurations: the same joints at regular closed configurations.
        fixed: columns that take no part: of joints that are actuated or coupled.
    """
    all_spins, still = list[Spin](), set(fixed)
    for chain in _chains(configurations[0]):
        usable = {index for index in chain if still.isdisjoint(configurations[0][index].columns)}
        if len(usable) < 2:
            continue
        bodies, of_chain = _bodies(configurations[0], chain), list[Spin]()
        before = [_group(configurations, chain[i::-1], usable) for i in range(len(chain) - 1)]
        after = [_group(configurations, chain[i + 1 :], usable) for i in range(len(chain) - 1)]
        for size, first in product(range(1, _LONGEST + 1), range(len(bodies))):
            rod, last = tuple(bodies[first : first + size]), first + size - 1
            if len(rod) < size or any(set(spin.bodies) <= set(rod) for spin in of_chain):
                continue
            ends, inner = (before[first], after[last]), chain[first + 1 : first + size]
            if all(_spin(edges, ends, inner) is not None for edges in configurations):
                of_chain.append(Spin(rod, (*ends[0], *ends[1])))
        all_spins += of_chain
    return all_spins


def motions(edges: Sequence[Edge], idle: Sequence[Spin], columns: int) -> Array:
    """Return the idle motions (n, columns) as steps of length 1, at the configuration of the joints."""
    rows = np.zeros((len(idle), columns))
    for row, spin in zip(rows, idle, strict=True):
        screws = np.hstack([edges[i].screws for i in spin.edges])
        step, at = np.linalg.svd(screws)[2][-1], 0
        for i in spin.edges:
            count = edges[i].screws.shape[1]
            for column, value in zip(edges[i].columns, step[at : at + count], strict=False):
                row[column] = value
            at += count
        row /= max(float(np.linalg.norm(row)), 1e-300)
    return rows


def _chains(edges: Sequence[Edge]) -> Iterator[list[int]]:
    """Yield series of joints, by their indices, between bodies that have other than two joints: the root always
    counts as such, and so does the first body of a ring."""
    at: dict[int, list[int]] = {}
    for i, edge in enumerate(edges):
        for body in (edge.first, edge.second):
            at.setdefault(body, []).append(i)
    ends = [body for body, joints in at.items() if body == 0 or len(joints) != 2]
    seen: set[int] = set()
    for start in (*ends, *at):
        for first in at[start]:
            chain, body, index = list[int](), start, first
            while index not in seen:
                seen.add(index)
                chain.append(index)
                edge = edges[index]
                body = edge.second if edge.first == body else edge.first
                if body in ends or body == start:
                    break
                index = next(i for i in at[body] if i != index)
            if len(chain) > 1:
                yield chain


def _bodies(edges: Sequence[Edge], chain: Sequence[int]) -> list[int]:
    """Return the bodies between the joints of a chain."""
    pairs = [{edges[i].first, edges[i].second} for i in chain]
    bodies: list[int] = []
    for pair, other in pairwise(pairs):
        bodies.append(next(iter(pair & other - set(bodies[-1:]) or pair & other)))
    return bodies


def _group(configurations: Sequence[Sequence[Edge]], series: Sequence[int], usable: Collection[int]) -> list[int]:
    """Return the first joints of a series, as many as have axes that meet in one point at all configurations."""
    group: list[int] = []
    for index in islice(series, _MOST):
        trial = [*group, index]
        if index not in usable or not all(_meet(edges, trial) for edges in configurations):
            break
        group = trial
    return group


def _meet(edges: Sequence[Edge], group: Sequence[int]) -> bool:
    """Return whether joints are rotations whose axes meet in one point."""
    screws = np.hstack([edges[i].screws for i in group])
    v, w = screws[:3], screws[3:]
    if screws.shape[1] == 0 or not np.isfinite(screws).all() or np.linalg.norm(w, axis=0).min() < 0.5:
        return False
    # v = p x w = -skew(w) p for all lines through the point p
    matrix, right = np.vstack([-skew(axis) for axis in w.T]), v.T.ravel()
    point = np.linalg.lstsq(matrix, right, rcond=_ROUNDING)[0]
    off = float(np.abs(matrix @ point - right).max())
    parallel = len(group) > 1 and float(np.linalg.svd(w, compute_uv=False)[1:2].sum()) < _ROUNDING
    return off < _ROUNDING and not parallel


def _spin(edges: Sequence[Edge], ends: tuple[list[int], list[int]], inner: Sequence[int]) -> Array | None:
    """Return the twist (6,) of a rod that both its ends allow, while the joints inside it are at rest; None unless
    there is just one, about a line on which these slide or turn."""
    left, right = (np.hstack([np.zeros((6, 0)), *(edges[i].screws for i in end)]) for end in ends)
    together = np.hstack([left, right])
    if min(left.shape[1], right.shape[1]) < 2 or not np.isfinite(together).all():
        return None
    s, vt = np.linalg.svd(together)[1:]
    values = np.concatenate([s, np.zeros(vt.shape[0] - len(s))])
    if values[-1] > _ROUNDING or (len(values) > 1 and values[-2] <= _ROUNDING):
        return None
    twist = left @ vt[-1][: left.shape[1]]
    size = float(np.linalg.norm(twist[3:]))
    if size < _ROUNDING:
        return None
    twist = twist / size
    for i in inner:
        for screw in edges[i].screws.T:
            slides = np.linalg.norm(screw[3:]) < 0.5
            along = np.cross(screw[:3], twist[3:]) if slides else screw - twist * float(screw[3:] @ twist[3:])
            if np.abs(along).max() > _ROUNDING:
                return None
    return np.asarray(twist)
