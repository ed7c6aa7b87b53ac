"""Calls from kernels to Pinocchio's compiled functions, without Python and without its lock.

Pinocchio's library exports these functions, and a kernel calls them by their addresses. The address of a model or its
data is the one that Boost.Python has of the C++ object in a Python object. A vector is passed as Eigen has it, by the
address of its first number and its size. Results are read in place (`cinegen.jit.foreign`).

`native` checks all of that once, with the installed build. No call may raise, as an exception of C++ would end the
process: a `NativeTree` has a model and data of its own, which nothing else changes, so that all sizes are right.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from pinocchio import pinocchio_pywrap_default

from cinegen.arrays import Array
from cinegen.errors import warn
from cinegen.jit.foreign import JointKinematics, address, frame_of, frames_in_place
from cinegen.joints import joint_data

_MODEL = b"N9pinocchio8ModelTplIdLi0ENS_25JointCollectionDefaultTplEEE"
_DATA = b"N9pinocchio7DataTplIdLi0ENS_25JointCollectionDefaultTplEEE"
_EVALUATE = (
    "_ZN9pinocchio4impl21computeJointJacobiansIdLi0ENS_25JointCollectionDefaultTplEN5Eigen3RefIKNS3_6MatrixIdLin1ELi1E"
    "Li0ELin1ELi1EEELi0ENS3_11InnerStrideILi1EEEEEEERKNS_7DataTplIT_XT0_ET1_E8Matrix6xERKNS_8ModelTplISC_XT0_ESD_EER"
    "SE_RKNS3_10MatrixBaseIT2_EE"
)
_INTEGRATE, _DIFFERENCE = (
    f"_ZN9pinocchio{name}IdLi0ENS_25JointCollectionDefaultTplEN5Eigen6MatrixIdLin1ELi1ELi0ELin1ELi1EEES4_S4_EEvRKNS_"
    "8ModelTplIT_XT0_ET1_EERKNS2_10MatrixBaseIT2_EERKNSB_IT3_EERKNSB_IT4_EE"
    for name in ("9integrate", "10difference")
)
_QUERY = "_ZN5boost6python9converter8registry5queryENS0_9type_infoE"
_LVALUE = "_ZN5boost6python9converter22get_lvalue_from_pythonEP7_objectRKNS1_12registrationE"
VECTOR = 8
"""Words that are reserved for a vector of Eigen: the address of its first number and its size, then zeros."""


@dataclass(frozen=True)
class Native:
    """Addresses of Pinocchio's functions; 0 if kernels can't call them.

    Attributes:
        evaluate: of `computeJointJacobians`: model, data, q.
        integrate: model, q, step, result.
        difference: model, q, other q, result.
        reason: why they can't be called, or "".
    """

    evaluate: int = 0
    integrate: int = 0
    difference: int = 0
    reason: str = ""


class NoAccessError(Exception):
    """Kernels can't call Pinocchio, for a reason."""


class NativeTree:
    """Pinocchio's model and data of one memory of kernels.

    Args:
        model: copied.

    Attributes:
        model_address: of the C++ object.
        data_address: likewise.
        offsets: (joints, 4, 3) frames of the joints at zero, relative to their parents, in the model's own memory.
        frames: (joints, 4, 3) of the joints at the last evaluation, in the data's, as the screws.
        screws: (nv, 6) the columns of the Jacobian.

    Raises:
        NoAccessError: Pinocchio's memory is not as expected.
    """

    def __init__(self, model: pin.Model) -> None:
        self._model = model.copy()
        self._data = joint_data(self._model)
        self.model_address, self.data_address = _address_of(self._model, _MODEL), _address_of(self._data, _DATA)
        if not self.model_address or not self.data_address:
            raise NoAccessError("Boost.Python does not know the C++ object of a model or its data")
        kinematics, offsets = JointKinematics(self._data), frames_in_place(self._model.jointPlacements)
        if offsets is None or not kinematics.frames_in_place or not kinematics.screws_in_place:
            raise NoAccessError("placements or Jacobians can't be read in place")
        self.offsets, self.frames, self.screws = offsets, kinematics.frames, kinematics.screws


def native() -> Native:
    """Return the addresses of Pinocchio's functions, checked. If they can't be called, the first call warns."""
    functions = _checked()
    if functions.reason and not _warned:
        _warned.append(functions.reason)
        warn(
            f"kernels can't call this build of Pinocchio ({pin.__version__}): {functions.reason}. They compute the "
            "kinematics of joints themselves; mechanisms with joints that are not revolute, prismatic, spherical or "
            "free can't be driven"
        )
    return functions


_warned: list[str] = []


@cache
def _checked() -> Native:
    try:
        library = ctypes.CDLL(pinocchio_pywrap_default.__file__)
        functions = Native(_pointer(library[_EVALUATE]), _pointer(library[_INTEGRATE]), _pointer(library[_DIFFERENCE]))
        _check(functions)
    except (OSError, AttributeError, TypeError, NoAccessError) as error:  # no such library, symbol, or kind of joint
        return Native(reason=str(error))
    return functions


