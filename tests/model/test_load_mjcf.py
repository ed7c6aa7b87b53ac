"""MJCF is loaded as MuJoCo itself understands it."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import cinegen
import raff2urdf

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
def write(tmp_path):
    def write(more="", text=MODEL):
        path = tmp_path / "zoo.xml"
        path.write_text(text.replace("{more}", more))
        return path

    return write


def without_mesh(text):
    """MuJoCo wants meshes; we don't."""
    lines = text.splitlines()
    kept = [line for line in lines if 'mesh="shell"' not in line]
    return "\n".join(kept).replace('<mesh name="shell" file="shell.stl" scale="0.5 0.5 0.5"/>', "")


def turned(angles):
    return pin.utils.rotate("x", angles[0]) @ pin.utils.rotate("y", angles[1]) @ pin.utils.rotate("z", angles[2])


def wxyz(rotation):
    x, y, z, w = pin.Quaternion(rotation).coeffs()
    return [w, x, y, z]


def test_every_body_stands_where_mujoco_has_it(write):
    mechanism = cinegen.load(write())
    model = mujoco.MjModel.from_xml_string(without_mesh(MODEL.replace("{more}", "")))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    loose = pin.SE3(turned(np.radians([5, 6, 7])), np.array([2.0, 0.0, 1.0]))
    for _ in range(20):
        turn, slide, bent, other, *more = rng.uniform(-1.5, 1.5, size=13)
        ball, (along, about) = more[:3], (np.array(more[3:6]), more[6:9])
        there = loose * pin.SE3(turned(about), along)
        data.qpos[:] = [turn, slide, *wxyz(turned(ball)), bent, other, *there.translation, *wxyz(there.rotation)]
        mujoco.mj_kinematics(model, data)
        names = ["turn", "slide", "bent", "other", "ball_X", "ball_Y", "ball_Z"]
        names += ["free_TX", "free_TY", "free_TZ", "free_X", "free_Y", "free_Z"]
        values = [turn, slide, bent, other, *ball, *along, *about]
        q = mechanism.configuration(dict(zip(names, values, strict=True)))
        for i in range(1, model.nbody):
            stands = mechanism.placement(q, model.body(i).name)
            assert np.allclose(stands.translation, data.xpos[i], atol=1e-12)
            assert np.allclose(stands.rotation, data.xmat[i].reshape(3, 3), atol=1e-12)


EQUALITY = """<equality>
    <connect name="pin" body1="c" body2="d" anchor="0 0 0.1"/>
    <weld name="glue" body1="b" body2="loose" relpose="0 0 0.4 1 0 0 0"/>
  </equality>"""


def test_connect_and_weld_become_loops_that_mujoco_finds_closed(write):
    path = write(EQUALITY)
    mechanism = cinegen.load(path)
    assert [(loop.name, loop.kind.name) for loop in mechanism.loops] == [("pin", "BALL"), ("glue", "RIGID")]
    assert mechanism.mobility == 4
    model = mujoco.MjModel.from_xml_string(without_mesh(MODEL.replace("{more}", EQUALITY)))
    data = mujoco.MjData(model)
    loose = pin.SE3(turned(np.radians([5, 6, 7])), np.array([2.0, 0.0, 1.0]))
    for q in [mechanism.q_home, *mechanism.random_closed(4)]:
        successive, angles = mechanism.successive, mechanism.spherical.to_successive(q)
        at = {joint: angles[successive.q_index(joint)] for joint in successive.joints}
        ball = turned([at[f"ball_{x}"] for x in "XYZ"])
        about, along = turned([at[f"free_{x}"] for x in "XYZ"]), np.array([at[f"free_T{x}"] for x in "XYZ"])
        there = loose * pin.SE3(about, along)
        hinges = [at["bent"], at["other"]]
        loose_at = [*there.translation, *wxyz(there.rotation)]
        data.qpos[:] = [at["turn"], at["slide"], *wxyz(ball), *hinges, *loose_at]
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
    home = {joint: mechanism.q_home[mechanism.q_index(joint)] for joint in mechanism.joints}
    assert home["turn"] == pytest.approx(0.1)
    assert home["slide"] == pytest.approx(0.3)
    assert mechanism.balls == ("ball",)
    assert mechanism.values(mechanism.q_home)["ball"] == pytest.approx([np.sin(np.pi / 8), 0.0, 0.0, np.cos(np.pi / 8)])
    assert (home["bent"], home["other"]) == pytest.approx((0.4, 0.5))


def test_a_first_body_that_is_free_is_a_base_that_moves(write):
    mechanism = cinegen.load(
        write(text='<mujoco><worldbody><body name="hull" pos="0 0 1"><freejoint name="f"/><geom size="1"/>'
              '<body name="arm"><joint name="j"/><geom size="1"/></body></body></worldbody></mujoco>')
    )  # fmt: skip
    assert mechanism.floating
    assert mechanism.mobility == 7
    assert mechanism.placement(mechanism.q_home, "hull").translation.tolist() == [0.0, 0.0, 1.0]


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
    found = raff2urdf.to_raff(path, path.with_suffix(".raff"))
    mechanism = cinegen.load(path.with_suffix(".raff"))
    assert len(mechanism.loops) == 1
    assert mechanism.mobility == cinegen.load(path).mobility == (4 if free else 1)
    assert mechanism.placement(mechanism.q_home, found.nodes["hull"]).translation.tolist() == [0.0, 0.0, 1.0]


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
