"""What is written reads back as the same document."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import documents, examples, layouts

import raff2urdf
from raff2urdf.raff.document import (
    Document,
    JointType,
    RaffLink,
    RaffParameters,
    RaffRobot,
    RaffSensor,
    SensorConstraint,
)


@given(documents())
@examples(80)
def test_what_is_written_reads_back_as_the_same_document(document: Document) -> None:
    assert raff2urdf.loads(raff2urdf.dumps(document)) == document


@given(documents(least_robots=1), st.data())
@examples(40)
def test_white_space_and_comments_mean_nothing(document: Document, data: st.DataObject) -> None:
    text = raff2urdf.dumps(document)
    assert raff2urdf.loads(data.draw(layouts(text))) == document


@pytest.mark.parametrize("name", ["robot", "3RRR", "a b", "", "-1", "a//b", "{", "Tête à tête", ".5"])
def test_a_file_may_bear_any_name(name: str) -> None:
    assert raff2urdf.loads(raff2urdf.dumps(Document(name))).name == name


@pytest.mark.parametrize("wrong", ['a "b"', "a\nb"])
@pytest.mark.parametrize("where", ["document", "path", "name", "filename", "port"])
def test_a_text_that_raff_cannot_hold_is_refused(wrong: str, where: str) -> None:
    link = RaffLink(1, RaffParameters(), JointType.FIXED, 0)
    document = {
        "document": lambda: Document(wrong),
        "path": lambda: Document("x", (RaffRobot("r", path=wrong),)),
        "name": lambda: Document("x", (RaffRobot("r", parts=(replace(link, name=wrong),)),)),
        "filename": lambda: Document("x", (RaffRobot("r", parts=(replace(link, filenames=(wrong,)),)),)),
        "port": lambda: Document("x", sensors=(RaffSensor(1, wrong),)),
    }[where]()
    with pytest.raises(raff2urdf.RaffError, match="quotation mark or a line's end"):
        raff2urdf.dumps(document)


@pytest.mark.parametrize("wrong", [math.inf, -math.inf, math.nan])
def test_a_number_that_raff_cannot_hold_is_refused(wrong: float) -> None:
    link = RaffLink(1, RaffParameters(d=wrong), JointType.REVOLUTE, 0)
    with pytest.raises(raff2urdf.RaffError):
        raff2urdf.dumps(Document("x", (RaffRobot("r", parts=(link,)),)))


@pytest.mark.parametrize("what", ["graphics", "sensors"])
def test_a_long_list_is_written_so_that_it_can_be_read(what: str) -> None:
    """The reader takes no line of over 10,000 characters."""
    if what == "graphics":
        link = RaffLink(
            1, RaffParameters(), JointType.FIXED, 0, filenames=tuple(f"part-{i:04}.stl" for i in range(1000))
        )
        document = Document("x", (RaffRobot("r", parts=(link,)),))
    else:
        sensors = tuple(RaffSensor(number, "port") for number in range(1, 3001))
        chosen = SensorConstraint(0, tuple(sensor.number for sensor in sensors))
        document = Document("x", (RaffRobot("r", sensor_constraints=(chosen,)),), sensors)
    assert raff2urdf.loads(raff2urdf.dumps(document)) == document
