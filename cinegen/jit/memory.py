"""Memory of compiled kernels: fields with a name and a shape, declared once, for Python and for kernels.

    class Balls(Memory):
        count: int = parameter(0)
        time: float = state(0.0)
        position: Array = array("count", 3)

    @entry
    def fall(memory: Balls) -> None:
        for i in range(memory.count):
            memory.position[i, 2] -= memory.time

    balls = Balls(count=2)
    balls.position[:] = 1.0
    prepare(fall, Balls)(balls.handle)

In Python a `Memory` owns one aligned block that holds all arrays, and has them as numpy arrays. In a kernel the same
names are the same arrays, of the same shapes. A kernel takes one argument instead of many: passing thirty arrays takes
longer than most kernels run.

A kernel sees a table of 8-byte words: a number for each parameter and state, an address for each array. Addresses and
parameters are marked as invariant, so that LLVM reads them once and not again after each number that is written.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar, cast
from weakref import WeakValueDictionary

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import (
    NativeValue,
    intrinsic,
    lower_cast,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import populate_array
from numba.np.numpy_support import from_dtype
from numpy.typing import NDArray

_ALIGNED = 64  # bytes

_MEMORIES: WeakValueDictionary[int, Memory] = WeakValueDictionary()

AnyMemory = TypeVar("AnyMemory", bound="Memory")


@dataclass(slots=True)
class Field:
    """Declaration of one field of a memory.

    Attributes:
        dtype: type of the number, or of the array's elements.
        shape: shape of an array: numbers, or names of parameters; None for a single number.
        default: initial value of a number.
        is_invariant: no kernel writes the number.
        is_foreign: the memory of the array belongs to another library.
        block: name of a group of arrays that are contiguous, or "".
        slot: index in the table.
    """

    dtype: np.dtype[Any]
    shape: tuple[int | str, ...] | None = None
    default: Any = 0
    is_invariant: bool = False
    is_foreign: bool = False
    block: str = ""
    slot: int = -1

    @property
    def is_own(self) -> bool:
        """True for an array that the memory allocates."""
        return self.shape is not None and not self.is_foreign

    def __get__(self, memory: Memory | None, owner: type) -> Any:
        return self if memory is None else memory._numbers[self.dtype.char][self.slot].item()

    def __set__(self, memory: Memory, value: Any) -> None:
        memory._numbers[self.dtype.char][self.slot] = value


def parameter(default: float) -> Any:
    """Declare a number that Python sets and kernels read; int or float like its default. Shapes may name it."""
    return Field(np.dtype(type(default)), default=default, is_invariant=True)


def state(default: float) -> Any:
    """Declare a number that kernels write, too; int or float like its default."""
    return Field(np.dtype(type(default)), default=default)


def array(*shape: int | str, dtype: type = float, block: str = "") -> Any:
    """Declare an array of zeros, C-contiguous; its dimensions are numbers, or names of parameters.

    Args:
        shape: dimensions.
        dtype: float, int or complex.
        block: arrays of one block, all of float, are contiguous: see `Memory.block`.
    """
    return Field(np.dtype(dtype), shape, block=block)


def foreign(*shape: int | str, dtype: type = float) -> Any:
    """Declare an array whose memory belongs to another library: see `Memory.point_at`."""
    return Field(np.dtype(dtype), shape, is_foreign=True)


class Memory:
    """Base of all declarations of memory. A subclass of a declaration adds fields; kernels for the base accept it.

    A subclass with `part=True` declares some fields of a larger declaration, which has it among its bases: kernels for
    the part accept the larger one, and see of it only these fields and those of the part's own bases.

    Args:
        sizes: values of the parameters that shapes name.

    Attributes:
        is_part: it is a part of another declaration, and has no table of its own.
        handle: argument of compiled kernels.
        words: table that kernels read.
    """

    fields: ClassVar[dict[str, Field]] = {}
    is_part: ClassVar[bool] = False
    numba_type: ClassVar[types.Type]

    def __init_subclass__(cls, part: bool = False) -> None:
        bases = [base for base in cls.__bases__ if issubclass(base, Memory)]
        bases = [base for base in bases if not base.is_part][:1] + [base for base in bases if base.is_part]
        declared = {name: field for name, field in vars(cls).items() if isinstance(field, Field)}
        cls.fields, cls.is_part = {}, part
        for fields in (*(base.fields for base in bases), declared):
            for name, field in fields.items():
                if cls.fields.setdefault(name, field) is not field or hasattr(Memory, name):
                    raise TypeError(f"{cls.__name__}.{name} is taken: a kernel for the base would not see this one")
        for name, field in declared.items():
            if field.shape is not None:
                delattr(cls, name)  # an instance has an array of that name
        if not part:
            for slot, field in enumerate(sorted(cls.fields.values(), key=lambda field: field.slot < 0)):
                if field.slot not in (-1, slot):
                    raise TypeError(f"{cls.__name__}: its parts are those of another declaration")
                field.slot = slot
        cls.numba_type = _MemoryType(cls)

    def __init__(self, **sizes: int) -> None:
        if self.is_part:
            raise TypeError(f"{type(self).__name__} is a part of another declaration: make a memory of that one")
        self.words = np.zeros(len(self.fields), dtype=np.int64)
        self._numbers = {"l": self.words, "d": self.words.view(np.float64)}
        self.handle = self.words.ctypes.data
        _MEMORIES[self.handle] = self
        for name, field in self.fields.items():
            if field.shape is None:
                setattr(self, name, field.default)
        for name, size in sizes.items():
            setattr(self, name, size)
        self._allocate({name for name, field in self.fields.items() if field.is_own})

    def resize(self, **sizes: int) -> None:
        """Set parameters that shapes name. Arrays whose shape changes, and others of their blocks, become zeros; the
        rest keep their values."""
        needed: set[str] = set()
        for name, size in sizes.items():
            if getattr(self, name) != size:
                setattr(self, name, size)
                needed |= {key for key, field in self.fields.items() if field.is_own and name in (field.shape or ())}
        if needed:
            blocks = {self.fields[name].block for name in needed} - {""}
            self._allocate(needed | {name for name, field in self.fields.items() if field.block in blocks})

    def _allocate(self, names: set[str]) -> None:
        """Allocate some arrays in one aligned piece; those of a block are contiguous."""
        fields = sorted((self.fields[name].block, self.fields[name].slot, name) for name in names)
        starts, end, last = [], 0, ""
        for block, _, name in fields:
            if not block or block != last:
                end = -(-end // _ALIGNED) * _ALIGNED
            starts.append(end)
            end += math.prod(self.shape(name)) * self.fields[name].dtype.itemsize
            last = block
        memory = np.zeros(end + _ALIGNED, dtype=np.uint8)
        address = memory.ctypes.data
        first = -address % _ALIGNED
        for (_, slot, name), start in zip(fields, starts, strict=True):
            self.__dict__[name] = np.ndarray(self.shape(name), self.fields[name].dtype, memory, first + start)
            self.words[slot] = address + first + start

    def block(self, name: str) -> tuple[NDArray[np.float64], dict[str, tuple[slice, tuple[int, ...]]]]:
        """Return a block as one array, and the slice and the shape of each of its fields."""
        where, end = {}, 0
        for key, field in self.fields.items():
            if field.block == name:
                size = math.prod(self.shape(key))
                where[key] = slice(end, end + size), self.shape(key)
                end += size
        first = self.__dict__[next(iter(where))]
        return np.ndarray(
            (end,), np.float64, first.base, first.__array_interface__["data"][0] - first.base.ctypes.data
        ), where

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the present shape of an array."""
        return tuple(
            size if isinstance(size, int) else int(self.words[self.fields[size].slot])
            for size in self.fields[name].shape or ()
        )

    def point_at(self, name: str, values: NDArray[Any]) -> None:
        """Point an array at the memory of `values`, which must be C-contiguous and stay where it is."""
        field = self.fields[name]
        if values.shape != self.shape(name) or values.dtype != field.dtype or not values.flags.c_contiguous:
            raise ValueError(f"{name} is {self.shape(name)} of {field.dtype}, not {values.shape} of {values.dtype}")
        self.__dict__[name] = values
        self.words[field.slot] = values.__array_interface__["data"][0]

    def __index__(self) -> int:
        return self.handle


