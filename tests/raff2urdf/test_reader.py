"""RAFF text as a person writes it, and what the reader says where it is wrong."""

import json
import math
import re
import warnings
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import documents, layouts
from wrong_raff import END, FIGURE_5, LINK, ONE, WRONG_BODIES, WRONG_TEXTS, assert_in_order, text_of

import raff2urdf
from raff2urdf import RaffError, RaffWarning
from raff2urdf.cli import main
from raff2urdf.errors import Problem
from raff2urdf.raff import document as raff
from raff2urdf.raff.document import Document, JointType, LoopKind, RaffLink, RaffLoop, RaffParameters, RaffRobot
from raff2urdf.raff.reader import parse
from raff2urdf.raff.textmate import grammar
from raff2urdf.raff.tokens import tokens


def problems_of(text: str, name: str = "<text>") -> tuple[Problem, ...]:
    with pytest.raises(RaffError) as caught:
        raff2urdf.loads(text, name)
    return caught.value.problems


def robot_of(body: str) -> RaffRobot:
    """The one robot whose block holds `body`."""
    (robot,) = raff2urdf.loads(f"RAFF test\nrobot r {{\n{body}\n}}\n").robots
    return robot


def link_of(body: str) -> RaffLink:
    (link,) = robot_of(f"link 1 {{ type 2 pred 0 {body} }}").links
    return link


# --- the paper's example -----------------------------------------------------------------------------------------


def test_figure_5_as_printed_has_two_errors_which_are_shown_with_what_is_meant() -> None:
    assert [str(problem) for problem in problems_of(FIGURE_5, "delta4.raff")] == [
        "delta4.raff:29:7: unknown parameter 'alphah': did you mean 'alpha'?\n          alphah 0.0\n          ^^^^^^",
        "delta4.raff:33:3: 'type' is outside a link: link 2 was closed on line 31; remove that '}'\n"
        "      type 2\n      ^^^^",
    ]


def test_figure_5_repaired_means_what_it_says() -> None:
    lines = FIGURE_5.splitlines(keepends=True)
    assert (lines[28], lines[30]) == ("      alphah 0.0\n", "  }\n")
    lines[28] = lines[28].replace("alphah", "alpha")
    del lines[30]
    document = raff2urdf.loads("".join(lines))
    assert (document.name, document.units) == ("MiniDelta", "mm")
    (robot,) = document.robots
    assert (robot.name, robot.path) == ("r1", "~/GKG/Models/delta-4/")
    assert robot.base == raff.RaffBase(filenames=("platform.dxf",))
    arm = RaffParameters(d=1500, alpha=90, gamma=120)
    assert robot.links == (
        RaffLink(1, RaffParameters(d=1500, alpha=90), JointType.REVOLUTE, 0, limits=(-85, 80), filenames=("bras.nff",)),
        RaffLink(2, RaffParameters(theta=211.21, d=2000), JointType.REVOLUTE, 1, limits=(185, 355)),
        RaffLink(6, arm, JointType.REVOLUTE, 0, limits=(-85, 80), filenames=("bras.nff",)),
    )
    assert robot.loops == (RaffLoop(5, 11, LoopKind.RIGID),)


# --- every construct ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("unit", "metres"), [("um", 0.0015), ("mm", 1.5), ("cm", 15.0), ("m", 1500.0)])
def test_units_say_what_a_length_is(unit: str, metres: float) -> None:
    document = raff2urdf.loads(f"RAFF test\nunits {unit}\nrobot r {{ }}")
    assert (document.units, document.metres(1500.0)) == (unit, metres)
    assert raff2urdf.loads("RAFF test").units == "mm"


