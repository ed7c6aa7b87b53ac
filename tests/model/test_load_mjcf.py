"""MJCF is loaded as MuJoCo itself understands it."""

import json
import re

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from elementary import ROBOTS
from small_robots import parallelogram

import cinegen
import raff2urdf
from cinegen.dynamics import InverseDynamics
from cinegen.errors import LoadError
from cinegen.model.build import build
from cinegen.session.holding import Holding

MODEL = """<mujoco model="zoo">
  <compiler angle="degree" eulerseq="xyz" meshdir="parts"/>
  <default>
    <joint damping="1"/><geom rgba="1 0 0 1"/>
    <default class="leg"><joint axis="0 1 0"/></default>
    <default class="hidden"><geom group="3"/></default>
  </default>
  <asset><material name="green" rgba="0 1 0 1"/><mesh name="shell" file="shell.stl" scale="0.5 0.5 0.5"/></asset>
  <worldbody>
    <body name="a" pos="0 0 1">
      <joint name="turn" type="hinge" axis="0 0 1" pos="0.1 0 0" range="-90 90" limited="true"/>
      <joint name="slide" type="slide" axis="1 0 0" ref="0.2"/>
      <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.05"/>
      <body name="b" pos="0.5 0 0" euler="0 90 0">
        <joint name="ball" type="ball" pos="0 0.1 0"/>
        <geom type="box" size="0.1 0.1 0.1" material="green"/>
        <geom type="mesh" mesh="shell" pos="0 0 0.5" euler="0 0 90"/>
        <body name="c" pos="0 0 0.2" childclass="leg">
          <joint name="bent" ref="30" pos="0.05 0 0.02"/>
          <geom type="sphere" size="0.1"/>
          <body name="held" pos="0 0 .3" euler="10 20 30"><geom type="sphere" size="0.1" class="hidden"/></body>
        </body>
      </body>
    </body>
    <body name="d" pos="1 0 1"><joint name="other" axis="0 1 0"/><geom type="cylinder" size=".1 .2"/></body>
    <body name="loose" pos="2 0 1" euler="5 6 7"><freejoint name="free"/><geom type="sphere" size="0.1"/></body>
  </worldbody>
  {more}
</mujoco>"""


@pytest.fixture
def write(text_file):
    return lambda more="", text=MODEL: text_file("zoo.xml", text.replace("{more}", more))


def without_mesh(text):
    """MuJoCo wants meshes; we don't."""
    return re.sub('<mesh name="shell".*?/>|<geom type="mesh".*?/>', "", text)


def turned(angles):
    return pin.utils.rotate("x", angles[0]) @ pin.utils.rotate("y", angles[1]) @ pin.utils.rotate("z", angles[2])


def wxyz(rotation):
    x, y, z, w = pin.Quaternion(rotation).coeffs()
    return [w, x, y, z]


def qpos(at):
    """MuJoCo's configuration of the model, for values of its successive joints."""
    ball, about = (turned([at[f"{joint}_{x}"] for x in "XYZ"]) for joint in ("ball", "free"))
    written = pin.SE3(turned(np.radians([5, 6, 7])), np.array([2.0, 0.0, 1.0]))
    loose = written * pin.SE3(about, np.array([at[f"free_T{x}"] for x in "XYZ"]))
    hinges = [at["bent"], at["other"]]
    return [at["turn"], at["slide"], *wxyz(ball), *hinges, *loose.translation, *wxyz(loose.rotation)]


def test_every_body_stands_where_mujoco_has_it(write):
    mechanism = cinegen.load(write())
    model = mujoco.MjModel.from_xml_string(without_mesh(MODEL.replace("{more}", "")))
    data = mujoco.MjData(model)
    successive = mechanism.successive
    rng = np.random.default_rng(0)
    for _ in range(20):
        values = dict(zip(successive.joints, rng.uniform(-1.5, 1.5, size=len(successive.joints)), strict=True))
        data.qpos[:] = qpos(values)
        mujoco.mj_kinematics(model, data)
        q = successive.configuration(values)
        for i in range(1, model.nbody):
            stands = successive.placement(q, model.body(i).name)
            assert np.allclose(stands.translation, data.xpos[i], atol=1e-12)
            assert np.allclose(stands.rotation, data.xmat[i].reshape(3, 3), atol=1e-12)


EQUALITY = """<equality>
    <connect name="pin" body1="c" body2="d" anchor="0 0 0.1"/>
    <weld name="glue" body1="b" body2="loose" relpose="0 0 0.4 1 0 0 0"/>
  </equality>"""


def test_connect_and_weld_become_loops_that_mujoco_finds_closed(write):
    mechanism = cinegen.load(write(EQUALITY))
    assert [(loop.name, loop.kind.name) for loop in mechanism.loops] == [("pin", "BALL"), ("glue", "RIGID")]
    assert mechanism.mobility == 4
    model = mujoco.MjModel.from_xml_string(without_mesh(MODEL.replace("{more}", EQUALITY)))
    data = mujoco.MjData(model)
    for q in [mechanism.q_home, *mechanism.random_closed(4)]:
        successive, angles = mechanism.successive, mechanism.spherical.to_successive(q)
        data.qpos[:] = qpos({joint: angles[successive.q_index(joint)] for joint in successive.joints})
        mujoco.mj_forward(model, data)
        equality = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        assert equality.sum() == 9
        assert np.abs(data.efc_pos[: data.nefc][equality]).max() < 1e-9