def memory_at(handle: int) -> Memory:
    """Return the memory of a handle."""
    return _MEMORIES[int(handle)]


def view(declaration: type[AnyMemory]) -> Callable[[int], AnyMemory]:
    """Return a function for kernels that converts a handle to its memory."""

    @intrinsic  # type: ignore[untyped-decorator]
    def memory_of(_typing: Any, _handle: Any) -> Any:
        def generate(_context: Any, _builder: Any, _signature: Any, arguments: Any) -> Any:
            return arguments[0]

        return declaration.numba_type(types.int64), generate

    memory_of.in_python = memory_at
    return cast(Callable[[int], AnyMemory], memory_of)


# --- numba ----------------------------------------------------------------------------------------------------------


class _MemoryType(types.Type):  # type: ignore[misc]
    """Numba's type of a declaration."""

    def __init__(self, declaration: type[Memory]) -> None:
        self.declaration = declaration
        super().__init__(name=f"{declaration.__module__}.{declaration.__qualname__}")

    def can_convert_to(self, _context: Any, other: types.Type) -> Conversion | None:
        is_base = isinstance(other, _MemoryType) and issubclass(self.declaration, other.declaration)
        return Conversion.safe if is_base else None


@register_model(_MemoryType)
class _MemoryModel(models.PrimitiveModel):  # type: ignore[misc]
    """The address of the table."""

    def __init__(self, manager: Any, kind: _MemoryType) -> None:
        super().__init__(manager, kind, ir.IntType(64))


