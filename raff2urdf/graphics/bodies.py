"""Draw a robot without graphics as a machine: rigid bodies with plates and tubes, and what connects them.

A body is all that is rigidly connected: a link or the base, with the frames and links that are fixed to it, and what
rigid loops weld to these. It is drawn once, by the first of its nodes that names no graphics. A body with three joints
or more is a plate if these are in a plane; otherwise tapered tubes lead from its own joint to each of them.

Both sides of a joint are drawn, so that it reads as what it is: the child's eye between two discs of its parent on a
revolute axis; rod and sleeve, or carriage and rail, of a prismatic joint; a sphere in a cup; two pins, each in the ears
of its side, of a universal joint. Joints of several variables are one joint, and so are passive ones of a closed robot
whose axes meet.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from itertools import combinations, pairwise

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.graphics.body_shapes import (
    CUP,
    SHARED,
    TUBE,
    Colour,
    DrawnBody,
    Joint,
    Shape,
    Solid,
    box,
    composed,
    cylinder,
    is_inside,
    principal,
    shifted,
    sphere,
)
from raff2urdf.graphics.skeleton import JOINT, SkeletonDrawing, digits, rounded
from raff2urdf.graphics.solids import hull, recipe
from raff2urdf.graphics.wheels import CouplingDrawing
from raff2urdf.placement import along, inverse
from raff2urdf.raff.compound import expanded
from raff2urdf.raff.document import Document, JointType, LoopKind, RaffFrame, RaffLink, RaffNode, RaffPart, RaffRobot
from raff2urdf.raff.kleinfinger import transform
from raff2urdf.tree import moved

_ROD = 0.8  # of the skeleton's radius: that of a tube where it begins
_FLAT = 0.12  # of its extent: deviation from a plane of the joints of a plate
_MOST_SEARCHED = 12  # joints of a body among which those in a plane are looked for
_FARTHEST = 1e5  # radii: plates are no larger


class BodyDrawing:
    """Drawings of the nodes of one robot, each in its own frame."""

    def __init__(self, document: Document, robot: RaffRobot) -> None:
        self.document, self.robot = document, expanded(robot)
        self.skeleton = SkeletonDrawing(document, self.robot)
        self.unit = _ROD * self.skeleton.radius
        self.bodies: dict[int, DrawnBody] = {}
        self._gather()
        self._eyes: dict[tuple[int, ...], int] = defaultdict(int)
        self._cups: list[tuple[DrawnBody, Array]] = []
        self._inner: set[DrawnBody] = set()  # bodies inside a joint
        self._drawn: dict[int, list[Shape]] = defaultdict(list)
        self._degree: dict[DrawnBody, int] = defaultdict(int)
        self.threads: dict[int, float] = {}  # leads (m) of slides whose shafts are screws, by number
        CouplingDrawing(self).draw()
        chains = list(self._chains(list(self._joints())))
        for chain in chains:
            self._degree[chain[0].first] += 1
            self._degree[chain[-1].second] += 1
        for chain in chains:
            self._join(chain)
        for body, place in self._cups:
            self._cup(body, place)
        for body in dict.fromkeys(self.bodies.values()):
            carrier = self._carrier(body)
            self._fill(body)
            back = inverse(body.nodes[carrier])
            self._drawn[carrier] += [self._written(shape, back @ shape.placement) for shape in body.shapes]

    def of(self, node: RaffNode) -> list[Shape]:
        """Return the shapes of one node, in its own frame."""
        return self._drawn[node.number]

    def _written(self, shape: Shape, placement: Array) -> Shape:
        """Return a shape at a placement, both without rounding errors such as 1e-17."""
        placed = np.round(placement, 12) + 0.0
        placed[:3, 3] = rounded(placement[:3, 3], self.unit)
        return shape._replace(sizes=tuple(map(digits, shape.sizes)), placement=placed)

    # --- bodies ---------------------------------------------------------------------------------------------------

    def _gather(self) -> None:
        self.bodies[0] = DrawnBody({0: np.eye(4)})
        for part in self.robot.outward:
            if isinstance(part, RaffLink) and part.type is not JointType.FIXED:
                self.bodies[part.number] = DrawnBody({part.number: np.eye(4)})
            else:
                body = self.bodies[part.number] = self.bodies[part.pred]
                body.nodes[part.number] = body.nodes[part.pred] @ transform(self.skeleton.parameters[part.number])
        branches: dict[DrawnBody, set[Colour]] = defaultdict(set)
        for number, body in self.bodies.items():
            body.colour = self.skeleton.colours[next(iter(body.nodes))]
            branches[body].add(self.skeleton.colours[number])
        for loop in self.robot.loops:
            first, second = self.bodies[loop.first], self.bodies[loop.second]
            shared = branches[first] | branches[second]
            branches[first], branches[second] = shared, shared
            if loop.kind is LoopKind.RIGID and first is not second:
                if 0 in second.nodes:
                    first, second, loop = second, first, type(loop)(loop.second, loop.first)
                onto = first.nodes[loop.first] @ inverse(second.nodes[loop.second])
                first.nodes |= {number: onto @ placed for number, placed in second.nodes.items()}
                self.bodies |= dict.fromkeys(second.nodes, first)
        self._shared = {body for body, colours in branches.items() if len(colours) > 2 and 0 not in body.nodes}

    def _carrier(self, body: DrawnBody) -> int:
        """Return the node that draws a body: none is seen of one that has graphics of its own, or shows nothing."""
        links = [number for number in body.nodes if not isinstance(self.robot.nodes[number], RaffFrame)]
        free = [number for number in links if self.robot.nodes[number].filenames is None]
        return 0 if 0 in links else [*free, *links][0]

    # --- joints ---------------------------------------------------------------------------------------------------

    def _joints(self) -> Iterator[Joint]:
        for link in self.robot.links:
            if link.type is not JointType.FIXED:
                first, second = self.bodies[link.pred], self.bodies[link.number]
                at_zero = transform(moved(link, self.skeleton.parameters[link.number], 0.0))
                kind = LoopKind.PRISMATIC if link.type is JointType.PRISMATIC else LoopKind.REVOLUTE
                on_first = first.nodes[link.pred] @ at_zero
                yield Joint(first, on_first, second, second.nodes[link.number], kind, link)
        for loop in self.robot.loops:
            first, second = self.bodies[loop.first], self.bodies[loop.second]
            if loop.kind is not LoopKind.RIGID:
                yield Joint(first, first.nodes[loop.first], second, second.nodes[loop.second], loop.kind, None)

    def _chains(self, joints: list[Joint]) -> Iterator[list[Joint]]:
        """Yield what is drawn as one joint: successive joints between which there is no extended body."""
        around: dict[DrawnBody, list[Joint]] = defaultdict(list)
        for joint in joints:
            around[joint.first].append(joint)
            around[joint.second].append(joint)
        following: dict[int, Joint] = {}
        for body, ends in around.items():
            if len(ends) == 2 and ends[0].second is body is ends[1].first and self._is_thin(body, *ends):
                following[id(ends[0])] = ends[1]
                self._inner.add(body)
        followers = {id(joint) for joint in following.values()}
        for joint in joints:
            if id(joint) not in followers:
                chain = [joint]
                while id(chain[-1]) in following:
                    chain.append(following[id(chain[-1])])
                yield chain

    def _is_thin(self, body: DrawnBody, before: Joint, after: Joint) -> bool:
        """Return whether a body between two joints is only a part of one joint of several variables."""
        nodes, apart = [self.robot.nodes[number] for number in body.nodes], after.on_first - before.on_second
        if before.link is None or after.link is None or float(np.abs(apart[:3, 3]).max()) > 1e-3 * self.unit:
            return False
        if any(isinstance(node, RaffFrame) for node in nodes) or any(
            bool(at[:3, 3].any()) for at in body.nodes.values()
        ):
            return False
        if before.link.own_joint is not None and before.link.filenames == ():
            return True  # `raff2urdf.raff.compound` has put it there
        coupled = {n for c in self.robot.couplings for n in (c.follower, *(drive.link for drive in c.drives))}
        is_passive = not any(link.actuated or link.number in coupled for link in (before.link, after.link))
        turns = before.kind is after.kind is LoopKind.REVOLUTE
        aligned = abs(float(before.on_second[:3, 2] @ after.on_first[:3, 2]))
        return bool(self.robot.loops) and is_passive and turns and aligned < 0.99

    def _join(self, chain: list[Joint]) -> None:
        """Draw a joint on both bodies."""
        first, last = chain[0], chain[-1]
        kinds = [joint.kind for joint in chain]
        child = first.link
        path = child if child is not None and child.pred == next(iter(first.first.nodes)) else None
        first.first.points.append((first.on_first[:3, 3], path))
        last.second.points.insert(0, (last.on_second[:3, 3], None))
        if kinds == [LoopKind.REVOLUTE]:
            self._hinge(first)
        elif kinds == [LoopKind.PRISMATIC]:
            self._slide(first)
        elif kinds == [LoopKind.REVOLUTE] * 2:
            self._universal(first, last)
        elif kinds == [LoopKind.REVOLUTE, LoopKind.PRISMATIC]:
            self._slide(last._replace(first=first.first, on_first=composed(chain)), round_=True)
        elif kinds == [LoopKind.PRISMATIC, LoopKind.PRISMATIC, LoopKind.REVOLUTE]:
            self._puck(chain)
        else:
            self._ball(first, last)

    def _hinge(self, joint: Joint) -> None:
        u = self.unit
        key = (id(joint.first), *np.round(joint.on_first[:3, 3] / u).astype(int).tolist())
        nested = self._eyes[key]
        self._eyes[key] += 1
        wide, long = 1.3 + 0.35 * nested, 1.3 / (1.0 + 0.5 * nested)
        self.add(joint.second, cylinder(joint.on_second, wide * u, -0.5 * long * u, 0.5 * long * u))
        if not nested:
            for side in (-1.0, 1.0):
                self.add(joint.first, cylinder(joint.on_first, 1.3 * u, 0.7 * side * u, 1.2 * side * u))
            self.add(joint.first, cylinder(joint.on_first, 0.6 * u, -1.6 * u, 1.6 * u), JOINT)

    def _slide(self, joint: Joint, round_: bool = False) -> None:
        u, place, on_second = self.unit, joint.on_first, joint.on_second
        if joint.link is None:
            low, high, rod = -8.0 * u, 8.0 * u, 0.0
        else:
            low, high, rod = self.skeleton.telescope_of(joint.link)
            if self._is_shaft(joint):
                self._shaft(joint)
                return
        if rod:
            sign = math.copysign(1.0, rod)
            self.add(joint.first, cylinder(place, 1.15 * u, low, high))
            self.add(joint.first, cylinder(place, 1.4 * u, high - 1.2 * sign * u, high + 0.1 * sign * u), JOINT)
            self.add(joint.second, cylinder(on_second, 0.65 * u, -rod, 0.0))
        elif round_:
            self.add(joint.first, cylinder(place, 0.7 * u, low - 1.5 * u, high + 1.5 * u))
            self.add(joint.second, cylinder(on_second, 1.3 * u, -1.5 * u, 1.5 * u), JOINT)
        else:
            self.add(joint.first, box(place, (1.3 * u, 1.3 * u), low - 1.6 * u, high + 1.6 * u))
            for end, side in ((low, -1.0), (high, 1.0)):
                self.add(joint.first, box(place, (2.0 * u, 2.0 * u), end + 1.6 * side * u, end + 2.1 * side * u))
            self.add(joint.second, box(on_second, (2.4 * u, 2.4 * u), -1.6 * u, 1.6 * u), JOINT)

    def _is_shaft(self, joint: Joint) -> bool:
        """Return whether a prismatic joint is along the axis about which its parent turns, through the same point."""
        root = self.robot.nodes[next(iter(joint.first.nodes))]
        if not isinstance(root, RaffLink) or root.type is not JointType.REVOLUTE:
            return False
        along_own = abs(joint.on_first[2, 2]) > 1.0 - 1e-9
        return along_own and bool(np.abs(joint.on_first[:3, 3]).max() < 1e-3 * self.unit)

    def _shaft(self, joint: Joint) -> None:
        """Draw a shaft that slides through its parent, over the whole stroke."""
        assert joint.link is not None
        u, (low, high) = self.unit, self.skeleton.stroke(joint.link)
        start, length = -high - 3.0 * u, high - low + 6.0 * u
        if (lead := self.threads.get(joint.link.number)) is None:
            self.add(joint.second, cylinder(joint.on_second, 0.7 * u, start, start + length))
        else:
            text = recipe("screw", min(length / lead, 60.0), 0.25)
            self.add(joint.second, ("mesh", (0.8 * u, 0.8 * u, length), shifted(joint.on_second, start), text))

    def _universal(self, first: Joint, last: Joint) -> None:
        u = self.unit
        for body, place in ((first.first, first.on_first), (last.second, last.on_second)):
            for side in (-1.0, 1.0):
                self.add(body, cylinder(place, 0.8 * u, 0.95 * side * u, 1.5 * side * u))
            self.add(body, cylinder(place, 0.4 * u, -1.75 * u, 1.75 * u), JOINT)
        self.add(last.second, sphere(last.on_second[:3, 3], 0.85 * u), JOINT)

    def _ball(self, first: Joint, last: Joint) -> None:
        """Draw a sphere now, and note its cup: that is on the body with fewer joints, and open away from it."""
        u, ends = self.unit, [(first.first, first.on_first), (last.second, last.on_second)]
        ends.sort(key=lambda end: (0 in end[0].nodes, self._degree[end[0]]))
        (cup, in_cup), (ball, on_ball) = ends
        self.add(ball, sphere(on_ball[:3, 3], 1.15 * u), JOINT)
        self._cups.append((cup, in_cup))

    def _puck(self, chain: list[Joint]) -> None:
        u, turned = self.unit, chain[-1].on_second
        spans = [self.skeleton.stroke(joint.link) for joint in chain[:2] if joint.link is not None]
        (x0, x1), (y0, y1) = ((low - 3.0 * u, high + 3.0 * u) for low, high in spans)
        table, x, y = composed(chain), chain[0].on_first[:3, 2], composed(chain[:2])[:3, 2]
        table[:3, :3] = np.column_stack([x, y, np.cross(x, y)])
        table[:3, 3] += 0.5 * ((x0 + x1) * x + (y0 + y1) * y)
        self.add(chain[0].first, box(table, (x1 - x0, y1 - y0), -1.1 * u, -0.6 * u))
        self.add(chain[-1].second, cylinder(turned, 1.8 * u, -0.6 * u, 0.6 * u))

    def _cup(self, body: DrawnBody, place: Array) -> None:
        others = [point for point, _ in body.points if np.abs(point - place[:3, 3]).max() > self.unit]
        way = place[:3, 3] - np.mean(others, axis=0) if others else place[:3, 2]
        self.add(body, ("mesh", (self.unit,) * 3, along(place[:3, 3], way), CUP))

    # --- what connects the joints of a body -------------------------------------------------------------------------

    def _fill(self, body: DrawnBody) -> None:
        shown = [self.robot.nodes[number] for number in body.nodes if self.robot.nodes[number].filenames]
        if any(not isinstance(node, RaffFrame) for node in shown):
            return  # the joints alone are drawn
        points = self._distinct(body)
        plane = self._plane(np.array([point for point, _ in points]))
        if plane is None:
            self._rods(body, points)
        elif not shown:
            if body in self._shared:
                colour, body.colour = body.colour, SHARED
                body.shapes[:] = [s._replace(colour=SHARED) if s.colour == colour else s for s in body.shapes]
            self._plate(body, points, plane)
        self._ends(body, [point for point, _ in points])
        if not body.shapes and body not in self._inner:
            self.add(body, sphere(np.zeros(3), self.unit))

    def _distinct(self, body: DrawnBody) -> list[tuple[Array, RaffPart | None]]:
        points: list[tuple[Array, RaffPart | None]] = []
        for point, path in body.points:
            if all(np.abs(point - other).max() > 0.5 * self.unit for other, _ in points):
                points.append((point, path))
        return points

    def _plane(self, points: Array) -> Array | None:
        """Return the placement (4, 4) whose x-y plane is that of three or more of a body's joints, and of two thirds of
        them at least; None without one."""
        count, best = len(points), None
        if count < 3 or np.ptp(points, axis=0).max() > _FARTHEST * self.unit:
            return None
        for some in (range(count), *combinations(range(min(count, _MOST_SEARCHED)), 3)):
            placement, extents = principal(points[list(some)])
            off = np.abs((points - placement[:3, 3]) @ placement[:3, 2])
            near = off <= max(_FLAT * extents[0], self.unit)
            if near[list(some)].all() and 3 * near.sum() >= 2 * count and near.sum() >= 3:
                placement, extents = principal(points[near])
                rank = int(near.sum()), float(extents[0] * extents[1])
                if extents[1] > 2.0 * self.unit and (best is None or rank > best[0]):
                    best = rank, placement
                if len(some) == count:
                    break
        return None if best is None else best[1]

    def _plate(self, body: DrawnBody, points: list[tuple[Array, RaffPart | None]], plane: Array) -> None:
        u, half = self.unit, 0.45
        local = np.array([(inverse(plane) @ [*point, 1.0])[:3] for point, _ in points])
        span = np.linalg.norm(local[:, :2], axis=1).max()
        held = np.abs(local[:, 2]) <= max(_FLAT * span, u)
        rim = local[held, :2][hull(local[held, :2])]
        self.add(body, ("mesh", (u, u, u), plane, recipe("plate", half, 1.7, *(rim / u).ravel())))
        for x, y, z in local:
            if abs(z) > half * u:  # a post
                inside = is_inside(np.array([x, y]), local[held, :2])
                nearest = local[held][np.linalg.norm(local[held] - [x, y, z], axis=1).argmin()]
                foot = np.array([x, y, 0.0] if inside else nearest)
                self._path(body, [(plane @ [*end, 1.0])[:3] for end in (foot, (x, y, z))], 1.0)

    def _rods(self, body: DrawnBody, points: list[tuple[Array, RaffPart | None]]) -> None:
        """Draw tubes from a body's own joint to the others: along the parameters of a child, or straight."""
        root = next(iter(body.nodes))
        hub = points[0][0] if points else np.zeros(3)
        if 0 in body.nodes and len(points) == 1 and points[0][1] is not None:  # a column, on its foot
            hub = np.zeros(3)
            if np.linalg.norm(points[0][0]) > self.unit:
                self.add(body, cylinder(np.eye(4), 3.0 * self.unit, -0.3 * self.unit, 0.3 * self.unit))
        for point, child in points:
            corners = [hub, point]
            if child is not None and not np.abs(body.nodes[root][:3, 3] - hub).max() > 1e-6 * self.unit:
                corners = [(body.nodes[root] @ [*corner, 1.0])[:3] for corner in self.skeleton.corners(child)]
            self._path(body, corners, 1.0)

    def _path(self, body: DrawnBody, corners: list[Array], thickness: float) -> None:
        drawn = [corners[0]]
        for corner in corners[1:]:
            if np.abs(corner - drawn[-1]).max() > 0.5 * self.unit:
                drawn.append(corner)
        for start, end in pairwise(drawn):
            self.add(body, self._tube(start, end, thickness))
        for corner in drawn[1:-1]:
            self.add(body, sphere(corner, thickness * self.unit))

    def _ends(self, body: DrawnBody, joints: list[Array]) -> None:
        """Draw frames: a thin tube from what is nearest, and a small sphere, unless a joint is there."""
        u, anchors = self.unit, [*joints]
        if len(joints) > 2:
            anchors.append(np.mean(joints, axis=0))
        for number, placed in body.nodes.items():
            node, point = self.robot.nodes[number], placed[:3, 3]
            if not isinstance(node, RaffFrame):
                continue
            nearest = min(anchors or [np.zeros(3)], key=lambda anchor: float(np.linalg.norm(anchor - point)))
            if np.linalg.norm(nearest - point) > 0.5 * u:
                self.add(body, self._tube(nearest, point, 0.6))
                if node.filenames is None:
                    self.add(body, sphere(point, 0.7 * u))
                anchors.append(point)

    def _tube(self, start: Array, end: Array, thickness: float) -> Solid:
        length = float(np.linalg.norm(end - start))
        wide = thickness * self.unit
        return "mesh", (wide, wide, length), along(start, end - start), TUBE

    def add(self, body: DrawnBody, solid: Solid, colour: Colour | None = None) -> None:
        """Draw a shape (kind, sizes, placement, recipe) in the frame of a body, in its colour or another one."""
        kind, sizes, placement, text = solid
        body.shapes.append(Shape(kind, sizes, placement, colour or body.colour, text))