def test_the_six_parameters_stand_in_any_order_and_default_to_zero() -> None:
    link = link_of("parameters { epsilon 6 gamma 5 alpha 4 d 3 r 2 theta 1 }")
    assert link.parameters == RaffParameters(theta=1, r=2, d=3, alpha=4, gamma=5, epsilon=6)
    assert link_of("").parameters == RaffParameters(0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize("text", ["12.", "+12", "1200e-2", "0.12E+2", ".12e2"])
def test_a_number_may_be_written_in_many_ways(text: str) -> None:
    assert link_of(f"parameters {{ d {text} }}").parameters.d == 12.0


def test_loops_between_the_same_nodes_have_names_of_their_own() -> None:
    robot = robot_of("link 1 { type 2 pred 0 }" + 3 * " constraint { base link 1 type 3 }")
    assert robot.loop_names == ("base-link1", "base-link1#2", "base-link1#3")
    robot = robot_of("link 1 { type 2 pred 0 } frame 2 { pred 0 } constraint { frame 2 link 1 }")
    assert robot.loops == (RaffLoop(2, 1, LoopKind.RIGID),)


def test_a_file_reads_as_its_text_does(tmp_path: Path) -> None:
    """Whatever its line ends, with or without a byte order mark."""
    for i, data in enumerate([b"\xef\xbb\xbfRAFF caf\xc3\xa9\r\nrobot r { }\r\n", "RAFF café\nrobot r { }".encode()]):
        (tmp_path / f"{i}.raff").write_bytes(data)
        assert raff2urdf.load(tmp_path / f"{i}.raff") == raff2urdf.loads("RAFF café robot r { }")


# --- what is wrong, where, and what it probably should be --------------------------------------------------------


def at(entry: tuple[str, int, int, str]) -> str:
    return entry[3].replace(" ", "-")


@pytest.mark.parametrize(("text", "line", "column", "words"), WRONG_TEXTS, ids=map(at, WRONG_TEXTS))
def test_an_error_says_where_it_is_and_what_is_likely_meant(text: str, line: int, column: int, words: str) -> None:
    (problem,) = problems_of(text)
    assert problem.location is not None
    assert_in_order(words, problem.message)
    assert (problem.location.line, problem.location.column) == (line, column)
    assert problem.text == (text.split("\n")[line - 1])


@pytest.mark.parametrize("before", ["", "\t\t", 'name "Ж" ', 300 * " "])
def test_the_caret_stands_under_the_offending_word_in_an_excerpt(before: str) -> None:
    (problem,) = problems_of(f"{LINK}{before}type 2 pred 0 velocty 5 {300 * ' '}{END}")
    _, shown, carets = str(problem).split("\n")
    assert len(shown) < 120
    assert [word for word, caret in zip(shown, carets, strict=False) if caret == "^"] == list("velocty")


def test_all_errors_of_a_file_are_reported_at_once_in_their_order() -> None:
    text = """RAFF several units inch
robot r {
  lnk 1 { type 2 pred 0 }
  link 2 { parameters { thetaa 3
                        alfa 2 d 5mm } type 9 pred 0.5 }
  link 3 { type 2 pred 0 limits { 1e400 0 } }
}
robot s { fram 4 { pred 0 } link 5 { type 2 type 2 pred 0 }
}
"""
    words = ["inch", "lnk", "thetaa", "alfa", "5mm", "9", "0.5", "1e400", "fram", "2 pred 0 }\n}"]
    assert [problem.location and (problem.location.line, problem.location.column) for problem in problems_of(text)] == [
        (text[: text.index(word)].count("\n") + 1, text.index(word) - text.rfind("\n", 0, text.index(word)))
        for word in words
    ]


def test_everything_that_blocks_lack_is_reported_at_once() -> None:
    problems = problems_of("RAFF t\nrobot r {\nlink 1 { }\nframe 2 { }\n}\nsensor 1 { }")
    told = [(problem.location.line, problem.message.split("'")[1]) for problem in problems]
    assert told == [(3, "type"), (3, "pred"), (4, "pred"), (6, "port")]


@pytest.mark.parametrize("line", ["lnk 1 { type 2 pred 0 }", "link 1 { parameters { d x } }", "frame 1 { }"])
def test_a_file_full_of_errors_tells_the_first_hundred(line: str) -> None:
    """No one reads more, and nothing is gained by falling over the thousandth."""
    problems = problems_of(f"RAFF t\nrobot r {{\n{5000 * (line + chr(10))}}}")
    assert len(problems) == 100
    assert problems[0].location is not None
    assert problems[0].location.line <= 4


_SCRAPS = ["{", "}", "(", ")", '"', "/", "5", "1e999", "-", "link", "type", "robot", "RAFF", "d", "x", "\n", "\0", "é"]


@given(documents(most_parts=3), st.lists(st.tuples(st.floats(0, 1), st.integers(0, 12), st.sampled_from(_SCRAPS))))
@settings(max_examples=150)
def test_whatever_is_done_to_a_text_it_is_a_document_or_an_error_with_its_place(document: Document, changes) -> None:
    text = raff2urdf.dumps(document)
    for where, removed, put in changes:
        at = int(where * len(text))
        text = f"{text[:at]} {put} {text[at + removed :]}"
    try:
        raff2urdf.loads(text)
    except RaffError as error:
        for problem in error.problems:
            assert problem.message
            assert problem.location is not None
            assert 1 <= problem.location.line <= text.count("\n") + 1
            assert 1 <= problem.location.column <= len(text.split("\n")[problem.location.line - 1]) + 1


# --- files that are no RAFF --------------------------------------------------------------------------------------


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "missing.raff", tmp_path, tmp_path / "nul\0.raff"):
        with pytest.raises(RaffError, match=f"^{re.escape(str(path))}: can't be read: "):
            raff2urdf.load(path)


