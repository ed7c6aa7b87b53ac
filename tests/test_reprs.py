"""What a user gets back prints as words, never as a dump of arrays, and does not change."""

from dataclasses import FrozenInstanceError, fields, is_dataclass

import numpy as np
import pytest

import cinegen
from cinegen.hexapod import Hexapod
from cinegen.singularities.grassmann import classify
from cinegen.singularities.loci import singular_loci
from cinegen.singularities.pluecker import LineAtInfinity, LinePlane, PlueckerLine, ProjectivePoint
from cinegen.singularities.slice import Slice, about_home


def results(robot):
    five_bar, tssm = robot("five_bar"), robot("tssm")
    yield five_bar
    yield five_bar.limits
    yield cinegen.assembly_modes(five_bar)
    target = five_bar.placement(five_bar.q_home, five_bar.end)
    yield cinegen.inverse_kinematics(five_bar, {five_bar.end: target})
    yield cinegen.evaluate(five_bar, five_bar.end, [[1.0, 2.0]])
    solver = cinegen.Solver(five_bar, 0.01)
    yield solver.add_task(five_bar.end)
    yield solver
    step = solver.step()
    yield from (step, step.lost_dof, step.uncontrolled_dof)
    singularity = cinegen.singularity(tssm, tssm.q_home)
    yield from (singularity, singularity.lost, singularity.lost_dof, singularity.legs[0])
    lines = [PlueckerLine.along(np.zeros(3), axis) for axis in (*np.eye(3), np.ones(3))]
    dependence = classify(lines, 1.0)
    yield from (dependence, *dependence.sets, dependence.motions, *dependence.sets[0].points)
    yield from (LineAtInfinity(np.eye(3)[0]), LinePlane(np.eye(3)[1], 0.5), ProjectivePoint(np.eye(3)[2], True))
    loci = singular_loci(Slice(five_bar, (about_home(five_bar, "x"), about_home(five_bar, "y")), {}), 9)
    yield from (loci, loci.curves[0])
    base, platform = np.random.default_rng(4).normal(size=(2, 6, 3))
    yield Hexapod(base, platform).modes(np.full(6, 3.0))


def test_results_print_as_words_and_those_that_are_data_do_not_change(robot):
    for result in results(robot):
        text = repr(result)
        assert text.startswith(f"<{type(result).__name__}") or text.startswith("<"), text
        assert "array(" not in text, text
        assert " object at 0x" not in text, text
        assert "\n" not in text, text
        assert len(text) < 500, text
        if is_dataclass(result):
            with pytest.raises(FrozenInstanceError):
                setattr(result, fields(result)[0].name, None)


def test_a_singularity_prints_its_description(robot):
    singularity = cinegen.singularity(robot("planar_3r"), np.zeros(3))
    assert repr(singularity) == f"<Singularity: {singularity.message}; of tool>"
    assert "tool loses, or nearly, a translation along (1, 0, 0)" in repr(singularity)
