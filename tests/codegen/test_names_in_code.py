"""Names in generated code: they are text, whatever they look like."""

import re
import shutil

from hostile_names import KEYS, urdf

import cinegen

GCC, NODE = shutil.which("gcc"), shutil.which("node")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror")


def test_nodes_whose_identifiers_would_be_equal_have_different_ones():
    found = cinegen.codegen.generate(
        cinegen.load(urdf(links=("a-b", "a_b", "a b", *KEYS), joints=tuple(map(str, range(8))))),
        cinegen.codegen.Language.C,
        functions=(),
        name="arm",
    )
    nodes = re.findall(r"(arm_NODE_\w+) = \d+", found["arm.h"])
    assert len(set(nodes)) == 9
