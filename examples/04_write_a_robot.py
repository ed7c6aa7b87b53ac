"""Write a robot as RAFF text, translate it into URDF plus constraints, and load what was written."""

import math
import tempfile
from pathlib import Path

import cinegen
import raff2urdf

# A slider-crank: crank 1, rod 2, and slide 3 on the base's x axis (alpha 90 after gamma 90 turns z onto x).
TEXT = """
RAFF SliderCrank

robot engine {
  base { }
  link 1 { name "crank" parameters { theta 60 }     type 2 pred 0 }
  link 2 { name "rod"   parameters { theta -85 d 50 } type 2 pred 1 }
  link 3 { name "slide" parameters { gamma 90 alpha 90 r 170 } type 1 pred 0 limits { 90 200 } }
  frame 4 { name "pin" parameters { d 150 } pred 2 }
  constraint { frame 4 link 3 type 3 } // the joint that was cut: a ball, so only the origins must coincide
}
"""

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder, "slider_crank.raff")
    path.write_text(TEXT.lstrip(), encoding="utf-8")
    (conversion,) = raff2urdf.convert(path, out=folder)
    print(f"{conversion.urdf.name} and {conversion.constraints.name} of robot '{conversion.robot}'")
    print(f"mobility {conversion.analysis.mobility}, actuated: {', '.join(conversion.analysis.actuated)}")
    engine = cinegen.load(conversion.urdf)  # reads the constraints beside the URDF

q = engine.q_home
for degrees in range(60, 361, 60):
    q = engine.close(engine.configuration({"joint1": math.radians(degrees)}, q), locked="joint1")
    print(f"crank at {degrees:3d} degrees: slide at {1000 * q[engine.q_index('joint3')]:.2f} mm")
