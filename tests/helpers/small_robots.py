"""Small closed robots, as text."""

FLOATING = "constraint { base sensor ( 0 1 ) }", 'sensor 1 { port "/dev/ttyS0" }'
"""Statements within and after a robot whose base floats."""


def two_bars(angles=(30, 50), lengths=(400, 300), words=("", "")):
    """Two bars in a plane as RAFF, with a tool at their end.

    Args:
        angles: of the links as written, degrees.
        lengths: of the bars, mm.
        words: more words of the links.
    """
    return f"""RAFF Arm
units mm
robot arm {{
  base {{ }}
  link 1 {{ parameters {{ theta {angles[0]} }} type 2 pred 0 {words[0]} }}
  link 2 {{ parameters {{ theta {angles[1]} d {lengths[0]} }} type 2 pred 1 {words[1]} }}
  frame 3 {{ name "tool" parameters {{ d {lengths[1]} }} pred 2 }}
}}
"""


def four_bar(angles=(50, -26, 89), lengths=(120, 400, 360, 240), words=("", "", ""), more="", after=""):
    """A planar four-bar as RAFF: a crank, a coupler, and a rocker whose pin is the loop.

    Args:
        angles: of the links 1 to 3 as written, degrees.
        lengths: of crank, ground, coupler and rocker, mm.
        words: more words of the links 1 to 3.
        more: more statements of the robot.
        after: statements after the robot.
    """
    crank, ground, coupler, rocker = lengths
    return f"""RAFF bars
units mm
robot bars {{
  base {{ }}
  link 1 {{ parameters {{ theta {angles[0]} }} type 2 pred 0 {words[0]} }}
  link 2 {{ parameters {{ theta {angles[1]} d {crank} }} type 2 pred 1 {words[1]} }}
  link 3 {{ parameters {{ theta {angles[2]} d {ground} }} type 2 pred 0 {words[2]} }}
  frame 4 {{ parameters {{ d {coupler} }} pred 2 }}
  frame 5 {{ parameters {{ d {rocker} }} pred 3 }}
  constraint {{ frame 4 frame 5 type 2 }}
  {more}
}}
{after}
"""


def rssr(turn="", back=""):
    """A crank and a rocker about axes that do not meet, and a rod with a ball at either end; the first is a joint.

    Args:
        turn: parameters of the joint, which rotate its axes.
        back: parameters that rotate them back.
    """
    return f"""RAFF RSSR
robot rssr {{
  link 1 {{ parameters {{ theta 40 }} type 2 pred 0 actuated 1 }}
  frame 10 {{ parameters {{ d 100 alpha 70 theta 10 }} pred 1 }}
  link 2 {{ parameters {{ {turn} }} joint ball pred 10 }}
  frame 11 {{ parameters {{ {back} }} pred 2 }}
  link 3 {{ parameters {{ gamma 20 d 300 alpha 80 theta 85 epsilon 30 }} type 2 pred 0 }}
  frame 4 {{ parameters {{ d 320 }} pred 11 }}
  frame 5 {{ parameters {{ d 200 }} pred 3 }}
  constraint {{ frame 4 frame 5 type 3 }}
}}
"""


def parallelogram(drive="", pin="", swing="", moment=1.0, coupler=1e-9):
    """A parallelogram as MJCF without gravity: both cranks turn alike, and the pin of the coupler backwards.

    Args:
        drive: attributes of the actuated joint.
        pin: attributes of the coupler's joint.
        swing: attributes of the other crank's joint.
        moment: of each crank about its axis, kg m2; their masses are 1 kg.
        coupler: its mass, kg, and its moments, kg m2.
    """
    crank = f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 {moment}"/>'
    return f"""<mujoco><option><flag gravity="disable"/></option><worldbody>
      <body name="left"><joint name="drive" axis="0 0 1" {drive}/>{crank}
        <body name="coupler" pos="1 0 0"><joint name="pin" axis="0 0 1" {pin}/>
          <inertial pos="0 0 0" mass="{coupler}" diaginertia="{coupler} {coupler} {coupler}"/></body></body>
      <body name="right" pos="0 2 0"><joint name="swing" axis="0 0 1" {swing}/>{crank}</body></worldbody>
      <equality><connect name="far" body1="coupler" body2="right" anchor="0 2 0"/></equality>
      <actuator><motor joint="drive"/></actuator></mujoco>"""