def test_motors_are_what_actuators_drive_and_home_is_the_key_frame(write):
    more = """<actuator><motor joint="turn"/><position name="p" joint="slide"/></actuator>
    <keyframe>
      <key name="rest" qpos="0 0 1 0 0 0 0 0 2 0 1 1 0 0 0"/>
      <key name="home" qpos="0.1 0.3 0.9238795325112867 0.3826834323650898 0 0 0.4 0.5 2 0 1 1 0 0 0"/>
    </keyframe>"""
    mechanism = cinegen.load(write(more))
    assert mechanism.actuated == ("turn", "slide")
    home = mechanism.values(mechanism.q_home)
    assert [home[joint] for joint in ("turn", "slide", "bent", "other")] == pytest.approx([0.1, 0.3, 0.4, 0.5])
    assert home["ball"] == pytest.approx([np.sin(np.pi / 8), 0.0, 0.0, np.cos(np.pi / 8)])


def test_shapes_are_shown_but_for_hidden_groups_and_meshes_need_not_be_there(write, tmp_path):
    path = write()
    mechanism = cinegen.load(path)
    with pytest.warns(cinegen.CinegenWarning, match=rf"{path}:\d+: mesh 'parts/shell.stl' is not found.*sticks"):
        _ = mechanism.visual
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/shell.stl").write_text(
        "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
        "endloop\nendfacet\nendsolid\n"
    )
    shapes = cinegen.load(path).visual.geometryObjects
    assert len(shapes) == 3 + 1 + 1 + 1 + 1 + 1  # a capsule is three, and what is hidden is not there
    mesh = next(shape for shape in shapes if shape.meshPath.endswith("shell.stl"))
    assert np.allclose(mesh.meshScale, 0.5)


def test_no_log_is_left_behind(write, monkeypatch, tmp_path):
    """MuJoCo writes its warnings into the working folder, unless it is told otherwise."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    cinegen.load(write(more="<option timestep='1'/>"))
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("free", ["<freejoint name='f'/>", ""])
def test_a_body_that_is_tied_to_the_world_is_turned_into_raff(write, free):
    arm = "<body name='arm'><joint name='j'/><geom size='1'/></body>"
    text = f"<body name='hull' pos='0 0 1'>{free}<geom size='1'/>{arm}</body>"
    tie = "<equality><connect name='tie' body1='arm' anchor='0 0 0.5'/></equality>"
    path = write(text=f"<mujoco><worldbody>{text}</worldbody>{tie}</mujoco>")
    made = raff2urdf.to_raff(path, path.with_suffix(".raff"))
    mechanism = cinegen.load(path.with_suffix(".raff"))
    assert (len(mechanism.loops), cinegen.load(path).floating) == (1, bool(free))
    assert mechanism.mobility == cinegen.load(path).mobility == (4 if free else 1)
    assert mechanism.placement(mechanism.q_home, made.nodes["hull"]).translation.tolist() == [0.0, 0.0, 1.0]


EFFORTS = """<mujoco>
  <worldbody>
    <body><geom size="0.1"/><joint name="own" actuatorfrcrange="-3 4"/>
      <body><geom size="0.1"/><joint name="servo"/>
        <body><geom size="0.1"/><joint name="geared"/>
          <body><geom size="0.1"/><joint name="pulled"/>
            <body><geom size="0.1"/><joint name="both" actuatorfrcrange="-9 9"/>
              <body><geom size="0.1"/><joint name="free"/></body></body></body></body></body></body>
  </worldbody>
  <actuator>
    <position joint="servo" forcerange="-87 87"/>
    <motor joint="geared" gear="-50" ctrlrange="-1 0.4"/>
    <motor joint="pulled" forcerange="0 6"/>
    <motor joint="both" forcerange="-5 5"/> <motor joint="both" forcerange="-2 2" gear="3"/>
    <motor joint="free"/>
  </actuator>
