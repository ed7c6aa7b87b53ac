"""A small biped in three formats: a trunk that floats at a height of 0.8 m, two legs of three joints, an arm."""

from urdf_text import UrdfJoint, urdf_text

HEIGHT = 0.8
FEET = ("left_foot", "right_foot")


def _urdf() -> str:
    joints = [UrdfJoint("root", "world", "trunk", f"0 0 {HEIGHT}", kind="floating")]

    def joint(name: str, parent: str, child: str, xyz: str, axis: str, lower: float, upper: float) -> None:
        joints.append(UrdfJoint(name, parent, child, xyz, axis, limit=(lower, upper), velocity=5.0))

    for side, y in (("left", 0.1), ("right", -0.1)):
        joint(f"{side}_roll", "trunk", f"{side}_hip", f"0 {y} 0", "1 0 0", -0.6, 0.6)
        joint(f"{side}_pitch", f"{side}_hip", f"{side}_thigh", "0 0 0", "0 1 0", -1.8, 1.0)
        joint(f"{side}_knee", f"{side}_thigh", f"{side}_shank", "0 0 -0.4", "0 1 0", 0.0, 2.5)
        joint(f"{side}_ankle", f"{side}_shank", f"{side}_sole", "0 0 -0.4", "0 1 0", -1.5, 1.5)
        joint(f"{side}_ankle_roll", f"{side}_sole", f"{side}_foot", "0 0 0", "1 0 0", -0.6, 0.6)
    joint("shoulder", "trunk", "upper_arm", "0 0.2 0.4", "0 1 0", -2.5, 2.5)
    joint("elbow", "upper_arm", "forearm", "0 0 -0.3", "1 0 0", -2.5, 2.5)
    joints.append(UrdfJoint("to_hand", "forearm", "hand", "0 0 -0.3", kind="fixed"))
    return urdf_text(joints, name="biped")


def _leg(side: str, y: float) -> str:
    return f"""<body name="{side}_hip" pos="0 {y} 0"><joint name="{side}_roll" axis="1 0 0" range="-0.6 0.6"/>
      <body name="{side}_thigh"><joint name="{side}_pitch" axis="0 1 0" range="-1.8 1"/>
      <body name="{side}_shank" pos="0 0 -0.4"><joint name="{side}_knee" axis="0 1 0" range="0 2.5"/>
      <body name="{side}_sole" pos="0 0 -0.4"><joint name="{side}_ankle" axis="0 1 0" range="-1.5 1.5"/>
      <body name="{side}_foot"><joint name="{side}_ankle_roll" axis="1 0 0" range="-0.6 0.6"/>
      </body></body></body></body></body>"""


URDF = _urdf()

MJCF = f"""<mujoco model="biped"><compiler angle="radian" autolimits="true"/><worldbody>
  <body name="trunk" pos="0 0 {HEIGHT}"><freejoint name="root"/>{_leg("left", 0.1)}{_leg("right", -0.1)}
    <body name="upper_arm" pos="0 0.2 0.4"><joint name="shoulder" axis="0 1 0" range="-2.5 2.5"/>
      <body name="forearm" pos="0 0 -0.3"><joint name="elbow" axis="1 0 0" range="-2.5 2.5"/>
        <body name="hand" pos="0 0 -0.3"/></body></body></body></worldbody></mujoco>"""
