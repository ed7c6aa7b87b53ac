"""Generated C in single precision: Pinocchio, in double precision, judges its frames and loops."""

import ctypes
import re

import numpy as np
import pytest
from generated_code import CHECKED, compiled, needs_gcc, run, written
from variants import slow

from cinegen.codegen import Function, Language, generate
from cinegen.codegen.precision import CLOSURE_ERROR, POSITION_ERROR
from cinegen.errors import ClosureError
from cinegen.model import ForwardKinematics

REGULAR = 0.1  # smallest singular value of the passive joints: no singularity is near

pytestmark = needs_gcc


@pytest.mark.parametrize("name", ["delta4", *slow("arm7", "hybrid")])
def test_recorded_cases_are_met(robot, tmp_path, name):
    written(tmp_path, robot(name), Language.C_FLOAT)
    run(tmp_path, compiled(tmp_path, "-Wdouble-promotion", *CHECKED))
    for file in ("robot.c", "robot.h"):
        code = re.sub(r"/\*.*?\*/", "", (tmp_path / file).read_text(), flags=re.DOTALL)
        assert "double" not in code
        assert not re.search(r"\b\d+\.\d*(e[-+]?\d+)?(?![\df.e])", code)  # a constant without f is a double


@pytest.mark.parametrize(("name", "count"), [("delta4", 300), *slow(("arm7", 3000), ("gough", 3000))])
def test_the_stated_error_is_kept(robot, tmp_path, name, count):
    """At random values of the actuated joints, wherever double precision gets to and no singularity is near."""
    mechanism, rng = robot(name), np.random.default_rng(4)
    written(tmp_path, mechanism, Language.C_FLOAT, functions=[Function.FORWARD])
    library = compiled(tmp_path, "-O2", "-shared", "-fPIC", files=["robot.c"])
    code, floats = ctypes.CDLL(str(library)), ctypes.POINTER(ctypes.c_float)
    code.robot_q.restype = code.robot_node.restype = floats
    code.robot_forward.restype = ctypes.c_bool
    state = ctypes.create_string_buffer(1 << 18)
    code.robot_init(state)
    q = np.ctypeslib.as_array(code.robot_q(state), (mechanism.model.nq,))
    frames = np.ctypeslib.as_array(code.robot_node(state, 0), (len(mechanism.nodes), 4, 3))
    home = np.array([mechanism.q_home[mechanism.q_index(joint)] for joint in mechanism.actuated])
    sizes = np.array([mechanism.scale[mechanism.v_index(joint)] for joint in mechanism.actuated])
    motion, columns, compared, refused = ForwardKinematics(mechanism), mechanism.structure.passive_columns, 0, 0
    for _ in range(count):
        values = (home + 0.2 * sizes * rng.uniform(-1.0, 1.0, len(home))).astype(np.float32)
        try:
            q_double = motion.move(dict(zip(mechanism.actuated, values.astype(float).tolist(), strict=True)))
        except ClosureError:
            continue
        if mechanism.is_constrained:
            jacobian = mechanism.structure.system.evaluate(q_double)[1][:, columns]
            if np.linalg.svd(jacobian, compute_uv=False)[mechanism.structure.passive_rank - 1] < REGULAR:
                continue
        if not code.robot_forward(state, values.ctypes.data_as(floats)):
            refused += 1
            continue
        code.robot_place(state)
        compared += 1
        assert mechanism.closure(q.astype(float)) <= CLOSURE_ERROR
        for frame, node in zip(frames, mechanism.nodes, strict=True):
            placement = mechanism.placement(q_double, node)
            assert np.abs(frame[:3].T - placement.rotation).max() <= POSITION_ERROR
            assert np.linalg.norm(frame[3] - placement.translation) <= POSITION_ERROR * mechanism.length
    assert compared > 0.3 * count
    assert refused <= 0.01 * count


def test_the_header_states_the_error(robot):
    mechanism = robot("delta4")
    text = generate(mechanism, Language.C_FLOAT, functions=[], name="robot")["robot.h"]
    comment = " ".join(re.search(r"/\*(.*?)\*/", text, re.DOTALL)[1].replace("\n *", " ").split())
    assert "Numbers are floats" in comment
    assert f"{1000.0 * POSITION_ERROR * mechanism.length:.2g} mm." in comment


def test_javascript_has_no_floats(typed, root, tmp_path):
    call = ["generate", str(root / "robots/four_bar.raff"), "--to", "js", "--precision", "float", "-o", str(tmp_path)]
    assert "JavaScript computes with doubles only" in typed(*call, code=2).err
    assert not list(tmp_path.iterdir())
