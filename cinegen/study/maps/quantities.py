"""What a map can tell of each cell: a quantity is one function and one line of `QUANTITIES`.

Singular values are those of `cinegen.study.singularity`, without unit: lengths are divided by the mechanism's
characteristic length, which makes them commensurable with angles. What counts of the node, its place or also how it is
turned, is `Survey.counted`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.solve.sample import Evaluations
from cinegen.study.maps.errors import MapError
from cinegen.study.maps.settled import Settled
from raff2urdf.errors import did_you_mean
from raff2urdf.readers.urdf import UNLIMITED

if TYPE_CHECKING:
    from cinegen.avoid.clearance import Clearance
    from cinegen.model import Mechanism
    from cinegen.study.maps.survey import Survey

Array = NDArray[np.float64]
Values = NDArray[Any]

_SLOWLY = 1.0  # rad/s or m/s, of motors whose speed nothing limits
_WEAKLY = 1.0  # N m or N, of motors whose effort nothing limits


class Cells:
    """What is known of a piece's cells, for quantities to be computed from.

    Attributes:
        survey: which asks.
        settled: the configurations.
        evaluations: what they are like.
    """

    def __init__(self, survey: Survey, settled: Settled, evaluations: Evaluations) -> None:
        self.survey, self.settled, self.evaluations = survey, settled, evaluations

    @cached_property
    def by_motors(self) -> Array:
        """(n, counted, motors) how motors move the node, in its own axes, without unit."""
        mechanism, (straight, turn) = self.survey.mechanism, self.survey.counted
        scale = mechanism.scale[[mechanism.v_index(name) for name in mechanism.actuated]]
        units = np.repeat([1.0 / mechanism.length, 1.0], 3)[:, None] * scale
        return np.asarray((self.evaluations.jacobians * units)[:, : straight + turn])

    @cached_property
    def by_motors_values(self) -> Array:
        """(n, rank) singular values of these, largest first; without loops those of the node."""
        if not self.survey.mechanism.loops and len(self.survey.mechanism.actuated) == self.survey.mechanism.model.nv:
            return self.evaluations.singular_values[:, : self.survey.rank]
        return _singular_values(self.by_motors)[:, : self.survey.rank]

    @cached_property
    def along(self) -> Array:
        """(n, 3) the survey's direction, in the node's own axes."""
        return np.asarray(self.evaluations.placements[:, :3, :3].transpose(0, 2, 1) @ np.asarray(self.survey.along))


def _singular_values(matrices: Array) -> Array:
    """Of (n, rows, columns); not a number where a matrix is not finite."""
    good = np.isfinite(matrices).all(axis=(1, 2))
    found = np.full((len(matrices), min(matrices.shape[1:])), np.nan)
    if good.any():
        found[good] = np.linalg.svd(matrices[good], compute_uv=False)
    return found


def _solutions(cells: Cells) -> Values:
    if cells.settled.solutions is not None:
        return cells.settled.solutions
    raise AssertionError("solutions were not counted")


def _sigma_1(cells: Cells) -> Values:
    return cells.evaluations.singular_values[:, cells.survey.rank - 1]


def _sigma_2(cells: Cells) -> Values:
    return cells.evaluations.second


def _condition(cells: Cells) -> Values:
    values = cells.by_motors_values
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(values[:, 0] / values[:, -1])


def _manipulability(cells: Cells) -> Values:
    return np.asarray(np.prod(cells.by_motors_values, axis=1))


def _margin(cells: Cells) -> Values:
    model, q = cells.survey.mechanism.model, cells.evaluations.q
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    limited = np.isfinite(low) & np.isfinite(high) & (high > low) & _moving(cells.survey)
    if not limited.any():
        return np.where(np.isfinite(q[:, 0]), 1.0, np.nan)
    q, low, high = q[:, limited], low[limited], high[limited]
    return np.asarray((np.minimum(q - low, high - q) / (0.5 * (high - low))).min(axis=1))


def _moving(survey: Survey) -> NDArray[np.bool_]:
    """(nq,) whether a number of the configuration has to do with where the node is: fingers behind it have not."""
    mechanism = survey.mechanism
    model, system = mechanism.model, mechanism.system
    ends = [model.frames[mechanism.frame_id(survey.node)].parentJoint]
    for first, _, second, _ in system.anchors:
        ends += [first, second]
    found = np.zeros(model.nq, dtype=bool)
    for joint in {joint for end in ends for joint in model.supports[end] if joint > 0}:
        found[model.joints[joint].idx_q : model.joints[joint].idx_q + model.joints[joint].nq] = True
    return found


def _velocity(cells: Cells) -> Values:
    from cinegen.study.maps.capability import fastest

    return fastest(cells.evaluations.jacobians, cells.along, cells.survey, _limits(cells.survey, "speed"))


def _force(cells: Cells) -> Values:
    from cinegen.study.maps.capability import strongest

    return strongest(cells.evaluations.jacobians, cells.along, _limits(cells.survey, "effort"))


def _limits(survey: Survey, of: str) -> Array:
    """(motors,) what the robot's description allows them, 1 where it says nothing."""
    mechanism = survey.mechanism
    columns = [mechanism.v_index(name) for name in mechanism.actuated]
    model, unsaid = mechanism.model, _SLOWLY if of == "speed" else _WEAKLY
    given = np.asarray(model.upperVelocityLimit if of == "speed" else model.upperEffortLimit)[columns]
    return np.where((given > 0.0) & (given < UNLIMITED), given, unsaid)


