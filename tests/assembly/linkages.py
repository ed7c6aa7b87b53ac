"""Closed mechanisms of random geometry whose assembly modes are known from elsewhere, as RAFF texts.

Each is assembled first and described then: its home is one of its modes.
"""

import math
from collections.abc import Sequence

import making
import numpy as np
from making import PRISMATIC, REVOLUTE, TOOL, Joint, Mechanism, axis, direction, legged

MOTOR = "actuated 1"
X, Y, Z = np.eye(3)


def hinge(point, along=Z, motor=False) -> Joint:
    """A joint that turns; planar points may have two coordinates."""
    return Joint(axis(np.append(point, [0.0] * (3 - len(point))), along), REVOLUTE, MOTOR if motor else "")


def slide(point, along, motor=False) -> Joint:
    """A joint that slides."""
    along = np.append(along, [0.0] * (3 - len(along)))
    return Joint(axis(np.append(point, [0.0] * (3 - len(point))), along), PRISMATIC, MOTOR if motor else "")


def universal(point, first, second) -> list[Joint]:
    """Two joints that turn about axes through a point."""
    return [hinge(point, first), hinge(point, second)]


def ball(point, rng) -> list[Joint]:
    """Three joints that turn about axes through a point, at right angles here."""
    return [hinge(point, row) for row in np.linalg.qr(rng.normal(size=(3, 3)))[0]]


# --- in a plane ---------------------------------------------------------------------------------------------------


def five_bar(rng, cut="rigid") -> Mechanism:
    """Motors at both feet."""
    (a, b), (c, d), p = _feet(rng), _knees(rng), rng.uniform(-0.5, 0.5, 2) + np.array([0.5, 1.2])
    return legged([[hinge(a, motor=True), hinge(c), hinge(p)], [hinge(b, motor=True), hinge(d)]], cut)


def _feet(rng):
    return np.array([[0.0, 0.0], [1.0, 0.0]]) + rng.uniform(-0.2, 0.2, (2, 2))


def _knees(rng):
    return np.array([[-0.3, 0.7], [1.3, 0.7]]) + rng.uniform(-0.3, 0.3, (2, 2))


def three_legs(rng, word: str, cut="rigid") -> Mechanism:
    """A planar platform on three legs such as RPR or RRR; `word` has its motor in small letters."""
    around = 2.0 * math.pi * np.arange(3) / 3.0
    feet = np.c_[np.cos(around), np.sin(around)] + rng.uniform(-0.3, 0.3, (3, 2))
    heads = 0.4 * np.c_[np.cos(around + 0.4), np.sin(around + 0.4)] + rng.uniform(-0.2, 0.2, (3, 2))
    legs = []
    for foot, head in zip(feet, heads, strict=True):
        joints = []
        for k, letter in enumerate(word):
            point = foot + k / 2.0 * (head - foot) + (rng.uniform(-0.3, 0.3, 2) if k == 1 else 0.0)
            made = slide(point, head - foot) if letter in "Pp" else hinge(point)
            joints.append(made._replace(more=MOTOR if letter.islower() else ""))
        legs.append(joints)
    return legged(legs, cut)


# --- about a point ------------------------------------------------------------------------------------------------


def about_a_point(directions: Sequence[Sequence[np.ndarray]], motors: Sequence[int], cut="rigid") -> Mechanism:
    """Legs whose axes all go through the origin, along these directions; `motors`: which joint of each leg has one, -1
    for none."""
    legs = []
    for along, motor in zip(directions, motors, strict=True):
        places = [axis(0.3 * (k + 1) * d, d) for k, d in enumerate(along)]
        legs.append([Joint(place, REVOLUTE, MOTOR if k == motor else "") for k, place in enumerate(places)])
    return legged(legs, cut)


def spherical_legs(rng, lengths: Sequence[int]) -> list[list[np.ndarray]]:
    """So many directions for each leg, from a cone about -z to one about z."""
    legs = []
    for i, length in enumerate(lengths):
        around = 2.0 * math.pi * i / len(lengths) + rng.uniform(-0.3, 0.3)
        leans = np.linspace(2.2, 0.8, length) + rng.uniform(-0.2, 0.2, length)
        turns = around + 0.6 * np.arange(length) + rng.uniform(-0.3, 0.3, length)
        across = np.sin(leans)
        legs.append(list(np.column_stack([across * np.cos(turns), across * np.sin(turns), np.cos(leans)])))
    return legs


# --- platforms in space -------------------------------------------------------------------------------------------


def points(rng, base=1.0, platform=0.5, height=1.0) -> tuple[np.ndarray, np.ndarray]:
    """(6, 3) feet and (6, 3) heads of general rods."""
    around = 2.0 * math.pi * np.arange(6) / 6.0
    feet = np.c_[base * np.cos(around), base * np.sin(around), np.zeros(6)] + rng.uniform(-0.25, 0.25, (6, 3))
    heads = np.c_[platform * np.cos(around + 0.5), platform * np.sin(around + 0.5), np.full(6, height)]
    return feet, heads + rng.uniform(-0.15, 0.15, (6, 3))


