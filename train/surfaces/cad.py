"""Surfaces of computer-aided design, with their exact signed distance in closed form.

f is the distance itself (‖∇f‖ = 1 almost everywhere), so that |f| / ‖∇f‖ is no approximation here.
"""

from dataclasses import dataclass

from array_api_compat import array_namespace

from train.surfaces.implicit import Points, Scalars


@dataclass(frozen=True, slots=True)
class Torus:
    """A torus round the z axis: the tube's radius r round a circle of radius R.

    Its feature is the outer equator.
    """

    ring: float
    tube: float

    def feature_distance(self, points: Points) -> Scalars:
        """Return the distance from the outer equator."""
        xp = array_namespace(points)
        return xp.hypot(self._radius(points) - self.ring - self.tube, points[:, 2])

    def value(self, points: Points) -> Scalars:
        """Return the signed distance."""
        xp = array_namespace(points)
        return xp.hypot(self._radius(points) - self.ring, points[:, 2]) - self.tube

    def gradient(self, points: Points) -> Points:
        """Return ∇f, away from the tube's circle."""
        xp = array_namespace(points)
        radius = self._radius(points)
        from_circle = xp.hypot(radius - self.ring, points[:, 2])
        outward = (radius - self.ring) / (from_circle * radius)
        return xp.stack(
            [points[:, 0] * outward, points[:, 1] * outward, points[:, 2] / from_circle], axis=-1
        )

    def _radius(self, points: Points) -> Scalars:
        return array_namespace(points).hypot(points[:, 0], points[:, 1])


@dataclass(frozen=True, slots=True)
class RoundedBox:
    """The corner of a box whose edges are rounded with one radius; the corner is at the origin.

    The box is x, y, z ≤ 0. Its edges are quarter cylinders, its corner an octant of a sphere. The
    feature is the middle line of the edges.
    """

    radius: float

    def feature_distance(self, points: Points) -> Scalars:
        """Return the distance from the middle line of the nearest of the three edges."""
        xp = array_namespace(points)
        middle = self.radius * (0.5**0.5 - 1)
        x, y, z = (points[:, axis] - middle for axis in range(3))
        return xp.minimum(xp.hypot(x, y), xp.minimum(xp.hypot(y, z), xp.hypot(z, x)))

    def value(self, points: Points) -> Scalars:
        """Return the signed distance, ‖max(q, 0)‖ + min(max q, 0) − r with q = p + r."""
        return _box_value(points + self.radius) - self.radius

    def gradient(self, points: Points) -> Points:
        """Return ∇f."""
        return _box_gradient(points + self.radius)


@dataclass(frozen=True, slots=True)
class Fillet:
    """A quarter cylinder of radius r that fills the corner between two walls.

    The walls are y = 0 and z = 0, the free space is y, z > 0; the surface runs along x. The
    feature is the middle line of the quarter cylinder.
    """

    radius: float

    def feature_distance(self, points: Points) -> Scalars:
        """Return the distance from the middle line."""
        xp = array_namespace(points)
        middle = self.radius * (1 - 0.5**0.5)
        return xp.hypot(points[:, 1] - middle, points[:, 2] - middle)

    def value(self, points: Points) -> Scalars:
        """Return the signed distance, positive in the free space."""
        return self.radius - _box_value(self._inward(points))

    def gradient(self, points: Points) -> Points:
        """Return ∇f."""
        xp = array_namespace(points)
        inward = _box_gradient(self._inward(points))
        return xp.stack([xp.zeros_like(inward[:, 0]), inward[:, 0], inward[:, 1]], axis=-1)

    def _inward(self, points: Points) -> Points:
        y, z = self.radius - points[:, 1], self.radius - points[:, 2]
        return array_namespace(points).stack([y, z], axis=-1)


def _box_value(q: Points) -> Scalars:
    """Return ‖max(q, 0)‖ + min(max q, 0): the distance to the orthant q ≤ 0, signed."""
    xp = array_namespace(q)
    outside = xp.where(q > 0, q, xp.zeros_like(q))
    largest = _largest(q)
    inside = xp.where(largest < 0, largest, xp.zeros_like(largest))
    return xp.linalg.vector_norm(outside, axis=-1) + inside


def _box_gradient(q: Points) -> Points:
    xp = array_namespace(q)
    outside = xp.where(q > 0, q, xp.zeros_like(q))
    length = xp.linalg.vector_norm(outside, axis=-1)
    safe = xp.where(length > 0, length, xp.ones_like(length))
    nearest_wall = xp.astype(q == _largest(q)[:, None], q.dtype)
    return xp.where((length > 0)[:, None], outside / safe[:, None], nearest_wall)


def _largest(q: Points) -> Scalars:
    xp = array_namespace(q)
    largest = q[:, 0]
    for axis in range(1, q.shape[1]):
        largest = xp.maximum(largest, q[:, axis])
    return largest
