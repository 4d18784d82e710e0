"""Options of a refinement, and limits on its cost."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin, get_type_hints

from pns_common.scheme_names import BASE_SCHEMES

from .errors import InvalidParameter, check_choice

# Of the environment's variables that are settings.
PREFIX = "PNS_"
MAX_LEVELS = 6
# The library's, without its import (tests hold them equal).
DEFAULT_LEVELS = 2

if TYPE_CHECKING:
    SchemeName = str
else:  # A type checker cannot see the names that a table gives.
    SchemeName = Literal["auto", "pns", *BASE_SCHEMES]
Diagnostics = Literal["summary", "full", "none"]
UvRule = Literal["linear", "smooth"]
NormalRule = Literal["auto", "keep", "smooth"]
WeldRule = Literal["position", "index", "off"]
BorderRule = Literal["smooth", "corners", "fixed"]
PolygonRule = Literal["auto", "off"]
Compression = Literal["none", "draco", "meshopt"]
# A weld further than a hundredth of R is a different tool: it would take features away.
MAX_WELD_TOLERANCE = 0.01
# `angle:` is followed by degrees.
_CREASE = r"^(auto|off|normals|angle:\d{1,3}(\.\d{1,6})?)$"

# A length in the file's units, or a share of the mesh's diagonal; empty: none.
_LENGTH = r"^(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?%?$"

# The upload, its decoded JSON, and its bytes again in the answer.
BYTES_PER_INPUT_BYTE = 4

# Groups of `--help`, in their order.
EVERYDAY, FILES, MORE, RESEARCH = "Everyday", "Files", "More", "Research"


def _told(panel: str, metavar: str | None = None, **bounds: Any) -> dict[str, Any]:
    """Return how the command line shows an option, and what its type does not say of its bounds."""
    return {"panel": panel, "metavar": metavar, "bounds": bounds}


@dataclass(frozen=True, slots=True)
class Options:
    """One request's parameters, valid once constructed: the command line's and HTTP's too.

    `budget` is the dimensionless C (None: the model's own); `reference_length` is a length in the
    mesh's local coordinates, or "auto"; `weld_tolerance` is in units of R; `limit` puts the
    vertices on the limit surface, with its normals; `tolerance`, `angle`, `max_faces` and
    `max_edge_length` refine faces only where that is needed, by up to MAX_LEVELS levels whatever
    `levels` are; `polygons` joins triangles of a glTF;
    `material` and `group` name the faces to refine (None: all). Raises InvalidParameter.
    """

    levels: int = field(default=DEFAULT_LEVELS, metadata=_told(EVERYDAY, ge=1, le=MAX_LEVELS))
    tolerance: str | None = field(default=None, metadata=_told(EVERYDAY, "X|X%", pattern=_LENGTH))
    angle: float | None = field(default=None, metadata=_told(EVERYDAY, "DEG", gt=0, lt=180))
    max_faces: int | None = field(default=None, metadata=_told(EVERYDAY, "N", ge=1))
    max_edge_length: str | None = field(
        default=None, metadata=_told(EVERYDAY, "X|X%", pattern=_LENGTH)
    )
    crease: str = field(
        default="auto", metadata=_told(EVERYDAY, "auto|off|normals|angle:DEG", pattern=_CREASE)
    )
    scheme: SchemeName = field(default="auto", metadata=_told(EVERYDAY))
    limit: bool = field(default=True, metadata=_told(EVERYDAY))
    normals: NormalRule = field(default="auto", metadata=_told(EVERYDAY))
    uv: UvRule = field(default="linear", metadata=_told(MORE))
    weld: WeldRule = field(default="position", metadata=_told(MORE))
    weld_tolerance: float = field(
        default=0.0, metadata=_told(MORE, "X", ge=0, le=MAX_WELD_TOLERANCE, allow_inf_nan=False)
    )
    border: BorderRule = field(default="smooth", metadata=_told(MORE))
    polygons: PolygonRule = field(default="off", metadata=_told(MORE))
    material: str | None = field(default=None, metadata=_told(MORE, "NAME"))
    group: str | None = field(default=None, metadata=_told(MORE, "NAME"))
    compress: Compression = field(default="none", metadata=_told(FILES))
    budget: float | None = field(
        default=None, metadata=_told(RESEARCH, "C", ge=0, allow_inf_nan=False)
    )
    reference_length: float | Literal["auto"] = field(
        default="auto", metadata=_told(RESEARCH, "auto|X")
    )
    diagnostics: Diagnostics = field(default="summary", metadata=_told(RESEARCH))

    def __post_init__(self) -> None:
        if not 1 <= self.levels <= MAX_LEVELS:
            raise InvalidParameter(
                "levels", f"levels is {self.levels}; it must be 1 to {MAX_LEVELS}"
            )
        for name, choices in _CHOICES.items():
            check_choice(name, getattr(self, name), choices)
        if self.budget is not None and not (math.isfinite(self.budget) and self.budget >= 0):
            raise InvalidParameter("budget", "budget must be a finite number, zero or more")
        if self.reference_length != "auto" and not (
            math.isfinite(self.reference_length) and self.reference_length > 0
        ):
            raise InvalidParameter(
                "reference_length", "reference_length must be 'auto' or a finite positive number"
            )
        if not re.fullmatch(_CREASE, self.crease) or not (self.crease_angle or 0) <= math.pi:
            raise InvalidParameter(
                "crease",
                "crease must be 'auto', 'off', 'normals' or 'angle:' and 0 to 180 degrees, "
                "as in 'angle:40'",
            )
        if not 0 <= self.weld_tolerance <= MAX_WELD_TOLERANCE:
            raise InvalidParameter(
                "weld_tolerance", f"weld_tolerance must be 0 to {MAX_WELD_TOLERANCE}"
            )
        if self.weld_tolerance and self.weld != "position":
            raise InvalidParameter("weld_tolerance", "weld_tolerance needs weld=position")

        self._check_goals()

    def _check_goals(self) -> None:
        """Check what faces of several levels are asked for. Raises InvalidParameter."""
        for name in ("tolerance", "max_edge_length"):
            given = getattr(self, name)
            if given is None:
                continue
            if not re.fullmatch(_LENGTH, given) or float(given.rstrip("%")) <= 0:
                expected = "must be a length above 0, or a share of the diagonal, as in 0.1%"
                raise InvalidParameter(name, f"{name} is {given}; it {expected}")
        if self.angle is not None and not 0 < self.angle < 180:
            expected = "must be degrees, above 0 and below 180"
            raise InvalidParameter("angle", f"angle is {self.angle:g}; it {expected}")
        if self.max_faces is not None and self.max_faces < 1:
            raise InvalidParameter(
                "max_faces", f"max_faces is {self.max_faces}; it must be above 0"
            )
        if not self.goals:
            return
        with_goal = f"with {', '.join(self.goals)}"
        wrong = {
            "scheme": self.scheme == "catmull-clark" and "polygons are refined by whole levels",
            "uv": self.uv == "smooth" and "texture coordinates are linear",
            "polygons": self.polygons != "off" and "triangles stay triangles",
            "limit": not self.limit and "vertices are on the limit surface",
            "material": self.material is not None and "all faces are refined",
            "group": self.group is not None and "all faces are refined",
        }
        for name, reason in wrong.items():
            if reason:
                raise InvalidParameter(name, f"{with_goal} {reason}: leave {name} out")

    @property
    def goals(self) -> dict[str, Any]:
        """Goals of faces of several levels, as arguments of the library's refine."""
        names = ("tolerance", "angle", "max_faces", "max_edge_length")
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}

    def faces_after(self, triangles: int) -> int:
        """Return how many faces triangles become; of a goal the most, or the least if not known."""
        if self.max_faces is not None:
            return max(self.max_faces, triangles)
        return triangles if self.goals else triangles * 4**self.levels

    @property
    def learns(self) -> bool:
        """True if a model is asked for, if only for meshes of triangles."""
        return self.scheme in ("auto", "pns")

    @property
    def selects(self) -> bool:
        """True if some faces are refined alone."""
        return self.material is not None or self.group is not None

    @property
    def crease_angle(self) -> float | None:
        """The dihedral angle, in radians, above which an edge is a crease; None without one."""
        rule, _, degrees = self.crease.partition(":")
        return math.radians(float(degrees)) if rule == "angle" else None

    @property
    def weld_unit(self) -> float | None:
        """The length that `weld_tolerance` counts in; None: each mesh's own R."""
        return None if self.reference_length == "auto" else self.reference_length


