"""Parents of refined vertices, as arrays of an .npz file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Shaped

from pns_common.matrix import SubdivisionMatrix

from ..read.schema import Document
from ..refine.meshes import MeshOutcome

Arrays = dict[str, Shaped[np.ndarray, "..."]]


def matrix_arrays(parents: SubdivisionMatrix, under: str = "") -> Arrays:
    """Return a matrix as `scipy.sparse.load_npz` reads it, with `under` before each name."""
    parts = {
        "format": np.array(b"csr"),
        "shape": np.array(parents.shape),
        "data": parents.weights,
        "indices": parents.columns,
        "indptr": parents.starts,
    }
    return {f"{under}{name}": values for name, values in parts.items()}


def parents_of_mesh(document: Document, mesh: MeshOutcome) -> Arrays:
    """Return a matrix for each refined primitive of a mesh that was traced.

    A row is a vertex written. Columns are the elements of the POSITION accessors of all primitives
    of the mesh, one primitive after the other; `offsets` says where those of each begin.
    """
    counts = [
        document.accessors[primitive.attributes["POSITION"]].count
        if "POSITION" in primitive.attributes
        else 0
        for primitive in document.meshes[mesh.index].primitives
    ]
    offsets = np.cumsum([0, *counts])
    arrays = {f"meshes/{mesh.index}/offsets": offsets}
    if mesh.parents is None:
        return arrays
    elements = np.concatenate([own.rows + offsets[own.number] for own in mesh.primitives])
    for refined in mesh.refined:
        if refined.vertex is None:
            raise ValueError("a mesh of a union is not traced")
        own = mesh.parents.take(refined.vertex)
        own = replace(own, columns=elements[own.columns], shape=(own.shape[0], int(offsets[-1])))
        under = f"meshes/{mesh.index}/primitives/{refined.source.number}/"
        arrays |= matrix_arrays(own, under)
    return arrays
