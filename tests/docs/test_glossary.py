"""Every entry of the glossary is complete."""

import re

import pytest
from pages import ROOT

TEXT = (ROOT / "docs/glossary.md").read_text(encoding="utf-8")
ENTRIES = dict(re.findall(r"^### (.+)\n\n((?:.+\n)+)", TEXT, flags=re.MULTILINE))


def test_the_glossary_has_the_terms_of_the_field():
    assert len(ENTRIES) > 50


@pytest.mark.parametrize("term", ENTRIES)
def test_an_entry_has_one_to_three_sentences_and_a_source(term: str):
    definition, _, source = ENTRIES[term].partition("\\\n")
    assert source.startswith(("Source: ", "More: "))  # terms of the project have no source
    assert 1 <= len(re.findall(r"[.](?=\s|$)", definition)) <= 3