# --- writer -----------------------------------------------------------------------------------------------------------
# What is written reads back as the same document.


@given(documents(least_robots=1), st.data())
@settings(max_examples=80)
def test_what_is_written_is_valid_and_reads_back_as_the_same_document(document: Document, data: st.DataObject) -> None:
    """White space and comments mean nothing."""
    text = raff2urdf.dumps(document)
    assert raff2urdf.loads(text) == document
    assert raff2urdf.loads(data.draw(layouts(text))) == document
    with warnings.catch_warnings(action="ignore", category=RaffWarning):
        raff2urdf.check(document)


@pytest.mark.parametrize("wrong", ['a "b"', "a\nb"])
def test_a_text_that_raff_cannot_hold_is_refused(wrong: str) -> None:
    link = RaffLink(1, RaffParameters(), JointType.FIXED, 0)
    robots = [RaffRobot("r", path=wrong)]
    robots += [RaffRobot("r", parts=(replace(link, **word),)) for word in ({"name": wrong}, {"filenames": (wrong,)})]
    of_robots = (Document("x", (robot,)) for robot in robots)
    for document in (Document(wrong), Document("x", sensors=(raff.RaffSensor(1, wrong),)), *of_robots):
        with pytest.raises(raff2urdf.RaffError, match="quotation mark or a line's end"):
            raff2urdf.dumps(document)


@pytest.mark.parametrize("wrong", [math.inf, -math.inf, math.nan])
def test_a_number_that_raff_cannot_hold_is_refused(wrong: float) -> None:
    link = RaffLink(1, RaffParameters(d=wrong), JointType.REVOLUTE, 0)
    with pytest.raises(raff2urdf.RaffError):
        raff2urdf.dumps(Document("x", (RaffRobot("r", parts=(link,)),)))


def test_long_lists_are_written_so_that_they_can_be_read() -> None:
    """The reader takes no line of over 10,000 characters."""
    files = tuple(f"part-{i:04}.stl" for i in range(1000))
    sensors = tuple(raff.RaffSensor(number, "port") for number in range(1, 3001))
    chosen = raff.SensorConstraint(0, tuple(sensor.number for sensor in sensors))
    link = RaffLink(1, RaffParameters(), JointType.FIXED, 0, filenames=files)
    document = Document("x", (RaffRobot("r", parts=(link,), sensor_constraints=(chosen,)),), sensors)
    assert raff2urdf.loads(raff2urdf.dumps(document)) == document


