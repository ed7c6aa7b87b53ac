"""Contact of a robot's meshes, by trimesh's files and coal's trees alone: a yardstick for distances of links.

Nothing of `cinegen.collision` is used. Poses are Pinocchio's. Pairs of links that a joint of the URDF connects, also by
way of links without shapes, are not judged, nor those that are fixed to each other.
"""

from itertools import combinations
from pathlib import Path

import coal
import networkx
import numpy as np
import pinocchio as pin
import trimesh
from lxml import etree

from cinegen import Mechanism


def tree_of(vertices, faces) -> coal.BVHModelOBBRSS:
    """Coal's tree of boxes over triangles."""
    tree = coal.BVHModelOBBRSS()
    tree.beginModel(len(faces), len(vertices))
    tree.addVertices(np.asarray(vertices, dtype=float))
    tree.addTriangles(np.asarray(faces, dtype=np.int64))
    tree.endModel()
    return tree


def shape_of(drawn: pin.GeometryObject):
    """The shape of a description; a mesh is read again, by trimesh, where it has no frames and units of its own."""
    if Path(drawn.meshPath).suffix.lower() not in (".stl", ".obj"):
        return drawn.geometry
    mesh = trimesh.load_mesh(drawn.meshPath, process=False)
    if not isinstance(mesh, trimesh.Trimesh):
        return drawn.geometry
    return tree_of(np.asarray(mesh.vertices) * np.asarray(drawn.meshScale), mesh.faces)


def adjacent_links(urdf: str) -> set[frozenset[str]]:
    """The pairs of links that are connected by a joint, or by joints and links without shapes between these, as in
    MoveIt's setup assistant."""
    tree = etree.fromstring(urdf.encode())
    tag = "collision" if next(tree.iter("collision"), None) is not None else "visual"
    shaped = {link.get("name") for link in tree.iter("link") if {"collision", tag} & {child.tag for child in link}}
    graph = networkx.Graph(
        (joint.find("parent").get("link"), joint.find("child").get("link"))
        for joint in tree.iter("joint")
        if joint.find("parent") is not None
    )
    pairs = {frozenset(edge) for edge in graph.edges}
    for empty in set(graph) - shaped:
        near = list(graph.neighbors(empty))
        graph.remove_node(empty)
        graph.add_edges_from(combinations(near, 2))
    return pairs | {frozenset(edge) for edge in graph.edges}


class MeshContact:
    """Which meshes of a mechanism touch.

    Args:
        mechanism: robot.
        samples: (n, nq) configurations: pairs in contact in each of them are not judged.

    Attributes:
        names: link of each shape.
        pairs: indices of the shapes of each judged pair.
        always: pairs that are not judged.
    """

    def __init__(self, mechanism: Mechanism, samples) -> None:
        self.model = mechanism.model
        self.data = self.model.createData()
        self.drawn = list(mechanism.collision.geometryObjects)
        self.names = [self.model.frames[mesh.parentFrame].name for mesh in self.drawn]
        self.shapes = [shape_of(mesh) for mesh in self.drawn]
        joints, adjacent = [mesh.parentJoint for mesh in self.drawn], adjacent_links(mechanism.source.urdf)
        self.pairs = [
            (i, k)
            for i, k in combinations(range(len(joints)), 2)
            if joints[i] != joints[k] and frozenset((self.names[i], self.names[k])) not in adjacent
        ]
        self.measures = {pair: coal.ComputeCollision(*(self.shapes[i] for i in pair)) for pair in self.pairs}
        self.always = set(self.pairs)
        for q in samples:
            if not self.always:
                break
            self.always &= set(self.touching(q, pairs=sorted(self.always)))
        self.pairs = [pair for pair in self.pairs if pair not in self.always]
        self._geometry = pin.GeometryModel()
        for number, (mesh, shape) in enumerate(zip(self.drawn, self.shapes, strict=True)):
            self._geometry.addGeometryObject(pin.GeometryObject(f"{number}", mesh.parentJoint, mesh.placement, shape))
        for pair in self.pairs:
            self._geometry.addCollisionPair(pin.CollisionPair(*pair))
        self._results = self._geometry.createData()

    def touches(self, q, margin: float = 0.0) -> bool:
        """Whether any pair is nearer than a margin, m: `touching` in one call."""
        for request in self._results.collisionRequests:
            request.security_margin = margin
        return bool(pin.computeCollisions(self.model, self.data, self._geometry, self._results, q, True))

    def touching(self, q, margin: float = 0.0, pairs=None, first: bool = False) -> list[tuple[int, int]]:
        """The pairs nearer than a margin, m; only one of them if `first`."""
        pin.forwardKinematics(self.model, self.data, q)
        at = self.placed()
        request, contacts = coal.CollisionRequest(), []
        request.security_margin = margin
        for i, k in self.pairs if pairs is None else pairs:
            if self.measures[i, k](at[i], at[k], request, coal.CollisionResult()):
                contacts.append((i, k))
                if first:
                    break
        return contacts

    def placed(self) -> list[coal.Transform3s]:
        """Poses of the shapes, where the joints were placed last."""
        poses = [self.data.oMi[mesh.parentJoint] * mesh.placement for mesh in self.drawn]
        return [coal.Transform3s(pose.rotation, pose.translation) for pose in poses]

    def approach(self, q, pair) -> tuple[float, np.ndarray]:
        """The distance of a pair at q (nq,), m, and how fast each joint velocity changes it (nv,), by the nearest
        points; not above 0 in contact."""
        jacobian = pin.computeJointJacobians(self.model, self.data, q)
        at, request, result = self.placed(), coal.DistanceRequest(True), coal.DistanceResult()
        first, second = pair
        distance = coal.distance(self.shapes[first], at[first], self.shapes[second], at[second], request, result)
        start, other = result.getNearestPoint1(), result.getNearestPoint2()
        normal, rates = (other - start) / max(float(np.linalg.norm(other - start)), 1e-12), np.zeros(self.model.nv)
        for shape, point, sign in ((first, start, -1.0), (second, other, 1.0)):
            moved = np.zeros(self.model.nv)
            for joint in list(self.model.supports[self.drawn[shape].parentJoint])[1:]:
                begin = self.model.joints[joint].idx_v
                moved[begin : begin + self.model.joints[joint].nv] = 1.0
            rates += sign * moved * (normal @ (jacobian[:3] - pin.skew(point) @ jacobian[3:]))
        return distance, rates
