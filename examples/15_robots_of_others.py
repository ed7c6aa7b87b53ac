"""A Panda and a Cassie as others have described them, in URDF and SDF: their properties, and the same in RAFF."""

import sysconfig
import warnings
from pathlib import Path

import cinegen
import raff2urdf

robots = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
if not robots.exists():
    raise SystemExit("these robots come with the package example-robot-data, which `make test` installs")
warnings.simplefilter("ignore")  # of what they leave out

cassie = cinegen.load(robots / "cassie_description/robots/cassie_v2.sdf")
print(cassie, f"closed to {cassie.closure(cassie.q_home):.0e}")
for loop in cassie.loops:
    print(f"  {loop.name}: {loop.kind.name.lower()}, between {loop.first} and {loop.second}")

panda = raff2urdf.to_raff(robots / "panda_description/urdf/panda.urdf", units="mm")
print("panda in RAFF, mm and degrees:")
for link in panda.document.robot().links:
    p = link.parameters
    print(f"  {link.node:<18} theta {p.theta:6.1f}  r {p.r:6.1f}  d {p.d:6.1f}  alpha {p.alpha:6.1f}")
print("one finger follows the other:", cinegen.load(robots / "panda_description/urdf/panda.urdf").couplings[0])
