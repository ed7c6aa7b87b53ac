"""The inertia that a RAFF file gives to a node: stated, or that of a solid of one density."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

from raff2urdf.errors import RaffError, RaffWarning
from raff2urdf.graphics.meshes import Graphics
from raff2urdf.graphics.skeleton import SkeletonDrawing
from raff2urdf.inertia import Inertia, sum_of
from raff2urdf.raff.document import Document, RaffInertial, RaffNode
from raff2urdf.raff.sizes import LARGEST, label
from raff2urdf.tree import stated_inertia
from raff2urdf.writers.inertia import load_surface, of_geometry, of_surface


class RaffMasses:
    """The inertias of the nodes of one robot.

    Args:
        document: that holds the robot.
        graphics: of the robot.
        skeleton: of the robot.
    """

    def __init__(self, document: Document, graphics: Graphics, skeleton: SkeletonDrawing) -> None:
        self.document, self.graphics, self.skeleton = document, graphics, skeleton

    def of(self, node: RaffNode) -> Inertia | None:
        """Return the inertia of a node in its own frame, kg and m; None if the file gives none. Of a surface that does
        not enclose a volume the convex hull counts, and a warning names it.

        Raises:
            RaffError: a density without a volume.
        """
        if node.inertial is None:
            return None
        if node.inertial.density is None:
            return stated_inertia(self.document, node.inertial)
        density, radius = node.inertial.density, node.inertial.radius
        if radius is None:
            whole = sum_of(self._of_files(node, node.inertial, density))
        else:
            bars = self.skeleton.bars(node, self.document.metres(radius))
            whole = sum_of(of_geometry(shape, density).in_frame(placed) for shape, placed in bars)
        if whole.mass <= 0.0:
            lacking = "no children, and so no bars" if radius is not None else "graphics that enclose no volume"
            raise self._error(node.inertial, f"{label(node)} has a 'density', but {lacking}: give its 'mass'")
        if not whole.largest <= LARGEST:
            what = f"{label(node)} has an inertia beyond {LARGEST:g} in SI units, the largest"
            raise self._error(node.inertial, f"{what}: check the density and the units")
        return whole

    def _of_files(self, node: RaffNode, inertial: RaffInertial, density: float) -> Iterator[Inertia]:
        import trimesh

        for name in node.filenames or ():
            drawings, reason = self.graphics.of_file(name)
            if reason is not None:
                why = f"{label(node)} has a 'density', but its graphics '{name}' can't be read: {reason}"
                raise self._error(inertial, f"{why}. Give its 'mass'")
            parts = [load_surface(drawing.path, self.graphics.written.get(drawing.path)) for drawing in drawings]
            surface: Any = trimesh.util.concatenate(parts)
            surface.merge_vertices()
            if not surface.is_volume:
                message = (
                    f"the graphics '{name}' of {label(node)} enclose no volume: its mass is that of its convex hull"
                )
                where = inertial.locations.get("density")
                warnings.warn(str(self.document.source.problem(message, where)), RaffWarning, stacklevel=2)
            yield of_surface(surface, density, self.document.metres(1.0))

    def _error(self, inertial: RaffInertial, message: str) -> RaffError:
        return RaffError(self.document.source.problem(message, inertial.locations.get("density")))
