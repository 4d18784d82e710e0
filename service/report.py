"""The report of a refined glTF: one entry for each mesh, and totals over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pns_common.operator.scheme import Scheme
from pns_common.report import EdgeCounts, GateSummary, LevelReport, RatioSummary, Report

from .advice import NO_BENDS, Bends, advice_on
from .changes import Change, changes_of
from .errors import shortened


@dataclass(frozen=True, eq=False)
class MeshResult:
    """Report of one mesh of the file.

    Attributes:
        index: its place in `meshes`.
        instances: how many nodes show it.
        primitives, vertices, faces: refined ones, as written.
        degenerate: dropped faces of the control mesh.
        copies: faces of the control mesh that follow another with the same vertices.
        report: the operator's; None where no face was left, and the mesh stays as it was.
        bends: its steep edges, and those in doubt.
        name: what the file calls it; None without a name.
    """

    index: int
    instances: int
    primitives: int
    vertices: int
    faces: int
    degenerate: int
    copies: int
    report: Report | None
    bends: Bends
    name: str | None = None


def build_report(
    scheme: Scheme,
    levels: int,
    results: Sequence[MeshResult],
    unused_vertices: int,
    changes: Sequence[Change],
) -> dict[str, Any]:
    """Build the report as JSON data; `unused_vertices` of the file were dropped."""
    refined = [result.report for result in results if result.report is not None]
    totals = [
        total_level([report["levels"][level] for report in refined])
        for level in range(min([levels, *(len(report["levels"]) for report in refined)]))
        if refined
    ]
    bends = sum((result.bends for result in results), NO_BENDS)
    return {
        "scheme": scheme.name,
        "base": scheme.base.name,
        "budget": scheme.budget,
        "model": scheme.model,
        "model_hash": scheme.model_hash,
        "totals": {
            "meshes": len(refined),
            "primitives": sum(result.primitives for result in results),
            "vertices": sum(result.vertices for result in results),
            "faces": sum(result.faces for result in results),
            "copied_faces": sum(result.copies for result in results),
            "zero_reference_lengths": sum(report["reference_length"] == 0 for report in refined),
        },
        "dropped": dropped(sum(result.degenerate for result in results), unused_vertices),
        **changes_of(changes),
        "advice": [each.as_entry() for each in advice_on(totals, bends)],
        "levels": totals,
        "meshes": [_mesh(result) for result in results],
    }


def dropped(degenerate_faces: int, vertices: int) -> dict[str, int]:
    """Return what a file loses. Duplicate faces stay: refined once, they come back as copies."""
    return {"degenerate_faces": degenerate_faces, "duplicate_faces": 0, "vertices": vertices}


def total_level(levels: Sequence[LevelReport]) -> LevelReport:
    """Total a level over meshes: counts add, means weigh by what is meant, the largest wins.

    The p99 of the whole does not follow from the meshes' own; the largest of them bounds it.
    """
    weights = [level["edges"]["interior"] for level in levels]
    creases = sum(level["edges"].get("crease", 0) for level in levels)
    soft = sum(level["edges"].get("soft", 0) for level in levels)
    edges: EdgeCounts = {
        "interior": sum(weights),
        "boundary": sum(level["edges"]["boundary"] for level in levels),
        "irregular": sum(level["edges"]["irregular"] for level in levels),
    }
    if creases:
        edges["crease"] = creases
    if soft:
        edges["soft"] = soft
    total: LevelReport = {
        "vertices": sum(level["vertices"] for level in levels),
        "faces": sum(level["faces"] for level in levels),
        "edges": edges,
        "degenerate_frames": sum(level["degenerate_frames"] for level in levels),
        "flipped_faces": sum(level["flipped_faces"] for level in levels),
        "proximity_ratio": _total_ratio([level["proximity_ratio"] for level in levels], weights),
        "gate": _total_gate([level["gate"] for level in levels], weights),
        "normal_jump_max": max(level["normal_jump_max"] for level in levels),
    }
    rules = [level["vertex_rule"] for level in levels if "vertex_rule" in level]
    if rules:
        moved = [rule["vertices"] for rule in rules]
        total["vertex_rule"] = {
            "vertices": sum(moved),
            "proximity_ratio": _total_ratio([rule["proximity_ratio"] for rule in rules], moved),
            "gate": _total_gate([rule["gate"] for rule in rules], moved),
        }
    shut = [level["shut"] for level in levels if "shut" in level]
    if shut:
        total["shut"] = sum(shut)
    guarded = [level["guarded"] for level in levels if "guarded" in level]
    if guarded:
        total["guarded"] = sum(guarded)
    return total


def _total_ratio(ratios: Sequence[RatioSummary], weights: Sequence[int]) -> RatioSummary:
    return {
        "max": max(ratio["max"] for ratio in ratios),
        "mean": _mean([ratio["mean"] for ratio in ratios], weights),
        "p99": max(ratio["p99"] for ratio in ratios),
    }


def _total_gate(gates: Sequence[GateSummary], weights: Sequence[int]) -> GateSummary:
    return {
        "mean": _mean([gate["mean"] for gate in gates], weights),
        "max": max(gate["max"] for gate in gates),
        "active": _mean([gate["active"] for gate in gates], weights),
    }


def _mean(values: Sequence[float], weights: Sequence[int]) -> float:
    weighted = [weight * value for weight, value in zip(weights, values, strict=True)]
    return sum(weighted) / max(sum(weights), 1)


def _mesh(result: MeshResult) -> dict[str, Any]:
    report = result.report
    return {
        "index": result.index,
        **({} if result.name is None else {"name": shortened(result.name)}),
        "instances": result.instances,
        "reference_length": 0.0 if report is None else report["reference_length"],
        "multi_fan_vertices": 0 if report is None else report["multi_fan_vertices"],
        "learned_levels": 0 if report is None else report["learned_levels"],
        "limit_distance": 0.0 if report is None else report["limit_distance"],
        "limit_distance_bound": 0.0 if report is None else report["limit_distance_bound"],
        "degenerate_faces": result.degenerate,
        "copied_faces": result.copies,
        "levels": [] if report is None else report["levels"],
        **({} if report is None or "adaptive" not in report else {"adaptive": report["adaptive"]}),
    }
