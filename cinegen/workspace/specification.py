"""`MapSpecification`: all that determines a map: of which robot, over what, which quantities, and how thoroughly."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.model import Mechanism
from cinegen.model.fingerprint import fingerprint
from cinegen.model.urdf import kinematics_of
from cinegen.singularities.slice import POSE
from cinegen.workspace.errors import MapError
from cinegen.workspace.quantities import DIRECTED, QUANTITIES
from cinegen.workspace.region import Region
from raff2urdf.closure import rank
from raff2urdf.errors import did_you_mean

Array = NDArray[np.float64]

VERSION = 4
"""Of what stands in a map's folder, and how: changes when the same specification would give other numbers."""

_UNIT = 1e-12  # by which a unit vector may be longer or shorter
_MOVES = 1e-9  # rad or lengths for each: less is rounding

_TAKEN = (*QUANTITIES, "configuration", "reachable", "settled", "joint")

STARTS = 6
"""From how many configurations a pose is looked for that no neighbour leads to, unless said."""


@dataclass(frozen=True, eq=False)
class MapSpecification:
    """All that determines a map. What it takes to make it (processes, machines) is no part of it.

    Attributes:
        mechanism: which.
        region: the grid.
        quantities: names of what is wanted in each cell, see `cinegen.workspace.quantities`.
        node: whose pose is meant, and whose motions; the mechanism's end unless given.
        limits: whether joints must keep to their position limits, where poses are looked for.
        starts: from how many configurations a pose is looked for, where no neighbour's leads there.
        directions: into how many directions a sphere is divided, for the dexterous solid angle.
        along: (3,) in the world, along which speeds and forces are meant; unless given the first of z, x and y along
            which the node can move.
        scene: obstacles, as `cinegen.planning.Scene.document` has them, for the clearance; none unless given.
        folder: where the scene's files are looked for.

    Raises:
        UnknownNameError: no such node.
        MapError: coordinates, quantities or numbers that make no sense.
    """

    mechanism: Mechanism
    region: Region
    quantities: tuple[str, ...] = ("sigma_1", "sigma_2")
    node: str = ""
    limits: bool = True
    starts: int = STARTS
    directions: int = 64
    along: tuple[float, ...] = ()
    scene: Mapping[str, Any] | None = field(default=None, repr=False)
    folder: str = "."

    def __post_init__(self) -> None:
        if not self.node:
            object.__setattr__(self, "node", self.mechanism.end)
        self.mechanism.frame_id(self.node)
        if self.starts < 0 or self.directions < 1:
            raise MapError(f"starts ({self.starts}) must be 0 or more, and directions ({self.directions}) 1 or more")
        if not self.along:
            object.__setattr__(self, "along", self._usual_direction())
        length = math.hypot(*self.along)
        if not (len(self.along) == 3 and 0.0 < length < math.inf):
            raise MapError(f"along {self.along}: give a direction, three numbers")
        if abs(length - 1.0) > _UNIT:  # else it is one, and stays as it is to the last bit
            object.__setattr__(self, "along", tuple(float(x) / length for x in self.along))
        self._check_names()
        self._check_independent()
        object.__setattr__(self, "quantities", _checked(self))

    def _check_names(self) -> None:
        """Whether motors can stand beside all else that a map holds."""
        for name in self.region.names:
            if name in _TAKEN or "/" in name:
                why = "has a /" if "/" in name else "is that of something else in every map"
                raise MapError(f"{self.mechanism.name}: no map over motor '{name}', whose name {why}: rename it")

    def _check_independent(self) -> None:
        """Whether the coordinates can be given at all."""
        mechanism, region = self.mechanism, self.region
        if self.of_motors:
            return
        home = self.home
        for k, name in enumerate(POSE):
            given = region.at.get(name)
            if given is None and name not in region.names:
                continue
            if self._moves(k):
                continue
            value = float(np.r_[home.translation, pin.rpy.matrixToRpy(home.rotation)][k])
            if name in region.names or not math.isclose(float(given or 0.0), value, abs_tol=1e-9):
                raise MapError(
                    f"{mechanism.name}: {self.node} can't move along {name}: it stays at {value + 0.0:g}. Leave it out"
                )

    def _usual_direction(self) -> tuple[float, ...]:
        axes = (2, 0, 1) if DIRECTED & set(self.quantities) else (2,)
        return tuple(np.eye(3)[next((k for k in axes if self._moves(k)), 2)])

    def _moves(self, k: int) -> bool:
        """Whether a coordinate of the node's pose can change at all."""
        for q, rows in self._moved:
            at = self.mechanism.placement(q, self.node).rotation
            changed = at @ rows[:3] if k < 3 else _rates(at) @ rows[3:]
            if np.abs(changed[k % 3]).max(initial=0.0) > _MOVES:
                return True
        return False

    @cached_property
    def _moved(self) -> list[tuple[Array, Array]]:
        """Some configurations, the base at rest, and how the node moves there (6, freedoms), in its own axes, without
        unit, by all motions that loops leave."""
        from cinegen.ik.resolve import free_motions

        mechanism, found = self.mechanism, []
        units = np.repeat([1.0 / mechanism.length, 1.0], 3)[:, None] * mechanism.scale
        resting = 6 if mechanism.floating else 0
        for sample in mechanism.samples:
            q = np.r_[mechanism.q_home[:7], sample[7:]] if mechanism.floating else sample
            loops = mechanism.system.evaluate(q)[1][:, resting:]
            motions = free_motions(loops, mechanism.loop_rank)[0]
            found.append((q, (mechanism.jacobian(q, self.node) * units)[:, resting:] @ motions))
        return found

    @cached_property
    def freedoms(self) -> int:
        """How many ways the mechanism can move in, its base at rest."""
        return self.mechanism.mobility - 6 * self.mechanism.floating

    @cached_property
    def of_motors(self) -> bool:
        """Whether it is over values of motors, else over poses."""
        return self.region.of_motors(self.mechanism)

    @cached_property
    def home(self) -> pin.SE3:
        """The node's pose at home."""
        return self.mechanism.placement(self.mechanism.q_home, self.node)

    @cached_property
    def rotation(self) -> int:
        """How many rotations of the node are given: 0, 2 (the direction of its z) or 3."""
        region = self.region
        turned = any(name in (*region.names, *region.at) for name in POSE[3:])
        return {"free": 3 if turned else 0, "axis": 2, "fixed": 3}[region.orientation]

    @cached_property
    def counted(self) -> tuple[int, int]:
        """How many translations and rotations of the node count for singular values: those that are given; of motors
        all that don't follow from others, as `cinegen.singularity` counts them."""
        turns = 3 if self.of_motors else self.rotation
        return (3, turns) if turns and self._rank(3 + turns) > self._rank(3) else (3, 0)

    @cached_property
    def rank(self) -> int:
        """Of the node's motions that count: generic."""
        return self._rank(sum(self.counted))

    def _rank(self, rows: int) -> int:
        found = 0
        for _, moved in self._moved:
            found = max(found, rank(moved[:rows]))
        return found

    # --- words ---------------------------------------------------------------------------------------------------

    @cached_property
    def robot(self) -> dict[str, Any]:
        """What the map's numbers depend on of the robot: how it moves; where distances are asked for also its shapes,
        which are files that lie somewhere else on another machine."""
        moves = self._motion
        return moves if self.scene is None else {**moves, "urdf": self.mechanism.source.urdf}

    @cached_property
    def _motion(self) -> dict[str, Any]:
        source = self.mechanism.source
        return {
            "urdf": kinematics_of(source.urdf, source.name),
            "constraints": None if source.constraints is None else dict(source.constraints),
        }

    @cached_property
    def robot_hash(self) -> str:
        """SHA-256 of how the robot moves, shapes left out: the same on any machine."""
        return fingerprint(**self._motion)

    def document(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "version": VERSION,
            "robot": self.robot,
            "node": self.node,
            "region": self.region.document(),
            "quantities": list(self.quantities),
            "limits": self.limits,
            "starts": self.starts,
            "directions": self.directions,
            "along": list(self.along),
            "scene": None if self.scene is None else dict(self.scene),
        }

    @property
    def text(self) -> str:
        """The document, always the same way: two specifications are the same where their texts are."""
        return _text(self.document())

    @property
    def attributes(self) -> dict[str, str]:
        """What is written into a map for `of_attributes`: the text, and where robot and scene are found here."""
        source = self.mechanism.source
        found = {"urdf": source.urdf, "constraints": source.constraints, "folder": source.folder, "name": source.name}
        return {"specification": self.text, "source": _text(found), "folder": self.folder}

    @classmethod
    def of_attributes(cls, attributes: Mapping[str, Any]) -> MapSpecification:
        """What `attributes` has written.

        Raises:
            KeyError, TypeError, ValueError: it is something else.
            LoadError: the robot can't be built from it.
            MapError: by another version; or robot and specification don't belong together.
        """
        document = json.loads(attributes["specification"])
        if document.get("version") != VERSION:
            raise MapError(f"this map is of version {document.get('version')}, and {VERSION} is read here")
        from cinegen.model.load import build

        spec = cls(
            build(**json.loads(attributes["source"])),
            Region.of_document(document["region"]),
            tuple(document["quantities"]),
            document["node"],
            document["limits"],
            document["starts"],
            document["directions"],
            tuple(document["along"]),
            document["scene"],
            attributes["folder"],
        )
        if spec.text != attributes["specification"]:
            raise MapError("what it says of its robot and of its making does not belong together")
        return spec


