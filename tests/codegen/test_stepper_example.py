"""The steps of example 27 beside a delta's closed form: each actuator's angle is a two-link arm's in its plane."""

import re

import numpy as np
from generated_code import compiled, needs_gcc, run

from cinegen.codegen import Function, Language, generate

UPPER, LOWER, OUT, IN = 2.0, 3.5, 1.5, 0.50654  # m: arms; shoulder and the platform's joint from their centres
HEIGHT = -LOWER * np.sin(np.radians(31.21))
STEPS = 16000 / np.pi  # per radian


@needs_gcc
def test_every_step_is_made_where_the_actuator_is(robot, root, tmp_path):
    text = (root / "examples/27_steps_of_a_delta.py").read_text()
    planner = re.search(r'PLANNER = r"""(.*?)"""', text, re.DOTALL)[1]
    files = generate(robot("delta4"), Language.C, functions=[Function.TICK], dt=1e-3, name="delta4")
    for name, content in {**files, "planner.c": planner}.items():
        (tmp_path / name).write_text(content)
    program = compiled(tmp_path, "-O2", "-Wno-error", files=["delta4.c", "planner.c"])
    steps = np.loadtxt(run(tmp_path, program).splitlines())
    times = np.linspace(0.0, 1.0, 20_001)
    along = 0.6 * (times - np.sin(2 * np.pi * times) / (2 * np.pi))
    for i in range(3):
        place = along * np.exp(-2j * np.pi * i / 3)  # of the platform, in the arm's axes
        a = place.real + IN - OUT
        cosine = (a**2 + place.imag**2 + HEIGHT**2 + UPPER**2 - LOWER**2) / (2.0 * UPPER * np.hypot(a, HEIGHT))
        exact = STEPS * (np.arctan2(HEIGHT, a) + np.arccos(cosine))
        _, directions, due = steps[steps[:, 0] == i].T
        made = np.concatenate([[0.0], directions.cumsum()])[np.searchsorted(due, times)]
        assert np.abs(made - exact).max() < 0.55
        assert len(directions) > 1000
