"""RAFF text of 100 kB that is meant to make a reader slow, or to make it fail otherwise than by its own error."""

from __future__ import annotations

from collections.abc import Callable

SIZE = 100_000


def _lines(line: Callable[[int], str], size: int = SIZE - 1000) -> str:
    """Return lines, each made of its number, as many as there is room for."""
    found, length = [], 0
    while length < size:
        found.append(line(len(found) + 1))
        length += len(found[-1]) + 1
    return "\n".join(found)


def _robot(body: str, head: str = "") -> str:
    return f"RAFF t\nunits mm\n{head}robot r {{\n{body}\n}}\n"


_LONG = 9900 * "x"
_TWO = "link 1 { type 2 pred 0 } link 2 { type 2 pred 0 }\n"
_NAMED = f'frame 3 {{ pred 0 name "{_LONG}" }}\nframe 4 {{ pred 0 name "{_LONG}y" }}\n'

HOSTILE = {
    "braces": "RAFF t " + 50_000 * "{\n",
    "closing braces": "RAFF t " + 50_000 * "}\n",
    "nested robots": "RAFF t\n" + _lines(lambda _: "robot r {"),
    "nested links": _robot(_lines(lambda _: "link 1 {")),
    "parentheses": _robot("constraint { base sensor " + 50_000 * "(\n"),
    "digits": _robot(_lines(lambda i: f"link {9900 * '1'} {{ type 0 pred 0 }}")),
    "digits in words": _robot(_lines(lambda i: f"{4900 * '1'}.{4900 * '1'}x")),
    "exponents in words": _robot(_lines(lambda i: f"velocity {4900 * '1'}e{4900 * '1'}x")),
    "huge numbers": _robot(_lines(lambda i: f"link {i}e300 {{ type 0 pred 0 }}")),
    "open texts": "RAFF t\n" + 50_000 * '"\n',
    "lone slashes": "RAFF t\n" + 50_000 * "/\n",
    "open comments": "RAFF t\n" + 30_000 * "/*\n",
    "long names": _robot(_lines(lambda i: f'frame {i} {{ pred 0 name "{_LONG}{i}" }}')),
    "loops of long names": _robot(
        f"{_TWO}{_NAMED}coupling {{ link 1 link 2 ratio 1 }}\n"
        + _lines(lambda _: "constraint{link 3 link 4}", SIZE - 21_000)
    ),
    "wrong parents": _robot(_lines(lambda i: f"link {i}{{type 0 pred 99999}}")),
    "a chain": _robot(_lines(lambda i: f"link {i}{{type 2 pred {i - 1}}}")),
    "a star": _robot(_lines(lambda i: f"link {i}{{type 2 pred 0}}")),
    "one cycle": _robot(_lines(lambda i: f"link {i}{{type 2 pred {i + 1}}}") + "\nlink 99999 { type 0 pred 1 }"),
    "many cycles": _robot(_lines(lambda i: f"link {i}{{type 2 pred {i}}}")),
    "one number": _robot(_lines(lambda _: "link 1{type 2 pred 0}")),
    "unknown words": _robot(_lines(lambda i: f"{90 * 'a'}{i} 1")),
    "robots": "RAFF t\nunits mm\n" + _lines(lambda i: f"robot r{i}{{}}"),
    "robots of one name": "RAFF t\nunits mm\n" + _lines(lambda _: "robot r{}"),
    "robots and sensors": "RAFF t\nunits mm\n"
    + _lines(lambda i: f'sensor {i}{{port""}}', SIZE // 2)
    + _lines(lambda i: f"robot r{i}{{constraint{{base sensor(1)}}}}", SIZE // 2 - 1000),
    "a list of sensors": _robot("constraint{base sensor(" + _lines(str) + ")}"),
    "ball joints": _robot(_lines(lambda i: f"link {i}{{joint ball pred {i - 1}}}")),
    "couplings": _robot(_TWO + _lines(lambda _: "coupling{link 1 link 2 ratio 1}")),
    "couplings of nothing": _robot(_lines(lambda i: f"coupling{{link {i} link 9 ratio 1}}")),
    "a polynomial": _robot(f"{_TWO}coupling {{ link 1 link 2 polynomial ({_lines(lambda _: '1e300')}) }}"),
    "drives": _robot(
        _lines(lambda i: f"link {i}{{type 2 pred 0}}", SIZE // 2)
        + "\ncoupling { link 1\n"
        + _lines(lambda i: f"link {i + 1} ratio 1", SIZE // 3)
        + "}"
    ),
    "variables": _robot("link 1 { joint ball pred 0\n" + _lines(lambda i: f"variable x{i} {{ }}") + "}"),
    "lists of files": _robot("base {" + _lines(lambda _: 'filename{"a"}') + "}"),
    "inertias": _robot(_lines(lambda i: f"frame {i}{{pred 0 inertial{{mass 1 moments{{1 1 9}}}}}}")),
    "letters beyond 16 bits": "RAFF t " + _lines(lambda _: 2000 * "\U0001f9be{"),
    "empty lines": "RAFF t" + SIZE * "\n",
    "zero bytes": _robot(_lines(lambda _: "\0")),
}
"""Texts, by what there is too much of in them."""
