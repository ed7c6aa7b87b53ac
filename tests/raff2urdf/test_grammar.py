"""The grammar for editors marks RAFF as the reader reads it: it is applied by the rules of TextMate's manual."""

import json
import re

from raff2urdf.cli import main
from raff2urdf.raff.grammar import grammar
from raff2urdf.raff.tokens import tokens


def scopes(text):
    """Return (line, column, text, scope) of all that a grammar marks, line by line as an editor does.

    In a region its end is tried first, then its rules in order; the match that begins first counts.
    """
    rules = grammar()
    repository = {f"#{key}": value["patterns"] for key, value in rules["repository"].items()}

    def flat(patterns):
        for one in patterns:
            yield from flat(repository[one["include"]]) if "include" in one else (one,)

    found, stack = [], [(None, rules["patterns"], {})]

    def mark(line, match, rule, captures):
        if "name" in rule:
            found.append((line, match.start() + 1, match[0], rule["name"]))
        for group, value in rule.get(captures, {}).items():
            if match[int(group)] is not None:
                found.append((line, match.start(int(group)) + 1, match[int(group)], value["name"]))

    for number, line in enumerate(text.splitlines(), 1):
        at = 0
        while True:
            end, patterns, region = stack[-1]
            tried = [(re.compile(end).search(line, at), None)] if end else []
            for rule in flat(patterns):
                tried.append((re.compile(rule.get("begin") or rule["match"]).search(line, at), rule))
            tried = [one for one in tried if one[0] is not None]
            if not tried:
                break
            match, rule = min(tried, key=lambda one: one[0].start())
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
    return found


def test_robots_have_nothing_illegal_and_every_token_has_a_scope(root):
    for path in sorted((root / "robots").glob("*.raff")):
        text = path.read_text()
        marked = scopes(text)
        assert [one for one in marked if one[3].startswith("invalid")] == [], path.name
        at = {(line, column) for line, column, _, _ in marked}
        for token in tokens(text.splitlines()):
            if token.kind not in ("END", ")", "("):
                assert (token.line, token.column) in at, (path.name, token)


def test_what_does_not_belong_is_illegal():
    text = 'RAFF t\nrobot r {\n  link 1 { typ 2 pred 0 joint ball name "a" }\n  d 5mm\n}\nunits cm // note\n'
    found = {word: scope for _, _, word, scope in scopes(text)}
    assert found["typ"] == found["d"] == found["5mm"] == "invalid.illegal.raff"
    assert found["pred"] == found["units"] == "keyword.other.raff"
    assert found["robot"] == found["link"] == "storage.type.raff"
    assert found["ball"] == found["cm"] == "constant.language.raff"
    assert found["RAFF"] == "keyword.control.raff"
    assert found["t"] == found["r"] == "entity.name.raff"
    assert found['"a"'] == "string.quoted.double.raff"
    assert found["// note"] == "comment.line.double-slash.raff"
    assert found["1"] == "constant.numeric.raff"


def test_the_command_prints_it(capfd):
    assert main(["--grammar"]) == 0
    assert json.loads(capfd.readouterr().out) == grammar()