</mujoco>"""


def test_velocity_limits_that_raff2urdf_writes_come_back(robot, tmp_path):
    (made,) = raff2urdf.convert(ROBOTS / "scara.raff", tmp_path, format="mjcf")
    written, back = robot("scara").limits, cinegen.load(made.file).limits
    assert np.isfinite(written.velocity).any()
    assert back.velocity == pytest.approx(written.velocity)
    made.file.write_text(re.sub('(name="velocity:joint1" data)="[^"]*"', r'\1="0"', made.file.read_text()))
    with pytest.raises(LoadError, match=r"scara\.xml: velocity:joint1 in <custom> is 0: it must be above 0"):
        cinegen.load(made.file)


def test_effort_limits_are_those_that_mujoco_enforces(write):
    mechanism = cinegen.load(write(text=EFFORTS))
    assert {name: mechanism.limits[name].effort for name in mechanism.joints} == {
        "own": 3.0, "servo": 87.0, "geared": 20.0, "pulled": 6.0, "both": 9.0, "free": np.inf,
    }  # fmt: skip
    model = mujoco.MjModel.from_xml_string(EFFORTS)
    data = mujoco.MjData(model)
    for sign in (1.0, -1.0):
        data.ctrl[:] = [sign * 1e9] * model.nu
        mujoco.mj_forward(model, data)
        for name, limit in mechanism.limits.items():
            j = model.joint(name).dofadr[0]
            if name in ("servo", "both"):
                assert data.qfrc_actuator[j] == sign * limit.effort
            elif name != "free":
                assert abs(data.qfrc_actuator[j]) in (0.0, limit.effort, 4.0, 50.0)


# --- load mjcf dynamics -----------------------------------------------------------------------------------------------
# Gravity, friction and the inertia of rotors of an MJCF count as in MuJoCo; what does not count is told.


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
def test_torques_and_inertia_are_mujocos_with_its_gravity_armature_and_damping(text):
    rng = np.random.default_rng(1)
    mechanism = cinegen.load(text)
    assert mechanism.gravity.tolist() == [1.0, -4.0, -6.0]
    assert "gravity is 1, -4, -6 m/s2" in mechanism.source.notes
    dynamics, full = InverseDynamics(mechanism), np.zeros((3, 3))
    for _ in range(5):
        q, v, a = rng.normal(size=(3, 3))
        model, data = theirs(text, q, v, a)
        mujoco.mj_fullM(model, data, full)
        assert dynamics.mass_matrix(q) == pytest.approx(full)
        assert dynamics.mass_matrices_of(q[None])[0] == pytest.approx(full)
        assert dynamics.torques(q, v, a) == pytest.approx(data.qfrc_inverse, abs=1e-9)
        assert dynamics.torques_of(q[None], v[None], a[None])[0] == pytest.approx(data.qfrc_inverse, abs=1e-9)
        assert dynamics.balance(q, v, a).efforts / dynamics.tree.step == pytest.approx(data.qfrc_inverse, abs=1e-9)


def test_a_rotor_behind_a_loop_is_seen_at_the_actuated_joint():
    """In a parallelogram both cranks turn alike: the passive one's rotor adds to the torque of the other one."""
    mechanism = cinegen.load(parallelogram(swing='armature="0.7"', moment=0.1))
    assert mechanism.gravity.tolist() == [0.0, 0.0, 0.0]
    dynamics, q = InverseDynamics(mechanism), mechanism.q_home[None]
    expected = 3.0 * (0.1 + 0.1 + 0.7)
    assert dynamics.torques(q[0], None, {"drive": 3.0}) == pytest.approx([expected], abs=1e-6)
    assert dynamics.torques_of(q, None, [[3.0]], actuated=True)[0] == pytest.approx([expected], abs=1e-6)
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


def test_what_forces_leave_out_is_told(typed, text_file):
    path = text_file("arm.xml", ARM.format(more='damping="3 0.1" frictionloss="0.2" stiffness="9"'))
    left_out = "forces leave out the nonlinear damping of shoulder, the springs of shoulder"
    assert left_out in cinegen.load(path).source.notes
    assert f"note: {left_out}\n  gravity: 1, -4, -6 m/s2\n" in typed("forces", path).out
    report = json.loads(typed("forces", path, "--json", "--gravity", "0,0,-2").out)
    assert (report["notes"], report["gravity"], report["resting"]) == ([left_out], [0.0, 0.0, -2.0], ["shoulder"])
    assert report["torques"][0]["band"] == pytest.approx(0.2)
    assert not any("leave out" in note for note in cinegen.load(ARM.format(more="")).source.notes)


def test_what_acts_on_balls_and_tendons_is_told_too():
    text = """<mujoco><worldbody><body name="b"><joint name="ball" type="ball" {ball}/><geom size="0.1"/>
      <body name="c" pos="1 0 0"><joint name="hinge"/><geom size="0.1"/></body></body></worldbody>
      <tendon><fixed name="belt" {belt}><joint joint="hinge" coef="2"/></fixed></tendon>
      <actuator><motor name="reel" tendon="belt" {reel}/></actuator></mujoco>"""
    numbers = 'armature="1" damping="1" frictionloss="1"'
    notes = cinegen.load(text.format(ball=numbers, belt=numbers, reel='armature="1" damping="1"')).source.notes
    friction = "the damping of ball, belt, reel, the friction of ball, belt, the armature of ball, belt, reel"
    assert f"forces leave out {friction}" in notes
    assert not any("leave out" in note for note in cinegen.load(text.format(ball="", belt="", reel="")).source.notes)


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
    pose = mechanism.placement(np.array([0.3, -0.2, 0.0]), "fore")
    assert cinegen.inverse_kinematics(mechanism, {"fore": pose})


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
