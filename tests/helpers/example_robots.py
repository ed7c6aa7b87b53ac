"""Robots of example-robot-data, each loaded once, without their warnings."""

import sysconfig
import warnings
from functools import cache
from pathlib import Path

import cinegen

SHARE = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
ROBOTS = Path(__file__).resolve().parents[2] / "robots"
PANDA, UR5 = "panda_description/urdf/panda.urdf", "ur_description/urdf/ur5_robot.urdf"

PANDA_READY = {f"panda_joint{i}": q for i, q in enumerate((0, -0.785, 0, -2.356, 0, 1.571, -0.785), 1)}


@cache
def load(name: str) -> cinegen.Mechanism:
    """A URDF of the package, or a RAFF file of the repository by its name."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cinegen.load(SHARE / name if name.endswith(".urdf") else ROBOTS / f"{name}.raff")
