"""Parts drawn with few faces, as modellers do, and what an artist expects of them.

An outline goes round a plan: barrels, bottles, cakes, limbs, cones, wheels, slices, rounded boxes,
prisms, alone or several in one mesh. Corners of outline and plan stand for a smooth curve through
them where they turn by less than `CRISP`, and are meant as they are where they turn by more: so
seven sides are round and six are a hexagon, and rims stay crisp. Quads are cut one way, in turn or
at random, and lids from a middle, from a corner or by ears: sharpness has to follow none of these.
"""

import mapbox_earcut
import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common import Mesh
from train.data.batch import joined_meshes
from train.data.pairs.faceted import polyhedron, sampled
from train.data.pairs.grid import cut_quads, random_cut
from train.data.pairs.outlines import CURVED, OUTLINES, Outline, smoothed, wheel
from train.data.pairs.references import Pair
from train.surfaces.solids import random_rotation

# Corners of a plan, anticlockwise round the origin.
Plan = Float[np.ndarray, "S 2"]

# Triangles of a lid: numbers of the plan's corners; their count stands for a vertex in the middle.
Lid = Int[np.ndarray, "T 3"]

# Sides from which on a part is round, and of the mesh that stands for it.
ROUND, FINE = 7, 180
FEWEST_SIDES, MOST_SIDES = 3, 36

# Steps of a slice, as often as they stand here.
STEPS = (2, 2, 3, 3, 4, 5, 6)

# How often a lid has a vertex in its middle, and else is a fan from a corner.
CENTRE, FAN = 0.4, 0.4

# How often several parts are one mesh, at most how many, and how often one is a polyhedron.
SEVERAL, MOST_PARTS, POLYHEDRA = 0.4, 4, 0.25


def lathe_pair(rng: np.random.Generator) -> Pair:
    """Return one part or several as few faces, each turned at random in space."""
    count = int(rng.integers(2, MOST_PARTS + 1)) if rng.random() < SEVERAL else 1
    coarse, fine, end = [], [], 0.0
    for _ in range(count):
        scale, turn = np.exp(rng.uniform(-1.5, 0)), random_rotation(rng)
        pair = _as_drawn(rng) if count > 1 and rng.random() < POLYHEDRA else _part(rng)
        points = scale * pair[1].vertices @ turn
        low, high = points[:, 0].min(), points[:, 0].max()
        shift = np.array([end - low, 0.0, 0.0])
        end += 1.2 * (high - low)
        for mesh, parts in zip(pair, (coarse, fine), strict=True):
            parts.append(Mesh(scale * mesh.vertices @ turn + shift, mesh.faces))
    whole = joined_meshes(fine)
    surface = sampled(whole.vertices, whole.faces, rng)
    return Pair("lathe", joined_meshes(coarse), surface)


