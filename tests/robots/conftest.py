"""Assertions in what the tests of this folder share say what they compared."""

import pytest

pytest.register_assert_rewrite("hand")
