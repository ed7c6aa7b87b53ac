"""The visual shapes of a mechanism."""

from __future__ import annotations

import pinocchio as pin

from cinegen.errors import LoadError


def shapes(model: pin.Model, urdf: str, folder: str | None) -> pin.GeometryModel:
    """The visual shapes that a URDF gives its links, as Pinocchio reads them.

    Args:
        model: of the same URDF.
        urdf: its text.
        folder: where its meshes are looked for.

    Raises:
        LoadError: a mesh can't be read.
    """
    folders = [folder] if folder else []
    try:
        return pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.VISUAL, None, folders)
    except (ValueError, RuntimeError) as error:
        raise LoadError(f"the shapes of '{model.name}' can't be read: {error}") from None
