"""Checks of a constraints file: its schema, names, numbers, and what must agree with its URDF."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from raff2urdf.axes import UNCHANGED, parse_axes
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.readers.urdf import LARGEST

Problems = Iterator[tuple[Sequence[str | int], str]]
"""Paths to wrong values, and the errors."""


class UrdfSummary(NamedTuple):
    """Links and joints of a URDF, with which its constraints file must agree.

    Attributes:
        links: names of the URDF's links.
        joints: its joints that move, by name.
    """

    links: Sequence[str]
    joints: Mapping[str, str]


def problems(values: Any, urdf: UrdfSummary | None) -> Problems:
    """Yield all problems of the contents of a file, of any type; of a URDF only where it is given."""
    return chain(
        _unreadable(values),
        _mismatches(values),
        _unknown_names(values, urdf),
        _contradictions(values),
        _other_types(values, {} if urdf is None else urdf.joints),
        _wrong_placements(values),
    )


def shown(path: Sequence[str | int]) -> str:
    """Return a path in JSONPath notation: $.joints[0].name."""
    return "$" + "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)


def _unreadable(values: Any) -> Problems:
    """Yield numbers that are not finite and texts that can't be encoded."""
    pending: list[tuple[list[str | int], Any]] = [([], values)]
    while pending:
        path, value = pending.pop()
        if isinstance(value, dict | list):
            members = list(value.items() if isinstance(value, dict) else enumerate(value))
            pending += [([*path, key], member) for key, member in reversed(members)]
        elif isinstance(value, float) and not math.isfinite(value):
            yield path, "this is not a finite number: the largest is 1.8e308"
        elif isinstance(value, str) and any("\ud800" <= letter <= "\udfff" for letter in value):
            yield path, "this text holds half a character (a lone surrogate): remove it"
        elif isinstance(value, str) and not value.isprintable() and path[:1] not in (["name"], ["sensors"]):
            yield path, "this text holds a character that can't be printed, such as a line break: remove it"


@cache
def _validator() -> Any:
    import jsonschema

    schema = files("raff2urdf").joinpath("constraints.schema.json").read_text(encoding="utf-8")
    return jsonschema.Draft202012Validator(json.loads(schema))


def _mismatches(values: Any) -> Problems:
    """Yield the worst mismatch with the schema."""
    import jsonschema

    worst = jsonschema.exceptions.best_match(_validator().iter_errors(values))
    if worst is not None:
        path = list(worst.absolute_path)
        remedy = ": write the file again with raff2urdf" if path == ["version"] else ""
        yield path, worst.message[:300] + remedy


def _unknown_names(values: Mapping[str, Any], urdf: UrdfSummary | None) -> Problems:
    nodes: Sequence[str] = values["nodes"]
    moving = [joint["name"] for joint in values["joints"]]
    for path, who, name in _named(values):
        known, what = (nodes, "node") if path[-1] == "node" else (moving, "joint that moves")
        if name not in known:
            yield path, f"{who} '{name}', which is not a {what}{did_you_mean(name, known)}"
    if urdf is None:
        return
    links, joints = urdf
    for i, node in enumerate(nodes):
        if node not in links:
            yield ["nodes", i], f"the URDF has no link '{node}'{did_you_mean(node, links)}"
    for i, name in enumerate(moving):
        if name not in joints:
            yield ["joints", i, "name"], f"the URDF has no joint '{name}'{did_you_mean(name, list(joints))}"
    for name in joints:
        if name not in moving:
            yield ["joints"], f"joint '{name}' of the URDF is missing: add an entry for it"


def _named(values: Mapping[str, Any]) -> Iterator[tuple[list[str | int], str, str]]:
    """Yield where nodes and joints are named, by what, and their names."""
    for i, loop in enumerate(values["loops"]):
        for end in ("first", "second"):
            yield ["loops", i, end, "node"], f"loop '{loop['name']}' ends at", loop[end]["node"]
    for i, ball in enumerate(values.get("balls", [])):
        for j, name in enumerate(ball["joints"]):
            yield ["balls", i, "joints", j], f"ball joint '{ball['name']}' names", name
    for i, coupling in enumerate(values.get("couplings", [])):
        for j, term in enumerate(coupling["terms"]):
            yield ["couplings", i, "terms", j, "joint"], f"coupling '{coupling['name']}' names", term["joint"]
    for i, entry in enumerate(values.get("sensor_constraints", [])):
        yield ["sensor_constraints", i, "node"], "a sensor constraint names", entry["node"]


