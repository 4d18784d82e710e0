"""Analytic surfaces that training patches are drawn on, beside those of the paper's families."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Points = Float[np.ndarray, "P 3"]
Scalars = Float[np.ndarray, " P"]


@dataclass(frozen=True, slots=True)
class CurvedRidge:
    """Ridge along a circle: z = a exp(−b s²), s = ‖(x − cx, y − cy)‖ − ρ."""

    amplitude: float
    sharpness: float
    radius: float
    centre_x: float
    centre_y: float

    def height(self, points: Points) -> Scalars:
        """Return the height of the surface over (x, y); z is not read."""
        across = self._from_centre(points) - self.radius
        return self.amplitude * np.exp(-self.sharpness * across**2)

    def value(self, points: Points) -> Scalars:
        """Return f = z − height(x, y)."""
        return points[:, 2] - self.height(points)

    def gradient(self, points: Points) -> Points:
        """Return ∇f; not defined at the circle's centre."""
        reach = self._from_centre(points)
        fall = 2 * self.sharpness * (reach - self.radius) * self.height(points) / reach
        x, y = points[:, 0] - self.centre_x, points[:, 1] - self.centre_y
        return np.stack([fall * x, fall * y, np.ones_like(fall)], axis=-1)

    def _from_centre(self, points: Points) -> Scalars:
        return np.hypot(points[:, 0] - self.centre_x, points[:, 1] - self.centre_y)


@dataclass(frozen=True, slots=True)
class Bump:
    """Elliptic Gaussian bump z = a exp(−b x'² − e b y'²), (x', y') turned by φ."""

    amplitude: float
    sharpness: float
    elongation: float
    angle: float
    centre_x: float
    centre_y: float

    def height(self, points: Points) -> Scalars:
        """Return the height of the surface over (x, y); z is not read."""
        along, across = self._turned(points)
        return self.amplitude * np.exp(-self.sharpness * (along**2 + self.elongation * across**2))

    def value(self, points: Points) -> Scalars:
        """Return f = z − height(x, y)."""
        return points[:, 2] - self.height(points)

    def gradient(self, points: Points) -> Points:
        """Return ∇f = (−∂height, 1)."""
        along, across = self._turned(points)
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        fall = 2 * self.sharpness * self.height(points)
        by_along, by_across = fall * along, fall * self.elongation * across
        x = cosine * by_along - sine * by_across
        y = sine * by_along + cosine * by_across
        return np.stack([x, y, np.ones_like(x)], axis=-1)

    def _turned(self, points: Points) -> tuple[Scalars, Scalars]:
        """Return x', y'."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        x, y = points[:, 0] - self.centre_x, points[:, 1] - self.centre_y
        return cosine * x + sine * y, cosine * y - sine * x


@dataclass(frozen=True, slots=True)
class LumpySphere:
    """A sphere with waves: r = R + a sin(k û_x + p) sin(k û_y + q) sin(k û_z + s)."""

    radius: float
    amplitude: float
    frequency: float
    phases: tuple[float, float, float]

    def reach(self, direction: Points) -> Scalars:
        """Return the surface's distance r from the centre in unit directions."""
        x, y, z = self._waves(direction)
        return self.radius + self.amplitude * np.sin(x) * np.sin(y) * np.sin(z)

    def value(self, points: Points) -> Scalars:
        """Return f = ‖p‖ − r(p / ‖p‖)."""
        length = np.linalg.norm(points, axis=-1)
        return length - self.reach(points / length[:, None])

    def gradient(self, points: Points) -> Points:
        """Return ∇f = û − (1 − û ûᵀ) ∇r / ‖p‖."""
        length = np.linalg.norm(points, axis=-1)[:, None]
        direction = points / length
        x, y, z = self._waves(direction)
        slope = self.amplitude * self.frequency
        rise = np.stack(
            [
                slope * np.cos(x) * np.sin(y) * np.sin(z),
                slope * np.sin(x) * np.cos(y) * np.sin(z),
                slope * np.sin(x) * np.sin(y) * np.cos(z),
            ],
            axis=-1,
        )
        radial = np.sum(rise * direction, axis=-1)[:, None] * direction
        return direction - (rise - radial) / length

    def _waves(self, direction: Points) -> tuple[Scalars, Scalars, Scalars]:
        x, y, z = (self.frequency * direction + self.phases).T
        return x, y, z


@dataclass(frozen=True, slots=True)
class Fillet:
    """A quarter cylinder of radius r along x that fills the corner between the walls y = 0, z = 0.

    f is the signed distance itself, in the free space y, z > 0 positive.
    """

    radius: float

    def value(self, points: Points) -> Scalars:
        """Return the signed distance."""
        inward = self.radius - points[:, 1:]
        outside = np.linalg.norm(np.maximum(inward, 0), axis=-1)
        return self.radius - (outside + np.minimum(inward.max(axis=-1), 0))

    def gradient(self, points: Points) -> Points:
        """Return ∇f."""
        inward = self.radius - points[:, 1:]
        outside = np.maximum(inward, 0)
        length = np.linalg.norm(outside, axis=-1, keepdims=True)
        nearest_wall = (inward == inward.max(axis=-1, keepdims=True)).astype(float)
        towards = np.where(length > 0, outside / np.where(length > 0, length, 1), nearest_wall)
        return np.concatenate([np.zeros_like(length), towards], axis=-1)
