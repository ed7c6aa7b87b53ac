"""Loops that JavaScript closes: the same home, degrees of freedom and actuated joints as Python's analysis."""

from __future__ import annotations

import re
from random import Random

import numpy as np
import pytest
from raff_in_node import analyse_in_node
from variants import slow

from raff2urdf.analysis import analyse
from raff2urdf.closure import CLOSED
from raff2urdf.errors import RaffClosureError
from raff2urdf.raff.reader import parse, read

OTHERS = [
    # joints at limits, a ball, couplings of all kinds, a loop through the base
    """RAFF limited
    robot r {
      link 1 { parameters { theta 50 } type 2 pred 0 limits { 52 80 } }
      link 2 { parameters { theta -26 d 120 } type 2 pred 1 }
      link 3 { parameters { theta 89 d 400 } type 2 pred 0 }
      frame 4 { parameters { d 360 } pred 2 } frame 5 { parameters { d 240 } pred 3 }
      constraint { frame 4 frame 5 type 2 }
    }""",
    """RAFF coupled
    robot r {
      link 1 { parameters { theta 10 d 100 } type 2 pred 0 } link 2 { parameters { d 100 r 20 } type 1 pred 1 }
      link 3 { parameters { theta 5 d 100 alpha 30 } type 2 pred 2 } link 4 { joint ball pred 3 }
      link 5 { parameters { d 300 } type 2 pred 4 } link 6 { parameters { r 7 d 20 } type 1 pred 0 }
      coupling { link 2 link 1 lead 5 offset 3 } coupling { link 3 link 1 ratio -2 link 5 ratio 0.5 }
      coupling { link 6 link 5 polynomial ( 0.5 -0.01 ) }
    }""",
    """RAFF bench
    robot r {
      base { parameters { gamma 40 d 700 epsilon 100 } }
      link 1 { parameters { r 800 alpha 90 } joint universal pred 0 variable y { home 20 } }
      link 2 { parameters { gamma 90 alpha 90 r 500 } type 1 pred 1 actuated 1 }
      frame 3 { parameters { d 500 r 300 } pred 0 }
      constraint { link 2 frame 3 type 3 } constraint { base sensor ( 0 ) }
    }""",
]
OPEN = """RAFF welded
robot linkage {
  link 1 { parameters { theta 50 } type 2 pred 0 } link 2 { parameters { theta -26 d 120 } type 2 pred 1 }
  link 3 { parameters { theta 89 d 400 } type 2 pred 0 }
  frame 4 { parameters { d 360 } pred 2 } frame 5 { parameters { d 240 } pred 3 }
  constraint { frame 4 frame 5 }
}"""


def compare(texts: list[str]) -> int:
    """Compare the analyses of texts; return how many robots both can close."""
    closed = 0
    for text, found in zip(texts, analyse_in_node(texts), strict=True):
        document = parse(text)
        for robot, one in zip(document.robots, found, strict=True):
            try:
                expected = analyse(document, robot)
            except RaffClosureError:
                assert isinstance(one, str), text
                continue
            assert not isinstance(one, str), (text, one)
            closed += 1
            assert np.allclose(one["home"], list(expected.home.values()), rtol=0.0, atol=1e-9), text
            assert (one["rows"], one["rank"], one["mobility"]) == (expected.rows, expected.rank, expected.mobility), (
                text
            )
            names = [name for name, has in zip(expected.home, one["actuated"], strict=True) if has]
            assert tuple(names) == expected.actuated, text
            assert one["closure"] <= CLOSED
            assert abs(one["gap"] - expected.gap) < 1e-12 + 1e-12 * expected.gap
            assert abs(one["length"] / expected.length - 1.0) < 1e-9, text
    return closed


def files(root) -> list[str]:
    return [read(path) for path in sorted((root / "robots").glob("*.raff"))]


def test_loops_close_as_in_python(root):
    texts = [*files(root), *OTHERS]
    assert compare(texts) == len(texts) + 1  # one file has two robots


@pytest.mark.parametrize(("seed", "count"), [(0, 12), *slow((1, 300))])
def test_loops_close_from_where_an_editor_puts_them(root, seed, count):
    """The written angles of joints are changed by some degrees."""
    rng = Random(seed)
    seeds = [text for text in files(root) if "constraint" in text]

    def moved(found: re.Match[str]) -> str:
        return f"theta {float(found[1]) + rng.gauss(0.0, 4.0)!r}"

    texts = [re.sub(r"theta\s+(-?[\d.]+)", moved, rng.choice(seeds)) for _ in range(count)]
    assert compare(texts) > count / 2


def test_loops_that_remain_open_are_named():
    ((found,),) = analyse_in_node([OPEN])
    with pytest.raises(RaffClosureError) as caught:
        analyse(parse(OPEN), parse(OPEN).robot())
    number = re.compile(r"0\.4\d+")  # random starts, others than Python's, may end nearer
    assert isinstance(found, str)
    assert number.sub("", found) == number.sub("", caught.value.problems[0].message.split("\n")[0])
