"""Mutate files. Every mutation is a function `(rng, data, words) -> data`; what a format knows is data: its words, and
for RAFF the tables of its grammar.

Mutations of a tree (XML, JSON, YAML, RAFF) leave a file that parses, so that they reach what is behind the parser;
those of bytes, words and lines attack the parser. A file that a mutation can't parse is mutated by words instead.
"""

import json
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import accumulate
from random import Random
from typing import Any

import yaml
from lxml import etree

from raff2urdf.raff.syntax import STATEMENTS
from raff2urdf.raff.tokens import tokens

Words = Sequence[str]
Mutation = Callable[[Random, bytes, Words], bytes]

NUMBERS = (
    *("0", "-0", "1", "-1", "2", "0.5", "-0.25", "3.141592653589793", "90", "1e-9", "1e-300", "5e-324", "1e6", "1e16"),
    *("1e150", "-1e308", "1.7976931348623157e308", "1e309", "1e400", "-1e400", "nan", "NaN", "inf", "-inf", "Infinity"),
    *("9" * 25, "9" * 400, "0x10", "1_000", "1,5", "1e", "--1", "+-2", "१", "²", "1 2", "", " ", "None", "true"),
    "4294967296",
)
"""Numbers, and words in places of numbers, at which readers go wrong."""

