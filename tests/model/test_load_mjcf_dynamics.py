"""Gravity, friction and the inertia of rotors of an MJCF count as in MuJoCo; what does not count is told."""

import json

import mujoco
import numpy as np
import pytest

import cinegen
import raff2urdf
from cinegen.dynamics import InverseDynamics
from cinegen.model.build import build
from cinegen.session.holding import Holding

ARM = """<mujoco>
  <option gravity="1 -4 -6"/>
  <worldbody>
    <body name="upper" pos="0 0 0.2" euler="10 20 0">
      <joint name="shoulder" axis="0 1 0" armature="0.4" {more}/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0.1" size="0.03"/>
      <body name="fore" pos="0.3 0 0.1">
        <joint name="elbow" axis="0 1 0.2" armature="0.05"/>
        <inertial pos="0.1 0.01 0" mass="1.3" diaginertia="0.02 0.03 0.04"/>
        <body name="rod" pos="0.2 0 0"><joint name="slide" type="slide" axis="1 0 0" armature="2"/>
          <geom type="sphere" size="0.05"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>"""


def theirs(text, q, v=0.0, a=0.0):
    """Return MuJoCo's model and its torques (nv,)."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
    mujoco.mj_inverse(model, data)
    return model, data


ACTUATED = ARM.replace(
    "</mujoco>",
    """<actuator><motor joint="elbow" gear="3" armature="0.2" damping="0.1"/>
      <position joint="slide" kp="1" armature="0.3"/><motor joint="shoulder"/></actuator></mujoco>""",
)


@pytest.mark.parametrize("text", [ARM.format(more=""), ARM.format(more='damping="3"'), ACTUATED.format(more="")])
def test_torques_are_mujocos_with_its_gravity_armature_and_damping(text):
    rng = np.random.default_rng(1)
    mechanism = cinegen.load(text)
    assert mechanism.gravity.tolist() == [1.0, -4.0, -6.0]
    assert "gravity is 1, -4, -6 m/s2" in mechanism.source.notes
    dynamics = InverseDynamics(mechanism)
    for _ in range(5):
        q, v, a = rng.normal(size=(3, 3))
        _, data = theirs(text, q, v, a)
        assert dynamics.torques(q, v, a) == pytest.approx(data.qfrc_inverse, abs=1e-9)
        assert dynamics.torques_of(q[None], v[None], a[None])[0] == pytest.approx(data.qfrc_inverse, abs=1e-9)
        assert dynamics.balance(q, v, a).efforts / dynamics.tree.step == pytest.approx(data.qfrc_inverse, abs=1e-9)


def test_the_inertia_at_the_joints_has_that_of_the_rotors():
    text, q = ARM.format(more=""), np.array([0.3, -0.7, 0.1])
    model, data = theirs(text, q)
    full = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, full)
    dynamics = InverseDynamics(cinegen.load(text))
    assert dynamics.mass_matrix(q) == pytest.approx(full)
    assert dynamics.mass_matrices_of(q[None])[0] == pytest.approx(full)


def test_a_rotor_behind_a_loop_is_seen_at_the_actuated_joint():
    """In a parallelogram both cranks turn alike: the passive one's rotor adds to the torque of the other one."""
    text = """<mujoco><option><flag gravity="disable"/></option><worldbody>
      <body name="left"><joint name="drive" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 0.1"/>
        <body name="coupler" pos="1 0 0"><joint name="pin" axis="0 0 1"/>
          <inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/></body></body>
      <body name="right" pos="0 2 0"><joint name="swing" axis="0 0 1" armature="0.7"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 0.1"/></body></worldbody>
      <equality><connect name="far" body1="coupler" body2="right" anchor="0 2 0"/></equality>
      <actuator><motor joint="drive"/></actuator></mujoco>"""
    mechanism = cinegen.load(text)
    assert mechanism.gravity.tolist() == [0.0, 0.0, 0.0]
    dynamics, q = InverseDynamics(mechanism), mechanism.q_home[None]
    expected = 3.0 * (0.1 + 0.1 + 0.7)
    assert dynamics.torques(q[0], None, {"drive": 3.0}) == pytest.approx([expected], abs=1e-6)
    assert dynamics.torques_of(q, None, np.array([[3.0]]), actuated=True) == pytest.approx(
        np.array([[expected]]), abs=1e-6
    )
    assert dynamics.mass_matrices_of(q)[0] == pytest.approx(dynamics.mass_matrix(q[0]))


def test_gravity_of_the_file_is_that_of_sessions_and_of_what_is_saved():
    text = ARM.format(more="")
    mechanism = cinegen.load(text)
    _, data = theirs(text, 0.0)
    assert Holding(mechanism).torques(mechanism.q_home) == pytest.approx(data.qfrc_inverse)
    again = build(mechanism.source.urdf, mechanism.source.constraints)
    assert again.gravity.tolist() == [1.0, -4.0, -6.0]
    assert cinegen.forces(again, again.q_home).torques == pytest.approx(data.qfrc_inverse)
    downwards = cinegen.forces(again, again.q_home, gravity=(0.0, 0.0, -9.81)).torques
    _, data = theirs(text.replace("1 -4 -6", "0 0 -9.81"), 0.0)
    assert downwards == pytest.approx(data.qfrc_inverse)


