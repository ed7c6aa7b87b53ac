"""Names of elements that sound like a loop or a coupling."""

from hypothesis import strategies as st

STEMS = ["loop", "closure", "closed", "closing", "constraint", "coupling", "coupler", "equality", "bushing", "mimic"]
STEMS += ["gear", "tendon", "weld", "pulley", "belt", "cut_joint", "cutjoint"]
AFFIXES = ["", "_", "-", "joint", "_joint", "Joint", "kinematic_", "robot", "x", "2", "list", "s"]


@st.composite
def names(draw):
    stem = draw(st.sampled_from(STEMS))
    stem = draw(st.sampled_from([stem, stem.upper(), stem.capitalize()]))
    before, after = (draw(st.sampled_from(AFFIXES)) for _ in range(2))
    name = f"{before}{stem}{after}".lstrip("-2")
    return name
