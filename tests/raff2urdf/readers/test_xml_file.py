"""XML as robots are published in; what could make a program read what it must not is refused."""

import pytest

from raff2urdf.errors import RaffError
from raff2urdf.readers.xml_file import parse_xml, read_text


@pytest.mark.parametrize("text", [
    "<robot><drake:joint drake:name='x'/><link/></robot>", "<robot><plugin gz::kind='x'/><link/></robot>",
    "<robot><!-- a -- b --><link/></robot>", "\n  <?xml version='1.0'?><robot><link/></robot>",
    "<?xml version='0.0'?><robot><link/></robot>",
    "\ufeff<?xml version='1.0' encoding='utf-16'?><robot><link/></robot>",
    "<robot xmlns='http://drake.mit.edu'><link/></robot>",
])  # fmt: skip
def test_what_can_mean_only_one_thing_is_read(text):
    tree = parse_xml(text, "x")
    assert tree.tag == "robot"
    assert tree.find("link") is not None


@pytest.mark.parametrize(("text", "says"), [
    ("", "x:1: invalid XML"),
    ("<robot>\n<link>\n</robot>", r"x:3: invalid XML: Opening and ending tag mismatch"),
    ("<robot/><robot/>", "x:1: invalid XML: Extra content"),
    ("<robot>\n" + 10_000 * "<a>" + 10_000 * "</a>" + "</robot>", "x:2: invalid XML: Excessive depth"),
    ("<!DOCTYPE r [<!ENTITY a 'ha'><!ENTITY b '&a;&a;'>]><r>&b;</r>", "x:1: the entity 'a' is not read"),
    ("<!DOCTYPE r [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><r>&a;</r>", "x:1: the entity 'a' is not read"),
    ("<!DOCTYPE r SYSTEM 'x.dtd'><r>\n&b;</r>", r"x:\d: the entity 'b' is not read"),
    ("<r xmlns:xi='http://www.w3.org/2001/XInclude'>\n<xi:include href='/etc/passwd'/></r>",
     "x:2: '/etc/passwd' by XInclude is not read"),
])  # fmt: skip
def test_what_is_wrong_is_told_by_its_line(text, says):
    with pytest.raises(RaffError, match=says):
        parse_xml(text, "x")


def test_a_text_is_read_in_the_encoding_that_it_says(tmp_path):
    path = tmp_path / "a.xml"
    for content in (
        "<r a='\xe9'/>".encode(),
        b"\xef\xbb\xbf" + "<r a='\xe9'/>".encode(),
        "<r a='\xe9'/>".encode("utf-16"),
        b"<?xml version='1.0' encoding='ISO-8859-1'?><r a='\xe9'/>",
    ):
        path.write_bytes(content)
        assert parse_xml(read_text(path), "x").get("a") == "\xe9"


@pytest.mark.parametrize(("content", "says"), [
    (b"<r>\n\xe9</r>", r":2: this is not text in utf-8: save the file as UTF-8"),
    (b"<?xml version='1.0' encoding='klingon'?><r/>", r":1: unknown encoding 'klingon'"),
    (b"<?xml version='1.0' encoding='hex'?><r/>", r":1: unknown encoding 'hex'"),
])  # fmt: skip
def test_an_encoding_that_is_none_is_told(content, says, tmp_path):
    path = tmp_path / "a.xml"
    path.write_bytes(content)
    with pytest.raises(RaffError, match=says):
        read_text(path)