SNIPPETS = (
    b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\xc3", b"\r", b"\x0b\x0c", b"\xe2\x80\xae", b"\x1b[31m",
    b"<!--", b"-->", b"<![CDATA[", b"]]>", b"<?xml version='1.0' encoding='utf-16'?>", b"<x/>", b"&#0;", b"&x;",
    b"<!DOCTYPE a [<!ENTITY x SYSTEM 'file:///etc/hostname'>]>",
    b"<!DOCTYPE a [<!ENTITY x 'xxxxxxxxxx'><!ENTITY y '&x;&x;&x;&x;&x;&x;&x;&x;&x;&x;'>]>",
    b"{", b"}", b"[", b"]", b"(", b")", b'"', b"'", b"//", b"#", b"\\u0000", b"\\ud83d", b"*a", b"&a ",
    b"!!python/object:os.system",
    b"[" * 2000, b"{\"a\":" * 2000, b"<a>" * 2000, b"${1/0}", b"${'a'*10**6}", b"$(find x)", b"../" * 20, b"a" * 5000,
)  # fmt: skip

_NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[\w.+-]+")


# --- bytes, words, lines -----------------------------------------------------------------------------------------


def change_bytes(rng: Random, data: bytes, _: Words) -> bytes:
    """Flip, delete, insert, repeat or exchange bytes, or cut the end off."""
    if not data:
        return rng.randbytes(rng.randint(1, 20))
    i = rng.randrange(len(data))
    j = min(len(data), i + rng.choice((1, 1, 2, 4, 16, 64, 256)))
    kind = rng.randrange(6)
    if kind == 0:
        return data[:i] + bytes([data[i] ^ (1 << rng.randrange(8))]) + data[i + 1 :]
    if kind == 1:
        return data[:i] + data[j:]
    if kind == 2:
        return data[:i] + (rng.choice(SNIPPETS) if rng.random() < 0.7 else rng.randbytes(j - i)) + data[i:]
    if kind == 3:
        return data[:i] + data[i:j] * rng.choice((2, 3, 50)) + data[j:]
    if kind == 4:
        k = rng.randrange(len(data))
        return data[:i] + data[k : k + j - i] + data[j:]
    return data[:i]


def change_number(rng: Random, data: bytes, _: Words) -> bytes:
    """Replace a number of the text."""
    return _replace(rng, data, _NUMBER, lambda number: _number(rng, number.decode()).encode())


def change_word(rng: Random, data: bytes, words: Words) -> bytes:
    """Replace a word by another word of the text or of the format, or misspell it."""

    def other(word: bytes) -> bytes:
        kind = rng.randrange(3)
        if kind == 0:
            return rng.choice([match[0] for match in _some(rng, _WORD, data)] or [b"x"])
        return rng.choice(words).encode() if kind == 1 and words else misspelt(rng, word.decode("latin-1")).encode()

    return _replace(rng, data, _WORD, other)


def change_lines(rng: Random, data: bytes, _: Words) -> bytes:
    """Delete, repeat, exchange or join lines."""
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(4)
    if kind == 0:
        del lines[i : i + rng.choice((1, 1, 3, 10))]
    elif kind == 1:
        lines[j:j] = lines[i : i + rng.choice((1, 1, 5))]
    elif kind == 2:
        lines[i], lines[j] = lines[j], lines[i]
    else:
        lines[i : i + 2] = [b"".join(lines[i : i + 2])]
    return b"\n".join(lines)


def misspelt(rng: Random, word: str) -> str:
    """Return a word with a letter exchanged, doubled, lost, in the other case, or with a letter more."""
    if not word:
        return "x"
    i = rng.randrange(len(word))
    return rng.choice((
        word[:i] + word[i + 1 : i + 2] + word[i] + word[i + 2 :], word[:i] + word[i] + word[i:],
        word[:i] + word[i + 1 :], word.swapcase(), word + "s", word + " ", "x:" + word, word.replace("_", "-"),
    ))  # fmt: skip


def _number(rng: Random, text: str) -> str:
    if rng.random() < 0.5:
        with suppress(ValueError):
            value = float(text)
            near = (value + 1e-9, value * (1 + 1e-6), value + 1.0)
            return repr(rng.choice((-value, value * 1000.0, value / 1000.0, value * 1e9, *near)))
    return rng.choice(NUMBERS)


def _some(rng: Random, pattern: re.Pattern[bytes], data: bytes) -> list[re.Match[bytes]]:
    """Return the matches in a window of the data: files may be long."""
    start = rng.randrange(max(1, len(data) - 4000))
    return list(pattern.finditer(data, start, start + 4000))


def _replace(rng: Random, data: bytes, pattern: re.Pattern[bytes], new: Callable[[bytes], bytes]) -> bytes:
    matches = _some(rng, pattern, data)
    if not matches:
        return change_bytes(rng, data, ())
    match = rng.choice(matches)
    return data[: match.start()] + new(match[0]) + data[match.end() :]


def _parsed(parse: Callable[[bytes], Any]) -> Callable[[bytes], Any]:
    """Return a function that returns what a text holds, and None of one that can't be parsed."""

    def parsed(data: bytes) -> Any:
        with suppress(etree.XMLSyntaxError, yaml.YAMLError, ValueError, RecursionError):
            return parse(data)

    return parsed


_XML = etree.XMLParser(resolve_entities=False, recover=False, huge_tree=False)
_xml = _parsed(lambda data: etree.fromstring(data, _XML))
_json = _parsed(json.loads)
_yaml = _parsed(yaml.safe_load)


def _shuffle(rng: Random, table: Any) -> None:
    """Change the order of a table's entries."""
    items = list(table.items())
    rng.shuffle(items)
    table.clear()
    table.update(items)


# --- XML ---------------------------------------------------------------------------------------------------------


def change_xml(rng: Random, data: bytes, words: Words) -> bytes:
    """Delete, repeat, move, nest or rename an element, or change one of its attributes or its text."""
    root = _xml(data)
    if root is None:
        return change_word(rng, data, words)
    nodes = [node for node in root.iter() if isinstance(node.tag, str)]
    node, other = rng.choice(nodes), rng.choice(nodes)
    parent = node.getparent()
    kind = rng.randrange(8)
    if kind < 4:
        others = [element for element in nodes if element.attrib] or nodes
        _change_attribute(rng, node if node.attrib else rng.choice(others), words)
    elif kind == 4 or parent is None:
        node.tag = _tag(rng, node.tag, words)
    elif kind == 5:
        parent.remove(node)
    elif kind == 6:
        copied = etree.fromstring(etree.tostring(node, with_tail=False))
        (other if rng.random() < 0.4 else parent).append(copied)
        if rng.random() < 0.5:
            _change_attribute(rng, copied, words)
    else:
        word = rng.choice(words) if words else "x"
        node.text = rng.choice((_number(rng, node.text or ""), word, "", "1 2", "0 0 0 0 0 0 0"))
    return etree.tostring(root)


def misspell_xml(rng: Random, data: bytes, words: Words) -> bytes:
    """Misspell the name of an element or an attribute."""
    root = _xml(data)
    if root is None:
        return data
    nodes = [node for node in root.iter() if isinstance(node.tag, str) and node is not root]
    node = rng.choice(nodes)
    if node.attrib and rng.random() < 0.5:
        name = rng.choice(list(node.attrib))
        value = node.attrib.pop(name)
        node.set(_tag(rng, name, ()), value)
    else:
        node.tag = _tag(rng, node.tag, ())
    return etree.tostring(root)


def relayout_xml(rng: Random, data: bytes, _: Words) -> bytes:
    """Change comments, blanks and the order of attributes: nothing that means anything."""
    root = _xml(data)
    if root is None:
        return data
    for node in [node for node in root.iter() if isinstance(node.tag, str)]:
        _shuffle(rng, node.attrib)
        if len(node) and not (node.text or "").strip():
            node.insert(rng.randint(0, len(node)), etree.Comment(" of no meaning "))
            node.text = " \n\t "
    return etree.tostring(root, encoding="utf-8", xml_declaration=rng.random() < 0.5) + b"\n"


def _tag(rng: Random, name: str, words: Words) -> str:
    new = rng.choice(words) if words and rng.random() < 0.5 else misspelt(rng, name.rpartition("}")[2])
    new = re.sub(r"[^\w.-]", "_", new)
    return new if re.match(r"[A-Za-z_]", new) else f"x{new}"


def _change_attribute(rng: Random, node: Any, words: Words) -> None:
    name = rng.choice([*node.attrib, *(["name"] if rng.random() < 0.2 else [])] or ["name"])
    value, kind = node.get(name, ""), rng.randrange(5)
    if kind == 0:
        node.attrib.pop(name, None)
    elif kind == 1:
        node.set(_tag(rng, rng.choice(words) if words else "x", ()), value)
    elif kind == 2 and words:
        node.set(name, rng.choice(words))
    else:
        parts = value.split(" ")
        i = rng.randrange(len(parts))
        parts[i] = _number(rng, parts[i]) if rng.random() < 0.8 else misspelt(rng, parts[i])
        node.set(name, " ".join(parts if rng.random() < 0.8 else parts[1:]))


# --- JSON and YAML -----------------------------------------------------------------------------------------------


def change_json(rng: Random, data: bytes, words: Words) -> bytes:
    """Change a value or a key of a JSON text."""
    values = _json(data)
    if values is None:
        return change_word(rng, data, words)
    text = json.dumps(_changed(rng, values, words))
    if rng.random() < 0.15:  # a number that Python's json would not write; a key twice
        text = re.sub(r"-?\d+\.\d+", lambda match: rng.choice((match[0], "1e400", "1e999", "-0.0")), text, count=3)
    if rng.random() < 0.1 and isinstance(values, dict) and values:
        key = rng.choice(list(values))
        text = f"{text[:-1]}, {json.dumps(key)}: {json.dumps(rng.choice(([], {}, None, 0, values[key])))}}}"
    return text.encode()


def misspell_json(rng: Random, data: bytes, _: Words) -> bytes:
    """Misspell a key, or give it twice, first as it is and then without a value."""
    values = _json(data)
    if not isinstance(values, dict):
        return data
    table = rng.choice([container for container in _containers(values) if isinstance(container, dict) and container])
    key = rng.choice(list(table))
    if table is values and rng.random() < 0.5:
        return f"{json.dumps(values)[:-1]}, {json.dumps(key)}: {rng.choice(('[]', 'null', '{}'))}}}".encode()
    table[misspelt(rng, key)] = table.pop(key)
    return json.dumps(values).encode()


def relayout_json(rng: Random, data: bytes, _: Words) -> bytes:
    """Change blanks and the order of keys."""
    values = _json(data)
    if values is None:
        return data
    for table in _containers(values):
        if isinstance(table, dict):
            _shuffle(rng, table)
    return json.dumps(values, indent=rng.choice((None, 0, 3, "\t"))).encode()


def change_yaml(rng: Random, data: bytes, words: Words) -> bytes:
    """Change a value or a key of a YAML text."""
    values = _yaml(data)
    if isinstance(values, (dict, list)):
        with suppress(yaml.YAMLError, RecursionError):
            return yaml.safe_dump(_changed(rng, values, words), allow_unicode=True).encode("utf-8", "replace")
    return change_word(rng, data, words)


def misspell_yaml(rng: Random, data: bytes, _: Words) -> bytes:
    """Misspell a key."""
    values = _yaml(data)
    key = rng.choice(list(values))
    values[misspelt(rng, key)] = values.pop(key)
    return yaml.safe_dump(values).encode()


def relayout_yaml(rng: Random, data: bytes, _: Words) -> bytes:
    """Change the style of lists and tables, and the order of keys."""
    return b"# of no meaning\n" + yaml.safe_dump(_yaml(data), default_flow_style=rng.random() < 0.5).encode()


def _containers(values: Any) -> list[Any]:
    containers, left = [], [values]
    while left and len(containers) < 2000:
        container = left.pop()
        if isinstance(container, (dict, list)):
            containers.append(container)
            left += container.values() if isinstance(container, dict) else container
    return containers


def _changed(rng: Random, values: Any, words: Words) -> Any:
    containers = [container for container in _containers(values) if container]
    if not containers:
        return rng.choice(([], {}, None, 1))
    table = rng.choice(containers)
    key = rng.choice(list(table)) if isinstance(table, dict) else rng.randrange(len(table))
    kind, value = rng.randrange(8), table[key]
    if kind == 0:
        del table[key]
    elif kind == 1 and isinstance(table, list):
        table.insert(rng.randrange(len(table)), value)
    elif kind == 1:
        table[rng.choice(words) if words else "x"] = value
    elif kind == 2 and isinstance(table, dict):
        table[misspelt(rng, str(key))] = table.pop(key)
    elif kind == 3:
        numbers = (0, -1, 1e308, -1e308, 2**63, 10**30)
        table[key] = rng.choice((None, True, [], {}, "", "x", *numbers, [value], {"x": value}, "\ud83d"))
    elif kind == 4:
        other = rng.choice(containers)
        holds = any(container is table for container in _containers(other))
        table[key] = other if rng.random() < 0.3 and not holds else rng.choice(words or ("x",))
    elif kind == 5 and isinstance(value, str):
        table[key] = misspelt(rng, value)
    elif kind == 6 and isinstance(table, list):
        rng.shuffle(table)
    elif isinstance(value, (int, float)):
        table[key] = text = _number(rng, repr(value))
        with suppress(ValueError):
            table[key] = float(text) if rng.random() < 0.9 else text
    else:
        table[key] = rng.choice(words or ("x",))
    return values


# --- RAFF --------------------------------------------------------------------------------------------------------


def change_raff(rng: Random, data: bytes, _: Words) -> bytes:
    """Delete, repeat or move a statement, or insert one that the grammar has."""
    statements = _statements(data)
    if len(statements) < 2:
        return change_word(rng, data, ())
    text, (start, end, block) = data.decode(), rng.choice(statements)
    kind = rng.randrange(4)
    if kind == 0:
        return (text[:start] + text[end:]).encode()
    if kind == 1:
        at = rng.choice(statements)[rng.randrange(2)]
        return (text[:at] + " " + text[start:end] + " " + text[at:]).encode()
    if kind == 2:
        return (text[:start] + statement(rng, block) + text[end:]).encode()
    return (text[:start] + statement(rng, block) + " " + text[start:]).encode()


def relayout_raff(rng: Random, data: bytes, _: Words) -> bytes:
    """Change blanks and comments."""
    head, *lines = data.decode().splitlines()
    parts = [[token.text for token in tokens([line]) if token.kind != "END"] for line in lines]
    blanks = ("\n", "  ", "\t", " // of no meaning {\n")
    return (head + "\n" + "".join(word + rng.choice(blanks) for line in parts for word in line) + "\n").encode()


def misspell_raff(rng: Random, data: bytes, _: Words) -> bytes:
    """Misspell a word."""
    text, statements = data.decode(), _statements(data)
    start = rng.choice(statements)[0]
    word = re.match(r"\w*", text[start:])[0]
    return (text[:start] + misspelt(rng, word) + text[start + len(word) :]).encode()


def statement(rng: Random, block: str, depth: int = 3) -> str:
    """Return a random statement of a kind of block, as the grammar has it."""
    known = STATEMENTS.get(block) or STATEMENTS["robot"]
    word = rng.choice(list(known))
    parts = [word]
    for follow in known[word].follows.split():
        for _ in range(rng.choice((1, 1, 2, 7)) if follow[-1] in "+*" else 1):
            parts.append(_token(rng, follow.rstrip("+*")))
    if known[word].follows.endswith("{"):
        parts += [statement(rng, word, depth - 1) for _ in range(rng.randint(0, 4) if depth else 0)] + ["}"]
    return " ".join(parts)


def _token(rng: Random, kind: str) -> str:
    if kind == "NUMBER":
        return rng.choice(
            NUMBERS if rng.random() < 0.2 else ["0", "1", "2", "3", "4", "5", "9", "-30", "90", "120.5", "300"]
        )
    if kind in ("STRING", "NAME"):
        return rng.choice(('"a b"', '""', '"../x.stl"', '"é"', '"<&>"', "r1" if kind == "NAME" else '"r1"'))
    return rng.choice(("ball", "planar", "universal", "x", "y", "z", "m", "mm", "phi")) if kind == "WORD" else kind


def _statements(data: bytes) -> list[tuple[int, int, str]]:
    """Return the start and end of each statement, and the kind of the block that it is in."""
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return []
    lines = text.split("\n")
    starts = list(accumulate((len(line) + 1 for line in lines), initial=0))
    statements: list[tuple[int, int, str]] = []
    opened: list[tuple[str, int]] = [("", 0)]  # kind of block, start of its present statement
    word, last = "", 0
    for token in tokens(lines):
        if token.line == 1:
            continue
        block, start = opened[-1]
        is_word = token.text in STATEMENTS.get(block, ())
        if start and (is_word or token.kind in ("}", "END")):
            statements.append((start, last, block))
        at = starts[token.line - 1] + token.column - 1
        if token.kind == "}" and len(opened) > 1:
            opened.pop()
        elif token.kind == "{":
            opened.append((word if word in STATEMENTS else block, 0))
        elif is_word:
            word, opened[-1] = token.text, (block, at)
        last = at + len(token.text)
    return statements


PLAIN: tuple[Mutation, ...] = (change_bytes, change_number, change_number, change_word, change_lines)
"""Mutations of any text."""
XML: tuple[Mutation, ...] = (*PLAIN, change_xml, change_xml, change_xml, change_xml, change_xml)
JSON: tuple[Mutation, ...] = (*PLAIN, change_json, change_json, change_json, change_json, change_json)
YAML: tuple[Mutation, ...] = (*PLAIN, change_yaml, change_yaml, change_yaml, change_yaml, change_yaml)
RAFF: tuple[Mutation, ...] = (*PLAIN, change_raff, change_raff, change_raff, change_raff)
MISSPELL = {XML: misspell_xml, JSON: misspell_json, YAML: misspell_yaml, RAFF: misspell_raff}
RELAYOUT = {XML: relayout_xml, JSON: relayout_json, YAML: relayout_yaml, RAFF: relayout_raff}