def test_what_forces_leave_out_is_told(capsys, tmp_path):
    from cinegen.cli import main

    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(more='damping="3 0.1" frictionloss="0.2" stiffness="9"'))
    told = "forces leave out the nonlinear damping of shoulder, the springs of shoulder"
    assert told in cinegen.load(path).source.notes
    assert main(["forces", str(path)]) == 0
    assert f"note: {told}\n  gravity: 1, -4, -6 m/s2\n" in capsys.readouterr().out
    assert main(["forces", str(path), "--json", "--gravity", "0,0,-2"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["notes"], report["gravity"], report["resting"]) == ([told], [0.0, 0.0, -2.0], ["shoulder"])
    assert report["torques"][0]["band"] == pytest.approx(0.2)
    assert not any("leave out" in note for note in cinegen.load(ARM.format(more="")).source.notes)


def test_what_acts_on_balls_and_tendons_is_told_too():
    text = """<mujoco><worldbody><body name="b"><joint name="ball" type="ball" {ball}/><geom size="0.1"/>
      <body name="c" pos="1 0 0"><joint name="hinge"/><geom size="0.1"/></body></body></worldbody>
      <tendon><fixed name="belt" {belt}><joint joint="hinge" coef="2"/></fixed></tendon>
      <actuator><motor name="reel" tendon="belt" {reel}/></actuator></mujoco>"""
    numbers = 'armature="1" damping="1" frictionloss="1"'
    told = cinegen.load(text.format(ball=numbers, belt=numbers, reel='armature="1" damping="1"')).source.notes
    friction = "the damping of ball, belt, reel, the friction of ball, belt, the armature of ball, belt, reel"
    assert f"forces leave out {friction}" in told
    assert not any("leave out" in note for note in cinegen.load(text.format(ball="", belt="", reel="")).source.notes)


def test_urdf2raff_keeps_gravity_and_torques(tmp_path):
    path, raff = tmp_path / "arm.xml", tmp_path / "arm.raff"
    path.write_text(ARM.format(more='damping="3" frictionloss="0.2"'))
    made = raff2urdf.to_raff(path, raff)
    assert made.document.gravity == (1.0, -4.0, -6.0)
    there, back, rng = cinegen.load(path), cinegen.load(raff), np.random.default_rng(2)
    q, v, a = rng.normal(size=(3, 3))
    moved = q + [made.offsets[made.joints[joint]] for joint in there.joints]
    assert InverseDynamics(back).torques(moved, v, a) == pytest.approx(InverseDynamics(there).torques(q, v, a))


@pytest.mark.parametrize("handle", [
    '<weld body1="handle" body2="fore"/>',
    '<connect body1="fore" body2="handle" anchor="0 0 0"/>',
    '<weld site1="grip" site2="point"/>',
])  # fmt: skip
def test_a_mocap_body_is_a_handle_not_a_loop(handle):
    grip = '<body name="handle" mocap="true" pos="0 0 1"><site name="point"/></body>'
    text = ARM.format(more="").replace("<worldbody>", f"<worldbody>{grip}")
    text = text.replace('<body name="rod"', '<site name="grip"/><body name="rod"')
    mechanism = cinegen.load(text.replace("</mujoco>", f"<equality>{handle}</equality></mujoco>"))
    assert (mechanism.loops, mechanism.mobility) == ((), 3)
    (note,) = [note for note in mechanism.source.notes if "handle" in note]
    assert "'fore' to the mocap body 'handle'" in note
    assert "a task on 'fore' moves it" in note
    there = mechanism.placement(np.array([0.3, -0.2, 0.0]), "fore")
    assert cinegen.inverse_kinematics(mechanism, {"fore": there})


def test_a_keyframe_places_free_bodies():
    text = """<mujoco><worldbody>
      <body name="hull" pos="0 0 1"><freejoint name="f"/><geom size="0.1"/>
        <body name="leg"><joint name="hip"/><geom size="0.1"/></body></body>{other}</worldbody>
      <keyframe><key name="high" qpos="{high}"/><key name="home" qpos="{home}"/></keyframe></mujoco>"""
    loose = '<body name="ball" pos="1 0 1" euler="0 90 0"><freejoint/><geom size="0.1"/></body>'
    hull, ball = [0.1, 0.2, 0.7, 0.8, 0.0, 0.6, 0.0], [1.0, 0.5, 0.3, 0.5, 0.5, -0.5, 0.5]
    for other in ("", loose):
        qpos = [*hull, 0.4, *(ball if other else [])]
        written = text.format(other=other, high=" ".join("1" * len(qpos)), home=" ".join(map(str, qpos)))
        mechanism, (model, data) = cinegen.load(written), theirs(written, qpos)
        mujoco.mj_kinematics(model, data)
        assert "home is the keyframe 'home'" in mechanism.source.notes
        for body in ("hull", "leg", *(["ball"] if other else [])):
            placed = mechanism.placement(mechanism.q_home, body)
            assert placed.translation == pytest.approx(data.body(body).xpos, abs=1e-12)
            assert placed.rotation.ravel() == pytest.approx(data.body(body).xmat, abs=1e-12)
