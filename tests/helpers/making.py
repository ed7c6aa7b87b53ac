"""RAFF texts of mechanisms that are given by where their joints stand in the world, and their mobility by screws.

A mechanism is assembled before it is described: whatever the axes, its loops close, up to the digits that are written.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from elementary import shift, turn

FIXED, PRISMATIC, REVOLUTE = 0, 1, 2
RIGID, BALL = 0, 3  # of loops; 1 and 2 are prismatic and revolute there too
TOOL = 1000  # number of the frame that is called "tool"
FREE = {RIGID: (), PRISMATIC: (2,), REVOLUTE: (5,), BALL: (3, 4, 5)}
"""Which components of (v, omega), in the axes of a loop's end, the joint that was cut leaves free."""


def six(placement: np.ndarray) -> tuple[float, float, float, float, float, float]:
    """gamma, epsilon, alpha, d, theta, r of a (4, 4) placement: Euler's ZXZ, and the way along three lines."""
    m, p = placement[:3, :3], placement[:3, 3]
    sine = math.hypot(m[0, 2], m[1, 2])
    if sine > 1e-9:
        alpha = math.atan2(sine, m[2, 2])
        gamma = math.atan2(m[0, 2], -m[1, 2])
        x, y, z = turn("z", -gamma)[:3, :3] @ p
        r = -y / sine
        d, epsilon = x, z - r * math.cos(alpha)
    else:
        alpha = 0.0 if m[2, 2] > 0.0 else math.pi
        d = math.hypot(p[0], p[1])
        gamma = math.atan2(p[1], p[0]) if d > 0.0 else 0.0
        epsilon, r = p[2], 0.0
    last = turn("x", -alpha)[:3, :3] @ turn("z", -gamma)[:3, :3] @ m
    return gamma, float(epsilon), alpha, float(d), math.atan2(last[1, 0], last[0, 0]), float(r)