def _solid_angle(cells: Cells) -> Values:
    assert cells.settled.solid_angle is not None
    return cells.settled.solid_angle


def _clearance(cells: Cells) -> Values:
    clearance = _clearance_of(cells.survey)
    return np.array([clearance.least(q) if np.isfinite(q[0]) else np.nan for q in cells.evaluations.q])


@lru_cache(maxsize=2)
def _clearance_of(survey: Survey) -> Clearance:
    """Kept from piece to piece: shapes take a while."""
    from cinegen.avoid import scene_of, surroundings

    assert survey.scene is not None
    return surroundings(scene_of(dict(survey.scene), survey.folder, mechanism=survey.mechanism))[0]


class Quantity(NamedTuple):
    """What a map can tell.

    Attributes:
        unit: "1" where it has none.
        words: what it is.
        of: computes it of cells, (n,).
        dtype: how it is stored.
    """

    unit: str
    words: str
    of: Callable[[Cells], Values]
    dtype: str = "float32"


QUANTITIES: dict[str, Quantity] = {
    "solutions": Quantity("1", "inverse solutions, or of motors assembly modes", _solutions, "int32"),
    "sigma_1": Quantity("1", "smallest singular value of type 1: the node loses a freedom at 0", _sigma_1),
    "sigma_2": Quantity("1", "smallest singular value of type 2: motors lose hold of the node at 0", _sigma_2),
    "condition": Quantity("1", "condition of how motors move the node, 1 at best", _condition),
    "manipulability": Quantity("1", "Yoshikawa's: the volume that unit velocities of the motors span", _manipulability),
    "margin": Quantity("1", "joint-limit margin: 1 in the middle of all ranges, 0 at a limit", _margin),
    "velocity": Quantity("m s-1", "largest speed of the node along the direction", _velocity),
    "force": Quantity("N", "largest force of the node along the direction", _force),
    "solid_angle": Quantity("sr", "directions that the node's z can have here (dexterous solid angle)", _solid_angle),
    "clearance": Quantity("m", "least distance to the scene's obstacles and between links", _clearance),
}
"""By name. `reachable`, `settled` and `configuration` are in every map."""


def checked(survey: Survey) -> tuple[str, ...]:
    """The names of a survey's quantities, each once, in the order of `QUANTITIES`.

    Raises:
        MapError: unknown; or it makes no sense there.
    """
    mechanism, wanted = survey.mechanism, set(survey.quantities)
    for name in survey.quantities:
        if name not in QUANTITIES:
            raise MapError(f"no quantity '{name}'{did_you_mean(name, tuple(QUANTITIES))}")
    if not mechanism.passive_rank:
        wanted.discard("sigma_2")  # nothing is passive, nothing can be of type 2
    if "clearance" in wanted and survey.scene is None:
        raise MapError("clearance is that in a scene: say which (--scene)")
    if "clearance" in wanted:
        _read_scene(survey)
    if "solid_angle" in wanted and (survey.of_motors or survey.rotation):
        raise MapError("solid_angle asks which directions the node can have: leave its orientation free")
    if "solutions" in wanted and survey.of_motors and mechanism.loops:
        _check_motors(mechanism)
    if "solutions" in wanted and not survey.of_motors:
        free, held = mechanism.mobility, survey.rank if survey.rotation != 2 else survey.rank + 2
        if free > held:
            raise MapError(
                f"{mechanism.name} has infinitely many solutions here: it can move in {free} ways, and the pose of "
                f"{survey.node} takes {held} of them. Leave 'solutions' out, or give its orientation too"
            )
    return tuple(name for name in QUANTITIES if name in wanted)


def _read_scene(survey: Survey) -> None:
    """Whether it can be read.

    Raises:
        MapError: it can't.
    """
    from cinegen.avoid import AvoidError, scene_of

    try:
        scene_of(dict(survey.scene or {}), survey.folder, mechanism=survey.mechanism)
    except AvoidError as error:
        raise MapError(f"the scene can't be read: {error}") from None


def _check_motors(mechanism: Mechanism) -> None:
    """Whether motors determine it, so that its assembly modes can be counted.

    Raises:
        MapError: they don't.
    """
    from cinegen.study.modes.linkage import Linkage, ModesError

    try:
        Linkage(mechanism)
    except ModesError as error:
        raise MapError(f"its assembly modes can't be counted: {error}. Leave 'solutions' out") from None
