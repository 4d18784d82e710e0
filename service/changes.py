"""Everything that the service may change or lose beside the geometry: codes, texts, what to do.

A report names a change by its code, which stays; its text is for people.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from .errors import shortened, shortened_pointer


@dataclass(frozen=True)
class Advice:
    """Advice on what to do, or that nothing need be done.

    Attributes:
        text: for people; options are spelled in it as below.
        options: those that it names, as HTTP spells them: ``crease=off``.
    """

    text: str
    options: tuple[str, ...] = ()

    def as_entry(self) -> dict[str, Any]:
        """Return it as an entry of a report."""
        return {"text": self.text, "options": [*self.options]}


@dataclass(frozen=True)
class Kind:
    """A kind of change: its text, where ``{}`` stands for names, and what to do about it."""

    text: str
    advice: Advice | None = None


Key = TypeVar("Key", bound="str | tuple[str, ...]")
NO_HARM = Advice("harmless")
KINDS = {
    # Of every format.
    "degenerate-faces": Kind("degenerate faces dropped", Advice("harmless, they have no area")),
    "left-as-it-was": Kind("left as it was: no face has an area"),
    "too-far": Kind(
        "faces too far from the origin: a side has fewer than {} steps of float32",
        Advice("move the mesh to the origin, or it will look toothed"),
    ),
    "near-misses": Kind(
        "border vertices lie within 1e-5 R of another",
        Advice("use weld_tolerance=0.001 if the result has gaps", ("weld_tolerance=0.001",)),
    ),
    "joined": Kind("vertices joined within weld_tolerance"),
    "joints-cut": Kind(
        "refined vertices that lost their lightest joints, at most {} % of the weight",
        Advice("if they move wrongly add JOINTS_1 and WEIGHTS_1"),
    ),
    "light-joints-cut": Kind(
        "refined vertices that lost their lightest joints, at most 1 % of the weight", NO_HARM
    ),
    "opposed-normals": Kind(
        "corners with a normal that points away from their face's front",
        Advice("if they show as dark spots use normals=smooth", ("normals=smooth",)),
    ),
    "unused-file": Kind("not used by the document: {}"),
    # A glTF's document.
    "bytes-behind": Kind("bytes behind the GLB left out", NO_HARM),
    "buffers-joined": Kind("joined into one", NO_HARM),
    "buffers-numbered": Kind("joined: {} may name them by number"),
    "buffer-properties": Kind("left out, since buffers are one: {}"),
    "meshopt-decoded": Kind(
        "meshopt compression decoded",
        Advice("harmless, compress=meshopt packs the result again", ("compress=meshopt",)),
    ),
    "draco-decoded": Kind(
        "Draco compression decoded",
        Advice("harmless, compress=draco packs the result again", ("compress=draco",)),
    ),
    "embedded": Kind("embedded", Advice("harmless, the result needs no file beside it")),
    "kept-by-uri": Kind("kept by its URI: {}"),
    "numbers-of-vertices": Kind("left out: {}, by the numbers of vertices"),
    "extras-moved": Kind("moved to /asset/extras/extras"),
    "breach": Kind("found, and left: {}", NO_HARM),
    "whole-floats": Kind(
        "found, and read as integers: integers that are written with a fraction, as 3.0"
    ),
    # Its storage.
    "geometry-kept": Kind("replaced geometry kept: {} may refer to it"),
    "ngons-replaced": Kind("{} left out: other triangles are in place of its own"),
    "ngons-reordered": Kind("{} left out: Draco orders triangles anew"),
    "outlines-reordered": Kind("{} left out: Draco orders vertices anew"),
    "lines-left": Kind("points and lines left where they were, beside what is refined"),
    "strip": Kind("triangle strip written as triangles", NO_HARM),
    "fan": Kind("triangle fan written as triangles", NO_HARM),
    "sparse": Kind("sparse accessors written dense", NO_HARM),
    "quantised": Kind("quantised attributes written as float32", NO_HARM),
    "accessors-extended": Kind("left out with the accessors that had them: {}"),
    "meshopt": Kind("compressed by meshopt, exactly"),
    "draco": Kind("compressed by Draco: positions, normals and texture coordinates rounded"),
    "not-draco": Kind("not compressed: Draco cannot hold it"),
    "not-compressed": Kind("not compressed: only a glTF is"),
    # Mesh files that are read.
    "dropped": Kind("{} dropped"),
    "few-corners": Kind("faces of fewer than three vertices dropped", NO_HARM),
    "unused-vertices": Kind("vertices dropped that no face uses", NO_HARM),
    "repeated-corners": Kind("repeated corners dropped"),
    "facet-tail": Kind("bytes behind the last facet left out"),
    "facet-count": Kind("count of facets corrected: the file says {}"),
    "solid-open": Kind("end of the last solid missing: the file may be cut off"),
    "polygons-cut": Kind("triangles added by cutting polygons", NO_HARM),
    "polygons-crossed": Kind(
        "polygons without an area or that cross themselves: their triangles may overlap"
    ),
    "concave-cut": Kind("concave polygons cut into convex pieces"),
    "concave-crossed": Kind("polygons that cross themselves: their quads may overlap"),
    # Files that are written in another format.
    "not-written": Kind("{} dropped: not written to {} files"),
    "no-coordinates": Kind("names of textures dropped: there are no texture coordinates"),
    "no-library": Kind("materials not found: no {} came with the file"),
    "rounded-flat": Kind("faces without an area once positions are rounded to float32"),
    "rounded-far": Kind(
        "faces too far from the origin once positions are rounded to float32: fewer than {} steps "
        "to a side",
        Advice("move the mesh to the origin, or it will look toothed"),
    ),
    "left-out": Kind("{} left out"),
    "several-parents": Kind("nodes with several parents placed once, by one"),
    "nodes-joined": Kind("nodes joined into one mesh in world space", NO_HARM),
    "copied-beside": Kind("copied beside the result: {}"),
    "not-copied": Kind(
        "not copied, since others of these names lie there (--force replaces them): {}"
    ),
    # What a report counts elsewhere.
    "non-manifold": Kind(
        "non-manifold edge, refined as a border",
        Advice("harmless unless the faces come apart there"),
    ),
}


@dataclass(frozen=True)
class Change:
    """Something lost or changed beside the geometry.

    Attributes:
        pointer: where: a JSON pointer, or nothing.
        code: its kind, of KINDS.
        count: how often.
        names: those that its text has room for. Of names without end, which an upload may hold, a
            beginning is told.
    """

    pointer: str
    code: str
    count: int
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pointer", shortened_pointer(self.pointer))
        object.__setattr__(self, "names", tuple(shortened(name) for name in self.names))

    @property
    def what(self) -> str:
        """The kind's text with the names in it."""
        return shortened(KINDS[self.code].text.format(*self.names))

    def as_entry(self) -> dict[str, Any]:
        """Return it as an entry of a report."""
        return {
            "pointer": self.pointer,
            "code": self.code,
            "what": self.what,
            "count": self.count,
        }