# What each says to users, of the command line and of HTTP.
DESCRIPTIONS = {
    "levels": f"how fine, 1 to {MAX_LEVELS}: each level makes four faces of one. "
    "Without effect with tolerance, angle, max_faces or max_edge_length",
    "scheme": "the rules. auto and pns: the learned ones; of polygons that the model has no rules "
    "for auto makes quads by Catmull-Clark, and pns triangles. loop: the classic rules for "
    "triangles; polygons are cut. catmull-clark: the classic rules for polygons",
    "budget": "C, dimensionless: how far the model may go from Loop. Default: the model's own",
    "reference_length": "R, the unit of length of the budget. auto measures each mesh: the largest "
    "distance of a vertex from the centroid of all, over √2",
    "diagnostics": "what a glTF carries of the report. full: also the vertex attributes "
    "_PNS_RATIO and _PNS_GATE of the last learned level",
    "uv": "smooth: Loop's stencil inside charts; their boundaries stay linear",
    "normals": "shading. auto: the file's normals; new ones, smooth but across sharp edges, where "
    "a mesh of a glTF has none, and where most faces are shaded flat and crease is off. keep: the "
    "file's, or none. smooth: new ones for every mesh. New ones are those of the limit surface, "
    "if the vertices are on it",
    "crease": "edges to keep sharp. auto: those that the model finds, and those that a glTF's "
    "shading marks. angle: and degrees, as in angle:40: edges that bend by more. normals: edges "
    "where the file's normals differ. off: none, everything becomes round",
    "weld": "which vertices are one. position: those in one place. index: those that the file "
    "gives one number, so that poses keep one numbering. off: corners alike in all they have",
    "weld_tolerance": f"0 to {MAX_WELD_TOLERANCE}: join vertices nearer than this share of the "
    "mesh's size R, the largest distance of a vertex from the centroid of all, over √2",
    "border": "boundaries. smooth: curves. corners: curves that end at vertices of one face. "
    "fixed: as they are",
    "polygons": "triangles of a glTF. auto: joined to the quads that most of them are halves of, "
    "or to polygons by FB_ngon_encoding, for Catmull-Clark. off: refined as they are",
    "material": "refine only the faces of this material; triangles beside them are cut, and "
    "polygons get more corners",
    "group": "refine only this group or object of an OBJ, or mesh of a glTF, by its name or that "
    "of a node that shows it",
    "compress": "how a glTF's geometry is written. meshopt: exact. draco: smaller; positions, "
    "normals and UVs are rounded",
    "limit": "put each vertex where endless refinement would take it, on the limit surface: then "
    "more levels give a finer mesh of one shape. Off: control points for further refinement",
    "tolerance": "refine faces only where they may be farther from the limit surface, by up to "
    f"{MAX_LEVELS} levels: a length in the file's units, or as in 0.1% a share of each mesh's "
    "diagonal. Polygons are cut into triangles",
    "angle": "refine faces only where shading turns over them by more degrees, measured at their "
    "corners and where finer faces have vertices on their sides; sharp edges apart, as tolerance",
    "max_faces": "most faces of the file: those farthest from the limit surface are refined first. "
    "Of several meshes in a glTF each has the share that it has before",
    "max_edge_length": "refine faces only where their sides are longer; as tolerance",
}

_CHOICES = {
    name: get_args(hint)
    for name, hint in get_type_hints(Options).items()
    if get_origin(hint) is Literal
}


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits on the cost of one job; checked against predictions, before memory is allocated.

    Bytes for `max_memory_bytes`; counts for the others. `max_json_items` bounds the characters that
    open or separate values in the JSON text, `max_json_depth` how deep it nests.
    """

    max_faces: int = 5_000_000
    max_memory_bytes: int = 4 * 1024**3
    max_json_items: int = 2_000_000
    max_json_depth: int = 128
