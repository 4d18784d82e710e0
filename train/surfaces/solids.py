"""Random solids, as fields that are negative inside: blends of simple parts, with waves on them.

Each part is a field close to a signed distance (Quilez, "Distance functions"); parts are joined or
cut with a smooth minimum, so that their seams are fillets of any radius down to nearly none. Waves
of many lengths stand for detail, some of it finer than any coarse mesh can hold.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

Points = Float[np.ndarray, "P 3"]
Scalars = Float[np.ndarray, " P"]
Field = Callable[[Points], Scalars]

# How many parts a solid has, and how often.
COUNTS = {1: 0.25, 2: 0.2, 3: 0.25, 4: 0.2, 6: 0.1}

# Radii of the seams.
BLENDS = (0.02, 0.08, 0.2, 0.35)

# How often a part is cut away; how often there are a few long waves; and waves of all lengths.
CUT, WAVES, DETAIL = 0.15, 0.45, 0.5

# Waves of all lengths: how many, the lowest frequency, and the ratio from one to the next.
OCTAVES, LOWEST, STEP = 10, 4.0, 1.28


def random_solid(rng: np.random.Generator) -> Field:
    """Return the field of a solid of about unit size, somewhere around the origin."""
    count = int(rng.choice(list(COUNTS), p=list(COUNTS.values())))
    parts = [_placed_part(rng, alone=count == 1) for _ in range(count)]
    cut = [number > 0 and rng.random() < CUT for number in range(count)]
    blend, waves = rng.choice(BLENDS), _random_waves(rng)

    def field(points: Points) -> Scalars:
        value = np.array(parts[0](points))
        for part, away in zip(parts[1:], cut[1:], strict=True):
            other = part(points)
            if away:
                value = -_smooth_minimum(-value, other, blend)
            else:
                value = _smooth_minimum(value, other, blend)
        # Farther away than the waves are high, none of them moves the surface.
        near = np.flatnonzero(np.abs(value) < sum(height for _, _, height in waves))
        for frequency, phase, height in waves:
            value[near] += height * np.sin(points[near] @ frequency + phase)
        return value

    return field


def random_rotation(rng: np.random.Generator) -> Float[np.ndarray, "3 3"]:
    """Return a rotation, all equally likely (from a random unit quaternion)."""
    w, x, y, z = _direction(rng, 4)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _ellipsoid(rng: np.random.Generator) -> Field:
    round_one = rng.random() >= 0.7
    radii = np.full(3, rng.uniform(0.3, 0.8)) if round_one else rng.uniform(0.2, 0.9, 3)

    def field(points: Points) -> Scalars:
        once = np.linalg.norm(points / radii, axis=1)
        twice = np.linalg.norm(points / radii**2, axis=1)
        return once * (once - 1) / np.maximum(twice, 1e-9)

    return field


def _box(rng: np.random.Generator) -> Field:
    half = rng.uniform(0.15, 0.8, 3)
    radius = _rounding(rng, half.min())

    def field(points: Points) -> Scalars:
        beyond = np.abs(points) - (half - radius)
        outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
        return outside + np.minimum(beyond.max(axis=1), 0) - radius

    return field


def _capsule(rng: np.random.Generator) -> Field:
    half = rng.uniform(0.2, 0.9)
    low, high = rng.uniform(0.1, 0.4, 2)

    def field(points: Points) -> Scalars:
        along = np.clip((points[:, 2] + half) / (2 * half), 0, 1)
        foot = points - np.outer((2 * along - 1) * half, [0, 0, 1])
        return np.linalg.norm(foot, axis=1) - (low + (high - low) * along)

    return field


def _ring(rng: np.random.Generator) -> Field:
    radius, tube = rng.uniform(0.4, 0.75), rng.uniform(0.1, 0.35)
    return lambda points: (
        np.hypot(np.hypot(points[:, 0], points[:, 1]) - radius, points[:, 2]) - tube
    )


def _cylinder(rng: np.random.Generator) -> Field:
    radius, half = rng.uniform(0.15, 0.8), rng.uniform(0.1, 0.8)
    rounding = _rounding(rng, min(radius, half))
    taper = rng.uniform(-0.3, 0.3) if rng.random() < 0.4 else 0.0

    def field(points: Points) -> Scalars:
        across = np.hypot(points[:, 0], points[:, 1]) * (1 + taper * points[:, 2])
        side, lid = across - (radius - rounding), np.abs(points[:, 2]) - (half - rounding)
        outside = np.hypot(np.maximum(side, 0), np.maximum(lid, 0))
        return np.minimum(np.maximum(side, lid), 0) + outside - rounding

    return field


# Kinds of parts, and how often.
PARTS = {_ellipsoid: 0.3, _box: 0.2, _capsule: 0.25, _ring: 0.1, _cylinder: 0.15}


def _placed_part(rng: np.random.Generator, *, alone: bool) -> Field:
    part = list(PARTS)[rng.choice(len(PARTS), p=list(PARTS.values()))](rng)
    rotation = random_rotation(rng)
    centre = np.zeros(3) if alone else rng.uniform(-0.55, 0.55, 3)
    scale = 1.0 if alone else rng.uniform(0.5, 1.0)
    return lambda points: part((points - centre) @ rotation / scale) * scale


def _random_waves(
    rng: np.random.Generator,
) -> list[tuple[Float[np.ndarray, " 3"], float, float]]:
    """Return frequencies, phases and heights; slopes stay well below 1."""
    waves = []
    if rng.random() < WAVES:
        for _ in range(int(rng.integers(1, 4))):
            frequency = rng.uniform(2, 9)
            height = rng.uniform(0.05, 0.25) / frequency
            waves.append((frequency * _direction(rng), rng.uniform(0, 2 * np.pi), height))
    if rng.random() < DETAIL:
        slope = rng.uniform(0.02, 0.25)
        for octave in range(OCTAVES):
            frequency = LOWEST * STEP**octave * rng.uniform(0.9, 1.2)
            height = slope / frequency * rng.uniform(0.5, 1.0)
            waves.append((frequency * _direction(rng), rng.uniform(0, 2 * np.pi), height))
    return waves


def _rounding(rng: np.random.Generator, largest: float) -> float:
    """Return the radius of a part's edges: none for three in ten."""
    return 0.0 if rng.random() < 0.3 else rng.uniform(0.02, 0.9) * largest


def _smooth_minimum(left: Scalars, right: Scalars, radius: float) -> Scalars:
    share = np.clip(0.5 + 0.5 * (right - left) / radius, 0, 1)
    return left * share + right * (1 - share) - radius * share * (1 - share)


def _direction(rng: np.random.Generator, size: int = 3) -> Float[np.ndarray, " N"]:
    vector = rng.normal(size=size)
    return vector / np.linalg.norm(vector)
