"""`python -m cinegen.assembly` compiles its kernels ahead of time."""

from pathlib import Path

import numpy as np

from cinegen.assembly import assembly_modes
from cinegen.hexapod import TSSM, Hexapod
from cinegen.model.load import build
from raff2urdf import loads
from raff2urdf.conversion import translate

FOUR_BAR = """RAFF FourBar
robot linkage {
  base { }
  link 1 { parameters { theta 50 } type 2 pred 0 actuated 1 }
  link 2 { parameters { theta -26 d 120 } type 2 pred 1 }
  link 3 { parameters { theta 89 d 400 } type 2 pred 0 }
  frame 4 { parameters { d 360 } pred 2 }
  frame 5 { parameters { d 240 } pred 3 }
  constraint { frame 4 frame 5 type 2 }
}
"""


def compile_all() -> None:
    """Use every kernel once."""
    document = loads(FOUR_BAR)
    made = translate(document, document.robot(), Path())
    assembly_modes(build(made.urdf, made.constraints))
    base, platform = np.random.default_rng(0).normal(size=(2, 6, 3))
    Hexapod(base, platform).modes(np.full(6, 4.0))
    TSSM(base, platform[:3]).modes(np.full(6, 4.0))


if __name__ == "__main__":
    compile_all()
