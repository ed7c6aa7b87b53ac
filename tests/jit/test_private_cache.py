"""Machine code is not loaded from where other users may write it; the error's command mends that."""

import grp
import os
import pwd
import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace as Entry

import pytest

from cinegen import CinegenError, Solver
from cinegen.ik._kernels.memory import SolverMemory
from cinegen.ik._kernels.tick import tick
from cinegen.jit import private_cache
from cinegen.jit.compiled import is_cached
from cinegen.jit.private_cache import check_private

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="there are no such users")

OTHER = 54321
"""A user that there is not."""


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """The folder of a tick's machine code, for which a copy stands."""
    original, folder = Path(tick._cache.cache_path), tmp_path / "cache of kernels"
    folder.mkdir(mode=0o700)
    for path in original.glob(f"{Path(tick._cache._cache_file._index_path).stem}*"):  # none of earlier versions
        shutil.copy(path, folder)
    for file in folder.iterdir():
        file.chmod(0o600)
    monkeypatch.setattr(tick._cache, "_cache_path", str(folder))
    kept = tick._cache._cache_file
    for name in ("_cache_path", "_index_path"):
        if hasattr(kept, name):
            path = folder if name == "_cache_path" else folder / Path(kept._index_path).name
            monkeypatch.setattr(kept, name, str(path))
    return folder


def use():
    return is_cached(tick, SolverMemory)


def test_a_folder_of_ones_own_is_used(cache):
    cache.chmod(0o755)
    use()


@pytest.mark.parametrize("mode", [0o777, 0o757, 0o1777])
def test_a_folder_that_others_may_write_is_refused_and_the_command_mends_it(cache, mode, robot):
    mechanism = robot("four_bar")
    cache.chmod(mode)
    for call in (use, lambda: Solver(mechanism, 0.004)):
        with pytest.raises(CinegenError, match="other users may write it") as error:
            call()
    command = re.search(r"chmod -R go-w '[^']*'", str(error.value))[0]
    subprocess.run(command, shell=True, check=True)
    use()


def test_so_is_a_file_in_it(cache):
    for file in cache.iterdir():
        file.chmod(0o666)
        with pytest.raises(CinegenError, match=re.escape(file.name) if file.suffix == ".nbi" else "may write it"):
            use()
        file.chmod(0o600)


def test_a_folder_in_one_that_others_may_write_is_refused_unless_it_is_sticky(cache):
    cache.parent.chmod(0o1777)
    use()
    cache.parent.chmod(0o777)
    with pytest.raises(CinegenError, match=r"other users may write .*, replace it and run code") as error:
        use()
    subprocess.run(re.search(r"chmod go-w \S*", str(error.value))[0].rstrip(","), shell=True, check=True)
    use()


def test_a_folder_of_somebody_else_is_refused_and_the_command_mends_it(cache):
    try:
        os.chown(cache, OTHER, -1)
    except PermissionError:
        pytest.skip("only root may give a folder away here")
    with pytest.raises(CinegenError, match="belongs to another user") as error:
        use()
    subprocess.run(re.search(r"rm -r '[^']*'", str(error.value))[0], shell=True, check=True)
    assert not use()


def test_a_group_of_ones_own_may_write_it(tmp_path, monkeypatch):
    tmp_path.chmod(0o770)
    monkeypatch.setattr(private_cache, "_is_own_group", lambda _: True)
    check_private(tmp_path, Path(__file__))
    monkeypatch.setattr(private_cache, "_is_own_group", lambda _: False)
    with pytest.raises(CinegenError, match="other users may write it"):
        check_private(tmp_path, Path(__file__))


def test_groups_with_other_members_are_not_ones_own(monkeypatch):
    me, friend = (Entry(pw_name=name, pw_gid=gid) for name, gid in (("me", 7), ("friend", 8)))
    groups = {7: [], 8: [], 9: ["me"], 10: ["me", "friend"]}
    monkeypatch.setattr(pwd, "getpwuid", lambda _: me)
    monkeypatch.setattr(pwd, "getpwall", lambda: [me, friend])
    monkeypatch.setattr(grp, "getgrgid", lambda gid: Entry(gr_mem=groups[gid]))
    assert [private_cache._is_own_group(group) for group in (7, 8, 9, 10)] == [True, False, True, False]
