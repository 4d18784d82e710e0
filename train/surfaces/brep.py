"""Exact solids of OpenCascade, and their surfaces as triangles with exact normals.

OpenCascade (LGPL-2.1, Python wheel `cadquery-ocp-novtk`) makes training data alone. A shape is
built by booleans, fillets and chamfers from prisms, cylinders and turned profiles.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Int
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepAlgoAPI import BRepAlgoAPI_BooleanOperation, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_Transform,
)
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepFilletAPI import BRepFilletAPI_MakeChamfer, BRepFilletAPI_MakeFillet
from OCP.BRepLib import BRepLib_ToolTriangulatedShape
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism, BRepPrimAPI_MakeRevol
from OCP.BRepTools import BRepTools
from OCP.collections import (
    IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher,
    List_TopoDS_Shape,
)
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.gp import gp_Ax1, gp_Ax2, gp_Ax3, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Shape

Solid: TypeAlias = TopoDS_Shape
Vector = Sequence[float] | Float[np.ndarray, " N"]

# Points nearer than this share of the shape's size are one vertex.
WELD = 1e-7

# A finished edge's radius or width, over the shortest edge's length, at most.
LARGEST_FINISH = 0.3


@dataclass(frozen=True, eq=False, slots=True)
class Tessellation:
    """The triangles of a solid; a vertex where several of its faces meet has a normal in each.

    Attributes:
        normals: of each corner, exact: those of the surface that its triangle belongs to.
    """

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    normals: Float[np.ndarray, "F 3 3"]


def prism(outline: Float[np.ndarray, "N 2"], low: float, high: float) -> Solid:
    """Return the prism of a polygon of the xy plane between two heights."""
    return BRepPrimAPI_MakePrism(
        _polygon(np.c_[outline, np.full(len(outline), low)]), gp_Vec(0, 0, high - low)
    ).Shape()


def box(low: Vector, high: Vector) -> Solid:
    """Return the box between two corners."""
    (x, y, z), (u, v, w) = low, high
    return prism(np.array([[x, y], [u, y], [u, v], [x, v]]), z, w)


def turned(profile: Float[np.ndarray, "N 2"]) -> Solid:
    """Return what a closed polygon of (radius, height) sweeps round the z axis."""
    points = np.c_[profile[:, 0], np.zeros(len(profile)), profile[:, 1]]
    axis = gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))
    return BRepPrimAPI_MakeRevol(_polygon(points), axis).Shape()


def cylinder(centre: Vector, radius: float, low: float, high: float) -> Solid:
    """Return an upright cylinder round (x, y)."""
    profile = np.array([[0, low], [radius, low], [radius, high], [0, high]])
    return moved(turned(profile), (*centre, 0.0))


def moved(shape: Solid, shift: Vector) -> Solid:
    """Return a shape moved along a vector."""
    motion = gp_Trsf()
    motion.SetTranslation(gp_Vec(*map(float, shift)))
    return BRepBuilderAPI_Transform(shape, motion, True).Shape()


def laid_over(shape: Solid, axis: int) -> Solid:
    """Return a shape whose upright axis points along x (0), y (1) or z (2)."""
    motion = gp_Trsf()
    direction = gp_Dir(*(float(k == axis) for k in range(3)))
    aside = gp_Dir(*(float(k == (axis + 1) % 3) for k in range(3)))
    motion.SetTransformation(gp_Ax3(gp_Ax2(gp_Pnt(0, 0, 0), direction, aside)), gp_Ax3())
    return BRepBuilderAPI_Transform(shape, motion, True).Shape()


def fused(shape: Solid, others: Iterable[Solid]) -> Solid:
    """Return the union."""
    return _operated(BRepAlgoAPI_Fuse(), shape, others)


def cut(shape: Solid, others: Iterable[Solid]) -> Solid:
    """Return the shape without the others."""
    return _operated(BRepAlgoAPI_Cut(), shape, others)


def _operated(
    operation: BRepAlgoAPI_BooleanOperation, shape: Solid, others: Iterable[Solid]
) -> Solid:
    arguments, tools = List_TopoDS_Shape(), List_TopoDS_Shape()
    arguments.Append(shape)
    for other in others:
        tools.Append(other)
    if tools.Size() == 0:
        return shape
    operation.SetArguments(arguments)
    operation.SetTools(tools)
    operation.Build()
    operation.SimplifyResult()
    return operation.Shape()


def edge_groups(shape: Solid) -> list[list[TopoDS_Edge]]:
    """Return the edges in groups of one kind of curve whose middles are at one height."""
    groups: dict[tuple[object, float], list[TopoDS_Edge]] = {}
    for part in _explored(shape, TopAbs_ShapeEnum.TopAbs_EDGE):
        edge = TopoDS.Edge(part)
        if BRep_Tool.Degenerated_s(edge):
            continue
        curve = BRepAdaptor_Curve(edge)
        middle = curve.Value((curve.FirstParameter() + curve.LastParameter()) / 2)
        key = (curve.GetType(), round(middle.Z(), 3))
        groups.setdefault(key, []).append(edge)
    return list(groups.values())


def filleted(shape: Solid, edges: Iterable[TopoDS_Edge], radius: float) -> Solid:
    """Round edges with a radius; return the shape as it is where OpenCascade cannot."""
    return _finished(BRepFilletAPI_MakeFillet(shape), shape, edges, radius)


def chamfered(shape: Solid, edges: Iterable[TopoDS_Edge], width: float) -> Solid:
    """Chamfer edges by a width on both sides; return the shape as it is where it cannot be."""
    return _finished(BRepFilletAPI_MakeChamfer(shape), shape, edges, width)


def tessellated(shape: Solid, deflection: float, angle: float) -> Tessellation:
    """Return triangles whose chords are within a deflection, and turn by at most an angle."""
    BRepTools.Clean_s(shape)
    BRepMesh_IncrementalMesh(shape, deflection, False, angle, False)
    points, normals, faces, count = [], [], [], 0
    for part in _explored(shape, TopAbs_ShapeEnum.TopAbs_FACE):
        face = TopoDS.Face(part)
        place = TopLoc_Location()
        triangles = BRep_Tool.Triangulation_s(face, place)
        if triangles is None:
            continue
        BRepLib_ToolTriangulatedShape.ComputeNormals_s(face, triangles)
        turned_over = part.Orientation() == TopAbs_Orientation.TopAbs_REVERSED
        nodes = range(1, triangles.NbNodes() + 1)
        shift = place.Transformation().TranslationPart().Coord()  # a prism's upper face has one
        points.append(np.array([triangles.Node(node).Coord() for node in nodes]) + shift)
        outward = np.array([triangles.Normal(node).Coord() for node in nodes])
        normals.append(-outward if turned_over else outward)
        corners = np.array(
            [triangles.Triangle(k).Get() for k in range(1, triangles.NbTriangles() + 1)]
        )
        faces.append((corners[:, ::-1] if turned_over else corners) - 1 + count)
        count += len(nodes)
    return _welded(*(np.concatenate(rows) for rows in (points, normals, faces)))


def _welded(
    points: Float[np.ndarray, "N 3"],
    normals: Float[np.ndarray, "N 3"],
    faces: Int[np.ndarray, "F 3"],
) -> Tessellation:
    size = float(np.ptp(points, axis=0).max())
    _, first, number = np.unique(
        np.round(points / (WELD * size)), axis=0, return_index=True, return_inverse=True
    )
    welded = number.reshape(-1)[faces]
    kept = (welded != np.roll(welded, 1, axis=1)).all(axis=1)
    return Tessellation(points[first], welded[kept], normals[faces[kept]])


def _explored(shape: Solid, kind: TopAbs_ShapeEnum) -> Iterator[Solid]:
    """Yield all faces, or edges, each once."""
    found = IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher()
    TopExp.MapShapes_s(shape, kind, found)
    for number in range(1, found.Size() + 1):
        yield found.FindKey(number)


def _polygon(points: Float[np.ndarray, "N 3"]) -> Solid:
    maker = BRepBuilderAPI_MakePolygon()
    for point in points:
        maker.Add(gp_Pnt(*map(float, point)))
    maker.Close()
    return BRepBuilderAPI_MakeFace(maker.Wire()).Shape()


def _finished(
    maker: BRepFilletAPI_MakeFillet | BRepFilletAPI_MakeChamfer,
    shape: Solid,
    edges: Iterable[TopoDS_Edge],
    size: float,
) -> Solid:
    edges = list(edges)
    shortest = min(GCPnts_AbscissaPoint.Length_s(BRepAdaptor_Curve(edge)) for edge in edges)
    try:
        for edge in edges:
            maker.Add(min(size, LARGEST_FINISH * shortest), edge)
        maker.Build()
        done = maker.Shape() if maker.IsDone() else shape
    except Exception:  # OpenCascade's exceptions share no base class in Python
        return shape
    return done if BRepCheck_Analyzer(done).IsValid() else shape
