"""A delta robot is exported to MuJoCo, where it moves under gravity with closed loops, and imported again."""

import tempfile

import mujoco

import cinegen
import raff2urdf

delta = cinegen.load("delta4")
with tempfile.TemporaryDirectory() as folder:
    (made,) = raff2urdf.convert("delta4", folder, format="mjcf")
    model = mujoco.MjModel.from_xml_path(str(made.file))
    back = cinegen.load(made.file)

data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
while data.time < 0.5:  # s
    mujoco.mj_step(model, data)

q = delta.configuration({joint: data.joint(joint).qpos[0] for joint in delta.joints})
print(f"after {data.time:.1f} s of MuJoCo its loops stand open by {1000 * delta.length * delta.closure(q):.2f} mm")
print(back)
away = delta.random_closed(1)[0]
q_back = back.configuration({joint: away[delta.q_index(joint)] for joint in delta.joints})
print("closed here and there:", delta.closure(away) < 1e-12, back.closure(q_back) < 1e-12)
