"""Random RAFF documents, and random ways to lay out the same text."""

import re
from itertools import cycle
from typing import Any

from hypothesis import strategies as st

from raff2urdf.raff import document as raff
from raff2urdf.raff.compound import VARIABLES
from raff2urdf.raff.document import DriveKind
from raff2urdf.raff.syntax import STATEMENTS

UNITS = ("mm", "um", "cm", "m")

_ANY_DOUBLE = st.floats(allow_nan=False, allow_infinity=False)
_TELLING = st.sampled_from(
    [0.0, -0.0, 0.1, 211.21, -85.0, 90.0, 5e-324, -5e-324, 1.7e308, -1.7e308, 1e22, 1e-7, 2.0**53]
)
EXTREME = _TELLING | _ANY_DOUBLE
"""Any finite double, with a liking for those that are hard to write."""

LENGTHS = st.just(0.0) | st.floats(-1000.0, 1000.0)
"""Lengths of a robot one can build, mm."""

ANGLES = st.sampled_from([0.0, 90.0, -90.0, 180.0, 45.0, 90.0 + 1e-9, 90.0 - 1e-7, 1e-6]) | st.floats(-360.0, 360.0)
"""Angles in degrees, with a liking for those at which formulas break down."""

# Letters that XML allows at the beginning of a name, and what it allows behind; production [5] of XML 1.0.
_FIRST = st.sampled_from("aBz_éłλЖ中🦾")
_REST = st.text(st.sampled_from("aBz_éłλЖ中🦾059.-·\u0301"), max_size=6)
XML_NAMES = st.builds(str.__add__, _FIRST, _REST)

TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters='"\n\0'), max_size=12)
"""What RAFF can write between quotation marks."""

SENSOR_AXES = st.none() | st.permutations(["x", "-y", "0.1*z", "rx", "-2e-3*ry", "0"]).map(", ".join)
"""What commands a node's axes, in any order."""

KEYWORDS = st.sampled_from(sorted({"RAFF", "mm", "ball", *(word for block in STATEMENTS.values() for word in block)}))


def parameters(lengths: Any, angles: Any) -> st.SearchStrategy[raff.RaffParameters]:
    return st.builds(raff.RaffParameters, angles, lengths, lengths, angles, angles, lengths)


@st.composite
def documents(draw, moderate=False, loops=True, graphics=True, least_robots=0, most_parts=8) -> raff.Document:
    """A random document that `check` accepts.

    Args:
        draw: hypothesis's.
        moderate: numbers of a robot one can build, instead of any double; each link has one variable at most.
        loops: with loops; they join any two nodes, so that few of them can be closed.
        graphics: with names of graphic files (there are no such files).
        least_robots: at least so many robots.
        most_parts: at most so many links and frames in each.
    """
    lengths, angles, least_speed = (LENGTHS, ANGLES, 1e-3) if moderate else (EXTREME, EXTREME, 1e-5)
    numbers = draw(st.lists(st.integers(1, 10**6), unique=True, max_size=3))
    counts = st.integers(0, 3)
    sensors = [raff.RaffSensor(n, draw(TEXTS), draw(counts), draw(counts), draw(SENSOR_AXES)) for n in numbers]
    names = draw(st.lists(XML_NAMES | KEYWORDS, unique=True, min_size=least_robots, max_size=max(2, least_robots)))
    numbered, kinds = [0, *numbers], parameters(lengths, angles)
    robots = [
        draw(_robots(name, numbered, kinds, lengths, loops, graphics, most_parts, least_speed, not moderate))
        for name in names
    ]
    return raff.Document(
        draw(XML_NAMES | KEYWORDS | TEXTS),
        tuple(robots),
        tuple(sensors),
        "mm" if moderate else draw(st.sampled_from(UNITS)),
        draw(st.none() | st.tuples(lengths, lengths, lengths)),
    )


@st.composite
def _robots(draw, name, sensors, params, values, loops, graphics, most_parts, least_speed, compounds) -> raff.RaffRobot:
    files = st.none() | st.lists(TEXTS, max_size=2).map(tuple) if graphics else st.none()
    numbers = draw(st.lists(st.integers(1, 40) | st.integers(1, 10**9), unique=True, max_size=most_parts))
    name_or_none = st.none() | (XML_NAMES | KEYWORDS).filter(lambda word: word not in ("base", "world", "universe"))
    names = draw(st.lists(name_or_none, min_size=len(numbers), max_size=len(numbers), unique_by=_or_unlike))
    parts: list[raff.RaffLink | raff.RaffFrame] = []
    for number, own_name in zip(numbers, names, strict=True):
        common = {
            "number": number,
            "parameters": draw(params),
            "pred": draw(st.sampled_from([0, *(part.number for part in parts)])),
            "name": own_name,
            "filenames": draw(files),
            "inertial": draw(st.none() | inertials(values)),
        }
        if draw(st.integers(0, 3)) == 0:
            parts.append(raff.RaffFrame(**common))
            continue
        pair = st.tuples(values, values).map(lambda two: (min(two), max(two)))
        speed = values.map(lambda value: max(abs(value), 2.0 * least_speed))
        if compounds and draw(st.integers(0, 3)) == 0:
            parts.append(draw(_compounds(common, values, pair, speed)))
            continue
        parts.append(raff.RaffLink(**common, type=draw(st.sampled_from(raff.JointType)), **_driven(draw, pair, speed)))
    nodes = [0, *numbers]
    ends = st.lists(st.sampled_from(nodes), min_size=2, max_size=2, unique=True)
    loop = st.builds(lambda two, kind: raff.RaffLoop(*two, kind), ends, st.sampled_from(raff.LoopKind))
    choices = st.lists(st.sampled_from(sensors), min_size=1, max_size=3).map(tuple)
    held = st.builds(raff.SensorConstraint, st.sampled_from(nodes), choices)
    return raff.RaffRobot(
        name,
        raff.RaffBase(draw(st.just(raff.RaffParameters()) | params), draw(files), draw(st.none() | inertials(values))),
        tuple(draw(st.permutations(parts))),  # a father may stand behind its children
        tuple(draw(st.lists(loop, max_size=3))) if loops and numbers else (),
        draw(_couplings(parts, values)) if loops else (),
        tuple(draw(st.lists(held, max_size=2))),
        draw(st.none() | TEXTS) if graphics else None,
    )