# --- grammar ----------------------------------------------------------------------------------------------------------
# The grammar for editors marks RAFF as the reader reads it: it is applied by the rules of TextMate's manual.


def scopes(text):
    """Return (line, column, text, scope) of all that a grammar marks, line by line as an editor does.

    In a region its end is tried first, then its rules in order; the match that begins first counts.
    """
    rules = grammar()
    repository = {f"#{key}": value["patterns"] for key, value in rules["repository"].items()}

    def flat(patterns):
        for pattern in patterns:
            yield from flat(repository[pattern["include"]]) if "include" in pattern else (pattern,)

    marks, stack = [], [(None, rules["patterns"], {})]

    def mark(line, match, rule, captures):
        if "name" in rule:
            marks.append((line, match.start() + 1, match[0], rule["name"]))
        for group, value in rule.get(captures, {}).items():
            if match[int(group)] is not None:
                marks.append((line, match.start(int(group)) + 1, match[int(group)], value["name"]))

    for number, line in enumerate(text.splitlines(), 1):
        at = 0
        while True:
            end, patterns, region = stack[-1]
            tried = [(re.compile(end).search(line, at), None)] if end else []
            for rule in flat(patterns):
                tried.append((re.compile(rule.get("begin") or rule["match"]).search(line, at), rule))
            tried = [attempt for attempt in tried if attempt[0] is not None]
            if not tried:
                break
            match, rule = min(tried, key=lambda attempt: attempt[0].start())
            if rule is None:
                mark(number, match, {"endCaptures": region.get("endCaptures", {})}, "endCaptures")
                stack.pop()
            elif "begin" in rule:
                mark(number, match, {"beginCaptures": rule["beginCaptures"]}, "beginCaptures")
                stack.append((rule["end"], rule["patterns"], rule))
            else:
                mark(number, match, rule, "captures")
                assert match.end() > match.start()
            at = match.end()
    assert len(stack) == 1, "a region is open at the end"
    return marks


def test_robots_have_nothing_illegal_and_every_token_has_a_scope(root):
    for path in sorted((root / "robots").glob("*.raff")):
        text = path.read_text()
        marked = scopes(text)
        assert [mark for mark in marked if mark[3].startswith("invalid")] == [], path.name
        at = {(line, column) for line, column, _, _ in marked}
        for token in tokens(text.splitlines()):
            if token.kind not in ("END", ")", "("):
                assert (token.line, token.column) in at, (path.name, token)


def test_what_does_not_belong_is_illegal():
    text = 'RAFF t\nrobot r {\n  link 1 { typ 2 pred 0 joint ball name "a" }\n  d 5mm\n}\nunits cm // note\n'
    scope_of = {word: scope.removesuffix(".raff") for _, _, word, scope in scopes(text)}
    expected = {
        "RAFF": "keyword.control", "t": "entity.name", "robot": "storage.type", "r": "entity.name",
        "link": "storage.type", "1": "constant.numeric", "typ": "invalid.illegal", "pred": "keyword.other",
        "ball": "constant.language", '"a"': "string.quoted.double", "d": "invalid.illegal", "5mm": "invalid.illegal",
        "units": "keyword.other", "cm": "constant.language", "// note": "comment.line.double-slash",
    }  # fmt: skip
    assert {word: scope_of[word] for word in expected} == expected


def test_the_command_prints_it(capfd):
    assert main(["--grammar"]) == 0
    assert json.loads(capfd.readouterr().out) == grammar()


# --- check ------------------------------------------------------------------------------------------------------------
# Checks beyond the grammar: parents, numbers, names, limits, and constraints on what does not exist.


def faults_of(text: str) -> tuple[Problem, ...]:
    with pytest.raises(RaffError) as caught:
        raff2urdf.check(raff2urdf.loads(text))
    return caught.value.problems


def warnings_of(text: str) -> list[str]:
    with warnings.catch_warnings(record=True, action="always") as caught:
        raff2urdf.check(raff2urdf.loads(text))
    assert all(warning.category is RaffWarning for warning in caught)
    return [str(warning.message) for warning in caught]