def axis(point: Sequence[float], along: Sequence[float] = (0.0, 0.0, 1.0)) -> np.ndarray:
    """A placement at a point with its z along a direction."""
    z = np.asarray(along, dtype=float) / np.linalg.norm(along)
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    m = np.eye(4)
    m[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    m[:3, 3] = point
    return m


class Joint(NamedTuple):
    """What rotates about, or slides along, the z of a place in the world."""

    place: np.ndarray
    kind: int = REVOLUTE
    more: str = ""


@dataclass(frozen=True)
class Body:
    """A link (or a frame: `kind` None), where it stands in the world; 0 is the base."""

    number: int
    pred: int
    place: np.ndarray
    kind: int | None = REVOLUTE
    more: str = ""


@dataclass(frozen=True)
class Mechanism:
    """Bodies, fathers first, and loops: two numbers and a kind."""

    bodies: tuple[Body, ...]
    loops: tuple[tuple[int, int, int], ...] = ()
    base: np.ndarray = field(default_factory=lambda: np.eye(4))

    @property
    def places(self) -> dict[int, np.ndarray]:
        return {0: self.base} | {body.number: body.place for body in self.bodies}

    @property
    def joints(self) -> tuple[Body, ...]:
        """The bodies that move on their fathers."""
        return tuple(body for body in self.bodies if body.kind in (PRISMATIC, REVOLUTE))

    def moved(self, place: np.ndarray) -> Mechanism:
        """The whole of it elsewhere."""
        bodies = tuple(replace(body, place=place @ body.place) for body in self.bodies)
        return replace(self, bodies=bodies, base=place @ self.base)

    def scaled(self, factor: float) -> Mechanism:
        """All lengths by a factor."""

        def larger(place: np.ndarray) -> np.ndarray:
            place = place.copy()
            place[:3, 3] *= factor
            return place

        bodies = tuple(replace(body, place=larger(body.place)) for body in self.bodies)
        return replace(self, bodies=bodies, base=larger(self.base))

    def renumbered(self, numbers: Mapping[int, int], order: Sequence[int] | None = None) -> Mechanism:
        """Other numbers, and the bodies in another order: a file may name a node before its father."""
        numbers = {0: 0, **numbers}
        bodies = [replace(body, number=numbers[body.number], pred=numbers[body.pred]) for body in self.bodies]
        loops = tuple((numbers[a], numbers[b], kind) for a, b, kind in self.loops)
        kept = bodies if order is None else [bodies[i] for i in order]
        return replace(self, bodies=tuple(kept), loops=loops)

    def text(self, digits: int | None = None, joint_digits: int | None = 7, units: str | None = "mm") -> str:
        """As RAFF. `digits`: significant ones of the geometry, `joint_digits` of the joint variables; None: all."""
        unit = {"um": 1e6, "mm": 1e3, "cm": 1e2, "m": 1.0, None: 1e3}[units]
        places = self.places
        lines = [] if units is None else [f"units {units}"]
        lines += ["robot r {", f"  base {{ {_parameters(self.base, None, unit, None, None)} }}"]
        for body in self.bodies:
            local = np.linalg.inv(places[body.pred]) @ body.place
            said = _parameters(local, body.kind, unit, digits, joint_digits)
            word = "frame" if body.kind is None else "link"
            kind = "" if body.kind is None else f"type {body.kind} "
            lines.append(f"  {word} {body.number} {{ {said} {kind}pred {body.pred} {body.more} }}")
        names = {0: "base"} | {b.number: f"{'frame' if b.kind is None else 'link'} {b.number}" for b in self.bodies}
        for first, second, kind in self.loops:
            lines.append(f"  constraint {{ {names[first]} {names[second]} type {kind} }}")
        return "\n".join([*lines, "}", ""])

    def constraint_rows(self) -> np.ndarray:
        """(rows, joints) what each joint adds to the twist between the two ends of each loop, freedoms left out.

        Screw theory: a revolute joint's twist at p is (z x (p - o), z), a prismatic joint's (z, 0).
        """
        places, column = self.places, {body.number: i for i, body in enumerate(self.joints)}
        by_number = {body.number: body for body in self.bodies}
        blocks = [np.zeros((0, len(column)))]
        for first, second, kind in self.loops:
            end = places[first]
            block = np.zeros((6, len(column)))
            for sign, tip in ((-1.0, first), (1.0, second)):
                while tip != 0:
                    body = by_number[tip]
                    if tip in column:
                        z, o = body.place[:3, 2], body.place[:3, 3]
                        slides = body.kind == PRISMATIC
                        v = z if slides else np.cross(z, end[:3, 3] - o)
                        w = np.zeros(3) if slides else z
                        block[:, column[tip]] += sign * np.concatenate([end[:3, :3].T @ v, end[:3, :3].T @ w])
                    tip = body.pred
            blocks.append(np.delete(block, FREE[kind], axis=0))
        return np.vstack(blocks)

    def singular_values(self) -> np.ndarray:
        """Of the loops, without unit: by the largest distance between two places."""
        places = np.array([place[:3, 3] for place in self.places.values()])
        size = max(float(np.linalg.norm(places - places.mean(axis=0), axis=1).max()), 1e-12)
        rows = self.scaled(1.0 / size).constraint_rows()
        return np.linalg.svd(rows, compute_uv=False) if rows.size else np.zeros(0)

    def mobility(self) -> int | None:
        """Joints less independent rows here; None where it is too near a singularity to be sure."""
        sigma = self.singular_values()
        if ((sigma > 1e-9) & (sigma < 1e-3)).any():
            return None
        return len(self.joints) - int(np.count_nonzero(sigma >= 1e-3))


def _parameters(place: np.ndarray, kind: int | None, unit: float, digits: int | None, joint_digits: int | None) -> str:
    gamma, epsilon, alpha, d, theta, r = six(place)
    said = []
    for word, value, variable in (
        ("gamma", math.degrees(gamma), False),
        ("epsilon", epsilon * unit, False),
        ("alpha", math.degrees(alpha), False),
        ("d", d * unit, False),
        ("theta", math.degrees(theta), kind == REVOLUTE),
        ("r", r * unit, kind == PRISMATIC),
    ):
        kept = joint_digits if variable else digits
        said.append(f"{word} {value!r}" if kept is None else f"{word} {float(f'{value:.{kept}g}')!r}")
    return f"parameters {{ {' '.join(said)} }}"


# --- random geometry ---------------------------------------------------------------------------------------------


def direction(rng: np.random.Generator) -> np.ndarray:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def somewhere(rng: np.random.Generator, size: float = 1.0) -> np.ndarray:
    """A random placement."""
    m = axis(rng.uniform(-size, size, 3), direction(rng))
    return m @ turn("z", rng.uniform(-math.pi, math.pi))


def graph(rng: np.random.Generator, bodies: int, loops: int, kinds: Sequence[int] = (RIGID, 1, 2, BALL)) -> Mechanism:
    """A random tree of bodies, joints anywhere, with loops between any two of them, the base too: between frames on
    them, or between one of them as it stands and a frame on the other."""
    parts: list[Body] = []
    for number in range(1, bodies + 1):
        kind = int(rng.choice([REVOLUTE, PRISMATIC, FIXED], p=[0.75, 0.2, 0.05]))
        pred = number - 1 if rng.random() < 0.7 else int(rng.integers(0, number))
        parts.append(Body(number, pred, somewhere(rng), kind))
    places = {0: np.eye(4)} | {body.number: body.place for body in parts}
    closed, number = [], bodies + 1
    for _ in range(loops):
        first, second = (int(i) for i in rng.choice(bodies + 1, 2, replace=False))
        itself = rng.random() < 0.3
        place = places[first] if itself else somewhere(rng)
        if not itself:
            parts.append(Body(number, first, place, None))
            first, number = number, number + 1
        parts.append(Body(number, second, place, None))
        closed.append((first, number, int(rng.choice(kinds))))
        number += 1
    return Mechanism(tuple(parts), tuple(closed))


# --- rings -------------------------------------------------------------------------------------------------------


def ring(axes, kinds=None, cut=-1, how="joint", more=None):
    """One closed loop: joint i joins body i to body i + 1, the last one to the base again. `TOOL` is on the middle one.

    Args:
        axes: of all joints, in the world.
        kinds: REVOLUTE or PRISMATIC; all revolute unless said.
        cut: which joint is cut.
        how: "joint": as what it is; "rigid": the joint stays and the far end is held rigidly; "ball": as a ball.
        more: words of the links that joints move.
    """
    n = len(axes)
    kinds = [REVOLUTE] * n if kinds is None else list(kinds)
    more = [""] * n if more is None else list(more)
    cut %= n
    parts = [Body(b, b - 1, axes[b - 1], kinds[b - 1], more[b - 1]) for b in range(1, cut + 1)]
    parts += [Body(b, (b + 1) % n, axes[b], kinds[b], more[b]) for b in range(n - 1, cut, -1)]
    near, far = cut, (cut + 1) % n
    tool = Body(TOOL, n // 2, axes[n // 2] @ shift("x", 0.2), None, 'name "tool"')
    if how == "rigid":
        parts.append(Body(n, near, axes[cut], kinds[cut], more[cut]))
        parts += [Body(n + 1, n, axes[cut], None), Body(n + 2, far, axes[cut], None)]
        return Mechanism((*parts, tool), ((n + 1, n + 2, RIGID),))
    parts += [Body(n + 1, near, axes[cut], None), Body(n + 2, far, axes[cut], None)]
    return Mechanism((*parts, tool), ((n + 1, n + 2, BALL if how == "ball" else kinds[cut]),))


def planar(points: np.ndarray) -> list[np.ndarray]:
    """Parallel axes through points (n, 2) of the plane."""
    return [axis((x, y, 0.0)) for x, y in points]


def bennett(rng: np.random.Generator) -> list[np.ndarray]:
    """The four axes of a random Bennett linkage, mobility 1 where Kutzbach and Gruebler say -2.

    G. T. Bennett, "A new mechanism", Engineering 76, 1903: opposite sides are equal, a / sin(alpha) = b / sin(beta),
    and tan(t1 / 2) tan(t2 / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2).
    """
    alpha, size, t1 = rng.uniform(0.3, 1.2), rng.uniform(0.3, 1.0), rng.uniform(0.5, 2.6)
    beta = alpha + rng.uniform(0.2, 1.0)
    t2 = 2.0 * math.atan(math.sin((beta + alpha) / 2.0) / math.sin((beta - alpha) / 2.0) / math.tan(t1 / 2.0))
    places = [np.eye(4)]
    for twist, t in ((beta, t1), (alpha, t2), (beta, -t1), (alpha, -t2)):
        places.append(places[-1] @ turn("x", twist) @ shift("x", size * math.sin(twist)) @ turn("z", t))
    assert np.abs(places[4] - places[0]).max() < 1e-12
    return [*places[1:4], places[0]]


def sarrus(rng: np.random.Generator) -> list[np.ndarray]:
    """The six axes of a random Sarrus linkage: two folding pairs of plates that lift a platform straight up. Mobility 1
    where Kutzbach and Gruebler say 0."""
    sides = []
    for angle in (0.0, rng.uniform(0.6, 2.5)):
        along = np.array([math.cos(angle), math.sin(angle), 0.0])
        out = np.array([-along[1], along[0], 0.0])
        foot, knee = out * rng.uniform(0.1, 1.0), rng.uniform(0.3, 0.7)
        up = np.array([0.0, 0.0, 1.0])
        sides.append([axis(foot, along), axis(foot + knee * out + 0.4 * up, along), axis(foot + up, along)])
    return sides[0] + sides[1][::-1]


def parallelograms(rng: np.random.Generator, storeys: int, cranks: int = 2, lean: float | None = None) -> Mechanism:
    """Parallelograms on top of each other, each on the coupler of the one below; `cranks` equal bars in each, of which
    all but two add nothing but rows. Mobility: one for each storey. `lean`: angle between bars and base."""
    parts, loops, number, pred = [], [], 1, 0
    low, across = np.zeros(2), np.array([rng.uniform(0.3, 0.6), rng.uniform(-0.2, 0.2)])
    for _ in range(storeys):
        angle = math.atan2(across[1], across[0]) + (rng.uniform(0.5, 2.6) if lean is None else lean)
        bar = rng.uniform(0.2, 0.5) * np.array([math.cos(angle), math.sin(angle)])
        first, coupler = number, number + 1
        parts += [Body(first, pred, axis((*low, 0.0))), Body(coupler, first, axis((*(low + bar), 0.0)))]
        number += 2
        for part in np.linspace(1.0, 0.3, cranks - 1):
            foot = low + part * across
            head = axis((*(foot + bar), 0.0))
            parts += [Body(number, pred, axis((*foot, 0.0))), Body(number + 1, number, head, None)]
            parts.append(Body(number + 2, coupler, head, None))
            loops.append((number + 1, number + 2, REVOLUTE))
            number += 3
        pred, low = coupler, low + bar
    parts.append(Body(TOOL, pred, axis((*(low + 0.1), 0.0)), None, 'name "tool"'))
    return Mechanism(tuple(parts), tuple(loops))


# --- platforms on legs -------------------------------------------------------------------------------------------


def leg(word: str, rng: np.random.Generator, foot: np.ndarray, head: np.ndarray) -> list[Joint]:
    """The joints of a leg such as UPS or RUS from foot to head; S is three revolute joints."""
    joints: list[Joint] = []
    for i, letter in enumerate(word):
        along = i / max(1, len(word) - 1)
        point = foot + along * (head - foot)
        if 0 < i < len(word) - 1 and letter != "P":
            point = point + 0.3 * rng.normal(size=3)
        if letter == "R":
            joints.append(Joint(axis(point, direction(rng))))
        elif letter == "P":
            way = head - foot if 0 < i < len(word) - 1 else direction(rng)
            joints.append(Joint(axis(point, way), PRISMATIC))
        elif letter == "U":
            first = direction(rng)
            joints += [Joint(axis(point, along)) for along in (first, np.cross(first, direction(rng)))]
        else:
            joints += [Joint(axis(point, along)) for along in np.linalg.qr(rng.normal(size=(3, 3)))[0]]
    return joints


def legged(legs, cut="rigid", place=lambda: axis((0.1, -0.2, 0.3), (0.2, 0.5, 1.0))):
    """A platform on legs, joints from the base to the platform; all legs but the first are cut at the platform. `TOOL`
    is a frame on it.

    Args:
        legs: joints of each.
        cut: of each leg, or of all: "rigid": at a place on the platform; "joint": at the last joint, as what it is;
            "ball": at the last three, as a ball.
        place: returns where a rigid end is, and the tool.
    """
    cuts = [cut] * len(legs) if isinstance(cut, str) else cut
    parts, loops, platform = list[Body](), list[tuple[int, int, int]](), 0

    def add(pred: int, joint: Joint, kind: int | None) -> int:
        parts.append(Body(len(parts) + 1, pred, joint.place, kind, joint.more))
        return len(parts)

    for i, (joints, how) in enumerate(zip(legs, cuts, strict=True)):
        kept = len(joints) - (0 if i == 0 else {"rigid": 0, "joint": 1, "ball": 3}[how])
        pred = 0
        for joint in joints[:kept]:
            pred = add(pred, joint, joint.kind)
        if i == 0:
            platform = pred
            continue
        end = joints[kept] if kept < len(joints) else Joint(place(), RIGID)
        end = Joint(end.place, BALL if how == "ball" else end.kind)
        loops.append((add(pred, end, None), add(platform, end, None), end.kind))
    parts.append(Body(TOOL, platform, place(), None, 'name "tool"'))
    return Mechanism(tuple(parts), tuple(loops))


def platform(rng: np.random.Generator, words: Sequence[str], cut: str = "rigid") -> Mechanism:
    """A platform on legs of random geometry.

    Args:
        rng: makes the geometry.
        words: of the legs, such as UPS.
        cut: "rigid": at a place on the platform; "joint": at the last joint (S: as a ball).
    """
    legs = []
    for i, word in enumerate(words):
        around = 2.0 * math.pi * i / len(words)
        foot = np.array([math.cos(around), math.sin(around), 0.0]) + 0.2 * rng.normal(size=3)
        head = np.array([0.4 * math.cos(around + 0.4), 0.4 * math.sin(around + 0.4), 1.0]) + 0.1 * rng.normal(size=3)
        legs.append(leg(word, rng, foot, head))
    cuts, other = ["ball" if cut == "joint" and word[-1] == "S" else cut for word in words], rng.spawn(1)[0]
    return legged(legs, cuts, lambda: somewhere(other))
