"""What once broke a promise keeps it now."""

import shutil

import pytest

from campaign.corpus import CORPUS, entries, seed_of
from campaign.readers import READERS, read


@pytest.mark.parametrize("entry", entries(), ids=lambda entry: f"{entry.parent.name}-{entry.name}")
def test_an_entry_of_the_corpus(entry, tmp_path):
    folder = tmp_path / "entry"
    shutil.copytree(entry, folder, symlinks=True) if entry.is_dir() else shutil.copy(entry, tmp_path)
    outcome = read(READERS[entry.parent.name], folder if entry.is_dir() else tmp_path, seed_of(entry))
    assert outcome.broken == []
    assert outcome.status == entry.name.partition("-")[0], outcome.message


def test_every_entry_belongs_to_a_reader_and_states_what_must_happen():
    assert {entry.parent.name for entry in CORPUS.glob("*/*")} <= set(READERS)
    assert {entry.name.partition("-")[0] for entry in CORPUS.glob("*/*")} == {"read", "refused"}
