"""Read YAML files: without aliases, which make short files endless, and without repeated keys."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import yaml

from raff2urdf.errors import RaffError
from raff2urdf.readers.xml_file import read_text

T = TypeVar("T")

_LARGEST = 2_000_000  # bytes: the parser reads some 100 kB a second


class _Loader(yaml.SafeLoader):
    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(problem="aliases are not read: write the value again", problem_mark=mark)
        return super().compose_node(parent, index)

    def compose_mapping_node(self, anchor: Any) -> Any:
        node = super().compose_mapping_node(anchor)
        met: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in met:
                    problem = f"the key '{key.value}' is repeated: remove one of them"
                    raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
                met.add(key.value)
        return node


def nodes_of(path: Path) -> Any:
    """Return the root node of a file, whose nodes have their lines; None if it is empty.

    Raises:
        RaffError: it can't be read, is too large, or is no YAML; it has an alias or a repeated key.
    """
    return _loaded(path, lambda text: yaml.compose(text, _Loader))


def values_of(path: Path) -> Any:
    """Return the values of a file.

    Raises:
        RaffError: as `nodes_of`.
    """
    return _loaded(path, lambda text: yaml.load(text, _Loader))


def _loaded(path: Path, load: Callable[[str], T]) -> T:
    if path.stat().st_size > _LARGEST:
        raise RaffError(f"{path}: is not read: it is larger than {_LARGEST / 1e6:.0f} MB")
    try:
        return load(read_text(path))
    except RecursionError:
        raise RaffError(f"{path}:1: its values are nested too deeply") from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # ValueError: such as a date with a 13th month
        line = getattr(getattr(error, "problem_mark", None), "line", 0) + 1
        problem = " ".join(str(getattr(error, "problem", None) or error).split())
        raise RaffError(f"{path}:{line}: invalid YAML: {problem[:200]}") from None