@pytest.mark.parametrize(("body", "line", "column", "words"), WRONG_BODIES, ids=map(at, WRONG_BODIES))
def test_a_fault_is_named_where_it_stands(body: str, line: int, column: int, words: str) -> None:
    (problem,) = faults_of(text_of(body))
    assert_in_order(words, problem.message)
    assert problem.location is not None
    assert (problem.location.line, problem.location.column) == (line, column)


@pytest.mark.parametrize("name", ["4bar", '"left arm"', '""', "-r"])
def test_a_robots_name_must_be_one_that_xml_takes(name: str) -> None:
    (problem,) = faults_of(f"RAFF t\nrobot {name} {{ }}")
    assert "can't name a robot" in problem.message


@pytest.mark.parametrize("length", [1, 3000])
def test_a_cycle_of_parents_is_one_fault_however_long(length: int) -> None:
    ring = [RaffLink(i, RaffParameters(), JointType.REVOLUTE, 1 + i % length) for i in range(1, length + 1)]
    on_it = [raff.RaffFrame(length + i, RaffParameters(), i) for i in range(1, length + 1)]
    with pytest.raises(RaffError, match="link 1 is part of a cycle of parents: 1 -> ") as caught:
        raff2urdf.check(Document("t", (RaffRobot("r", parts=(*on_it, *ring)),)))
    (problem,) = caught.value.problems
    assert len(problem.message) < 200


def test_all_faults_are_reported_at_once_in_the_order_of_the_text() -> None:
    wrong = ["link 1 { type 2 pred 9 limits { 2 1 } }", ONE, "link 3 { type 2 pred 3 }", "constraint { base link 8 }"]
    with pytest.raises(RaffError) as caught:
        raff2urdf.check(parse(text_of("\n".join(wrong), "robot r { }")))
    assert [problem.location and problem.location.line for problem in caught.value.problems] == [3, 3, 4, 5, 6, 8]


# --- understood, but probably not meant --------------------------------------------------------------------------


@pytest.mark.parametrize(("link", "column", "words"), [
    ("type 0 pred 0 limits { 0 90 }", 33, "link 1 is fixed limits"),
    ("type 0 pred 0 actuated 1", 33, "link 1 is fixed actuate"),
    ("type 0 pred 0 friction 5", 33, "link 1 is fixed friction"),
    ("type 2 pred 0 effort 5 actuated 0", 31, "link 1 is passive effort 'actuated 1'"),
    ("joint ball pred 0 variable y { effort 5 }", 48, "variable y of link 1 is passive effort"),
    ("parameters { theta 95 } type 2 pred 0 limits { 0 90 }", 57, "link 1 95 outside limits"),
    ("parameters { r -9 } type 1 pred 0 limits { 0 90 }", 53, "link 1 -9 outside limits"),
])  # fmt: skip
def test_what_is_probably_not_meant_is_a_warning_with_its_place(link: str, column: int, words: str) -> None:
    (warning,) = warnings_of(text_of(f"link 1 {{ {link} }}"))
    assert warning.startswith(f"<text>:3:{column}: ")
    assert all(word in warning for word in words.split())


def test_a_robot_of_some_mm_must_state_its_units() -> None:
    links = " link 1 { type 2 pred 0 parameters { d 0.4 } }\n frame 2 { pred 1 parameters { d 1.2 } }\n"
    begin, end = "RAFF x\n", f"robot r {{\n{links}}}\n"
    with pytest.raises(raff2urdf.RaffError, match=r"<text>:4:.*1\.2 mm: did you mean metres\? Write 'units m'"):
        raff2urdf.check(raff2urdf.loads(begin + end))
    for units in ("units mm\n", "units m\n", "units um\n"):
        raff2urdf.check(raff2urdf.loads(begin + units + end))
    small = replace(raff2urdf.loads(begin + end), states_units=True)  # as a program would make it
    again = raff2urdf.loads(raff2urdf.dumps(small))
    assert (again, again.states_units) == (small, True)
    raff2urdf.check(again)
