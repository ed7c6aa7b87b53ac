"""Generated code in a folder, compiled and run."""

import re
import shutil
import subprocess

import pytest

from cinegen.codegen import generate

GCC, NODE = shutil.which("gcc"), shutil.which("node")
WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror")
CHECKED = ("-O0", "-g", "-fsanitize=address,undefined")

needs_gcc = pytest.mark.skipif(GCC is None, reason="there is no gcc")
needs_node = pytest.mark.skipif(NODE is None, reason="there is no node")


def written(folder, mechanism, language, **settings):
    for name, text in generate(mechanism, language, name="robot", **settings).items():
        (folder / name).write_text(text)


def compiled(folder, *options, files=("robot.c", "robot_test.c")):
    """The program, or library, that gcc makes."""
    command = [GCC, *WARNINGS, *options, *files, "-o", "robot.out", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "robot.out"


def run(folder, *command):
    """What a program prints, which reports no error."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    return done.stdout


def run_script(folder, text):
    """What a script in JavaScript prints."""
    (folder / "run.mjs").write_text(text)
    return run(folder, NODE, "run.mjs")


def largest(said):
    """What a test program found: the largest difference from Python."""
    wrong, difference = re.search(r"(\d+) wrong results, largest difference (\S+)", said).groups()
    assert wrong == "0", said
    return float(difference)
