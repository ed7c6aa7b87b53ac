"""Robots with loops and couplings, as RAFF: some of each kind, and random ones."""

import numpy as np
from hypothesis import strategies as st
from small_robots import four_bar

seeds = st.integers(0, 2**32 - 1)

CLOSED_TEXTS = {
    "balls": four_bar((70, -60, 95), (100, 200, 250, 180), ("actuated 1", "", "")).replace("5 type 2", "5 type 3"),
    "slide_loop": """RAFF Slide
robot slide {
  base { parameters { theta 30 alpha 40 r 100 } }
  link 1 { parameters { theta 40 } type 2 pred 0 limits { -170 170 } }
  link 2 { parameters { theta 20 d 300 } type 2 pred 1 }
  link 3 { parameters { theta 60 d 200 } type 2 pred 2 }
  frame 4 { parameters { alpha 90 d 100 } pred 3 }
  frame 5 { parameters { gamma 30 d 350 alpha 90 } pred 0 }
  constraint { frame 4 frame 5 type 1 }
}""",
    "coupled": """RAFF Coupled
sensor 1 { port "/dev/tty" }
robot coupled {
  base { }
  link 1 { parameters { theta 40 } type 2 pred 0 limits { -170 170 } }
  link 2 { parameters { theta 20 d 300 } type 2 pred 1 }
  link 3 { parameters { theta 60 d 200 } type 2 pred 2 }
  link 4 { parameters { theta -26 d 120 } type 2 pred 0 }
  frame 5 { parameters { d 100 } pred 3 }
  frame 6 { parameters { d 360 } pred 4 }
  link 7 { parameters { r 20 alpha 90 } type 1 pred 4 }
  link 8 { parameters { theta 20 alpha 90 } type 2 pred 7 }
  link 9 { parameters { theta 10 alpha 70 r 50 } type 2 pred 4 }
  link 10 { parameters { theta 10 alpha 70 d 50 } type 2 pred 9 }
  constraint { frame 5 frame 6 type 2 }
  constraint { base sensor ( 0 1 ) }
  coupling { link 7 link 8 lead 20 offset 20 }
  coupling { name "siblings" link 9 link 10 ratio -2 }
  coupling { name "cam" link 8 link 1 polynomial ( 0 0.01 ) link 4 ratio 0.5 }
}""",
}
"""By name: loops of each kind, couplings of each kind, and a base that floats."""


def random_text(rng: np.random.Generator) -> tuple[str, int]:
    """A random tree of 3 to 8 joints with couplings, each of which follows joints before it; and their number."""
    count = int(rng.integers(3, 9))
    kinds = rng.choice([1, 2, 2, 2], size=count)
    lines = ["RAFF any", "robot any {"]
    for i in range(count):
        a, b, c, d, e = rng.uniform(-100.0, 100.0, size=5)
        lines.append(
            f"  link {i + 1} {{ parameters {{ theta {a} r {b} d {c + 200.0} alpha {d} gamma {e} }} type {kinds[i]} "
            f"pred {rng.integers(0, i + 1)} }}"
        )
    followers = rng.permutation(np.arange(1, count))[: int(rng.integers(1, count))]
    for i in followers:
        drives = rng.permutation(i)[: int(rng.integers(1, min(i, 3) + 1))]
        words = []
        for j in drives:
            mixed = kinds[i] != kinds[j]
            word = rng.choice(["lead", "radius"] if mixed else ["ratio"])
            value = rng.choice([-1.0, 1.0]) * rng.uniform(20.0, 200.0) if mixed else rng.uniform(-8.0, 8.0)
            if not mixed and rng.random() < 0.3:
                words.append(f"link {j + 1} polynomial ( {value} {1e-3 * value} )")
            else:
                words.append(f"link {j + 1} {word} {value}")
        lines.append(f"  coupling {{ link {i + 1} {' '.join(words)} offset {rng.uniform(-50.0, 50.0)} }}")
    return "\n".join([*lines, "}"]) + "\n", len(followers)
