"""The tables of messages and files in the docs are those of the schemas."""

import re

import msgspec.inspect
import pytest
from repository import module_of


@pytest.fixture(scope="module")
def protocols():
    return module_of("docs/protocols.py")


def test_every_schema_of_the_reference_is_a_table_on_the_site(protocols, root):
    text = (root / "docs/reference/protocol.md").read_text(encoding="utf-8")
    assert len(protocols.SCHEMA.findall(text)) > 40
    assert "Schema:" not in protocols.written(text).partition("## The websocket")[2]


def test_the_types_of_the_page_are_generated(protocols):
    assert protocols.types() == protocols.TYPES.read_text(encoding="utf-8"), "run python docs/protocols.py"


def test_every_field_is_documented(protocols):
    import typing

    from cinegen.cockpit import messages
    from cinegen.devices import reading_json
    from cinegen.mission import file_format
    from cinegen.session import commands, report, state

    for module in (file_format, reading_json, commands, messages, report, state):
        for name, struct in vars(module).items():
            if isinstance(struct, type) and issubclass(struct, msgspec.Struct) and re.match("[A-Z]", name):
                known = {field for base in struct.__mro__[:-2] for field in protocols.meanings(base)}
                fields = {field.name for field in msgspec.inspect.type_info(struct).fields}
                assert fields <= known | typing.get_type_hints(object).keys(), name
