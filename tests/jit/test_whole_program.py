"""Entries are compiled without machine code for their helpers, and do the same; helpers can still be called."""

import threading

import numpy as np
import pytest
from numba import float64
from numba.core.caching import NullCache

from cinegen.jit import compiled as kernels
from cinegen.jit import whole_program
from cinegen.jit.compiled import compiled, entry, together

VECTOR = float64[::1]


def kernels_of_our_own():
    """A helper, and an entry that calls it, not compiled yet."""

    def weighted(x, weight):
        total = 0.0
        for value in x:
            total += weight * value * value
        return total

    def sum_of_squares(x):
        return weighted(x, 1.0) + weighted(x, 0.5)

    weighted = compiled(weighted)
    return weighted, not_kept(entry(sum_of_squares))


def not_kept(function):
    """An entry that neither reads nor writes its code on disk."""
    function._cache = NullCache()
    return function


@pytest.fixture(autouse=True)
def _registered(monkeypatch):
    """Kernels of tests are forgotten afterwards."""
    monkeypatch.setattr(kernels, "_ENTRIES", list(kernels._ENTRIES))
    monkeypatch.setattr(kernels, "_HELPERS", list(kernels._HELPERS))


def test_the_version_of_numba_that_is_installed_is_supported():
    assert whole_program.is_supported(), "numba is newer than what was tested: test it, and add it to TESTED"


def test_a_helper_can_be_called_after_an_entry_was_compiled():
    helper, function = kernels_of_our_own()
    function.compile((VECTOR,))
    assert not helper.overloads  # it needs no machine code of its helpers
    assert helper(np.arange(4.0), 2.0) == 28.0
    assert function(np.arange(4.0)) == 21.0


@pytest.mark.parametrize("missing", ["version", "attribute"])
def test_with_another_numba_compilation_is_the_usual_one(monkeypatch, missing):
    if missing == "version":
        monkeypatch.setattr(whole_program, "TESTED", ("0.0",))
    else:
        monkeypatch.setattr(whole_program, "_NEEDED", {whole_program.JITCodeLibrary: ("_no_such_name",)})
    assert not whole_program.is_supported()
    helper, function = kernels_of_our_own()
    function.compile((VECTOR,))
    assert helper.overloads
    assert function(np.arange(4.0)) == 21.0


def test_numba_is_as_before_even_after_an_error():
    codegen = whole_program.cpu_target.target_context.codegen()
    before = codegen._library_class, whole_program.JITCPUCodegen.set_env, whole_program.gc.isenabled()
    with pytest.raises(ZeroDivisionError), together():
        raise ZeroDivisionError
    assert (codegen._library_class, whole_program.JITCPUCodegen.set_env, whole_program.gc.isenabled()) == before


def test_two_threads_may_compile_at_once():
    pairs = [kernels_of_our_own() for _ in range(2)]
    threads = [threading.Thread(target=function.compile, args=((VECTOR,),)) for _, function in pairs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [function(np.arange(4.0)) for _, function in pairs] == [21.0] * 2
    assert [helper(np.arange(4.0), 1.0) for helper, _ in pairs] == [14.0] * 2
