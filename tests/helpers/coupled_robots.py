"""Random robots with couplings, as RAFF."""

import numpy as np
from hypothesis import strategies as st

seeds = st.integers(0, 2**32 - 1)


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