def _check(functions: Native) -> None:
    """Compare the functions with what Python gets from Pinocchio, on all kinds of joints.

    Raises:
        NoAccessError: anything differs.
    """
    model = _sample()
    tree, data, rng = NativeTree(model), joint_data(model), np.random.default_rng(0)
    if _address_of(model, _DATA) or _address_of(data, _MODEL):
        raise NoAccessError("Boost.Python takes an object for one of another type")
    q = pin.neutral(model)
    for _ in range(5):
        step = rng.normal(size=model.nv)
        end, back = np.zeros(model.nq), np.zeros(model.nv)
        words = [_vector(vector) for vector in (q, step, end, back)]
        first, by, second, result = (address(word) for word in words)
        _call(functions.integrate, (tree.model_address, first, by, second))
        _call(functions.evaluate, (tree.model_address, tree.data_address, second))
        _call(functions.difference, (tree.model_address, first, second, result))
        pin.computeJointJacobians(model, data, end)
        same = (
            np.array_equal(end, pin.integrate(model, q, step)), np.array_equal(tree.screws, np.asarray(data.J).T),
            np.array_equal(tree.frames, [frame_of(placement) for placement in data.oMi]),
            np.array_equal(back, pin.difference(model, q, end)),
        )  # fmt: skip
        if not all(same):
            raise NoAccessError("results differ from those in Python")
        q = end


def _sample() -> pin.Model:
    """Return a model with joints of all kinds."""
    model, axis = pin.Model(), np.array([0.0, 0.6, 0.8])
    composite = pin.JointModelComposite()
    composite.addJoint(pin.JointModelRX())
    composite.addJoint(pin.JointModelPY(), pin.SE3(pin.exp3(axis), axis))
    joints = (
        *(getattr(pin, f"JointModel{kind}{letter}")() for kind in ("R", "P", "RUB") for letter in "XYZ"),
        *(getattr(pin, f"JointModelH{letter}")(0.1) for letter in "XYZ"),
        pin.JointModelRevoluteUnaligned(axis), pin.JointModelPrismaticUnaligned(axis), pin.JointModelSpherical(),
        pin.JointModelFreeFlyer(), pin.JointModelPlanar(), pin.JointModelTranslation(), pin.JointModelSphericalZYX(),
        pin.JointModelUniversal(axis, np.array([1.0, 0.0, 0.0])), pin.JointModelHelicalUnaligned(axis, 0.1), composite,
        pin.JointModelEllipsoid(0.1, 0.2, 0.3),
    )  # fmt: skip
    for j, joint in enumerate(joints):
        model.addJoint(j - j % 3, joint, pin.SE3(pin.exp3(j * axis), 0.1 * axis), f"j{j}")
    return model


def _vector(values: Array) -> np.ndarray:
    words = np.zeros(VECTOR, dtype=np.int64)
    words[:2] = address(values), len(values)
    return words


def _pointer(function: Any) -> int:
    return int(ctypes.cast(function, ctypes.c_void_p).value or 0)


def _address_of(instance: Any, kind: bytes) -> int:
    """Return the address of the C++ object of a type in a Python object; 0 if it has none."""
    query, lvalue = _boost()
    registration = query(kind)
    return int(lvalue(instance, registration) or 0) if registration else 0


@cache
def _boost() -> tuple[Any, Any]:
    """Return the functions of Boost.Python that find a type's registration, and an object by it."""
    library = ctypes.PyDLL(pinocchio_pywrap_default.__file__)  # keeps Python's lock
    query, lvalue = getattr(library, _QUERY), getattr(library, _LVALUE)
    query.restype = lvalue.restype = ctypes.c_void_p
    query.argtypes, lvalue.argtypes = [ctypes.c_char_p], [ctypes.py_object, ctypes.c_void_p]
    return query, lvalue


# --- for kernels ------------------------------------------------------------------------------------------------------


@intrinsic  # type: ignore[untyped-decorator]
def address_of(_typing: Any, values: Any) -> Any:
    """For kernels: the address of an array's first number."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = context.make_array(signature.args[0])(context, builder, arguments[0])
        return builder.ptrtoint(view.data, ir.IntType(64))

    return types.int64(values), generate


@intrinsic  # type: ignore[untyped-decorator]
def call_native(_typing: Any, function: Any, words: Any) -> Any:
    """For kernels: call the function at an address with some words."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        values = cgutils.unpack_tuple(builder, arguments[1])
        kind = ir.FunctionType(ir.IntType(64), [ir.IntType(64)] * len(values))
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), values)

    return types.int64(types.int64, words), generate


def _call(function: int, words: tuple[int, ...]) -> int:
    return int(ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * len(words))(function)(*words))


address_of.in_python, call_native.in_python = address, _call