def _as_drawn(rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    made = None
    while made is None:
        made = polyhedron(rng)
    return Mesh(*made), Mesh(*made)


def _part(rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    """Return a part as few faces, and as many."""
    plan, fine_plan = PLANS[rng.choice(len(PLANS), p=SHARES)](rng)
    kind = OUTLINES[int(rng.integers(len(OUTLINES)))]
    outline, closed = kind(rng), kind is wheel
    curve, lid = smoothed(outline, closed=closed), ears(fine_plan)
    way = random_cut(len(outline), len(plan), rng)
    coarse = raised(outline, plan, (random_lid(plan, rng), random_lid(plan, rng)), way, closed)
    return coarse, raised(curve, fine_plan, (lid, lid), closed=closed)


def raised(
    outline: Outline,
    plan: Plan,
    lids: tuple[Lid, Lid],
    other_way: Bool[np.ndarray, " Q"] | None = None,
    closed: bool = False,
) -> Mesh:
    """Return the surface of an outline that goes round a plan; outwards where it rises.

    Args:
        outline: how large the plan is, and how high, at each ring; size 0 at an end is a tip.
        plan: its corners.
        lids: of the first ring and the last; tips have none.
        other_way: for each quad whether its diagonal falls, row by row; at least as many.
        closed: whether the last ring is joined to the first, and there are no lids.
    """
    sides = len(plan)
    tips = outline[[0, -1], 0] == 0
    rings = outline[int(tips[0]) : len(outline) - int(tips[1])]
    points = [np.c_[size * plan, np.full(sides, height)] for size, height in rings]
    number = np.arange(len(rings) * sides).reshape(-1, sides)
    rows = np.r_[number, number[:1]] if closed else number
    quads = (len(rows) - 1) * sides
    ways = np.zeros(quads, dtype=bool) if other_way is None else other_way[:quads]
    faces = [cut_quads(np.c_[rows, rows[:, :1]], ways)[:, ::-1]]
    middles = len(rings) * sides
    for end, lid, tip in zip((0, -1), lids, tips, strict=True):
        if closed:
            break
        triangles = centred(sides) if tip else lid
        if triangles.max() == sides:
            points.append(np.array([[0.0, 0.0, outline[end, 1]]]))
        corners = np.append(number[end], middles)[triangles]
        faces.append(corners if end else corners[:, ::-1])
        middles += int(triangles.max() == sides)
    return Mesh(np.concatenate(points), np.concatenate(faces))


def random_lid(plan: Plan, rng: np.random.Generator) -> Lid:
    """Cut a plan into triangles in one of three ways."""
    sides, kind, first = len(plan), rng.random(), int(rng.integers(len(plan)))
    if kind < CENTRE:
        return centred(sides)
    before, after = plan - np.roll(plan, 1, axis=0), np.roll(plan, -1, axis=0) - plan
    convex = (before[:, 0] * after[:, 1] > before[:, 1] * after[:, 0]).all()
    if kind < CENTRE + FAN and convex:
        j = np.arange(1, sides - 1)
        return (np.c_[0 * j, j, j + 1] + first) % sides
    return (ears(np.roll(plan, -first, axis=0)) + first) % sides


def centred(sides: int) -> Lid:
    """Cut a plan into triangles round its middle."""
    j = np.arange(sides)
    return np.c_[j, (j + 1) % sides, np.full(sides, sides)]


def ears(plan: Plan) -> Lid:
    """Cut a plan into triangles by its ears."""
    ends = np.array([len(plan)], dtype=np.uint32)
    made = mapbox_earcut.triangulate_float64(np.ascontiguousarray(plan), ends)
    triangles = made.reshape(-1, 3).astype(np.int64)
    a, b, c = (plan[triangles[:, corner]] for corner in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return np.where((ux * vy < uy * vx)[:, None], triangles[:, ::-1], triangles)


def polygon(sides: int) -> Plan:
    """Return the regular polygon in the unit circle."""
    return _round_at(2 * np.pi * np.arange(sides) / sides)


def _round_at(angle: Float[np.ndarray, " S"]) -> Plan:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _round(rng: np.random.Generator) -> tuple[Plan, Plan]:
    """Return a polygon that stands for a circle, most of them of few sides."""
    sides = int(np.exp(rng.uniform(np.log(ROUND), np.log(MOST_SIDES + 1))))
    return polygon(sides), polygon(sides * -(-FINE // sides))


def _angular(rng: np.random.Generator) -> tuple[Plan, Plan]:
    """Return a polygon that is one."""
    plan = polygon(int(rng.integers(FEWEST_SIDES, ROUND)))
    return plan, plan


def _slice(rng: np.random.Generator) -> tuple[Plan, Plan]:
    """Return a slice of a circle, in few steps."""
    steps = int(rng.choice(STEPS))
    whole = steps * rng.uniform(np.radians(12), np.radians(min(45, 150 / steps)))
    middle = np.array([0.6, 0.0])

    def plan(steps: int) -> Plan:
        arc = _round_at(whole * np.linspace(-0.5, 0.5, steps + 1))
        return np.concatenate([np.zeros((1, 2)), arc]) - middle

    return plan(steps), plan(steps * CURVED)


def _rounded(rng: np.random.Generator) -> tuple[Plan, Plan]:
    """Return a triangle to a hexagon, or an oblong, with round corners of a few steps."""
    corners, radius = int(rng.integers(3, 7)), rng.uniform(0.1, 0.6)
    angle = 2 * np.pi / corners
    steps = int(np.ceil(angle / rng.uniform(np.radians(15), np.radians(45))))
    stretch = np.array([1.0, rng.uniform(0.3, 1.0) if corners == 4 else 1.0])
    way = angle * (np.arange(corners) + 0.5)

    def plan(steps: int) -> Plan:
        arc = way[:, None] + angle * np.linspace(-0.5, 0.5, steps + 1)
        centres = (1 - radius) * _round_at(way) * stretch
        return (centres[:, None] + radius * _round_at(arc.ravel()).reshape(*arc.shape, 2)).reshape(
            -1, 2
        )

    return plan(max(steps, 2)), plan(max(steps, 2) * CURVED)


def _wavy(rng: np.random.Generator) -> tuple[Plan, Plan]:
    """Return a closed curve with two to four waves."""
    sides, waves = int(rng.integers(14, 37)), np.arange(2, 5)
    size, phase = rng.uniform(-0.12, 0.12, 3), rng.uniform(0, 2 * np.pi, 3)

    def plan(sides: int) -> Plan:
        angle = 2 * np.pi * np.arange(sides) / sides
        reach = 1 + np.cos(np.outer(angle, waves) + phase) @ size
        return reach[:, None] * _round_at(angle)

    return plan(sides), plan(sides * CURVED)


PLANS = (_round, _angular, _slice, _rounded, _wavy)
# How often each is drawn.
SHARES = (0.42, 0.13, 0.25, 0.12, 0.08)
