"""Write the page's types of messages, and for the site the tables of messages and files, from their schemas.

    python docs/protocols.py

On the site a table replaces each line "Schema: `MODULE.NAME`" of `docs/reference/protocol.md`. NAME is a Struct, whose
fields are listed, or a union of messages, each listed with its fields. Meanings are those in the docstrings.
"""

from __future__ import annotations

import importlib
import inspect
import json
import re
import textwrap
import typing
from collections.abc import Iterator
from pathlib import Path

import msgspec.inspect as mi
from msgspec import Struct

DOCS = Path(__file__).parent
TYPES = DOCS.parent / "cinegen/cockpit/static/base/messages.d.ts"
SCHEMA = re.compile(r"^Schema: `(\S+)`$", flags=re.MULTILINE)


def written(text: str) -> str:
    """Return a page with its tables."""
    return SCHEMA.sub(lambda schema: table(schema[1]), text)


def table(name: str) -> str:
    """Return the table of a schema by the name of its class or union."""
    module, _, attribute = name.rpartition(".")
    schema = getattr(importlib.import_module(module), attribute)
    messages = typing.get_args(schema)
    if not messages:
        rows = [("field", "type", "meaning"), *_fields(schema)]
    else:
        tag = messages[0].__struct_config__.tag_field
        rows = [("message" if tag == "type" else tag, "field", "type", "meaning")]
        for message in messages:
            rows.append((f"`{message.__struct_config__.tag}`", "", "", _summary(message)))
            rows += [("", *row) for row in _fields(message)]
    lines = [f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |" for row in rows]
    return "\n".join([lines[0], "|" + " --- |" * len(rows[0]), *lines[1:]])


def meanings(struct: type[Struct]) -> dict[str, str]:
    """Return what the docstring of a Struct says about each of its own fields."""
    _, _, section = inspect.cleandoc(struct.__doc__ or "").partition("Attributes:\n")
    attributes = re.findall(r"^ {4}(\w+): ((?:.|\n {8})*)", section, flags=re.MULTILINE)
    texts = {name: re.sub(r"\bNone\b", "null", re.sub(r"\s+", " ", text).strip()) for name, text in attributes}
    return {name: text if ". " in text else text.rstrip(".") for name, text in texts.items()}


def _summary(struct: type[Struct]) -> str:
    text = inspect.cleandoc(struct.__doc__ or "").partition("\n\n")[0]
    return re.sub(r"\s+", " ", text)


def _fields(struct: type[Struct]) -> Iterator[tuple[str, ...]]:
    """Yield name, type and meaning of each field that the Struct's own docstring documents."""
    known = meanings(struct)
    for field in mi.type_info(struct).fields:
        if field.name in known:
            yield f"`{field.encode_name}`" + ("" if field.required else "?"), kind_of(field.type), known[field.name]


def kind_of(info: mi.Type) -> str:
    """Return a type in words."""
    match info:
        case mi.IntType() | mi.FloatType():
            low, high = info.ge, info.le
            word = "integer" if isinstance(info, mi.IntType) else "number"
            return word if low is None or high is None else f"{word} {low:,g} to {high:,g}"
        case mi.StrType():
            return "string"
        case mi.BoolType():
            return "boolean"
        case mi.NoneType():
            return "null"
        case mi.EnumType():
            return " or ".join(f'"{member.value}"' for member in info.cls)
        case mi.LiteralType():
            return " or ".join(f'"{value}"' if isinstance(value, str) else str(value) for value in info.values)
        case mi.UnionType():
            return " or ".join(dict.fromkeys(_family(info, member) or kind_of(member) for member in info.types))
        case mi.TupleType():
            first, *_ = kinds = [kind_of(element) for element in info.item_types]
            if set(kinds) == {first}:
                return f"{len(kinds)} lists of {first}" if "list" in first else f"list of {len(kinds)} {plural(first)}"
            return f"[{', '.join(kinds)}]"
        case mi.VarTupleType() | mi.ListType() | mi.FrozenSetType():
            return f"list of {plural(kind_of(info.item_type))}"
        case mi.DictType():
            return f"object of {plural(kind_of(info.value_type))}"
        case mi.StructType():
            return info.cls.__name__
        case mi.CustomType():
            return "pose" if info.cls.__name__ == "SE3" else "list of numbers"
        case mi.AnyType():
            return "value"
    raise TypeError(f"no words for {info}")


def _family(union: mi.UnionType, member: mi.Type) -> str:
    """Return the name of the base that several Structs of a union share; empty for any other type of it."""
    several = sum(isinstance(other, mi.StructType) for other in union.types) > 1
    return str(member.cls.__base__.__name__) if several and isinstance(member, mi.StructType) else ""


def plural(kind: str) -> str:
    """Return the plural of a type."""
    noun, space, rest = kind.partition(" ")
    ending = "" if noun in ("list", "object") else "es" if noun.endswith(("s", "ch")) else "s"
    return noun + ending + space + rest


def types() -> str:
    """Return the TypeScript types of the messages between the server and the page."""
    from cinegen.cockpit import map_messages, messages

    known: dict[str, str] = {}
    for union in ("ClientMessage", "ServerMessage"):
        names = [_type(mi.type_info(message), known) for message in typing.get_args(getattr(messages, union))]
        known[union] = f"export type {union} = {' | '.join(names)};"
    for struct in (map_messages.MapDescription, map_messages.MapCell):
        _type(mi.type_info(struct), known)
    head = "// Types of the messages between the server and the page. Generated by docs/protocols.py: don't edit."
    lines = [textwrap.fill(text, 120, subsequent_indent="  ", break_on_hyphens=False) for text in known.values()]
    return "\n".join([head, "", *lines]) + "\n"


def _type(info: mi.Type, known: dict[str, str], field: str = "") -> str:
    """Return a type in TypeScript; interfaces are added to those that are known."""
    match info:
        case mi.IntType() | mi.FloatType():
            return "number"
        case mi.StrType():
            return "string"
        case mi.BoolType():
            return "boolean"
        case mi.NoneType():
            return "null"
        case mi.LiteralType():
            return " | ".join(json.dumps(value) for value in info.values)
        case mi.EnumType():
            return " | ".join(json.dumps(member.value) for member in info.cls)
        case mi.UnionType():
            for name in {_family(info, member) for member in info.types} - {"", *known}:
                known[name] = ""
                members = [_type(member, known) for member in info.types if _family(info, member) == name]
                known[name] = f"export type {name} = {' | '.join(members)};"
            return " | ".join(dict.fromkeys(_family(info, member) or _type(member, known) for member in info.types))
        case mi.TupleType():
            return f"[{', '.join(_type(element, known) for element in info.item_types)}]"
        case mi.VarTupleType() | mi.ListType() | mi.FrozenSetType():
            item = _type(info.item_type, known)
            return f"({item})[]" if "|" in item else f"{item}[]"
        case mi.DictType():
            return f"Record<string, {_type(info.value_type, known)}>"
        case mi.CustomType():
            return "number[][]" if field in ("path", "axes") else "number[]"
        case mi.StructType():
            name = info.cls.__name__
            if name not in known:
                known[name] = ""
                tag = [] if info.tag is None else [f"{info.tag_field}: {json.dumps(info.tag)}"]
                fields = [
                    f"{member.encode_name}{'' if member.required else '?'}: {_type(member.type, known, member.name)}"
                    for member in info.fields
                ]
                known[name] = f"export interface {name} {{ {'; '.join(tag + fields)} }}"
            return name
    raise TypeError(f"no type for {info}")


if __name__ == "__main__":
    TYPES.write_text(types(), encoding="utf-8")
