"""The kernels of the page's solver in JavaScript, translated once for all mechanisms.

Sizes and places of arrays are no constants, as they are in what `cinegen generate` writes: they are arguments of the
function that makes the kernels. `static/session/memory.js` computes them from a robot's tables and from the
declarations of the memories, which are in the module, too.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

from cinegen.codegen import kernels
from cinegen.codegen.heap import Heap, table_of
from cinegen.codegen.language import Language
from cinegen.codegen.program import STATUSES
from cinegen.codegen.statements import FunctionTranslation
from cinegen.codegen.translation import KernelTranslation
from cinegen.codegen.values import Memories, Number, Value, View, kind_of
from cinegen.ik._kernels.memory import TaskMemory
from cinegen.jit.memory import Field, Memory
from cinegen.loops._kernels.memory import ClusterMemory
from cinegen.page import solver_kernels
from cinegen.page.solver_kernels import PageMemory
from raff2urdf.files import MARK

KERNELS = "cinegen/kernels.js"
"""Name of the module in the page."""

MOST_TASKS = 16
"""Tasks of one robot of a page."""

ENTRIES = (
    kernels.place, kernels.close, kernels.set_q, kernels.forward, solver_kernels.take_tasks, solver_kernels.step,
    solver_kernels.find_sigma,
)  # fmt: skip
VIEWS = (
    "q", "trial", "locked", "goal", "node_frame", "task_node", "task_offset", "task_target", "task_dof", "task_weight",
    "record_errors", "record_stopped", "tasks", "gain", "damping_threshold", "closure", "sigma_tasks", "sigma_passive",
)  # fmt: skip
"""Arrays and numbers that the page reads or writes."""

_FREE = frozenset(
    ("task_rank", "tasks", "gain", "damping_threshold", "joint", "place", "translation", "rotation", "weight")
)
"""Parameters that change while a robot moves."""

FOLDED: Mapping[type[Memory], Mapping[str, float]] = {
    PageMemory: {
        "evaluate_address": 0, "others": 0, "has_acceleration_limits": 0, "tasks_are_suspended": 0, "barriers": 0,
        "barrier_capacity": 0, "is_guarded": 0, "is_watched": 0, "capacity": MOST_TASKS, "task_rows": 6 * MOST_TASKS,
        "signatures": 1,
    },
    ClusterMemory: {},
    TaskMemory: {"is_valid": 1, "is_even": 1, "axes_of": 0, "axes_joint": 0, "is_twist": 0},
}  # fmt: skip
"""Parameters that are the same for all robots of pages: constants of the code."""

KINDS: Mapping[str, type[Memory]] = {"robot": PageMemory, "cluster": ClusterMemory, "task": TaskMemory}
_HANDLES = {"cluster_handles": ClusterMemory, "task_handles": TaskMemory}


def is_parameter(field: Field, name: str) -> bool:
    """Return whether a field is a number that never changes while a robot moves."""
    return field.shape is None and field.is_invariant and name not in _FREE


class _Fields(Heap):
    """Fields that kernels use; their places are not known."""

    def __init__(self) -> None:
        super().__init__(_FREE)
        self.used: dict[type[Memory], dict[str, Field]] = {kind: {} for kind in FOLDED}

    def use(self, kind: type[Memory], name: str) -> Field:
        """Return the declaration of a field, which is used from now on, as the sizes in its shape are."""
        declared = kind.fields[name]
        if name not in FOLDED[kind]:
            self.used[kind][name] = declared
        for size in declared.shape or ():
            if isinstance(size, str):
                self.use(kind, size)
        return declared


class _AnyBody(FunctionTranslation):
    """One function while it is translated for all mechanisms: sizes and places have names.

    Those of the robot are numbers of the function around the kernels. There are several clusters and tasks: the names
    are those of tables of them.
    """

    _heap: _Fields

    def _field(self, owner: Memories, name: str) -> Value:
        kind = type(owner.all[0])
        field, fixed = self._heap.use(kind, name), FOLDED[kind].get(name)
        if fixed is not None:
            return self._arithmetic.constant(fixed)
        if field.shape is not None:
            shape = tuple(self._size(owner, count) for count in field.shape)
            return View(table_of(field.dtype), self._integer_of(owner, name), shape)
        number = kind_of(table_of(field.dtype))
        if kind is PageMemory and is_parameter(field, name):
            return Number(number, _symbol(kind, name))
        return Number(number, self._state(owner, name))

    def _size(self, owner: Memories, size: int | str) -> Number:
        if size == "tasks":
            size = MOST_TASKS
        if isinstance(size, int):
            return self._arithmetic.constant(size)
        number = self._field(owner, size)
        assert isinstance(number, Number)
        return number

    def _integer_of(self, owner: Memories, name: str) -> Number:
        """Return the expression of an array's position."""
        symbol = _symbol(type(owner.all[0]), name)
        return Number("int", symbol if len(owner.all) == 1 else f"I[{symbol} + {owner.index.code}]")

    def _state(self, owner: Memories, name: str) -> str:
        kind = type(owner.all[0])
        field, symbol = self._heap.use(kind, name), _symbol(kind, name)
        table = table_of(field.dtype)
        return f"{table}[{symbol}]" if len(owner.all) == 1 else f"{table}[{symbol} + {owner.index.code}]"

    def _memory_of(self, handle: ast.expr) -> Memories:
        assert isinstance(handle, ast.Subscript)
        assert isinstance(handle.value, ast.Attribute)
        return Memories(_several(_HANDLES[handle.value.attr]), self._number(handle.slice))


