"""RAFF text as a person writes it, and what the reader says where it is wrong."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import documents, examples
from wrong_raff import END, FIGURE_5, LINK, assert_in_order
from wrong_raff import WRONG_TEXTS as WRONG

import raff2urdf
from raff2urdf import RaffError
from raff2urdf.errors import Problem
from raff2urdf.raff.document import (
    Document,
    JointType,
    LoopKind,
    RaffBase,
    RaffLink,
    RaffLoop,
    RaffParameters,
    RaffRobot,
)


def repaired_figure_5() -> str:
    """The same without the two slips: line 29 spelt right, the brace of line 31 gone."""
    lines = FIGURE_5.splitlines(keepends=True)
    assert (lines[28], lines[30]) == ("      alphah 0.0\n", "  }\n")
    lines[28] = lines[28].replace("alphah", "alpha")
    del lines[30]
    return "".join(lines)


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
    document = raff2urdf.loads(repaired_figure_5())
    assert (document.name, document.units) == ("MiniDelta", "mm")
    (robot,) = document.robots
    assert (robot.name, robot.path) == ("r1", "~/GKG/Models/delta-4/")
    assert robot.base == RaffBase(filenames=("platform.dxf",))
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
    assert document.units == unit
    assert document.metres(1500.0) == metres
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


def test_comments_run_to_the_end_of_their_line() -> None:
    text = 'RAFF test // name } {\nrobot r { // "\n//link 1\nlink 2 { type 2//3\npred 0 } }//'
    assert [link.number for link in raff2urdf.loads(text).robots[0].links] == [2]


def test_a_file_reads_as_its_text_does(tmp_path: Path) -> None:
    """Whatever its line ends, with or without a byte order mark."""
    for i, data in enumerate([b"\xef\xbb\xbfRAFF caf\xc3\xa9\r\nrobot r { }\r\n", "RAFF café\nrobot r { }".encode()]):
        (tmp_path / f"{i}.raff").write_bytes(data)
        assert raff2urdf.load(tmp_path / f"{i}.raff") == raff2urdf.loads("RAFF café robot r { }")


# --- what is wrong, where, and what it probably should be --------------------------------------------------------


def at(entry: tuple[str, int, int, str]) -> str:
    return entry[3].replace(" ", "-")


@pytest.mark.parametrize(("text", "line", "column", "words"), WRONG, ids=map(at, WRONG))
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
    text = """\
RAFF several
units inch
robot r {
  lnk 1 { type 2 pred 0 }
  link 2 { parameters { thetaa 3
                        alfa 2
                        d 5mm }
           type 9
           pred 0.5 }
  link 3 { type 2 pred 0 limits { 1e400 0 } }
}
robot s {
  fram 4 { pred 0 }
  link 5 { type 2 type 2 pred 0 }
}
"""
    words = ["inch", "lnk", "thetaa", "alfa", "5mm", "9", "0.5", "1e400", "fram", "2 pred 0 }\n}"]
    assert [problem.location and (problem.location.line, problem.location.column) for problem in problems_of(text)] == [
        (text[: text.index(word)].count("\n") + 1, text.index(word) - text.rfind("\n", 0, text.index(word)))
        for word in words
    ]


def test_everything_that_blocks_lack_is_reported_at_once() -> None:
    found = problems_of("RAFF t\nrobot r {\nlink 1 { }\nframe 2 { }\n}\nsensor 1 { }")
    assert [(problem.location.line, problem.message.split("'")[1]) for problem in found if problem.location] == [
        (3, "type"), (3, "pred"), (4, "pred"), (6, "port"),
    ]  # fmt: skip


@pytest.mark.parametrize("line", ["lnk 1 { type 2 pred 0 }", "link 1 { parameters { d x } }", "frame 1 { }"])
def test_a_file_full_of_errors_tells_the_first_hundred(line: str) -> None:
    """No one reads more, and nothing is gained by falling over the thousandth."""
    found = problems_of(f"RAFF t\nrobot r {{\n{5000 * (line + chr(10))}}}")
    assert len(found) == 100
    assert found[0].location is not None
    assert found[0].location.line <= 4


_SCRAPS = ["{", "}", "(", ")", '"', "/", "5", "1e999", "-", "link", "type", "robot", "RAFF", "d", "x", "\n", "\0", "é"]


@given(documents(most_parts=3), st.lists(st.tuples(st.floats(0, 1), st.integers(0, 12), st.sampled_from(_SCRAPS))))
@examples(150)
def test_whatever_is_done_to_a_text_it_is_a_document_or_an_error_with_its_place(
    document: Document, changes: list[tuple[float, int, str]]
) -> None:
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
        with pytest.raises(RaffError) as caught:
            raff2urdf.load(path)
        assert str(caught.value).startswith(f"{path}: can't be read: ")