def rod(rng, foot, head, word="UpS") -> list[Joint]:
    """UpS, SpS, SpU (a universal joint at the head), rUS (a crank at the foot), rSS or pSS (a slide there): the first
    axis of the ball at the head of these is along the rod."""
    along = head - foot
    first = np.cross(along, direction(rng))
    second = np.cross(along, first)
    if word == "UpS":
        return [*universal(foot, first, second), slide(foot + 0.4 * along, along, True), *ball(head, rng)]
    if word == "SpS":
        return [*ball(foot, rng), slide(foot + 0.4 * along, along, True), *ball(head, rng)]
    if word == "SpU":
        return [*ball(foot, rng), slide(foot + 0.4 * along, along, True), *universal(head, first, second)]
    low = foot + 0.3 * direction(rng) * [1.0, 1.0, 0.2]
    first = np.cross(along, direction(rng))
    second = np.cross(along, first)
    motor = (hinge if word[0] == "r" else slide)(low, direction(rng), True)
    if word[1] == "S":
        return [motor, *ball(foot, rng), *(hinge(head, turn) for turn in (along, first, second))]
    return [motor, *universal(foot, first, second), *ball(head, rng)]


def hexapod(rng, word="UpS", feet=None, heads=None, cut="ball") -> Mechanism:
    """Six rods."""
    random = points(rng)
    feet, heads = random[0] if feet is None else feet, random[1] if heads is None else heads
    return legged([rod(rng, foot, head, word) for foot, head in zip(feet, heads, strict=True)], cut)


def delta(rng, linear=False) -> tuple[Mechanism, np.ndarray, np.ndarray, np.ndarray]:
    """Three rods with universal joints whose axes are parallel by pairs, on cranks or on slides; and knees, heads and
    tool at home."""
    legs, knees, heads = [], [], []
    for around in 2.0 * math.pi * np.arange(3) / 3.0 + rng.uniform(-0.3, 0.3, 3):
        c, s = math.cos(around), math.sin(around)
        out, side = np.array([c, s, 0.0]), np.array([-s, c, 0.0])
        foot, head = rng.uniform(0.6, 0.9) * out, rng.uniform(0.15, 0.3) * out - rng.uniform(0.9, 1.1) * Z
        knee = foot + rng.uniform(0.2, 0.4) * out - rng.uniform(0.0, 0.3) * Z
        across = np.cross(side, head - knee)
        motor = slide(foot, -Z + 0.3 * out, True) if linear else hinge(foot, side, True)
        legs.append([motor, *universal(knee, side, across), *universal(head, across, side)])
        knees.append(knee)
        heads.append(head)
    return legged(legs), np.array(knees), np.array(heads)


def tripod_points(rng) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(3, 3) feet, directions of their hinges, and heads of a tripod."""
    feet, sides, heads = [], [], []
    for around in 2.0 * math.pi * np.arange(3) / 3.0 + rng.uniform(-0.3, 0.3, 3):
        out = np.array([math.cos(around), math.sin(around), 0.0])
        far, near, high = np.array([0.95, 0.5, 1.0]) + rng.uniform([-0.15, -0.1, -0.2], [0.15, 0.1, 0.2])
        feet.append(far * out)
        heads.append(near * out + high * Z)
        sides.append(np.cross(Z, out))
    return np.array(feet), np.array(sides), np.array(heads)


def tripod(rng, locked=()) -> Mechanism:
    """A platform on three legs RPS; the first and the third axis of `locked` legs' balls are one at home."""
    legs = []
    for i, (foot, side, head) in enumerate(zip(*tripod_points(rng), strict=True)):
        joints = ball(head, rng)
        if i in locked:
            across = np.cross(side, head - foot)
            joints = [hinge(head, side), hinge(head, across), hinge(head, side)]
        legs.append([hinge(foot, side), slide(foot + 0.5 * (head - foot), head - foot, True), *joints])
    return legged(legs, "ball")


def ring(joints: Sequence[Joint], cut: int = -1, how: str = "joint") -> Mechanism:
    """One loop from the base to the base again; joint `cut` is cut, or with "rigid" held rigidly beside itself."""
    places, kinds, more = zip(*joints, strict=True)
    return making.ring(places, kinds, cut, how, more)


def together(first: Mechanism, second: Mechanism) -> Mechanism:
    """Two mechanisms on one base; the second carries the tool."""
    kept = tuple(body for body in first.bodies if body.number != TOOL)
    numbers = {body.number: body.number + 500 for body in second.bodies if body.number != TOOL}
    other = second.renumbered(numbers | {TOOL: TOOL})
    return Mechanism(kept + other.bodies, first.loops + other.loops)