@cache
def _several(kind: type[Memory]) -> tuple[Memory, ...]:
    """Return what stands for several memories of a kind."""
    memory = kind()
    return memory, memory


def _symbol(kind: type[Memory], name: str) -> str:
    return f"{kind.__name__[0]}_{name}"


class _Translation(NamedTuple):
    text: str
    used: Mapping[type[Memory], Mapping[str, Field]]


@cache
def _translation() -> _Translation:
    heap = _Fields()
    translation = KernelTranslation(Language.JAVASCRIPT, heap, _AnyBody)
    for name in VIEWS:
        heap.use(PageMemory, name)
    robot = Memories((PageMemory(),), Number("int", "0", value=0))
    for kernel in ENTRIES:
        translation.function(kernel, [robot])
    translation.leave_out_uncalled(ENTRIES)
    names = [_symbol(kind, name) for kind, fields in heap.used.items() for name in fields]
    constants = {
        "memories": {name: _declarations(kind, heap.used[kind]) for name, kind in KINDS.items()}, "views": VIEWS,
        "statuses": STATUSES, "returned": len(heap.values["D"]), "mostTasks": MOST_TASKS,
    }  # fmt: skip
    lines = [
        f"/* {MARK}: cinegen's kernels, translated for all mechanisms. MIT licence. */",
        *(f"export const {name} = {json.dumps(value)};" for name, value in constants.items()),
        "export default function create(D, I, symbols) {",
        f"const {{ {', '.join(names)} }} = symbols;",
        "const least = (a, b) => b < a ? b : a;",
        "const most = (a, b) => b > a ? b : a;",
        *(line.lstrip() for code in translation.functions for line in code.lines if not line.startswith(("/*", " *"))),
        "return {",
        *(f"  {kernel.__name__}: {translation.name_of(kernel)}," for kernel in ENTRIES),
        "};",
        "}",
    ]
    return _Translation("\n".join(lines) + "\n", heap.used)


def module() -> str:
    """Return the module. It exports `memories`, the declarations of all fields that the kernels use, with the beginning
    of their names in the code; and, by default, a function that makes the kernels for the tables D and I and for the
    numbers that these names stand for."""
    return _translation().text


def used_fields() -> Mapping[type[Memory], Mapping[str, Field]]:
    """Return the fields of each memory that the kernels use, by name."""
    return _translation().used


def _declarations(kind: type[Memory], fields: Mapping[str, Field]) -> dict[str, Any]:
    return {
        "symbol": _symbol(kind, ""),
        "fields": {name: _declaration(kind, name, field) for name, field in fields.items()},
    }


def _declaration(kind: type[Memory], name: str, field: Field) -> dict[str, Any]:
    table = table_of(field.dtype)
    if field.shape is None:
        return {"table": table, "default": field.default, "isParameter": is_parameter(field, name)}
    fixed = {"tasks": MOST_TASKS, **FOLDED[kind]}
    return {"table": table, "shape": [fixed.get(size, size) if isinstance(size, str) else size for size in field.shape]}