@lower_cast(_MemoryType, _MemoryType)  # type: ignore[untyped-decorator]
def _cast(_context: Any, _builder: Any, _kind: _MemoryType, _to: _MemoryType, table: Any) -> Any:
    return table


@typeof_impl.register(Memory)  # type: ignore[untyped-decorator]
def _typeof(memory: Memory, _context: Any) -> types.Type:
    return memory.numba_type


@unbox(_MemoryType)  # type: ignore[untyped-decorator]
def _unbox(_kind: _MemoryType, handle: Any, c: Any) -> NativeValue:
    address = c.pyapi.long_as_longlong(handle)  # of an int, or by __index__
    return NativeValue(address, is_error=c.pyapi.c_api_error())


@infer_getattr
class _MemoryAttribute(AttributeTemplate):  # type: ignore[misc]
    key = _MemoryType

    def generic_resolve(self, kind: _MemoryType, name: str) -> types.Type | None:
        field = kind.declaration.fields.get(name)
        if field is None:
            return None
        number = from_dtype(field.dtype)
        return number if field.shape is None else types.Array(number, len(field.shape), "C")


def _slot(builder: Any, table: Any, slot: int, kind: Any) -> Any:
    """Return a pointer to a word of the table, which holds a number of some LLVM type."""
    return builder.gep(builder.inttoptr(table, kind.as_pointer()), [ir.Constant(ir.IntType(64), slot)])


def _load(builder: Any, table: Any, slot: int, kind: Any, is_invariant: bool) -> Any:
    loaded = builder.load(_slot(builder, table, slot, kind))
    if is_invariant:
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded


@lower_getattr_generic(_MemoryType)  # type: ignore[untyped-decorator]
def _get(context: Any, builder: Any, kind: _MemoryType, table: Any, name: str) -> Any:
    field = kind.declaration.fields[name]
    word = ir.IntType(64)
    if field.shape is None:
        return _load(builder, table, field.slot, context.get_value_type(from_dtype(field.dtype)), field.is_invariant)
    shape = []
    for size in field.shape:
        if isinstance(size, int):
            shape.append(ir.Constant(word, size))
        else:
            shape.append(_load(builder, table, kind.declaration.fields[size].slot, word, True))
    address = _load(builder, table, field.slot, word, True)
    return array_at(context, builder, types.Array(from_dtype(field.dtype), len(shape), "C"), address, shape)


def array_at(context: Any, builder: Any, kind: types.Array, address: Any, shape: list[Any]) -> Any:
    """Generate a C-contiguous array over memory at an address."""
    itemsize = ir.Constant(ir.IntType(64), context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides: list[Any] = []
    stride = itemsize
    for size in reversed(shape):
        strides.insert(0, stride)
        stride = builder.mul(stride, size)
    view = context.make_array(kind)(context, builder)
    data = builder.inttoptr(address, view.data.type)
    populate_array(view, data=data, shape=shape, strides=strides, itemsize=itemsize, meminfo=None)
    return view._getvalue()


@lower_setattr_generic(_MemoryType)  # type: ignore[untyped-decorator]
def _set(context: Any, builder: Any, signature: Any, arguments: Any, name: str) -> None:
    kind, value_type = signature.args
    table, value = arguments
    field = kind.declaration.fields[name]
    if field.shape is not None or field.is_invariant:
        raise TypeError(f"{name} of {kind.name} is not a state: a kernel can't set it")
    number = from_dtype(field.dtype)
    cast_value = context.cast(builder, value, value_type, number)
    builder.store(cast_value, _slot(builder, table, field.slot, context.get_value_type(number)))