def _other_types(values: Mapping[str, Any], joints: Mapping[str, str]) -> Problems:
    """Yield types of joints that are not those of the URDF."""
    for i, entry in enumerate(values["joints"]):
        kind = joints.get(entry["name"], entry.get("type"))
        if entry.get("type", kind) != kind:
            why = f"its type is {entry['type']} here and {kind} in the URDF: correct one of them"
            yield ["joints", i, "type"], f"joint '{entry['name']}': {why}"


def contradictions(values: Mapping[str, Any]) -> Problems:
    """Yield values that contradict each other, and numbers that are too large."""
    return chain(_contradictions(values), _wrong_placements(values))


def _contradictions(values: Mapping[str, Any]) -> Problems:
    """Yield values that contradict another one."""
    for key in ("joints", "balls", "loops", "couplings", "sensors"):
        word = "number" if key == "sensors" else "name"
        first: dict[str, int] = {}
        for i, entry in enumerate(values.get(key, [])):
            j = first.setdefault(entry[word], i)
            if j != i:
                yield [key, i, word], f"'{entry[word]}' is listed twice, also in {shown([key, j])}: remove one of them"
    yield from _sensor_problems(values)
    for i, joint in enumerate(values["joints"]):
        if not abs(home := joint.get("home", 0.0)) <= LARGEST:
            why = f"the home of joint '{joint['name']}' is {home:g}, beyond {LARGEST:g}: check its unit (rad, m)"
            yield ["joints", i, "home"], why
    names = {loop["name"]: i for i, loop in enumerate(values["loops"])}
    for i, coupling in enumerate(values.get("couplings", [])):
        if coupling["name"] in names:
            also = shown(["loops", names[coupling["name"]]])
            yield ["couplings", i, "name"], f"'{coupling['name']}' is also the name of {also}: rename one of them"
        for path, why in _coupling_problems(coupling):
            yield ["couplings", i, *path], f"coupling '{coupling['name']}'{why}"
    for i, loop in enumerate(values["loops"]):
        node = loop["first"]["node"]
        if node == loop["second"]["node"]:
            why = f"loop '{loop['name']}' joins '{node}' to itself: name two different nodes"
            yield ["loops", i, "second", "node"], why


def _sensor_problems(values: Mapping[str, Any]) -> Problems:
    """Yield axes that are none, and sensors of nodes that are not listed."""
    for i, sensor in enumerate(values.get("sensors", [])):
        try:
            parse_axes(sensor.get("axes", UNCHANGED))
        except RaffError as error:
            yield ["sensors", i, "axes"], str(error)
    listed = {0, *(sensor["number"] for sensor in values.get("sensors", []))}
    for i, entry in enumerate(values.get("sensor_constraints", [])):
        for j, number in enumerate(entry["sensors"]):
            if number not in listed:
                yield ["sensor_constraints", i, "sensors", j], f"sensor {number} is not listed in sensors: add it there"


def _coupling_problems(coupling: Mapping[str, Any]) -> Problems:
    """Yield numbers out of range and joints listed twice: paths in the coupling, and what follows its name."""
    if not abs(coupling["constant"]) <= LARGEST:
        yield ["constant"], f": its constant is beyond {LARGEST:g}: check its unit (rad, m)"
    first: dict[str, int] = {}
    for j, term in enumerate(coupling["terms"]):
        if first.setdefault(term["joint"], j) != j:
            yield ["terms", j, "joint"], f" lists '{term['joint']}' twice: join the two terms"
        if not 1.0 / LARGEST <= max(map(abs, term["coefficients"])) <= LARGEST:
            size = f"below {1.0 / LARGEST:g} or beyond {LARGEST:g}"
            yield ["terms", j, "coefficients"], f": the coefficients of '{term['joint']}' are {size}"


def _wrong_placements(values: Mapping[str, Any]) -> Problems:
    for i, loop in enumerate(values["loops"]):
        for end in ("first", "second"):
            matrix = np.array(loop[end]["placement"], dtype=float)
            rotation = matrix[:3, :3]
            why = ""
            if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
                why = "the last row of its placement must be 0 0 0 1"
            elif not np.abs(matrix).max() <= LARGEST:
                why = f"a number of its placement is beyond {LARGEST:g}: check its unit (m)"
            elif (
                np.abs(rotation).max() > 2.0
                or np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6
                or np.linalg.det(rotation) <= 0.0
            ):
                why = "the first three rows and columns of its placement must be a rotation"
            if why:
                yield ["loops", i, end, "placement"], f"loop '{loop['name']}': {why}"
