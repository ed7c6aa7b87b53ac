"""How conversion grows with the file, and what `raff2urdf --check` costs above bare Python.

    python benchmarks/convert.py

Prints, for chains and for four-bars, seconds and the ratio to half the size (2 is linear); then medians of starting
bare Python and of checking a small file, taken alternately.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import raff2urdf

FOUR_BAR = """
link {a} {{ parameters {{ theta 70 epsilon {a} }} type 2 pred 0 }}
link {b} {{ parameters {{ theta -60 d 100 }} type 2 pred {a} }}
link {c} {{ parameters {{ theta 95 d 200 epsilon {a} }} type 2 pred 0 }}
frame {d} {{ parameters {{ d 250 }} pred {b} }}
frame {e} {{ parameters {{ d 180 }} pred {c} }}
constraint {{ frame {d} frame {e} type 2 }}"""


def chain(nodes: int) -> str:
    """A chain of revolute links."""
    return "".join(f"link {i} {{ parameters {{ d 100 alpha 90 }} type 2 pred {i - 1} }}\n" for i in range(1, nodes + 1))


def four_bars(nodes: int) -> str:
    """Four-bars side by side on one base, five nodes each."""
    return "".join(FOUR_BAR.format(a=i, b=i + 1, c=i + 2, d=i + 3, e=i + 4) for i in range(1, nodes, 5))


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kind, sizes in ((chain, (1250, 2500, 5000, 10000)), (four_bars, (625, 1250, 2500))):
            before = None
            for size in sizes:
                path = folder / f"{kind.__name__}{size}.raff"
                path.write_text(f"RAFF x\nrobot r {{ base {{ }}\n{kind(size)}\n}}\n")
                raff2urdf.convert(path, folder) if before is None else None  # imports and caches are warm
                began = time.perf_counter()
                raff2urdf.convert(path, folder)
                spent = time.perf_counter() - began
                ratio = f"{spent / before:6.2f}" if before else "     -"
                print(f"{kind.__name__:<10}{size:>7} nodes {spent:8.2f} s {ratio}")
                before = spent
        small = folder / "small.raff"
        small.write_text("RAFF s\nrobot r { base { } link 1 { parameters { d 100 } type 2 pred 0 } }\n")
        bare, check = [], []
        for _ in range(15):
            bare.append(_seconds("-c", "pass"))
            check.append(_seconds("-m", "raff2urdf", "--check", str(small)))
        above = median(check) - median(bare)
        print(f"bare python {median(bare):.3f} s, raff2urdf --check {median(check):.3f} s: {above:.3f} s above")


def _seconds(*arguments: str) -> float:
    began = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
    return time.perf_counter() - began


if __name__ == "__main__":
    main()
