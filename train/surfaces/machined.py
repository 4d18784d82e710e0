"""Random parts as printers and mills make them: exact solids of OpenCascade.

Families with their own proportions, each with features (holes, counterbores, hexagonal sockets,
slots, bosses, ribs, text); some of their edges are then rounded or chamfered.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.textpath import TextPath

from train.surfaces.brep import (
    Solid,
    box,
    chamfered,
    cut,
    cylinder,
    edge_groups,
    filleted,
    fused,
    laid_over,
    moved,
    prism,
    turned,
)

Outline = Float[np.ndarray, "N 2"]
Solids = list[Solid]

# Groups of edges that are rounded or chamfered, at most; by which share of the part's thickness.
MOST_FINISHED, FINISHES, ROUNDED = 4, (0.05, 0.35), 0.55

LETTERS = "ABCDEFHJKLMNPRSTUVXYZ0123456789"


def machined_part(rng: np.random.Generator) -> Solid:
    """Return a random part, about one to four units across."""
    part, thickness = FAMILIES[int(rng.integers(len(FAMILIES)))](rng)
    for _ in range(int(rng.integers(0, MOST_FINISHED + 1))):
        groups = edge_groups(part)
        group = groups[int(rng.integers(len(groups)))]
        finish = filleted if rng.random() < ROUNDED else chamfered
        part = finish(part, group, rng.uniform(*FINISHES) * thickness)
    return part


def _polygon(count: int, radius: float, turn: float = 0.0) -> Outline:
    angle = turn + 2 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _places(half: Sequence[float], rng: np.random.Generator) -> Outline:
    """Return where features stand: the middle, a row, corners, or a circle."""
    x, y = np.multiply(half, rng.uniform(0.45, 0.7, 2))
    count, line = int(rng.integers(3, 8)), np.linspace(-x, x, int(rng.integers(2, 5)))
    return (
        np.zeros((1, 2)),
        np.c_[line, np.full(len(line), rng.choice([0.0, y]))],
        np.array([[-x, -y], [x, -y], [x, y], [-x, y]]),
        _polygon(count, min(x, y)),
    )[int(rng.integers(4))]


def _holes(
    places: Outline, radius: float, low: float, top: float, rng: np.random.Generator
) -> Solids:
    """Return what to cut for one kind of hole, from a face at the height `top`."""
    depth, kind = (top - low) * rng.uniform(0.25, 0.7), rng.integers(6)
    over, under, wide = top + 1.0, low - 1.0, radius * rng.uniform(1.4, 2.0)
    turn, length = rng.uniform(0, np.pi), rng.uniform(1, 3) * radius
    made: Solids = []
    for x, y in places:
        through = cylinder((x, y), radius, under, over)
        if kind == 0:
            made.append(through)
        elif kind == 1:
            made.append(cylinder((x, y), radius, top - depth, over))
        elif kind == 2:
            made += [through, cylinder((x, y), wide, top - depth, over)]
        elif kind == 3:
            cone = np.array([[0, top - wide], [wide + 0.1 * wide, top + 0.1 * wide], [0, over]])
            made += [through, moved(turned(cone), (x, y, 0))]
        elif kind == 4:
            hexagon = _polygon(6, wide, turn) + np.array([x, y])
            made.append(prism(hexagon, top - depth, over))
            made += [through] if rng.random() < 0.5 else []
        else:
            made += [
                box((x - length, y - radius, under), (x + length, y + radius, over)),
                cylinder((x - length, y), radius, under, over),
                cylinder((x + length, y), radius, under, over),
            ]
    return made


def _raised(
    places: Outline, radius: float, top: float, rng: np.random.Generator
) -> tuple[Solids, Solids]:
    """Return bosses, pads or ribs on a face, and the holes in them."""
    high, kind, bore = top + radius * rng.uniform(0.4, 3), rng.integers(4), rng.uniform(0.3, 0.7)
    added: Solids = []
    for x, y in places:
        if kind == 0:
            added.append(cylinder((x, y), radius, top - 0.01, high))
        elif kind == 1:
            added.append(prism(_polygon(6, radius) + np.array([x, y]), top - 0.01, high))
        elif kind == 2:
            added.append(box((x - radius, y - radius, top - 0.01), (x + radius, y + radius, high)))
        else:
            thin = radius * 0.3
            added.append(
                box((x - thin, y - 2 * radius, top - 0.01), (x + thin, y + 2 * radius, high))
            )
    bored = kind < 2 and rng.random() < 0.7
    return added, [
        cylinder((x, y), radius * bore, top + 0.2 * (high - top), high + 1) for x, y in places
    ] if bored else []


def _with_features(
    part: Solid,
    half: Sequence[float],
    low: float,
    top: float,
    rng: np.random.Generator,
    most: int = 3,
) -> Solid:
    """Return a part with some features on its upper face, whose half sizes are given."""
    for _ in range(int(rng.integers(1, most + 1))):
        places = _places(half, rng)
        radius = min(half) * rng.uniform(0.08, 0.2 if len(places) > 1 else 0.45)
        if rng.random() < 0.65:
            part = cut(part, _holes(places, radius, low, top, rng))
        else:
            added, bores = _raised(places, radius, top, rng)
            part = cut(fused(part, added), bores)
    return part


def _plate(rng: np.random.Generator) -> tuple[Solid, float]:
    x, y, top = *rng.uniform(0.5, 1.5, 2), rng.uniform(0.1, 0.5)
    u, v = x * rng.uniform(-0.3, 0.5), y * rng.uniform(-0.3, 0.5)
    kind = rng.integers(5)
    if kind == 0:
        part = cylinder((0, 0), min(x, y), 0, top)
    else:
        outline = (
            _polygon(int(rng.integers(3, 9)), min(x, y)),
            np.array([[-x, -y], [x, -y], [x, y], [-x, y]]),
            np.array([[-x, -y], [x, -y], [x, v], [u, v], [u, y], [-x, y]]),
            np.array([[-x, -y], [x, -y], [x, y], [0.5 * x, y], [0.5 * x, v], [-x, v]]),
        )[kind - 1]
        part = prism(outline, 0, top)
    half = (0.65 * min(x, y),) * 2 if kind < 2 else (x, y)
    return _with_features(part, half, 0, top, rng), top


def _housing(rng: np.random.Generator) -> tuple[Solid, float]:
    x, y, high = *rng.uniform(0.6, 1.5, 2), rng.uniform(0.3, 1.2)
    wall = rng.uniform(0.04, 0.14)
    part = box((-x, -y, 0), (x, y, high))
    if rng.random() < 0.6:
        upright = [group for group in edge_groups(part) if len(group) == 4]
        part = filleted(part, upright[0], rng.uniform(1.2, 4) * wall)
    inner = box((wall - x, wall - y, wall), (x - wall, y - wall, high + 1))
    part, boss = cut(part, [inner]), rng.uniform(1.2, 2.0) * wall
    corners = _places((1.4 * (x - 2 * wall), 1.4 * (y - 2 * wall)), rng)
    tall = high * rng.uniform(0.3, 0.95)
    part = fused(part, [cylinder(corner, boss, wall / 2, tall) for corner in corners])
    part = cut(part, [cylinder(corner, 0.5 * boss, wall, high + 1) for corner in corners])
    if rng.random() < 0.6:
        at, rib = np.linspace(-x, x, int(rng.integers(3, 8)))[1:-1], wall * rng.uniform(0.2, 0.5)
        height = wall + (high - wall) * rng.uniform(0.1, 0.9)
        part = fused(
            part,
            [box((k - rib, -y + wall / 2, wall / 2), (k + rib, y - wall / 2, height)) for k in at],
        )
    if rng.random() < 0.6:
        at, slot = np.linspace(-x, x, int(rng.integers(4, 10)))[1:-1], wall * rng.uniform(0.3, 0.8)
        low, top = sorted(rng.uniform(1.5 * wall, high, 2))
        part = cut(part, [box((k - slot, -y - 1, low), (k + slot, 0, top)) for k in at])
    if rng.random() < 0.4:
        lip = box((wall / 2 - x, wall / 2 - y, high - wall), (x - wall / 2, y - wall / 2, high + 1))
        part = cut(part, [lip])
    return part, wall


def _shroud(rng: np.random.Generator) -> tuple[Solid, float]:
    half, top = rng.uniform(0.6, 1.2), rng.uniform(0.08, 0.4)
    hole, wall = half * rng.uniform(0.75, 0.93), rng.uniform(0.03, 0.1)
    part = box((-half, -half, 0), (half, half, top))
    if rng.random() < 0.6:
        upright = [group for group in edge_groups(part) if len(group) == 4]
        part = filleted(part, upright[0], rng.uniform(0.1, 0.24) * half)
    narrow, high = hole * rng.uniform(0.5, 1.0), top + rng.uniform(0.2, 1.2)
    duct = [[hole + wall, top / 2], [narrow + wall, high], [narrow, high], [hole, top / 2]]
    bore = [[0, -1], [hole, -1], [hole, top / 2], [narrow, high], [narrow, high + 1], [0, high + 1]]
    part = cut(fused(part, [turned(np.array(duct))]), [turned(np.array(bore))])
    if rng.random() < 0.6:
        count, thin, turn = int(rng.integers(3, 6)), wall * rng.uniform(0.5, 1), rng.uniform(0, 3)
        blade = np.array([[0, -thin], [hole + wall / 2, -thin], [hole + wall / 2, thin], [0, thin]])
        struts = []
        for k in range(count):
            c, s = np.cos(turn + 2 * np.pi * k / count), np.sin(turn + 2 * np.pi * k / count)
            struts.append(prism(blade @ np.array([[c, s], [-s, c]]), 0.01, top * 0.5))
        hub = cylinder((0, 0), hole * rng.uniform(0.2, 0.4), 0, top * rng.uniform(0.6, 1))
        part = fused(part, [*struts, hub])
    screw = 0.86 * half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return cut(part, _holes(screw, 0.07 * half, 0, top, rng)), min(wall, top)


def _knob(rng: np.random.Generator) -> tuple[Solid, float]:
    radius, high = rng.uniform(0.5, 1.0), rng.uniform(0.4, 1.4)
    upper, shoulder = radius * rng.uniform(0.6, 1.0), high * rng.uniform(0.2, 0.8)
    profile = [[0, 0], [radius, 0], [radius, shoulder], [upper, high], [0, high]]
    part = turned(np.array(profile))
    if rng.random() < 0.7:
        rims = [group for group in edge_groups(part) if len(group) == 1]
        part = filleted(part, rims[int(rng.integers(len(rims)))], rng.uniform(0.05, 0.25) * radius)
    count, deep = int(rng.integers(6, 25)), rng.uniform(0.3, 1.0)
    flute = radius * np.pi / count * rng.uniform(0.4, 0.85)
    low = rng.choice([-1.0, shoulder * 0.5])
    around = _polygon(count, radius + flute * (1 - deep) * 0.5)
    if rng.random() < 0.75:
        part = cut(part, [cylinder(place, flute, low, high + 1) for place in around])
    bore, depth = radius * rng.uniform(0.15, 0.4), high * rng.uniform(0.4, 0.8)
    hole = cylinder((0, 0), bore, -1, depth)
    if rng.random() < 0.6:
        hole = cut(hole, [box((bore * 0.5, -bore, -2), (2 * bore, bore, depth + 1))])
    part = cut(part, [hole])
    if rng.random() < 0.4:
        thin = 0.06 * radius
        part = fused(
            part, [box((0.2 * upper, -thin, high * 0.9), (0.9 * upper, thin, high + thin))]
        )
    return part, 0.3 * radius


def _carriage(rng: np.random.Generator) -> tuple[Solid, float]:
    x, y, top = *rng.uniform(0.5, 1.2, 2), rng.uniform(0.4, 0.9)
    part = box((-x, -y, 0), (x, y, top))
    bore, apart = top * rng.uniform(0.2, 0.4), y * rng.uniform(0.4, 0.7)
    rods = [laid_over(cylinder((0, 0), bore, -2, 2), 0)] * 2
    part = cut(
        part,
        [moved(rod, (0, side, top / 2)) for rod, side in zip(rods, (-apart, apart), strict=True)],
    )
    if rng.random() < 0.6:
        wide, deep = rng.uniform(0.1, 0.5) * x, top * rng.uniform(0.2, 0.9)
        part = cut(part, [box((-wide, -2, deep), (wide, 2, 2))])
    if rng.random() < 0.5:
        step = (x * rng.uniform(0.3, 0.9), -2, top * rng.uniform(0.4, 0.8))
        part = cut(part, [box(step, (2, 2, 2))])
    if rng.random() < 0.5:
        teeth, thin = np.linspace(-x, x, int(rng.integers(8, 20)))[1:-1], 0.3 * x / 10
        part = cut(
            part, [box((k - thin, -apart + bore, top - 0.08), (k + thin, 0.3, 2)) for k in teeth]
        )
    return _with_features(part, (x, y), 0, top, rng), 0.3 * top


def _shaft(rng: np.random.Generator) -> tuple[Solid, float]:
    count = int(rng.integers(2, 6))
    radius = rng.uniform(0.15, 0.7, count)
    height = np.cumsum(rng.uniform(0.1, 0.8, count))
    profile = [[0.0, 0.0]]
    for k in range(count):
        low, bevel = 0.0 if k == 0 else height[k - 1], rng.uniform(0, 0.2) * radius[k]
        if rng.random() < 0.5:
            profile += [[radius[k], low], [radius[k], height[k]]]
        else:
            top = max(height[k] - bevel, (low + height[k]) / 2)
            profile += [[radius[k], low], [radius[k], top], [radius[k] - bevel, height[k]]]
    part = turned(np.array([*profile, [0.0, height[-1]]]))
    if rng.random() < 0.5:
        key, wide = radius[-1] * rng.uniform(0.4, 0.8), radius[-1] * 0.2
        part = cut(part, [box((key, -wide, height[-2]), (2, wide, height[-1] + 1))])
    if rng.random() < 0.5:
        bore = laid_over(cylinder((0, 0), 0.3 * radius[0], -2, 2), int(rng.integers(2)))
        part = cut(part, [moved(bore, (0, 0, height[0] / 2))])
    if rng.random() < 0.5:
        part = cut(part, _holes(np.zeros((1, 2)), 0.4 * radius[-1], height[-2], height[-1], rng))
    return part, 0.3 * float(radius.min())


def _screw(rng: np.random.Generator) -> tuple[Solid, float]:
    """Return a screw or a nut; its thread is rings of triangles, not one helix."""
    core, turns = rng.uniform(0.2, 0.4), int(rng.integers(4, 14))
    pitch, head = core * rng.uniform(0.3, 0.7), core * rng.uniform(1.6, 2.2)
    tip, tall = turns * pitch, core * rng.uniform(0.8, 1.5)
    ridge = np.array([[core, 0], [core + 0.6 * pitch, 0.5 * pitch]])
    thread = np.concatenate([ridge + np.array([0, k * pitch]) for k in range(turns)])
    profile = np.concatenate(
        [
            [[0, -0.5 * pitch]],
            [[0.8 * core, -0.5 * pitch]],
            thread,
            [[core, tip], [core, tip + pitch], [0, tip + pitch]],
        ]
    )
    part, low = turned(profile), tip + 0.9 * pitch
    if rng.random() < 0.5:
        cap = prism(_polygon(6, head), low, low + tall)
    else:
        cap = cylinder((0, 0), 0.85 * head, low, low + tall)
        cap = cut(cap, [prism(_polygon(6, 0.5 * head), low + 0.4 * tall, low + tall + 1)])
    return fused(part, [cap]), 0.3 * tall


def _gear(rng: np.random.Generator) -> tuple[Solid, float]:
    teeth, radius, top = int(rng.integers(8, 32)), rng.uniform(0.7, 1.2), rng.uniform(0.15, 0.5)
    deep, step = radius * 3.5 / teeth, 2 * np.pi / teeth
    shape = np.array([[0.0, -1], [0.25, -1], [0.42, 0], [0.58, 0], [0.75, -1]])[1:]
    angle = (np.arange(teeth)[:, None] + shape[:, 0]).reshape(-1) * step
    reach = radius + deep * np.tile(shape[:, 1], teeth)
    part = prism(reach[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1), 0, top)
    inner = radius - deep
    hub = inner * rng.uniform(0.3, 0.5)
    if rng.random() < 0.6:
        part = fused(part, [cylinder((0, 0), hub, 0, top * rng.uniform(1.2, 2.5))])
    if rng.random() < 0.5:
        ring = [
            [hub, 0.6 * top],
            [0.85 * inner, 0.6 * top],
            [0.85 * inner, top + 2],
            [hub, top + 2],
        ]
        part = cut(part, [turned(np.array(ring))])
    if rng.random() < 0.5:
        between, hole = (hub + 0.85 * inner) / 2, (0.85 * inner - hub) * 0.35
        part = cut(
            part, [cylinder(p, hole, -1, 2) for p in _polygon(int(rng.integers(3, 7)), between)]
        )
    bore = 0.5 * hub
    slot = box((0, -0.3 * bore, -1), (1.3 * bore, 0.3 * bore, 3))
    part = cut(part, [cylinder((0, 0), bore, -1, 3), *([slot] if rng.random() < 0.6 else [])])
    return part, 0.2 * top


def _bracket(rng: np.random.Generator) -> tuple[Solid, float]:
    x, y, high = rng.uniform(0.6, 1.4), rng.uniform(0.4, 1.0), rng.uniform(0.6, 1.5)
    wall = rng.uniform(0.08, 0.25)
    leg = box((-x, -y, 0), (wall - x, y, high))
    part = _with_features(box((-x, -y, 0), (x, y, wall)), (x, y), 0, wall, rng, most=2)
    places = np.array([[-0.6, 0.55], [0.0, 0.5], [0.6, 0.7]])[: int(rng.integers(1, 4))]
    holes = [
        moved(laid_over(cylinder((0, 0), 0.15 * min(y, high), -1, 1), 0), (-x, y * a, high * b))
        for a, b in places
    ]
    part = fused(part, [cut(leg, holes)])
    if rng.random() < 0.7:
        reach, thin = rng.uniform(0.3, 0.8) * (2 * x), wall * rng.uniform(0.3, 1.0)
        corner = np.array([[-x, 0], [reach - x, 0], [-x, min(reach, high)]])
        gusset = laid_over(prism(corner[:, ::-1], -thin, thin), 1)
        side = rng.choice([0.0, y - thin])
        part = fused(part, [moved(gusset, (0, side, 0))])
    return part, wall


def _sign(rng: np.random.Generator) -> tuple[Solid, float]:
    text = "".join(rng.choice(list(LETTERS), int(rng.integers(1, 4))))
    top, deep = rng.uniform(0.15, 0.3), rng.uniform(0.04, 0.12)
    outlines = [np.asarray(ring)[:-1] for ring in TextPath((0, 0), text, size=1).to_polygons()]
    corners = np.concatenate(outlines)
    low, high = corners.min(axis=0) - 0.2, corners.max(axis=0) + 0.2
    plate = box((*low, 0), (*high, top))
    raised = rng.random() < 0.6
    ends = (top - 0.02, top + deep) if raised else (top - deep, top + 1)
    solids = [(prism(ring, *ends), _area(ring)) for ring in outlines if len(ring) > 2]
    # Outer rings turn one way, holes the other; the largest is an outer one.
    outer = np.sign(max((area for _, area in solids), key=abs))
    letters = [solid for solid, area in solids if area * outer > 0]
    holes = [solid for solid, area in solids if area * outer < 0]
    letters = [cut(letter, holes) for letter in letters]
    return (fused if raised else cut)(plate, letters), 0.4 * deep


def _area(ring: Outline) -> float:
    x, y = ring.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2


def _blocks(rng: np.random.Generator) -> tuple[Solid, float]:
    """Return boxes and cylinders along all axes, joined and cut."""
    part = box((-0.8, -0.6, -0.5), rng.uniform(0.3, 1.0, 3))
    for _ in range(int(rng.integers(2, 6))):
        at, axis = rng.uniform(-0.7, 0.7, 3), int(rng.integers(3))
        if rng.random() < 0.5:
            size = rng.uniform(0.1, 0.5, 3)
            other = box(at - size, at + size)
        else:
            long = rng.uniform(0.2, 1.2)
            rod = cylinder((0, 0), rng.uniform(0.1, 0.4), -long, long)
            other = moved(laid_over(rod, axis), at)
        part = (fused if rng.random() < 0.6 else cut)(part, [other])
    return part, 0.2


FAMILIES: tuple[Callable[[np.random.Generator], tuple[Solid, float]], ...] = (
    _plate,
    _housing,
    _shroud,
    _knob,
    _carriage,
    _shaft,
    _screw,
    _gear,
    _bracket,
    _sign,
    _blocks,
)
