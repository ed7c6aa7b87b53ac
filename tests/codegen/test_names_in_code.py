"""Names in generated code: they are text, whatever they look like."""

import json
import re
import shutil
import subprocess

import pytest
from hostile_names import C_CODE, JOINTS, KEYS, LINKS, urdf

import cinegen
from cinegen.cli import main

GCC, NODE = shutil.which("gcc"), shutil.which("node")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Code of a robot with such names, in both languages."""
    folder = tmp_path_factory.mktemp("code")
    (folder / "arm.urdf").write_text(urdf(), encoding="utf-8")
    for language in ("c", "js"):
        command = ["generate", str(folder / "arm.urdf"), "--to", language, "-o", str(folder), "--task", C_CODE]
        assert main([*command, "--functions", "fk"]) == 0
    return folder


@pytest.mark.skipif(GCC is None, reason="there is no gcc")
def test_c_has_its_own_functions_only(folder):
    subprocess.run([GCC, *STRICT, "-c", "arm.c", "-o", "arm.o"], cwd=folder, check=True)
    symbols = subprocess.run(["nm", "--defined-only", "arm.o"], cwd=folder, check=True, capture_output=True, text=True)
    names = {line.split()[-1] for line in symbols.stdout.splitlines()}
    public = set(re.findall(r"\b(arm_\w+)\(", (folder / "arm.h").read_text(encoding="utf-8")))
    assert public <= names
    assert "owned" not in names
    sections = subprocess.run(["objdump", "-h", "arm.o"], cwd=folder, check=True, capture_output=True, text=True).stdout
    assert not re.search(r"\.(init_array|ctors|fini_array)", sections)


@pytest.mark.skipif(NODE is None, reason="there is no node")
def test_javascript_has_the_names_and_nothing_else(folder):
    program = """
        const before = Object.getOwnPropertyNames(globalThis).length;
        const { default: create, names } = await import("./arm.mjs");
        create().place();
        console.log(JSON.stringify([names, Object.getOwnPropertyNames(globalThis).length - before]));
    """
    (folder / "run.mjs").write_text(program)
    done = subprocess.run([NODE, "run.mjs"], cwd=folder, check=True, capture_output=True, text=True)
    names, added = json.loads(done.stdout)
    assert added == 0
    assert sorted(names["q"]) == sorted(JOINTS)
    assert set(LINKS) <= set(names["nodes"])


def test_nodes_whose_identifiers_would_be_equal_have_different_ones(tmp_path):
    (tmp_path / "arm.urdf").write_text(urdf(links=("a-b", "a_b", "a b", *KEYS), joints=tuple(map(str, range(8)))))
    found = cinegen.codegen.generate(
        cinegen.load(tmp_path / "arm.urdf"), cinegen.codegen.Language.C, functions=(), name="arm"
    )
    nodes = re.findall(r"(arm_NODE_\w+) = \d+", found["arm.h"])
    assert len(set(nodes)) == 9
