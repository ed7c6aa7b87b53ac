"""The tables that JavaScript makes of a text are those that Python makes of its mechanism, field by field."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from raff_in_node import tables_in_node
from test_raff_analysis import OTHERS, files

import cinegen
from cinegen.loops._kernels.memory import ClusterMemory
from cinegen.page.kernels_module import used_fields
from cinegen.page.solver_kernels import PageMemory
from cinegen.page.tables import robot_tables
from raff2urdf.raff.reader import parse

RATE = 240.0
PIERS = "\n".join(
    f"link {i} {{ parameters {{ d 100 theta {(-1) ** i * 5} }} type 2 pred {i - 1} }}"
    f" link {100 + i} {{ parameters {{ gamma -40 d {100 * i} theta 90 }} type 2 pred 0 }}"
    f" link {200 + i} {{ parameters {{ d 250 theta -20 }} type 2 pred {100 + i} }}"
    f" frame {300 + i} {{ parameters {{ d 250 }} pred {200 + i} }} constraint {{ link {i} frame {300 + i} type 2 }}"
    for i in range(1, 25)
)
LARGE = f"RAFF piers robot bridge {{ {PIERS} }}"
"""A chain of links, each on a leg of two: a cluster of 24 loops and 72 joints, which is factored block by block."""
OWN = {"sample", "samples"}
"""Random closed configurations: other ones than Python's."""


def filled(declaration, values):
    """All fields of a memory that the kernels use, with their defaults, as arrays."""
    found, sizes = {}, {}
    for name, field in used_fields()[declaration].items():
        if field.shape is None:
            found[name] = sizes[name] = np.array(float(values.get(name, field.default)))
    for name, field in used_fields()[declaration].items():
        if field.shape is not None:
            shape = [one if isinstance(one, int) else int(sizes.get(one, 16)) for one in field.shape]
            numbers = np.array([float(one) for one in values.get(name, [])])
            found[name] = np.concatenate([numbers, np.zeros(int(np.prod(shape)) - len(numbers))])
    return found


def apart(declaration, found, expected):
    """Fields that differ by more than 1e-9, relative to what is larger than 1."""
    found, expected = filled(declaration, found), filled(declaration, expected)
    return [
        name
        for name in found
        if name not in OWN and not np.allclose(found[name], expected[name], rtol=1e-9, atol=1e-9, equal_nan=True)
    ]


def pairs(texts, folder):
    """Yield the tables of robots that JavaScript makes of texts, and their mechanisms."""
    texts = [re.sub(r"filenames?\s*\{[^}]*\}", "", text) for text in texts]
    for number, (text, ones) in enumerate(zip(texts, tables_in_node(texts), strict=True)):
        path = folder / f"{number}.raff"
        path.write_text(text)
        for robot, one in zip(parse(text).robots, ones, strict=True):
            yield one, cinegen.load(path, robot=robot.name)


def assert_same(found, mechanism):
    expected = robot_tables(mechanism, RATE)
    assert found["names"] == json.loads(json.dumps(expected["names"]))
    assert apart(PageMemory, found["robot"], expected["robot"]) == [], mechanism
    for one, other in zip(found["clusters"], expected["clusters"], strict=True):
        assert apart(ClusterMemory, one, other) == [], mechanism


@pytest.mark.filterwarnings("ignore:.*outside its limits")
def test_tables_are_those_of_python(root, tmp_path):
    compared = 0
    for found, mechanism in pairs([*files(root), *OTHERS], tmp_path):
        if mechanism.floating or mechanism.balls:  # Python's have another joint there
            continue
        assert_same(found, mechanism)
        compared += 1
    assert compared > 20


@pytest.mark.slow
def test_tables_of_a_large_cluster_are_those_of_python(tmp_path):
    ((found, mechanism),) = pairs([LARGE], tmp_path)
    assert found["clusters"][0]["blocks"] == 24
    assert_same(found, mechanism)
