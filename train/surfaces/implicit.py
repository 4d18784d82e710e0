"""Analytic surfaces: an implicit function, its gradient, and the distance that follows from both.

A surface is a frozen dataclass whose parameters are floats, or arrays with one entry a point (a
batch of many instances at once). Everything is written over the Python array API, so numpy
serves it and torch differentiates through it.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from array_api_compat import array_namespace
from jaxtyping import Float

Points = Float[Any, "P 3"]
Scalars = Float[Any, " P"]


class Implicit(Protocol):
    """The zero set of `value`; positive outside (above), where `gradient` points."""

    def value(self, points: Points) -> Scalars:
        """Return f at each point."""
        ...

    def gradient(self, points: Points) -> Points:
        """Return ∇f at each point."""
        ...


class Surface(Implicit, Protocol):
    """A surface of the paper's families: a dataclass, whose fields are its parameters."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def feature_distance(self, points: Points) -> Scalars:
        """Return how far each point is from the surface's feature, ≥ 0; small means near it."""
        ...


@dataclass(frozen=True, slots=True)
class Ridge:
    """Gaussian ridge z = a exp(−b y'²), y' = −sin φ (x − cx) + cos φ (y − cy).

    Source: paper, Setup, baselines, and metrics.
    """

    amplitude: Any
    sharpness: Any
    angle: Any
    centre_x: Any
    centre_y: Any

    def feature_distance(self, points: Points) -> Scalars:
        """Return |y'|, the distance from the crest line in the plane."""
        return array_namespace(points).abs(self.across(points))

    def across(self, points: Points) -> Scalars:
        """Return y', the signed coordinate across the crest line."""
        normal_x, normal_y = _across_direction(self.angle, points)
        return normal_x * (points[:, 0] - self.centre_x) + normal_y * (points[:, 1] - self.centre_y)

    def height(self, points: Points) -> Scalars:
        """Return the height of the surface over (x, y); z is not read."""
        xp = array_namespace(points)
        return self.amplitude * xp.exp(-self.sharpness * self.across(points) ** 2)

    def value(self, points: Points) -> Scalars:
        """Return f = z − height(x, y)."""
        return points[:, 2] - self.height(points)

    def gradient(self, points: Points) -> Points:
        """Return ∇f = (−∂height, 1)."""
        xp = array_namespace(points)
        normal_x, normal_y = _across_direction(self.angle, points)
        fall = 2 * self.sharpness * self.across(points) * self.height(points)
        return xp.stack([fall * normal_x, fall * normal_y, xp.ones_like(fall)], axis=-1)


@dataclass(frozen=True, slots=True)
class Saddle:
    """Hyperbolic paraboloid z = a ((x − cx)² − (y − cy)²). Smooth: Loop is already right here."""

    amplitude: Any
    centre_x: Any
    centre_y: Any

    def feature_distance(self, points: Points) -> Scalars:
        """Return the distance from the saddle point in the plane."""
        along, across = points[:, 0] - self.centre_x, points[:, 1] - self.centre_y
        return array_namespace(points).hypot(along, across)

    def height(self, points: Points) -> Scalars:
        """Return the height of the surface over (x, y); z is not read."""
        along, across = points[:, 0] - self.centre_x, points[:, 1] - self.centre_y
        return self.amplitude * (along**2 - across**2)

    def value(self, points: Points) -> Scalars:
        """Return f = z − height(x, y)."""
        return points[:, 2] - self.height(points)

    def gradient(self, points: Points) -> Points:
        """Return ∇f = (−2a (x − cx), 2a (y − cy), 1)."""
        xp = array_namespace(points)
        along, across = points[:, 0] - self.centre_x, points[:, 1] - self.centre_y
        slope = 2 * self.amplitude
        return xp.stack([-slope * along, slope * across, xp.ones_like(along)], axis=-1)


@dataclass(frozen=True, slots=True)
class SphereRidge:
    """Ridge along a great circle of a sphere: r = R + a exp(−b α²), sin α = −sin φ û_x + cos φ û_y.

    α is the latitude of the unit direction û above the great circle (radians).
    """

    radius: Any
    amplitude: Any
    sharpness: Any
    angle: Any

    def feature_distance(self, points: Points) -> Scalars:
        """Return |α|, the angle from the crest."""
        return array_namespace(points).abs(self.latitude(points))

    def latitude(self, points: Points) -> Scalars:
        """Return α, the signed angle from the crest."""
        xp = array_namespace(points)
        normal_x, normal_y = _across_direction(self.angle, points)
        height = normal_x * points[:, 0] + normal_y * points[:, 1]
        return xp.asin(height / xp.linalg.vector_norm(points, axis=-1))

    def reach(self, points: Points) -> Scalars:
        """Return the surface's distance r from the centre in each point's direction."""
        xp = array_namespace(points)
        return self.radius + self.amplitude * xp.exp(-self.sharpness * self.latitude(points) ** 2)

    def value(self, points: Points) -> Scalars:
        """Return f = ‖p‖ − r(p / ‖p‖)."""
        xp = array_namespace(points)
        return xp.linalg.vector_norm(points, axis=-1) - self.reach(points)

    def gradient(self, points: Points) -> Points:
        """Return ∇f = û − r'(α) ∇α; singular at the great circle's two poles."""
        xp = array_namespace(points)
        length = xp.linalg.vector_norm(points, axis=-1)[:, None]
        direction = points / length
        normal_x, normal_y = _across_direction(self.angle, points)
        normal = xp.stack([normal_x, normal_y, xp.zeros_like(normal_x)], axis=-1)
        alpha = self.latitude(points)
        slope = -2 * self.sharpness * alpha * (self.reach(points) - self.radius)
        tangent = (normal - xp.sin(alpha)[:, None] * direction) / (length * xp.cos(alpha)[:, None])
        return direction - slope[:, None] * tangent


def signed_distance(surface: Implicit, points: Points) -> Scalars:
    """Return f / ‖∇f‖: the distance to first order, which the published metrics use."""
    xp = array_namespace(points)
    return surface.value(points) / xp.linalg.vector_norm(surface.gradient(points), axis=-1)


def unit_normal(surface: Implicit, points: Points) -> Points:
    """Return ∇f / ‖∇f‖ at each point."""
    xp = array_namespace(points)
    gradient = surface.gradient(points)
    return gradient / xp.linalg.vector_norm(gradient, axis=-1, keepdims=True)


def _across_direction(angle: Any, points: Points) -> tuple[Any, Any]:
    """Return (−sin φ, cos φ), as scalars or one pair a point.

    Taken in float64 before it is rounded to the points' precision, as in the published data.
    """
    xp = array_namespace(points)
    phi = xp.asarray(angle, dtype=xp.float64)
    return xp.astype(-xp.sin(phi), points.dtype), xp.astype(xp.cos(phi), points.dtype)
