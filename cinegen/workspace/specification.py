"""`MapSpecification`: everything that determines a map: its robot, its grid, its quantities and how long to search."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.model import Mechanism
from cinegen.model.fingerprint import fingerprint
from cinegen.model.urdf import kinematics_of
from cinegen.singularities.singularity import controlled_nowhere
from cinegen.singularities.slice import POSE
from cinegen.workspace.errors import DAMAGED, MapError
from cinegen.workspace.quantities import DIRECTED, QUANTITIES
from cinegen.workspace.region import Region
from cinegen.workspace.specification_checks import checked_quantities
from raff2urdf.closure import rank
from raff2urdf.errors import RaffError

if TYPE_CHECKING:
    import xarray


VERSION = 8
"""Version of a map's folder: changes when its layout changes, or when the same specification gives other numbers."""

STARTS = 6
"""Default number of starts of a search."""

_ROUNDING = 1e-12  # by which the length of a unit vector may differ from 1
_MOVES = 1e-9  # rad or characteristic lengths for each: less is rounding
_RESERVED = (*QUANTITIES, "configuration", "reachable", "status", "joint", "joint_unit")
_SETTINGS = (
    "node", "quantities", "limits", "starts", "directions", "along", "scene", "payloads", "wrenches", "gravity",
    "reaction", "stiffness", "tolerances",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class MapSpecification:
    """Everything that determines a map. The processes and machines that make it are no part of it.

    Attributes:
        mechanism: the robot.
        region: the grid.
        quantities: names of the quantities of each cell, see `cinegen.workspace.quantities`.
        node: base, link or frame whose pose is mapped; the mechanism's end unless given.
        limits: whether joints stay within their position limits.
        starts: number of starts of a search, for each cell that no neighbour leads to.
        directions: number of directions that the sphere is divided into, for the dexterous solid angle.
        along: (3,) direction in the world of velocities and forces; unless given the first of z, x and y along which
            the node can move.
        scene: obstacles for the clearance, as a document of `cinegen.collision.scene`; none unless given.
        folder: where the scene's files are.
        payloads: masses, kg, that nodes carry at their origins, by name.
        wrenches: (6,) that act on nodes at their origins, in the world's axes, N and N m, by name.
        gravity: (3,) acceleration in the world, m/s^2; the mechanism's unless given.
        reaction: the joint or loop whose reaction is wanted.
        stiffness: of elastic joints by name, N m/rad and N/m; other actuated joints are rigid, other passive ones free.
        tolerances: of dimensions, joints and encoders, for the accuracy: `raff`, the text of the robot's RAFF file, and
            `sigma`, `play` and `encoder`, as `cinegen.design.Tolerances` takes them.

    Raises:
        UnknownNameError: no such node, joint or loop.
        MapError: invalid coordinates, quantities or numbers.
        MassError: links have no mass, and a quantity takes it.
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
    payloads: Mapping[str, float] = field(default_factory=dict)
    wrenches: Mapping[str, Sequence[float]] = field(default_factory=dict)
    gravity: tuple[float, ...] = ()
    reaction: str = ""
    stiffness: Mapping[str, float] = field(default_factory=dict)
    tolerances: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if not self.node:
            object.__setattr__(self, "node", self.mechanism.end)
        self.mechanism.frame_id(self.node)
        if self.starts < 0 or self.directions < 1:
            raise MapError(f"starts ({self.starts}) must be 0 or more, and directions ({self.directions}) 1 or more")
        if not self.along:
            axes = (2, 0, 1) if DIRECTED & set(self.quantities) else (2,)
            default = np.eye(3)[next((k for k in axes if self._moves(k)), 2)]
            object.__setattr__(self, "along", tuple(map(float, default)))
        length = math.hypot(*self.along)
        if not (len(self.along) == 3 and 0.0 < length < math.inf):
            raise MapError(f"along {self.along}: give a direction, three numbers")
        if abs(length - 1.0) > _ROUNDING:  # else it stays as it is to the last bit
            object.__setattr__(self, "along", tuple(float(x) / length for x in self.along))
        for name in self.region.names:
            if name in _RESERVED or "/" in name:
                reason = "contains a /" if "/" in name else "is reserved in maps"
                raise MapError(f"{self.mechanism.name}: the name of joint '{name}' {reason}: rename it")
        if not self.over_joints:
            self._check_independent()
        for name in ("payloads", "stiffness"):
            object.__setattr__(self, name, {key: float(value) for key, value in getattr(self, name).items()})
        wrenches = {key: tuple(map(float, value)) for key, value in self.wrenches.items()}
        object.__setattr__(self, "wrenches", wrenches)
        object.__setattr__(
            self, "gravity", tuple(map(float, self.gravity if len(self.gravity) else self.mechanism.gravity))
        )
        object.__setattr__(self, "quantities", checked_quantities(self))

    def __repr__(self) -> str:
        return f"<MapSpecification of {self.mechanism.name}, {self.node}: {self.region!r}>"

    def _check_independent(self) -> None:
        """Check that the node can move along each given coordinate."""
        region, home = self.region, self.home
        for k, name in enumerate(POSE):
            fixed = region.at.get(name)
            if (fixed is None and name not in region.names) or self._moves(k):
                continue
            value = float(np.r_[home.translation, pin.rpy.matrixToRpy(home.rotation)][k])
            if name in region.names or not math.isclose(float(fixed or 0.0), value, abs_tol=1e-9):
                raise MapError(
                    f"{self.mechanism.name}: {self.node} can't move along {name}: it stays at {value + 0.0:g}. "
                    "Leave it out"
                )

    def _moves(self, k: int) -> bool:
        """Return whether a coordinate of the node's pose can change."""
        for q, rows in self._motions:
            rotation = self.mechanism.placement(q, self.node).rotation
            to_rates = pin.rpy.computeRpyJacobianInverse(pin.rpy.matrixToRpy(rotation), pin.LOCAL)
            changed = rotation @ rows[:3] if k < 3 else to_rates @ rows[3:]
            if np.abs(changed[k % 3]).max(initial=0.0) > _MOVES:
                return True
        return False

    @cached_property
    def _motions(self) -> list[tuple[Array, Array]]:
        """Sample configurations (nq,), the base at rest, and the node's motions (6, nv) there along all motions that
        close the loops, dimensionless, in the node's axes."""
        from cinegen.singularities.crossing import of_node

        mechanism, base = self.mechanism, 7 * self.mechanism.floating
        jacobian = of_node(mechanism, self.node, 6)
        samples = [np.r_[mechanism.q_home[:base], q[base:]] for q in mechanism.structure.samples]
        return [(q, jacobian(q)) for q in samples]

    @cached_property
    def dof(self) -> int:
        """Degrees of freedom of the mechanism with its base at rest."""
        return self.mechanism.mobility - 6 * self.mechanism.floating

    @cached_property
    def over_joints(self) -> bool:
        """True for a map over values of actuated joints, not over poses."""
        return self.region.is_over_joints(self.mechanism)

    @cached_property
    def home(self) -> pin.SE3:
        """Pose of the node in the home configuration."""
        return self.mechanism.placement(self.mechanism.q_home, self.node)

    @cached_property
    def rotation(self) -> int:
        """Number of given rotations of the node: 0, 2 (the direction of its z axis) or 3."""
        region = self.region
        is_given = any(name in (*region.names, *region.at) for name in POSE[3:])
        return {"free": 3 if is_given else 0, "axis": 2, "fixed": 3}[region.orientation]

    @cached_property
    def counted(self) -> tuple[int, int]:
        """Number of translations and of rotations of the node that singular values are computed from.

        They are those that are given; over actuated joints all, but rotations that follow from translations.
        """
        rotations = 3 if self.over_joints else self.rotation
        return (3, rotations) if rotations and self._rank(3 + rotations) > self._rank(3) else (3, 0)

    @cached_property
    def is_uncontrolled(self) -> bool:
        """True if the node moves in every configuration while all actuated joints are locked."""
        return bool(controlled_nowhere(self.mechanism, self.node))

    @cached_property
    def rank(self) -> int:
        """Generic rank of these motions."""
        return self._rank(sum(self.counted))

    def _rank(self, rows: int) -> int:
        return max((rank(motions[:rows]) for _, motions in self._motions), default=0)

    # --- JSON ----------------------------------------------------------------------------------------------------

    @cached_property
    def _kinematics(self) -> dict[str, Any]:
        source = self.mechanism.source
        return {"urdf": kinematics_of(source.urdf, source.name), "constraints": source.constraints}

    @cached_property
    def robot_hash(self) -> str:
        """SHA-256 of the robot's kinematics, without shapes: the same on every machine."""
        return fingerprint(**self._kinematics)

    def document(self) -> dict[str, Any]:
        """Return the specification as JSON values; with a scene, the robot includes its shapes."""
        source = self.mechanism.source
        shapes: dict[str, Any] = {} if self.scene is None else {"urdf": source.urdf}
        if self.scene is not None and source.srdf is not None:
            shapes["srdf"] = source.srdf
        return {
            "version": VERSION,
            "robot": {**self._kinematics, **shapes},
            "region": self.region.document(),
            **{name: getattr(self, name) for name in _SETTINGS},
        }

    def differences(self, other: MapSpecification) -> list[tuple[str, str, str]]:
        """Return the name of each setting that differs from another specification's, and both values, for people."""
        a, b = self._settings, other._settings
        names = (name for name in (*a, *b) if a.get(name) != b.get(name))
        return [(name, a.get(name, "as at home"), b.get(name, "as at home")) for name in dict.fromkeys(names)]

    @property
    def _settings(self) -> dict[str, str]:
        region = self.region
        texts = {"robot": f"{self.mechanism.name} ({self.robot_hash[:8]})"}
        for owner, names in ((self, _SETTINGS), (region, ("orientation", "centre", "ends"))):
            values = {name: getattr(owner, name) for name in names}
            texts |= {name: ", ".join(value) if name == "quantities" else str(value) for name, value in values.items()}
        texts |= {axis.name: f"{axis.low:g}..{axis.high:g}:{axis.count}" for axis in region.axes}
        return texts | {name: f"{value:g}" for name, value in region.at.items()}

    @property
    def text(self) -> str:
        """The document as canonical JSON text: equal for equal specifications."""
        return _json(self.document())

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of a map that `of_attributes` reads: the text, and where the robot and the scene are here."""
        source = self.mechanism.source
        names = (
            "urdf",
            "constraints",
            "folder",
            "name",
            *(name for name in ("srdf", "packages") if getattr(source, name)),
        )
        robot = {name: getattr(source, name) for name in names}
        return {"specification": self.text, "source": _json(robot), "folder": self.folder}

    @classmethod
    def of_attributes(cls, attributes: Mapping[str, Any]) -> MapSpecification:
        """Return the specification that `attributes` wrote; the robot is built once for equal attributes.

        Raises:
            KeyError: one is missing.
            MapError: another version wrote them; they are invalid; the robot can't be built; or robot and specification
                don't belong together.
        """
        return _parsed(*(str(attributes[name]) for name in ("specification", "source", "folder")))


@lru_cache(maxsize=4)
def _parsed(text: str, source: str, folder: str) -> MapSpecification:
    from cinegen.model.build import build

    try:
        document, robot = json.loads(text), json.loads(source)
        if document.get("version") != VERSION:
            raise MapError(f"the map has version {document.get('version')}; this program reads version {VERSION}")
        settings = {name: document[name] for name in _SETTINGS}
        settings |= {name: tuple(document[name]) for name in ("quantities", "along", "gravity")}
        region = Region.of_document(document["region"])
        spec = MapSpecification(build(**robot), region, folder=folder, **settings)
    except MapError:
        raise
    except (*DAMAGED, CinegenError, RaffError) as error:
        raise MapError(f"the map is damaged: its description is invalid ({error})") from None
    if spec.text != text:
        raise MapError("its robot and its specification do not belong together")
    return spec


def specification_of(dataset: xarray.Dataset) -> MapSpecification:
    """Return the specification of a map.

    Args:
        dataset: as `open_map` and `make_map` return it, whole.

    Raises:
        MapError: it is not a map, or only a part of one.
    """
    try:
        spec = MapSpecification.of_attributes(dataset.attrs)
    except KeyError:
        raise MapError("this dataset is not a map: give what open_map or make_map returned") from None
    shape = tuple(dataset.sizes.get(name, 0) for name in spec.region.names)
    if shape != spec.region.shape:
        raise MapError(
            f"this is a part of a map, {' x '.join(map(str, shape))} of its {' x '.join(map(str, spec.region.shape))}"
            " cells: give all of it, and select cells by a condition"
        )
    return spec


def map_slice(
    dataset: xarray.Dataset, spec: MapSpecification, cells: Mapping[str, int]
) -> tuple[xarray.Dataset, MapSpecification]:
    """Return a slice of a map, and the specification that would have made it.

    Args:
        dataset: the map.
        spec: its specification.
        cells: for each axis that is fixed, the number of the cell; one axis at least must remain.

    Raises:
        MapError: none remains.
    """
    region = spec.region
    at = {axis.name: float(axis.middles()[cells[axis.name]]) for axis in region.axes if axis.name in cells}
    axes = tuple(axis for axis in region.axes if axis.name not in cells)
    return dataset.isel(cells), replace(spec, region=replace(region, axes=axes, at={**region.at, **at}))


def _json(document: Any) -> str:
    return json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
