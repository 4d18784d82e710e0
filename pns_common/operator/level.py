"""One level's mesh before it is refined, with the measurements that the operator reads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.kernels import measures
from pns_common.kernels.frames import SHORTEST
from pns_common.mesh.creases import Creases
from pns_common.mesh.normals import NO_AREAS, measure_faces
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import BaseScheme


@dataclass(frozen=True, eq=False)
class EdgeMeasures:
    """Length h and x = 1 − n1 · n2 of every edge; x is 0 unless that is interior."""

    lengths: Float[np.ndarray, " E"]
    jumps: Float[np.ndarray, " E"]


@dataclass(frozen=True, eq=False)
class RingMeasures:
    """Measurements of the rings of vertices; ``kernels.measures`` names the columns.

    Attributes:
        fields: (V, 4) area-weighted mean normal, and umbrella height.
        means: (V, 5) means over spokes.
        valence: (V,) number of edges.
    """

    fields: Float[np.ndarray, "V 4"]
    means: Float[np.ndarray, "V M"]
    valence: Integer[np.ndarray, " V"]


@dataclass(frozen=True, eq=False)
class Level:
    """A mesh before refinement; each measurement is made when it is first read.

    Attributes:
        points: (V, 3) vertices.
        topology: connectivity and sharpness.
        base: the base scheme.
        reference_length: R ≥ 0, the unit of length of the budget; 0 switches corrections off, None
            where no rule reads it.
        blocks: how work is shared.
    """

    points: Float[np.ndarray, "V 3"]
    topology: Topology
    base: BaseScheme
    reference_length: float | None
    blocks: Blocks

    def with_creases(self, creases: Creases) -> Level:
        """Return the level with some edges kept sharp, and what is known of its faces."""
        normals = None if creases.angle is None else self.normals
        quiet = self.blocks.quiet()
        return self.with_topology(creases.applied(self.points, self.topology, normals, quiet))

    def with_topology(self, topology: Topology) -> Level:
        """Return the level with other sharpness, and what is known of its faces."""
        made = replace(self, topology=topology)
        for known in ("faces", "unmarked"):
            if known in vars(self):
                vars(made)[known] = vars(self)[known]
        return made

    @cached_property
    def unmarked(self) -> Level:
        """The level without sharp edges and corners, as networks of directed edges see it."""
        return self.with_topology(self.topology.without_creases())

    def measure(self, *, rings: bool) -> None:
        """Make the measurements that several threads are about to read."""
        _ = self.normals, self.logs
        if rings:
            _ = self.rings

    @cached_property
    def faces(self) -> tuple[Float[np.ndarray, "F 3"], Float[np.ndarray, "F 4"]]:
        """Unit normals, and twice the area vectors with their lengths."""
        return measure_faces(self.points, self.topology, self.blocks, areas=True)

    @property
    def normals(self) -> Float[np.ndarray, "F 3"]:
        """Unit normals of the faces; 0 without area."""
        return self.faces[0]

    @cached_property
    def edges(self) -> EdgeMeasures:
        """Lengths and turns of the edges."""
        mesh, count = self.topology, len(self.topology.edges)
        made = EdgeMeasures(np.empty(count), np.empty(count))
        read = self.points, self.normals, mesh.connectivity
        self.blocks.run(count, measures.measure_edges, *read, made.lengths, made.jumps)
        return made

    @cached_property
    def logs(self) -> Float[np.ndarray, " E"]:
        """Logarithms of the edges' lengths."""
        logs, lengths = np.empty(len(self.topology.edges)), self.edges.lengths

        def take(begin: int, end: int) -> None:
            np.log(np.maximum(lengths[begin:end], SHORTEST), out=logs[begin:end])

        self.blocks.run(len(logs), take)
        return logs

    @cached_property
    def rings(self) -> RingMeasures:
        """Means over the ring of every vertex."""
        mesh, count, owners = self.topology, len(self.points), self.blocks.owners(len(self.points))
        fields, means = np.empty((count, measures.FIELDS)), np.empty((count, measures.MEANS))
        valence = np.empty(count, dtype=np.int32)
        at_faces = mesh.connectivity, mesh.corner_reach, self.faces[1]
        spokes = self.points, mesh.edges, mesh.edge_reach, mesh.sharp_count

        def around(begin: int, end: int) -> None:
            measures.mean_normals(begin, end, *at_faces, fields)
            measures.mean_spokes(begin, end, *spokes, means, valence, fields)

        owners.run(count, around)
        # Nothing else reads the areas: an eighth of all memory.
        vars(self)["faces"] = self.normals, NO_AREAS
        return RingMeasures(fields, means, valence)

    @cached_property
    def ringed(self) -> Bool[np.ndarray, " V"]:
        """Vertices with one closed ring of faces: those that a vertex rule may move.

        The end of one crease, a dart, is among them; a vertex on a boundary is not.
        """
        mesh = self.topology
        ringed = mesh.fan_count == 1
        if len(mesh.sharp_count):
            creases = mesh.count_ends(mesh.crease_edges)
            ringed &= (mesh.sharp_count == 0) | ((mesh.sharp_count == 1) & (creases == 1))
        return ringed
