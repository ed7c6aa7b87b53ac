"""RAFF as both readers read it: the one in JavaScript, in node, and Python's own, in the same tables."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from unicodedata import category

import pytest

from raff2urdf.analysis import declared_actuated
from raff2urdf.errors import Problem, RaffError
from raff2urdf.raff.check import check, check_sizes
from raff2urdf.raff.compound import expanded, spherical_joints
from raff2urdf.raff.document import Document, JointType, RaffBase, RaffFrame, RaffNode, RaffRobot
from raff2urdf.raff.kleinfinger import transform
from raff2urdf.raff.reader import parse
from raff2urdf.tree import coupling_of, effort, home, kleinfinger, limits, placements, stated_inertia, velocity

SCRIPTS = Path(__file__).parent.parent / "javascript"


def read_in_node(texts: Iterable[str], *options: str) -> list[dict[str, Any]]:
    """Return what the reader in JavaScript makes of texts; the test is skipped where there is no node.

    Args:
        texts: to read.
        options: "verdicts" leaves the models out.
    """
    return _run("read_raff.js", texts, *options)


def analyse_in_node(texts: Iterable[str]) -> list[list[dict[str, Any] | str]]:
    """Return the analyses of the robots in texts, or the error of open loops, likewise."""
    return _run("analyse_raff.js", texts)


def tables_in_node(texts: Iterable[str]) -> list[list[dict[str, Any]]]:
    """Return the solver's tables of the robots in texts, likewise."""
    return _run("tables_of_raff.js", texts)


def skeletons_in_node(texts: Iterable[str]) -> list[list[dict[str, list[dict[str, Any]]]]]:
    """Return the shapes of the bodies of the robots in texts, by their names, likewise."""
    return _run("skeleton_of_raff.js", texts)


def planes_in_node(texts: Iterable[str]) -> list[list[list[float] | None]]:
    """Return the normals of the planes in which the robots in texts move, likewise."""
    return _run("planes_of_raff.js", texts)