def _rates(rotation: Array) -> Array:
    """(3, 3) how fast roll, pitch and yaw change, by angular velocities in the axes that they lead to."""
    roll, pitch, _ = pin.rpy.matrixToRpy(rotation)
    sin, cos, tan = math.sin(roll), math.cos(roll), math.tan(pitch)
    return np.array(
        [[1.0, sin * tan, cos * tan], [0.0, cos, -sin], [0.0, sin / math.cos(pitch), cos / math.cos(pitch)]]
    )


def _text(document: Any) -> str:
    return json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def _checked(spec: MapSpecification) -> tuple[str, ...]:
    """The names of a specification's quantities, each once, in the order of `QUANTITIES`.

    Raises:
        MapError: unknown; or it makes no sense there.
    """
    mechanism, wanted = spec.mechanism, set(spec.quantities)
    for name in spec.quantities:
        if name not in QUANTITIES:
            raise MapError(f"no quantity '{name}'{did_you_mean(name, tuple(QUANTITIES))}")
    if not mechanism.passive_rank:
        wanted.discard("sigma_2")  # nothing is passive, nothing can be of type 2
    if "clearance" in wanted and spec.scene is None:
        raise MapError("clearance is that in a scene: say which (--scene)")
    if "clearance" in wanted:
        _read_scene(spec)
    if "solid_angle" in wanted and (spec.of_motors or spec.rotation):
        raise MapError("solid_angle asks which directions the node can have: leave its orientation free")
    if "solutions" in wanted and spec.of_motors and mechanism.loops:
        _check_motors(mechanism)
    if "solutions" in wanted and not spec.of_motors:
        free, held = spec.freedoms, spec.rank
        if free > held:
            raise MapError(
                f"{mechanism.name} has infinitely many solutions here: it can move in {free} ways, and the pose of "
                f"{spec.node} takes {held} of them. Leave 'solutions' out, or give its orientation too"
            )
    return tuple(name for name in QUANTITIES if name in wanted)


def _read_scene(spec: MapSpecification) -> None:
    """Whether it can be read.

    Raises:
        MapError: it can't.
    """
    from cinegen.collision import AvoidError, scene_of

    try:
        scene_of(dict(spec.scene or {}), spec.folder, mechanism=spec.mechanism)
    except AvoidError as error:
        raise MapError(f"the scene can't be read: {error}") from None


def _check_motors(mechanism: Mechanism) -> None:
    """Whether motors determine it, so that its assembly modes can be counted.

    Raises:
        MapError: they don't.
    """
    from cinegen.assembly.linkage import Linkage, ModesError

    try:
        Linkage(mechanism)
    except ModesError as error:
        raise MapError(f"its assembly modes can't be counted: {error}. Leave 'solutions' out") from None
