"""Outlines of turned and raised parts: what stands for a curve in them, and what for a corner."""

import numpy as np
from jaxtyping import Float

# Corners that turn by more are meant, radians.
CRISP = np.radians(55)

# Points of the fine outline to each piece that is no straight line.
CURVED = 10

# How often an end is a tip.
TIP = 0.3

# Radius and height of each ring; radius 0 at an end is a tip.
Outline = Float[np.ndarray, "N 2"]


def smoothed(outline: Outline, *, closed: bool) -> Outline:
    """Return the curve through an outline, with corners where it turns by more than `CRISP`.

    Cubic pieces (Catmull and Rom 1974), parabolas beside a corner, straight between two of them.
    """
    if closed:
        before, after = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
    else:
        # Beyond a tip the outline goes on on the axis's other side, beyond a flat end on the axis.
        beyond = [
            np.where(end[0] == 0, inner * [-1, 1], end * [0, 1])
            for end, inner in ((outline[0], outline[1]), (outline[-1], outline[-2]))
        ]
        before = np.concatenate([[beyond[0]], outline[:-1]])
        after = np.concatenate([outline[1:], [beyond[1]]])
    came, goes = outline - before, after - outline
    cross = came[:, 0] * goes[:, 1] - came[:, 1] * goes[:, 0]
    smooth = np.abs(np.arctan2(cross, (came * goes).sum(axis=1))) < CRISP
    a, b = np.linalg.norm(came, axis=1)[:, None], np.linalg.norm(goes, axis=1)[:, None]
    tangent = (came / a * b + goes / b * a) / (a + b)
    curve: list[np.ndarray] = []
    for k in range(len(outline) - 1 + closed):
        n = (k + 1) % len(outline)
        chord, length = goes[k], b[k]
        start, end = tangent[k] * length, tangent[n] * length
        start = start if smooth[k] else (2 * chord - end if smooth[n] else chord)
        end = end if smooth[n] else 2 * chord - start
        share = np.linspace(0, 1, CURVED if smooth[k] or smooth[n] else 1, endpoint=False)[:, None]
        ease = share**2 * (3 - 2 * share)
        curve.append(
            outline[k]
            + ease * chord
            + share * (1 - share) ** 2 * start
            - share**2 * (1 - share) * end
        )
    made = np.concatenate(curve if closed else [*curve, outline[-1:]])
    made[:, 0] = np.maximum(made[:, 0], 0)
    return made


def _pieces(rng: np.random.Generator) -> Outline:
    """Return a few straight pieces of any proportions: cones, prisms, funnels."""
    count = int(rng.integers(1, 5))
    radius = np.exp(rng.uniform(-0.7, 0.4, count + 1))
    if rng.random() < 0.5:
        radius[:] = radius[0]
    height = np.append(0.0, np.cumsum(np.exp(rng.uniform(-2.0, 1.2, count))))
    tips = rng.random(2) < TIP
    tips[0] &= count > 1 or not tips[1]
    radius[[0, -1]] = np.where(tips, 0.0, radius[[0, -1]])
    return _with_rows(np.stack([radius, height], axis=1), rng)


def _with_rows(outline: Outline, rng: np.random.Generator) -> Outline:
    """Cut each straight piece into up to three, now and then."""
    most = int(rng.choice([1, 1, 2, 3]))
    counts = rng.integers(1, most + 1, len(outline) - 1)
    shares = [np.arange(count) / count for count in counts]
    place = np.concatenate([k + share for k, share in enumerate(shares)] + [[len(outline) - 1]])
    known = np.arange(len(outline))
    return np.stack([np.interp(place, known, column) for column in outline.T], axis=1)


def _barrel(rng: np.random.Generator) -> Outline:
    """Return a bulge between two flat ends, with hoops on it now and then."""
    height, bulge = rng.uniform(0.8, 3), rng.uniform(0.05, 0.35)
    share = np.linspace(-1, 1, int(rng.integers(3, 8)))
    outline = np.stack([1 - bulge * share**2, share * height / 2], axis=1)
    if rng.random() < 0.4:
        at, thick = outline[len(outline) // 2 - 1 : len(outline) // 2 + 1], rng.uniform(0.03, 0.1)
        outline = np.concatenate(
            [
                outline[: len(outline) // 2],
                at + np.array([thick, 0]),
                outline[len(outline) // 2 :],
            ]
        )
    return outline


def _cake(rng: np.random.Generator) -> Outline:
    """Return discs on one another, each narrower or wider than the one below."""
    count = int(rng.integers(1, 5))
    height = np.append(0.0, np.cumsum(rng.uniform(0.1, 0.6, count)))
    radius = np.exp(rng.uniform(-0.7, 0.3, count))
    if rng.random() < 0.6:
        radius = np.sort(radius)[::-1]
    outline = np.stack([np.repeat(radius, 2), np.repeat(height, 2)[1:-1]], axis=1)
    return _with_rows(outline, rng)


def _limb(rng: np.random.Generator) -> Outline:
    """Return a capsule, or half of one, of two radii."""
    rows, length = int(rng.integers(2, 5)), rng.uniform(0.2, 3)
    low, high = rng.uniform(0.3, 0.8, 2)
    angle = np.linspace(0, np.pi / 2, rows + 1)
    bottom = low * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    top = high * np.stack([np.cos(angle), np.sin(angle)], axis=1) + [0, length]
    return np.concatenate([bottom if rng.random() < 0.7 else bottom[-1:], top])


def _bottle(rng: np.random.Generator) -> Outline:
    """Return a body, a shoulder and a neck."""
    body, neck = rng.uniform(0.5, 1), rng.uniform(0.12, 0.4)
    height = np.cumsum(rng.uniform([0.6, 0.1, 0.1, 0.1, 0.2], [2, 0.3, 0.3, 0.3, 0.8]))
    radius = [body, body, 0.9 * body, (body + neck) / 2, neck, neck]
    outline = np.stack([radius, np.append(0.0, height)], axis=1)
    lip = np.array([[neck * 1.3, height[-1]], [neck * 1.3, height[-1] + 0.1]])
    return np.concatenate([outline, lip]) if rng.random() < 0.5 else outline


def wheel(rng: np.random.Generator) -> Outline:
    """Return the closed outline of a ring: a tyre, a rim or a tube."""
    count, radius = int(rng.integers(4, 13)), rng.uniform(0.15, 0.6)
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    section = radius * np.stack([np.cos(angle), np.sin(angle) * rng.uniform(0.5, 1.5)], axis=1)
    if rng.random() < 0.3:
        section = np.clip(section, -0.8 * radius, 0.8 * radius)
    return section + np.array([1.0, 0.0])


OUTLINES = (_pieces, _pieces, _barrel, _cake, _limb, _bottle, wheel)
