"""The operator as README and docs/features.md write it, one edge and one vertex at a time.

Of a closed mesh without creases. It shares nothing with the code under test: no topology, no masks,
no features, no gates.
"""

from math import cos, log, pi, tanh

import numpy as np

OPPOSITE_WEIGHT, END_WEIGHT = 1 / 8, 3 / 8


def unit(vector):
    return vector / np.linalg.norm(vector)


def shortened(vector, longest):
    """Π."""
    return vector * min(1.0, longest / max(np.linalg.norm(vector), 1e-300))


class PlainMesh:
    """A closed mesh: ``across[a, b]`` is the vertex opposite, in the face that runs from a to b."""

    def __init__(self, points, faces):
        self.points, self.faces = np.asarray(points), [tuple(map(int, face)) for face in faces]
        self.across = {}
        for a, b, c in self.faces:
            self.across |= {(a, b): c, (b, c): a, (c, a): b}
        vertices = range(len(points))
        self.ring = [[b for a, b in self.across if a == v] for v in vertices]
        # m_v, x_v and k_v.
        self.mean_normal = [self._mean_normal(v) for v in vertices]
        self.mean_jump = [np.mean([self.jump(v, j) for j in self.ring[v]]) for v in vertices]
        self.height = [
            self.umbrella(v) @ self.mean_normal[v] / self.spoke_length(v) for v in vertices
        ]

    def area(self, a, b, c):
        p = self.points
        return np.cross(p[b] - p[a], p[c] - p[a])

    def normals(self, a, b):
        """Of the face to the left of a → b, and of the one to its right."""
        return unit(self.area(a, b, self.across[a, b])), unit(self.area(b, a, self.across[b, a]))

    def jump(self, a, b):
        """x."""
        left, right = self.normals(a, b)
        return 1 - left @ right

    def bend(self, a, b):
        """s, the dihedral: positive on a crest."""
        left, right = self.normals(a, b)
        return np.cross(left, right) @ unit(self.points[b] - self.points[a])

    def spokes(self, v):
        return [self.points[j] - self.points[v] for j in self.ring[v]]

    def _mean_normal(self, v):
        areas = [self.area(*face) for face in self.faces if v in face]
        return sum(areas) / sum(np.linalg.norm(area) for area in areas)

    def umbrella(self, v):
        """u_v."""
        return np.mean(self.spokes(v), axis=0)

    def spoke_length(self, v):
        """h_v."""
        return np.mean([spoke @ spoke for spoke in self.spokes(v)]) ** 0.5

    def frame(self, a, b):
        """T, N, B."""
        tangent, both = unit(self.points[b] - self.points[a]), sum(self.normals(a, b))
        normal = unit(both - both @ tangent * tangent)
        return tangent, normal, np.cross(tangent, normal)

    def ring_features(self, v):
        """`ring-10`, in the order of its table."""
        m, u, r = self.mean_normal[v], self.umbrella(v), self.spoke_length(v)
        ring, spokes = self.ring[v], self.spokes(v)
        bends = [self.bend(v, j) for j in ring]
        tilts = [self.mean_normal[j] - m for j in ring]
        return [
            self.mean_jump[v],
            np.mean(bends),
            np.mean(np.square(bends)),
            self.height[v],
            u @ u / r**2,
            m @ m,
            np.mean([self.height[j] for j in ring]),
            np.mean([tilt @ spoke for tilt, spoke in zip(tilts, spokes, strict=True)]) / r,
            np.mean([np.linalg.norm(spoke) for spoke in spokes]) / r,
            np.mean([self.mean_jump[j] for j in ring]),
        ]

    def ring_vectors(self, v):
        """e₁, e₂, e₃."""
        r = self.spoke_length(v)
        pulls = [self.jump(v, j) / 2 * (self.points[j] - self.points[v]) for j in self.ring[v]]
        return self.mean_normal[v], self.umbrella(v) / r, np.mean(pulls, axis=0) / r

    def edge_features(self, a, b):
        """`signed-18`, in the order of its tables; of it the first five are `paper-5`."""
        p, c, d = self.points, self.across[a, b], self.across[b, a]
        h, (tangent, _, binormal) = np.linalg.norm(p[b] - p[a]), self.frame(a, b)
        sides = [log(np.linalg.norm(p[far] - p[end]) / h) for far in (c, d) for end in (a, b)]
        m = {v: self.mean_normal[v] for v in (a, b, c, d)}
        tilts = [
            m[v] @ axis for pair in ((a, b), (c, d)) for axis in (tangent, binormal) for v in pair
        ]
        heights = [self.height[v] for v in (a, b, c, d)]
        return [self.jump(a, b), *sides, self.bend(a, b), *tilts, *heights]

    # Loop's step

    def loop_vertex(self, v, values):
        k = len(self.ring[v])
        beta = (5 / 8 - (3 / 8 + cos(2 * pi / k) / 4) ** 2) / k
        return (1 - k * beta) * values[v] + beta * sum(values[j] for j in self.ring[v])

    def loop_edge(self, a, b, values):
        ends, far = values[a] + values[b], values[self.across[a, b]] + values[self.across[b, a]]
        return END_WEIGHT * ends + OPPOSITE_WEIGHT * far

    # What is added

    def push(self, v):
        """d_v at s = 1."""
        k, m = len(self.ring[v]), self.mean_normal[v]
        beta = (5 / 8 - (3 / 8 + cos(2 * pi / k) / 4) ** 2) / k
        m = m / max(np.linalg.norm(m), 1 / 4)
        return -(self.umbrella(v) @ m) * m / (1 + 3 / (8 * k * beta))

    def limit(self, v, values):
        """Where Loop's limit puts a vertex."""
        k = len(self.ring[v])
        beta = (5 / 8 - (3 / 8 + cos(2 * pi / k) / 4) ** 2) / k
        weight = 1 / (1 + 3 / (8 * k * beta))
        return (1 - weight) * values[v] + weight * np.mean(
            [values[j] for j in self.ring[v]], axis=0
        )

    def kept_at_tip(self, v, prior, pushes, strength):
        """D' of D: how far the limit of the pushed vertices stays behind the vertex says t."""
        pushed = {j: self.points[j] + pushes[j] for j in [v, *self.ring[v]]}
        m = self.mean_normal[v] / max(np.linalg.norm(self.mean_normal[v]), 1 / 4)
        left = abs((self.points[v] - self.limit(v, pushed)) @ m) / self.spoke_length(v)
        more = self.mean_jump[v] / np.mean([self.mean_jump[j] for j in self.ring[v]])
        rises = [min(1.0, max(0.0, share)) for share in ((left - 0.05) / 0.1, more - 1)]
        tip = np.prod([3 * rise**2 - 2 * rise**3 for rise in rises])
        back = self.points[v] - self.loop_vertex(v, self.points)
        return (1 - tip) * prior + tip * strength * back

    def length(self, a, b, altitudes):
        """ℓ: h, or so many times the lower of both faces' altitudes, less where both are thin."""
        h = np.linalg.norm(self.points[b] - self.points[a])
        if altitudes is None:
            return h
        edges = (a, b), (b, a)
        areas = [np.linalg.norm(self.area(*edge, self.across[edge])) for edge in edges]
        longest = [self.longest_of(*edge, self.across[edge]) for edge in edges]
        shape = max(area / side**2 for area, side in zip(areas, longest, strict=True))
        return min(h, altitudes * min(areas) / h) * min(1, 3 * altitudes * shape) ** 2

    def length_at(self, v, altitudes):
        """ℓ_v."""
        return np.mean([self.length(v, j, altitudes) ** 2 for j in self.ring[v]]) ** 0.5

    def longest_of(self, a, b, c):
        """Side of a face."""
        sides = (a, b), (b, c), (c, a)
        return max(np.linalg.norm(self.points[j] - self.points[i]) for i, j in sides)

    def longest_side(self, a, b):
        """Of both faces of an edge."""
        return max(self.longest_of(a, b, self.across[edge]) for edge in ((a, b), (b, a)))

    def side_gate(self, a, b, sharpness):
        """w: what the sides of both faces open."""

        def bends(i, j, k):
            jumps = [self.jump(*edge) for edge in ((i, j), (j, k), (k, i))]
            return np.mean([x * min(1.0, max(0.0, (0.6 - x) / 0.3)) for x in jumps])

        sides = bends(a, b, self.across[a, b]), bends(b, a, self.across[b, a])
        return tanh(sharpness * min(sides))
