"""The reader of RAFF in JavaScript: the same models, errors and warnings as Python's, whatever the text."""

from __future__ import annotations

import re
from random import Random

import pytest
from campaign.mutation import RAFF
from hostile_raff import HOSTILE, SIZE
from raff_in_node import differences, read_in_node, read_in_python
from variants import slow
from wrong_raff import EXACT, FIGURE_5, MORE_WRONG, WRONG_BODIES, WRONG_TEXTS, text_of

from cinegen.page.raff_definitions import FILE, module
from raff2urdf.raff import texts
from raff2urdf.raff.reader import read
from raff2urdf.raff.syntax import STATEMENTS

WRONG = [FIGURE_5, *(one[0] for one in WRONG_TEXTS), *(text_of(one[0]) for one in WRONG_BODIES), *MORE_WRONG]

ELSEWHERE = {
    *("MORE_PROBLEMS", "NO_SUCH_ROBOT", "NO_MASS", "MASS_NEGATIVE"),
    *("STAY_OPEN", "MORE_OPEN", "LOOPS", "LOOPS_AND_COUPLINGS"),
}
"""Texts of errors that no RAFF text by itself brings about, and of open loops, whose numbers may differ."""


def agree(given: list[str]) -> list[dict]:
    """Check that both readers make the same of texts; return what that is."""
    found = read_in_node(given)
    for text, one in zip(given, found, strict=True):
        assert differences(one, read_in_python(text)) == [], text[:2000]
    return found


def files(root) -> list[str]:
    paths = [*(root / "robots").glob("*.raff"), *(root / "tests").rglob("*.raff")]
    return [read(path) for path in sorted(paths)]


def test_the_definitions_are_those_of_python():
    assert FILE.read_text(encoding="utf-8") == module(), "run `make generated`"


def test_files_read_alike(root):
    found = agree(files(root))
    assert sum(bool(one["models"]) for one in found) > 20


def test_errors_and_warnings_are_the_same_and_where_they_are():
    found = agree(WRONG)
    assert all(one["errors"] or one["warnings"] for one in found)


def test_numbers_and_characters_are_written_alike():
    agree(EXACT)


def test_every_text_of_an_error_is_compared():
    """A text that nothing here brings about would be one that no test compares."""
    results = [read_in_python(text) for text in WRONG]
    messages = "\n".join(text for one in results for text in [*(e["message"] for e in one["errors"]), *one["warnings"]])
    unseen = {name for name, text in vars(texts).items() if name.isupper() and not _pattern(text).search(messages)}
    assert unseen == ELSEWHERE


def _pattern(text: str) -> re.Pattern[str]:
    parts = re.split(r"(\{\{|\}\}|\{[^{}]*\})", text)
    return re.compile(
        "".join(
            ".*" if len(part) > 2 and part[0] == "{" else re.escape(part.replace("{{", "{").replace("}}", "}"))
            for part in parts
        )
    )


def test_hostile_text_is_read_at_once():
    """Not a measurement: what is quadratic in 100 kB takes seconds."""
    assert all(0.8 * SIZE < len(text) < 1.1 * SIZE for text in HOSTILE.values())
    found = read_in_node(HOSTILE.values(), "verdicts")
    assert {name: one["took"] for name, one in zip(HOSTILE, found, strict=True) if one["took"] > 1000.0} == {}


@pytest.mark.slow
def test_hostile_text_has_the_same_verdict():
    agree(list(HOSTILE.values()))


@pytest.mark.parametrize(("seed", "count"), [(0, 400), *slow((1, 10_000))])
def test_mutated_text_has_the_same_verdict(root, seed, count):
    rng = Random(seed)
    words = [word for block in STATEMENTS.values() for word in block]
    seeds = [text.encode() for text in [*files(root), *WRONG, *EXACT] if len(text) < 10_000]
    mutated = []
    for _ in range(count):
        data = rng.choice(seeds)
        for _ in range(rng.choice((1, 1, 2, 4))):
            data = rng.choice(RAFF)(rng, data, words)
        mutated.append(data.decode("utf-8", "replace"))
    found = agree(mutated)
    assert count / 40 < sum(not one["errors"] for one in found) < count / 2