def counted(counts: Mapping[Key, int], pointer: str = "") -> list[Change]:
    """Return a change for each kind that occurs, of counts by code, or by code and names."""
    kinds = {(key,) if isinstance(key, str) else key: count for key, count in counts.items()}
    return [
        Change(pointer, code, count, tuple(names))
        for (code, *names), count in kinds.items()
        if count
    ]


def changes_of(changes: Iterable[Change]) -> dict[str, Any]:
    """Return the report's entries on changes, and what to do about those that do not say it."""
    return with_changes({"changes": []}, changes)


def with_changes(report: dict[str, Any], changes: Iterable[Change]) -> dict[str, Any]:
    """Return a report that tells of more changes."""
    entries = [*report["changes"], *(change.as_entry() for change in changes)]
    return report | {"changes": entries, "hints": _hints_on(entries)}


def _hints_on(entries: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return what to do about entries of a report, by code."""
    advice = {entry["code"]: KINDS[entry["code"]].advice for entry in entries}
    return {code: hint.as_entry() for code, hint in advice.items() if hint}


def lines_of(report: dict[str, Any]) -> Iterator[str]:
    """Yield what was changed or lost, each thing once: how often, what to do, and where first."""
    names = {
        f"/meshes/{mesh['index']}": mesh["name"] for mesh in report["meshes"] if "name" in mesh
    }
    said: Counter[tuple[str, str]] = Counter()
    places: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for change in report["changes"]:
        kind = change["code"], change["what"]
        said[kind] += change["count"]
        places[kind] += [change["pointer"]] if change["pointer"] else []
    irregular = report["levels"][0]["edges"]["irregular"] if report["levels"] else 0
    beside = {
        "degenerate-faces": report["dropped"]["degenerate_faces"],
        "unused-vertices": report["dropped"]["vertices"],
        "non-manifold": irregular,
    }
    for change in counted(beside):
        if change.code not in {code for code, _ in said}:
            said[change.code, change.what] = change.count
    for (code, what), count in said.items():
        first, *others = places[code, what] or [""]
        where = (
            f"{first} and {len(others)} more place{'s' * (len(others) > 1)}" if others else first
        )
        if name := names.get("/".join(first.split("/")[:3])):
            where = f"{name}, {where}"
        hint = KINDS[code].advice
        told = f": {with_flags(hint)}" if hint else ""
        yield f"{count:,} × {what}{told}" + (f" ({where})" if where else "")


def with_flags(advice: Advice) -> str:
    """Return advice with the options as the command line spells them."""
    text = advice.text
    for option in advice.options:
        name, _, value = option.partition("=")
        text = text.replace(option, f"--{name.replace('_', '-')} {value}")
    return text
