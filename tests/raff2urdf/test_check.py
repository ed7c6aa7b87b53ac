"""Checks beyond the grammar: parents, numbers, names, limits, and constraints on what does not exist."""

import warnings
from dataclasses import replace

import pytest
from hypothesis import given
from strategies import documents, examples
from wrong_raff import ONE, assert_in_order, text_of
from wrong_raff import WRONG_BODIES as WRONG

import raff2urdf
from raff2urdf import RaffError, RaffWarning
from raff2urdf.errors import Problem
from raff2urdf.raff.document import Document, JointType, RaffFrame, RaffLink, RaffParameters, RaffRobot
from raff2urdf.raff.reader import parse


def problems_of(text: str) -> tuple[Problem, ...]:
    with pytest.raises(RaffError) as caught:
        raff2urdf.check(raff2urdf.loads(text))
    return caught.value.problems


def warnings_of(text: str) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        raff2urdf.check(raff2urdf.loads(text))
    assert all(warning.category is RaffWarning for warning in caught)
    return [str(warning.message) for warning in caught]


@given(documents(least_robots=1))
@examples(60)
def test_a_document_without_faults_passes(document: Document) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RaffWarning)
        raff2urdf.check(document)


def at(entry: tuple[str, int, int, str]) -> str:
    return entry[3].replace(" ", "-")


@pytest.mark.parametrize(("body", "line", "column", "words"), WRONG, ids=map(at, WRONG))
def test_a_fault_is_named_where_it_stands(body: str, line: int, column: int, words: str) -> None:
    (problem,) = problems_of(text_of(body))
    assert_in_order(words, problem.message)
    assert problem.location is not None
    assert (problem.location.line, problem.location.column) == (line, column)


@pytest.mark.parametrize(
    ("text", "column", "what"),
    [
        ("RAFF t\nrobot a { }\nrobot b { }\nrobot a { }", 7, "robot 'a'"),
        ('RAFF t\nsensor 1 { port "a" }\nrobot r { }\nsensor 1 { port "b" }', 8, "sensor 1"),
    ],
)
def test_a_name_or_number_that_is_taken_is_refused_where_it_stands(text: str, column: int, what: str) -> None:
    (problem,) = problems_of(text)
    assert problem.location is not None
    assert (problem.location.line, problem.location.column) == (4, column)
    assert problem.message == f"{what} is defined twice, first on line 2: change one of them"


@pytest.mark.parametrize("name", ["4bar", '"left arm"', '""', "-r"])
def test_a_robots_name_must_be_one_that_xml_takes(name: str) -> None:
    (problem,) = problems_of(f"RAFF t\nrobot {name} {{ }}")
    assert "can't name a robot" in problem.message


def test_an_unknown_sensor_is_answered_with_those_that_exist() -> None:
    text = text_of(f"{ONE}\nconstraint {{ link 1 sensor ( 3 ) }}", 'sensor 7 { port "a" } sensor 2 { port "b" }')
    assert problems_of(text)[0].message == "sensor 3 is not declared (declared: 2, 7)"


@pytest.mark.parametrize("length", [1, 3000])
def test_a_cycle_of_parents_is_one_fault_however_long(length: int) -> None:
    ring = [RaffLink(i, RaffParameters(), JointType.REVOLUTE, 1 + i % length) for i in range(1, length + 1)]
    on_it = [RaffFrame(length + i, RaffParameters(), i) for i in range(1, length + 1)]
    with pytest.raises(RaffError) as caught:
        raff2urdf.check(Document("t", (RaffRobot("r", parts=(*on_it, *ring)),)))
    (problem,) = caught.value.problems
    assert "link 1 is part of a cycle of parents: 1 -> " in problem.message
    assert len(problem.message) < 200


def test_all_faults_are_reported_at_once_in_the_order_of_the_text() -> None:
    body = "\n".join(
        ["link 1 { type 2 pred 9 limits { 2 1 } }", ONE, "link 3 { type 2 pred 3 }", "constraint { base link 8 }"]
    )
    with pytest.raises(RaffError) as caught:
        raff2urdf.check(parse(text_of(body, "robot r { }")))
    assert [problem.location and problem.location.line for problem in caught.value.problems] == [3, 3, 4, 5, 6, 8]


# --- understood, but probably not meant --------------------------------------------------------------------------


@pytest.mark.parametrize(("link", "column", "words"), [
    ("type 0 pred 0 limits { 0 90 }", 33, "link 1 is fixed limits"),
    ("type 0 pred 0 velocity 90", 33, "link 1 is fixed velocity"),
    ("type 0 pred 0 actuated 1", 33, "link 1 is fixed actuate"),
    ("type 0 pred 0 effort 5", 31, "link 1 is fixed effort"),
    ("type 0 pred 0 armature 5", 33, "link 1 is fixed armature"),
    ("type 0 pred 0 damping 5", 32, "link 1 is fixed damping"),
    ("type 0 pred 0 friction 5", 33, "link 1 is fixed friction"),
    ("type 2 pred 0 effort 5 actuated 0", 31, "link 1 is passive effort 'actuated 1'"),
    ("joint ball pred 0 variable y { effort 5 }", 48, "variable y of link 1 is passive effort"),
    ("parameters { theta 95 } type 2 pred 0 limits { 0 90 }", 57, "link 1 95 outside limits"),
    ("parameters { r -9 } type 1 pred 0 limits { 0 90 }", 53, "link 1 -9 outside limits"),
])  # fmt: skip
def test_what_is_probably_not_meant_is_a_warning_with_its_place(link: str, column: int, words: str) -> None:
    (warning,) = warnings_of(text_of(f"link 1 {{ {link} }}"))
    assert warning.startswith(f"<text>:3:{column}: ")
    for word in words.split():
        assert word in warning


def test_a_robot_of_some_mm_must_state_its_units() -> None:
    links = " link 1 { type 2 pred 0 parameters { d 0.4 } }\n frame 2 { pred 1 parameters { d 1.2 } }\n"
    begin, end = "RAFF x\n", f"robot r {{\n{links}}}\n"
    with pytest.raises(raff2urdf.RaffError, match=r"<text>:4:.*1\.2 mm: did you mean metres\? Write 'units m'"):
        raff2urdf.check(raff2urdf.loads(begin + end))
    for units in ("units mm\n", "units m\n", "units um\n"):
        raff2urdf.check(raff2urdf.loads(begin + units + end))
    small = replace(raff2urdf.loads(begin + end), states_units=True)  # as a program would make it
    again = raff2urdf.loads(raff2urdf.dumps(small))
    assert again.states_units
    assert again == small
    raff2urdf.check(again)
