"""More analytic surfaces for training: curved and crossing ridges, bumps, lumpy spheres.

Like those of `train.surfaces.implicit`, their parameters are floats, or arrays with one
entry a point.
"""

from dataclasses import dataclass
from typing import Any

from array_api_compat import array_namespace

from train.surfaces.implicit import Points, Ridge, Scalars


@dataclass(frozen=True, slots=True)
class CurvedRidge:
    """Ridge along a circle: z = a exp(−b s²), s = ‖(x − cx, y − cy)‖ − ρ."""

    amplitude: Any
    sharpness: Any
    radius: Any
    centre_x: Any
    centre_y: Any

    def feature_distance(self, points: Points) -> Scalars:
        """Return |s|, the distance from the crest in the plane."""
        return array_namespace(points).abs(self._from_centre(points) - self.radius)

    def height(self, points: Points) -> Scalars:
        """Return the height of the surface over (x, y); z is not read."""
        across = self._from_centre(points) - self.radius
        return self.amplitude * array_namespace(points).exp(-self.sharpness * across**2)

    def value(self, points: Points) -> Scalars:
        """Return f = z − height(x, y)."""
        return points[:, 2] - self.height(points)

    def gradient(self, points: Points) -> Points:
        """Return ∇f; not defined at the circle's centre."""
        xp = array_namespace(points)
        reach = self._from_centre(points)
        fall = 2 * self.sharpness * (reach - self.radius) * self.height(points) / reach
        x, y = points[:, 0] - self.centre_x, points[:, 1] - self.centre_y
        return xp.stack([fall * x, fall * y, xp.ones_like(fall)], axis=-1)

    def _from_centre(self, points: Points) -> Scalars:
        xp = array_namespace(points)
        return xp.hypot(points[:, 0] - self.centre_x, points[:, 1] - self.centre_y)


@dataclass(frozen=True, slots=True)
class Crossing:
    """The sum of two straight ridges; the feature is the nearer crest."""

    amplitude: Any
    sharpness: Any
    angle: Any
    other_amplitude: Any
    other_sharpness: Any
    other_angle: Any

    def feature_distance(self, points: Points) -> Scalars:
        """Return the distance from the nearer crest line in the plane."""
        xp = array_namespace(points)
        first, second = (ridge.feature_distance(points) for ridge in self._ridges())
        return xp.minimum(first, second)

    def height(self, points: Points) -> Scalars:
        """Return the height of the surface over (x, y); z is not read."""
        first, second = (ridge.height(points) for ridge in self._ridges())
        return first + second

    def value(self, points: Points) -> Scalars:
        """Return f = z − height(x, y)."""
        return points[:, 2] - self.height(points)

    def gradient(self, points: Points) -> Points:
        """Return ∇f = (−∂height, 1)."""
        first, second = (ridge.gradient(points) for ridge in self._ridges())
        xp = array_namespace(points)
        return xp.stack(
            [first[:, 0] + second[:, 0], first[:, 1] + second[:, 1], first[:, 2]], axis=-1
        )

    def _ridges(self) -> tuple[Ridge, Ridge]:
        return (
            Ridge(self.amplitude, self.sharpness, self.angle, 0.0, 0.0),
            Ridge(self.other_amplitude, self.other_sharpness, self.other_angle, 0.0, 0.0),
        )


@dataclass(frozen=True, slots=True)
class Bump:
    """Elliptic Gaussian bump z = a exp(−b x'² − e b y'²), (x', y') turned by φ."""

    amplitude: Any
    sharpness: Any
    elongation: Any
    angle: Any
    centre_x: Any
    centre_y: Any

    def feature_distance(self, points: Points) -> Scalars:
        """Return the distance from the top in the plane."""
        xp = array_namespace(points)
        return xp.hypot(points[:, 0] - self.centre_x, points[:, 1] - self.centre_y)

    def height(self, points: Points) -> Scalars:
        """Return the height of the surface over (x, y); z is not read."""
        along, across, _, _ = self._turned(points)
        xp = array_namespace(points)
        return self.amplitude * xp.exp(-self.sharpness * (along**2 + self.elongation * across**2))

    def value(self, points: Points) -> Scalars:
        """Return f = z − height(x, y)."""
        return points[:, 2] - self.height(points)

    def gradient(self, points: Points) -> Points:
        """Return ∇f = (−∂height, 1)."""
        xp = array_namespace(points)
        along, across, cosine, sine = self._turned(points)
        fall = 2 * self.sharpness * self.height(points)
        by_along, by_across = fall * along, fall * self.elongation * across
        x = cosine * by_along - sine * by_across
        y = sine * by_along + cosine * by_across
        return xp.stack([x, y, xp.ones_like(x)], axis=-1)

    def _turned(self, points: Points) -> tuple[Scalars, Scalars, Any, Any]:
        """Return x', y', cos φ, sin φ."""
        xp = array_namespace(points)
        angle = xp.asarray(self.angle, dtype=points.dtype)
        cosine, sine = xp.cos(angle), xp.sin(angle)
        x, y = points[:, 0] - self.centre_x, points[:, 1] - self.centre_y
        return cosine * x + sine * y, cosine * y - sine * x, cosine, sine


@dataclass(frozen=True, slots=True)
class LumpySphere:
    """A sphere with waves: r = R + a sin(k û_x + p) sin(k û_y + q) sin(k û_z + s)."""

    radius: Any
    amplitude: Any
    frequency: Any
    phase_x: Any
    phase_y: Any
    phase_z: Any

    def feature_distance(self, points: Points) -> Scalars:
        """Return how far each point is below the highest lumps."""
        return self.radius + self.amplitude - self.reach(_direction(points))

    def reach(self, direction: Points) -> Scalars:
        """Return the surface's distance r from the centre in unit directions."""
        x, y, z = self._waves(direction)
        xp = array_namespace(direction)
        return self.radius + self.amplitude * xp.sin(x) * xp.sin(y) * xp.sin(z)

    def value(self, points: Points) -> Scalars:
        """Return f = ‖p‖ − r(p / ‖p‖)."""
        length = array_namespace(points).linalg.vector_norm(points, axis=-1)
        return length - self.reach(_direction(points))

    def gradient(self, points: Points) -> Points:
        """Return ∇f = û − (1 − û ûᵀ) ∇r / ‖p‖."""
        xp = array_namespace(points)
        direction = _direction(points)
        x, y, z = self._waves(direction)
        slope = self.amplitude * self.frequency
        rise = xp.stack(
            [
                slope * xp.cos(x) * xp.sin(y) * xp.sin(z),
                slope * xp.sin(x) * xp.cos(y) * xp.sin(z),
                slope * xp.sin(x) * xp.sin(y) * xp.cos(z),
            ],
            axis=-1,
        )
        radial = xp.sum(rise * direction, axis=-1)[:, None] * direction
        length = xp.linalg.vector_norm(points, axis=-1)[:, None]
        return direction - (rise - radial) / length

    def _waves(self, direction: Points) -> tuple[Scalars, Scalars, Scalars]:
        phases = (self.phase_x, self.phase_y, self.phase_z)
        x, y, z = (self.frequency * direction[:, axis] + phase for axis, phase in enumerate(phases))
        return x, y, z


def _direction(points: Points) -> Points:
    xp = array_namespace(points)
    return points / xp.linalg.vector_norm(points, axis=-1, keepdims=True)
