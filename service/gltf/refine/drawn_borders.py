"""Borders of what the primitives of a glTF mesh draw on its flat sides, in colours of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pns_common.connectivity.creases import Creases
from pns_common.crease_lines import named_on_parts
from pns_common.flat_borders import flat_borders
from pns_common.mesh import Cleaned

from .control_mesh import ControlMesh
from .face_parts import part_of_face
from .parts import Parts


def with_borders(
    control: ControlMesh, cleaned: Cleaned, lines: Creases, parts: Parts | None
) -> Creases:
    """Return the lines by name with these borders; the lines alone, as they are, without any.

    They are found first: no line ends or goes on by what is drawn beside it. `parts` are the meshes
    of a union; None: it is one mesh.
    """
    mesh = cleaned.mesh
    counts = [int(keep.sum()) for keep in control.kept]
    primitive = control.of_cleaned(cleaned, np.repeat(np.arange(len(counts)), counts))
    borders = flat_borders(mesh.vertices, mesh.faces, primitive)
    if len(borders) == 0:
        return lines
    found = named_on_parts(mesh, lines, *part_of_face(control, cleaned, parts))
    named = [borders] if found.named is None else [borders, found.named]
    return replace(found, named=np.concatenate(named))
