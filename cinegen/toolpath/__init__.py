"""Tool paths along curves: seams, their files, and the poses along them."""

from cinegen.toolpath.seam import Seam

__all__ = ["Seam"]
