"""Dense meshes to simplify: files in a folder, subdivided control meshes, and CAD-like parts."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pns_common import Mesh, MeshError, clean, loop
from train.connectivity import connect
from train.data.parts import CAD_PARTS
from train.refining import refine

# .npz: arrays `vertices` and `faces`.
FORMATS = (".glb", ".gltf", ".npz", ".obj", ".off", ".ply", ".stl")
# A file whose stem ends so holds a control mesh, to be subdivided.
CONTROL_ENDING = "_control_mesh"

CONTROL_LEVELS = 3
FEWEST_FACES = 900

ASSET, CONTROL, CAD = "file", "control mesh", "CAD part"


@dataclass(frozen=True, slots=True)
class DenseMesh:
    """A dense mesh: one manifold part without degenerate faces.

    Attributes:
        name: the file's name, or the part's.
        kind: ASSET, CONTROL or CAD.
    """

    name: str
    kind: str
    mesh: Mesh

    @property
    def title(self) -> str:
        """What the mesh is called in figures."""
        return self.name.partition(".")[0].removesuffix(CONTROL_ENDING)


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A file that is not in the test, and why."""

    name: str
    reason: str


def cad_meshes(fineness: int = 1) -> list[DenseMesh]:
    """Return every part of `train.data.parts`; with fineness n, of n² times the faces."""
    return [DenseMesh(name, CAD, make(fineness)) for name, make in CAD_PARTS.items()]


def asset_files(folder: Path) -> list[Path]:
    """Return the mesh files that lie in a folder itself, by name; folders in it are not read."""
    return sorted(
        (path for path in folder.iterdir() if path.is_file() and path.suffix.lower() in FORMATS),
        key=lambda path: path.name.lower(),
    )


def asset_meshes(folder: Path) -> Iterator[DenseMesh | LeftOut]:
    """Yield for each mesh file its dense mesh, or why there is none."""
    for path in asset_files(folder):
        yield dense_asset(path)


def dense_asset(path: Path) -> DenseMesh | LeftOut:
    """Return the largest manifold part of a file, welded by position; subdivided if a control mesh.

    A part is what hangs together across interior edges, so that a mesh is cut along edges of three
    faces or more.
    """
    try:
        part = largest_part(read_mesh(path))
    except MeshError as error:
        return LeftOut(path.name, error.reason)
    kind = CONTROL if path.stem.endswith(CONTROL_ENDING) else ASSET
    if kind == CONTROL:
        part = refine(part, loop(), CONTROL_LEVELS).mesh
    if not is_manifold(part):
        return LeftOut(path.name, "its largest part is no manifold")
    if len(part.faces) < FEWEST_FACES:
        return LeftOut(path.name, f"faces of its largest part: {len(part.faces)}")
    if np.linalg.matrix_rank(part.vertices - part.vertices[0]) < 3:
        return LeftOut(path.name, "it lies in a plane, where every scheme stays")
    return DenseMesh(path.name, kind, part)


def welded(mesh: Mesh) -> Mesh:
    """Return a mesh whose vertices at exactly one position are one, without degenerate faces.

    Raises:
        MeshError: nothing is left.
    """
    # −0 and 0 are one coordinate, but not the same bytes.
    positions, number = np.unique(mesh.vertices + 0.0, axis=0, return_inverse=True)
    return clean(Mesh(positions, number.reshape(-1)[mesh.faces])).mesh


def largest_part(mesh: Mesh) -> Mesh:
    """Return the part of a mesh with the most faces; parts meet at no interior edge."""
    level = connect(mesh.faces, len(mesh.vertices))
    first, second = level.half_edges[level.interior].T.numpy() // 3
    count = len(mesh.faces)
    joins = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    _, part = connected_components(joins, directed=False)
    return clean(Mesh(mesh.vertices, mesh.faces[part == np.bincount(part).argmax()])).mesh


def is_manifold(mesh: Mesh) -> bool:
    """Return whether all edges are interior or boundary, and all vertices used, with one fan."""
    level = connect(mesh.faces, len(mesh.vertices))
    regular = bool((level.paired | level.boundary).all())
    used = len(np.unique(mesh.faces)) == len(mesh.vertices)
    return regular and used and bool((level.fans <= 1).all())


def read_mesh(path: Path) -> Mesh:
    """Return all triangles of a file, in its scene's coordinates, welded.

    Raises:
        MeshError: it cannot be read, or has no triangles.
    """
    read = _arrays_of_numpy if path.suffix.lower() == ".npz" else _arrays_of_scene
    try:
        vertices, faces = read(path)
    except Exception as error:  # on a broken file these readers fail as it comes
        raise MeshError("it cannot be read", element="file") from error
    return welded(Mesh(vertices, faces))


def _arrays_of_scene(path: Path) -> tuple[np.ndarray, np.ndarray]:
    # Coordinates that are no numbers are refused by the mesh.
    with np.errstate(invalid="ignore"):
        scene = trimesh.load_scene(path, process=False, skip_materials=True).to_mesh()
    return scene.vertices, scene.faces


def _arrays_of_numpy(path: Path) -> tuple[np.ndarray, np.ndarray]:
    # Opened here: of a broken archive numpy leaves the file open.
    with path.open("rb") as file, np.load(file) as arrays:
        return arrays["vertices"], arrays["faces"]