def _driven(draw: st.DrawFn, pair: Any, speed: Any) -> dict[str, Any]:
    """What a joint, or one of its variables, may have."""
    words = {"limits": pair} | dict.fromkeys(("velocity", "effort", "armature", "damping", "friction"), speed)
    drawn = {word: draw(st.none() | value) for word, value in words.items()}
    return drawn | {"actuated": draw(st.sampled_from([None, None, True, False]))}


@st.composite
def inertials(draw: st.DrawFn, values: st.SearchStrategy[float]) -> raff.RaffInertial:
    """A mass that some body has: a point, or a ball."""
    mass = abs(draw(values))
    moment = abs(draw(values)) if mass else 0.0
    return raff.RaffInertial(mass, (draw(values), draw(values), draw(values)), (moment, moment, moment))


@st.composite
def _compounds(draw: st.DrawFn, common: dict[str, Any], values: Any, pair: Any, speed: Any) -> raff.RaffLink:
    """A link whose joint has several variables."""
    kind = draw(st.sampled_from(raff.CompoundKind))
    variables = [
        raff.RaffVariable(name, home=0.0 if written else draw(st.just(0.0) | values), **_driven(draw, pair, speed))
        for name, written in VARIABLES[kind].items()
        if draw(st.booleans())
    ]
    return raff.RaffLink(**common, type=raff.JointType.FIXED, compound=kind, variables=tuple(variables))


@st.composite
def _couplings(draw: st.DrawFn, parts: list[raff.RaffLink | raff.RaffFrame], values: st.SearchStrategy[float]) -> Any:
    links = [part for part in parts if isinstance(part, raff.RaffLink) and part.type is not raff.JointType.FIXED]
    if len(links) < 2:
        return ()
    factor = values.map(lambda value: value if abs(value) > 1e-2 else 1.0)
    couplings = []
    for name in draw(st.lists(st.none() | TEXTS, max_size=2, unique_by=_or_unlike)):
        follower, *others = draw(st.lists(st.sampled_from(links), min_size=2, max_size=4, unique=True))
        drives = []
        for other in others:
            kinds = (DriveKind.LEAD, DriveKind.RADIUS) if other.type is not follower.type else (DriveKind.RATIO,)
            kind = draw(st.sampled_from([*kinds, DriveKind.POLYNOMIAL]))
            most = 3 if kind is DriveKind.POLYNOMIAL else 1
            drives.append(raff.RaffDrive(other.number, kind, tuple(draw(st.lists(factor, min_size=1, max_size=most)))))
        couplings.append(raff.RaffCoupling(follower.number, tuple(drives), draw(values), name))
    return tuple(couplings)


def _or_unlike(name: str | None) -> object:
    """Makes names unique among each other, but lets any number of parts have none."""
    return object() if name is None else name


# --- layout ------------------------------------------------------------------------------------------------------

_TOKEN = re.compile(r'"[^"\n]*"|[{}()]|[^\s{}()"]+')
_BRACES = '{}()"'
_COMMENTS = st.sampled_from(["// {", '// "', "//", "// ключ: 5 mm → λ 🦾 }", "// link 3 // twice", "//\t\r"])
_SPACES = st.sampled_from([" ", "\t", "\n", "\r\n", "  \n\n ", "\f"])
GAPS = st.lists(_SPACES | _COMMENTS.map("{}\n".format), min_size=1, max_size=3).map("".join)


@st.composite
def layouts(draw: st.DrawFn, text: str) -> str:
    """The same words with other white space and comments between them; none at all where a brace parts them.

    `RAFF <name>` stays on one line.
    """
    between_words = cycle(draw(st.lists(GAPS, min_size=1, max_size=7)))
    beside_braces = cycle(draw(st.lists(st.just("") | GAPS, min_size=1, max_size=7)))
    header, *tokens = _TOKEN.findall(text)
    laid = next(beside_braces) + header + draw(st.sampled_from([" ", "\t", "  \t "]))
    before = "{"
    for i, token in enumerate(tokens):
        parted = token[0] in _BRACES or before[0] in _BRACES
        laid += (next(beside_braces if parted else between_words) if i else "") + token
        before = token
    return laid + next(beside_braces) + draw(st.just("") | _COMMENTS)
