"""Source code of a mechanism's kinematics in C and JavaScript, translated from the compiled kernels."""

from cinegen.codegen.generate import generate
from cinegen.codegen.language import Language, name_of
from cinegen.codegen.program import Function, GenerationError

__all__ = ["Function", "GenerationError", "Language", "generate", "name_of"]