def graphics_in_node(questions: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the graphics of texts, each with the files that a page holds (`text`, `known`), likewise."""
    return _run("graphics_of_raff.js", questions)


def _run(script: str, texts: Iterable[Any], *options: str) -> list[Any]:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node on PATH")
    lines = "".join(f"{json.dumps(text)}\n" for text in texts)
    command = [node, "--no-warnings", str(SCRIPTS / script), *options]
    ran = subprocess.run(command, input=lines, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return [json.loads(line) for line in ran.stdout.splitlines()]


def read_in_python(text: str) -> dict[str, Any]:
    """Return the same of Python's reader."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        errors: tuple[Problem, ...] = ()
        models: list[dict[str, Any]] = []
        try:
            document = parse(text)
            check(document)
            for robot in document.robots:
                check_sizes(document, robot)
            models = [_model(document, robot) for robot in document.robots]
        except RaffError as error:
            errors = error.problems
    return {
        "models": models,
        "errors": [_plain(problem) for problem in errors],
        "warnings": [str(warning.message) for warning in caught],
    }


def differences(found: Any, expected: Any, path: str = "") -> list[str]:
    """Return where two results differ: numbers by more than 1e-15 of the larger one; see `Placement`. Characters that
    this Python's Unicode lacks are spaces, as in its excerpts of lines."""
    if isinstance(expected, dict) and isinstance(found, dict):
        keys = {key: None for key in [*expected, *found] if key != "took"}
        return [one for key in keys for one in differences(found.get(key), expected.get(key), f"{path}.{key}")]
    if isinstance(expected, Placement):
        return _apart(found, expected, path)
    if isinstance(expected, list) and isinstance(found, list) and len(found) == len(expected):
        pairs = enumerate(zip(found, expected, strict=True))
        return [one for i, pair in pairs for one in differences(*pair, f"{path}[{i}]")]
    if isinstance(expected, str) and isinstance(found, str):
        same = found == expected or _known(found) == _known(expected)
    elif isinstance(expected, float) and isinstance(found, int | float) and not isinstance(found, bool):
        same = math.isclose(found, expected, rel_tol=1e-15)
    else:
        same = found == expected and type(found) is type(expected)
    return [] if same else [f"{path}: {found!r} is {expected!r} in Python"]


def _known(text: str) -> str:
    return "".join(" " if category(letter) == "Cn" else letter for letter in text)


class Placement(list[float]):
    """The first three rows of a matrix. Both languages round products and sines alike but for the last digit, and that
    of a sum may be lost to its largest term: elements of rotations are compared to 1e-15 for each factor, lengths to as
    much of the largest length."""


def _apart(found: Any, expected: Placement, path: str) -> list[str]:
    largest = max(1.0, *map(abs, expected))
    apart = max(abs(x - y) for x, y in zip(found, expected, strict=True))
    return [] if apart <= 4e-15 * largest else [f"{path}: differs by {apart:.1e} from {expected}"]


def _finite(value: float) -> float | str:
    """Return a number as JavaScript writes it to JSON."""
    return value if math.isfinite(value) else f"{'-' if value < 0 else ''}Infinity"


def _plain(problem: Problem) -> dict[str, Any]:
    at = problem.location
    where = None if at is None else [at.line, at.column, at.length]
    return {"message": problem.message, "at": where, "text": str(problem)}


def _model(document: Document, robot: RaffRobot) -> dict[str, Any]:
    flat = expanded(robot)
    order: list[RaffNode] = [flat.base, *flat.parts]
    index = {node.number: i for i, node in enumerate(order)}
    moving = [link for link in flat.links if link.type is not JointType.FIXED]
    columns = {link.joint: i for i, link in enumerate(moving)}
    actuated, world = declared_actuated(robot), placements(document, flat)
    used = {number for one in robot.sensor_constraints for number in one.sensors}

    def body(node: RaffNode) -> dict[str, Any]:
        parameters = kleinfinger(document, node.parameters)
        inertial = node.inertial
        stated = inertial is not None and inertial.density is None
        inertia = stated_inertia(document, inertial) if inertial is not None and stated else None
        radius = None if inertial is None else inertial.radius
        return {
            "name": node.node,
            "isNode": node.number in robot.nodes,
            "isFrame": isinstance(node, RaffFrame),
            "ofSeveral": node.number in robot.nodes and getattr(node, "own_joint", None) is not None,
            "parent": -1 if isinstance(node, RaffBase) else index[node.pred],
            "joint": -1 if isinstance(node, RaffBase) else columns.get(node.joint, -1),
            "jointName": None if isinstance(node, RaffBase) else node.joint,
            "parameters": parameters._asdict(),
            "placement": Placement(transform(parameters)[:3].ravel().tolist()),
            "world": Placement(world[node.number][:3].ravel().tolist()),
            "files": None if node.filenames is None else list(node.filenames),
            "inertia": None
            if inertia is None
            else {"mass": inertia.mass, "centre": inertia.centre.tolist(), "matrix": inertia.matrix.tolist()},
            "density": None if inertial is None else inertial.density,
            "barRadius": None if radius is None else document.metres(radius),
        }

    return {
        "name": document.name,
        "robot": robot.name,
        "path": robot.path,
        "movable": robot.movable,
        "metre": document.metres(1.0),
        "bodies": [body(node) for node in order],
        "joints": [
            {
                "name": link.joint,
                "type": link.type.name.lower(),
                "body": index[link.number],
                "home": home(document, link),
                "lower": _finite(limits(document, link)[0]),
                "upper": _finite(limits(document, link)[1]),
                "velocity": _finite(velocity(document, link)),
                "effort": _finite(effort(link)),
                "actuated": actuated[link.joint],
            }
            for link in moving
        ],
        "balls": [{"name": name, "joints": joints} for name, joints in spherical_joints(robot).items()],
        "loops": [
            {"name": name, "kind": loop.kind.name.lower(), "first": index[loop.first], "second": index[loop.second]}
            for name, loop in zip(robot.loop_names, robot.loops, strict=True)
        ],
        "couplings": [
            {
                "name": one.name,
                "terms": [{"joint": columns[joint], "coefficients": list(c)} for joint, c in one.terms.items()],
                "constant": one.constant,
                "equation": str(one),
            }
            for one in (coupling_of(document, flat, i) for i in range(len(robot.couplings)))
        ],
        "sensors": [
            {"number": one.number, "port": one.port, "translation": one.translation, "rotation": one.rotation}
            for one in document.sensors
            if one.number in used
        ],
        "sensorConstraints": [
            {"body": index[one.node], "sensors": list(one.sensors)} for one in robot.sensor_constraints
        ],
    }
