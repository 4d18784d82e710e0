"""Bounds of the distance of patches of a Loop surface from flat triangles.

A patch lies in the convex hull of the control points that its masks read. In each of its points
the triangle's own three have at least half of the weight, and what lies beyond edges of sharpness w
has 1 − w at most (docs/explanation/adaptive.md). So a linear function whose largest value is i at
those three, o at others on this side, and b beyond is at most

    i / 2 + (1/2 − δ) max(i, o) + δ max(i, o, b)      δ = min(1 − w, 1/2)

and the like from below. On a sharp curve both ends have two thirds of the weight.

Patches of regular faces are quartics, and lie between their Bernstein ordinates.

Where neither is near enough, values of the function are refined around the face, and its four
children are bounded, up to ``DEEPEST`` times. A face is three stars: a corner with its neighbours,
anticlockwise from the next corner on. All that is refined of a star follows from the star.
"""

from __future__ import annotations

import math

from pns_common.kernels import (
    b1_2d,
    f8_1d,
    f8_2d,
    i1_1d,
    i4_1d,
    i4_2d,
    i8_1d,
    i8_2d,
    inlined,
    kernel,
    u4_1d,
)
from pns_common.kernels.connectivity import BOUNDARY, IRREGULAR
from pns_common.kernels.loop import (
    CURVE_CENTRE,
    CURVE_NEIGHBOUR,
    EDGE_ENDPOINT,
    EDGE_OPPOSITE,
    MIDPOINT,
    at_sharpness,
)
from pns_common.kernels.vectors import (
    cross,
    difference,
    divisor,
    dot,
    norm,
    normal_and_area,
    over,
    row,
)

# Faces are refined so often, and have neighbours of so many neighbours at most.
DEEPEST, MOST = 4, 40
# Of a star: its centre, and the weights of the rules of curves and corners there.
CENTRE, SECOND, THIRD, WIDTH = MOST, MOST, MOST + 1, MOST + 2
DEGREE, GAP = 0, 1
# The least weight that the ends of a curve have on it, and the corners of a face on its patch.
OF_ENDS, OF_CORNERS = 2 / 3, 1 / 2
HALF = 1 / 2
# All but the curve's own rule has so much weight on a curve at most, in units of 1 − w.
OF_RING = 1.65
# Regular patches: their corners' neighbours, and the largest sharpness of edges to these.
REGULAR, SOFTEST = 6, 1 / 2
# What control points of children reach is a little more than what the patch reaches: at least so
# much, mostly. Bounds are near enough at NEAR times it, or BELOW it where that decides. Faces whose
# own control points reach FAR times what is enough are to be split. Patches reach at least TIGHT
# times what the ordinates of regular ones do. LITTLE: softness moves these by little.
LEAST, BELOW, NEAR, FAR, TIGHT, LITTLE = 0.85, 0.9, 1.05, 3.0, 0.93, 1 / 16


@inlined
def blended(inner, outer, beyond, own, loose):
    """Return the largest value where inner ones weigh ``own`` or more, and those beyond little."""
    here = max(inner, outer)
    if loose == 0:
        return own * inner + (1 - own) * here
    far = min(loose, 1 - own)
    return own * inner + (1 - own - far) * here + far * max(here, beyond)


# --- stars ----------------------------------------------------------------------------------------


@inlined
def before_and_after(h):
    """Return the corners of a triangle before and after one of it."""
    first = h - h % 3
    return first + (h + 2) % 3, first + (h + 1) % 3


@inlined
def across(corner_edges, half_edges, edge_class, h):
    """Return the half-edge of the other face at an edge of two faces; −1 at other edges."""
    e = corner_edges[h]
    if edge_class[e] == BOUNDARY or edge_class[e] == IRREGULAR:
        return -1
    return half_edges[e, 1] if half_edges[e, 0] == h else half_edges[e, 0]


@inlined
def find_star(corners, corner_edges, half_edges, edge_class, h, around, edges):
    """Write the neighbours of a corner's vertex and the edges to them.

    Return how many there are, and after which the fan has a gap: −1 if it has none. No neighbours
    are returned where there are too many.
    """
    at, k = h, 0
    while True:
        if k + 2 > MOST:
            return 0, -1
        before, after = before_and_after(at)
        around[k], edges[k] = corners[after], corner_edges[at]
        k += 1
        there = across(corner_edges, half_edges, edge_class, before)
        if there == h:
            return k, -1
        if there < 0:
            around[k], edges[k] = corners[before], corner_edges[before]
            k += 1
            break
        at = there
    gap, at, more = k - 1, h, 0
    while True:
        there = across(corner_edges, half_edges, edge_class, at)
        if there < 0:
            break
        _, at = before_and_after(there)
        more += 1
        if k + more > MOST:
            return 0, -1
    at = h
    for i in range(more):
        _, at = before_and_after(across(corner_edges, half_edges, edge_class, at))
        _, after = before_and_after(at)
        around[k + more - 1 - i], edges[k + more - 1 - i] = corners[after], corner_edges[at]
    return k + more, gap


@inlined
def wrapped(i, count):
    """Return i modulo a count that it is less than twice (a division takes longer than a star)."""
    return i if i < count else i - count


@inlined
def curve_of(w, shape, r):
    """Return which two neighbours are on the curve through a star's centre."""
    k, gap = shape[r, DEGREE], shape[r, GAP]
    if gap >= 0:
        return gap, wrapped(gap + 1, k)
    one, two = 0, 1
    if w[r, 1] > w[r, 0]:
        one, two = 1, 0
    for i in range(2, k):
        if w[r, i] > w[r, one]:
            one, two = i, one
        elif w[r, i] > w[r, two]:
            two = i
    return one, two


@inlined
def refine_star(z, w, shape, beta, r, to):
    """Write where a star's centre and the vertices of its edges go."""
    k, gap, p = shape[r, DEGREE], shape[r, GAP], z[r, CENTRE]
    total = 0.0
    for i in range(k):
        n = z[r, i]
        total += n
        middle = MIDPOINT * (p + n)
        if gap >= 0 and (i == gap or i == wrapped(gap + 1, k)):
            to[r, i] = middle
            continue
        sides = z[r, i - 1 if i > 0 else k - 1] + z[r, i + 1 if i + 1 < k else 0]
        smooth = EDGE_ENDPOINT * (p + n) + EDGE_OPPOSITE * sides
        to[r, i] = (1 - w[r, i]) * smooth + w[r, i] * middle
    smooth = (1 - k * beta[k]) * p + beta[k] * total
    if w[r, SECOND] > 0:
        one, two = curve_of(w, shape, r)
        curve = CURVE_CENTRE * p + CURVE_NEIGHBOUR * (z[r, one] + z[r, two])
        smooth = at_sharpness(smooth, curve, p, w[r, SECOND], w[r, THIRD])
    to[r, CENTRE] = smooth


@inlined
def keep_star(placed, w, shape, r, z, to):
    """Write the star of an old vertex a level later."""
    for i in range(shape[r, DEGREE]):
        z[to, i], w[to, i] = placed[r, i], w[r, i]
    z[to, CENTRE] = placed[r, CENTRE]
    w[to, SECOND], w[to, THIRD] = w[r, SECOND], w[r, THIRD]
    shape[to, DEGREE], shape[to, GAP] = shape[r, DEGREE], shape[r, GAP]


@inlined
def middle_star(placed, w, shape, x, y, turn, z, to):
    """Write the star of the vertex between corners x and y, which comes after x.

    Args:
        turn: at which place of the star the vertex between x and the third corner is; x is next.
    """
    k, sharp = shape[x, DEGREE], w[x, 0]
    border = shape[x, GAP] == k - 1
    many = 4 if border else 6
    for i in range(many):
        w[to, i] = 0.0
    own, other = wrapped(turn + 1, many), wrapped(turn + many - 2, many)
    z[to, turn], z[to, own] = placed[x, 1], placed[x, CENTRE]
    z[to, other], z[to, wrapped(other + 1, many)] = placed[y, CENTRE], placed[y, 0]
    w[to, own], w[to, other] = sharp, sharp
    if not border:
        z[to, wrapped(turn + 2, many)] = placed[x, k - 1]
        z[to, wrapped(turn + 3, many)] = placed[y, wrapped(2, shape[y, DEGREE])]
    z[to, CENTRE], w[to, SECOND], w[to, THIRD] = placed[x, 0], sharp, 0.0
    shape[to, DEGREE], shape[to, GAP] = many, own if border else -1


# --- bounds ---------------------------------------------------------------------------------------


@inlined
def regular_star(z, w, shape, c, to, k):
    """Write a star of six neighbours for one whose patches are the same by smooth rules alone.

    What lies beyond a curve is such that the smooth rules give the curve's. Return the largest
    sharpness of other edges; 1 if there is no such star.
    """
    many, gap, curve, most = shape[c, DEGREE], shape[c, GAP], -1, 0.0
    if w[c, THIRD] > 0 or many != (REGULAR if gap < 0 else REGULAR - 2):
        return 1.0
    if w[c, SECOND] >= 1:
        # The spoke of the curve before what lies beyond, which the face does not.
        curve = gap if gap >= 0 else 0
        while gap < 0 and curve < 3 and (w[c, curve] < 1 or w[c, curve + 3] < 1):
            curve += 1
        if gap < 0 and curve == 3:
            return 1.0
        curve = 3 if curve == 0 else curve
    elif gap >= 0:
        return 1.0
    straight = curve >= 0 or w[c, SECOND] == 0
    for i in range(many):
        j = i + 2 if gap >= 0 and i > gap else i
        to[k, j] = z[c, i]
        if curve < 0:
            straight = straight or (w[c, i] > 0 and w[c, wrapped(i + 3, REGULAR)] > 0)
        if curve < 0 or not (curve <= j <= curve + 3 or j == curve - 3):
            most = max(most, w[c, i])
    if curve >= 0:
        far = wrapped(curve + 3, REGULAR)
        to[k, curve + 1] = z[c, CENTRE] + to[k, curve] - to[k, curve - 1]
        to[k, curve + 2] = z[c, CENTRE] + to[k, far] - to[k, wrapped(far + 1, REGULAR)]
    to[k, REGULAR] = z[c, CENTRE]
    return most if straight else 1.0


@inlined
def regular_bounds(stars, softness, net, ordinates):
    """Return bounds on the patch of a regular face, of the ordinates of its four quartics.

    Return also how much of them softness may have moved.
    """
    for j in range(len(ordinates)):
        ordinates[j] = 0.0
    for k in range(3):
        for i in range(4):
            value = stars[k, REGULAR if i == 0 else i + 1]
            for j in range(len(ordinates)):
                ordinates[j] += value * net[4 * k + i, j]
    low, high = ordinates[0], ordinates[0]
    for j in range(1, len(ordinates)):
        low, high = min(low, ordinates[j]), max(high, ordinates[j])
    bend = 0.0
    if softness > 0:
        for k in range(3):
            before, here = stars[k, REGULAR - 1], stars[k, 0]
            for i in range(REGULAR):
                after = stars[k, wrapped(i + 1, REGULAR)]
                bend = max(bend, abs(stars[k, REGULAR] + here - before - after))
                before, here = here, after
    spare = softness * bend / (6 - 4 * softness)
    return low - spare, high + spare, spare


@inlined
def patch_bounds(z, w, shape, r):
    """Return the least and the largest value on the patch of a face of stars r, r + 1, r + 2."""
    low, high, least, most = math.inf, -math.inf, math.inf, -math.inf
    under, over_it, loose = math.inf, -math.inf, 0.0
    for c in range(r, r + 3):
        low, high = min(low, z[c, CENTRE]), max(high, z[c, CENTRE])
        k, sharp = shape[c, DEGREE], 0
        for i in range(k):
            sharp += w[c, i] > HALF
        if sharp < 2:
            for i in range(k):
                least, most = min(least, z[c, i]), max(most, z[c, i])
            continue
        up, down = 1, 0
        least, most = min(least, z[c, 1]), max(most, z[c, 1])
        while w[c, up] <= HALF:
            up = up + 1 if up + 1 < k else 0
            least, most = min(least, z[c, up]), max(most, z[c, up])
        least, most = min(least, z[c, 0]), max(most, z[c, 0])
        while w[c, down] <= HALF:
            down = down - 1 if down > 0 else k - 1
            least, most = min(least, z[c, down]), max(most, z[c, down])
        far = max(1 - w[c, up], 1 - w[c, down])
        if far > 0:
            loose = max(loose, far)
            for i in range(k):
                under, over_it = min(under, z[c, i]), max(over_it, z[c, i])
    return (
        -blended(-low, -least, -under, OF_CORNERS, loose),
        blended(high, most, over_it, OF_CORNERS, loose),
    )


@inlined
def side_bounds(z, w, shape, r, side):
    """Return the least and the largest value on a side of a face of stars r, r + 1, r + 2."""
    softness = 1 - w[r + side, 0]
    smooth = softness > HALF
    own, loose = OF_CORNERS if smooth else OF_ENDS, 0.0 if smooth else softness
    low, high, least, most = math.inf, -math.inf, math.inf, -math.inf
    under, over_it = math.inf, -math.inf
    for end in range(2):
        c = r + (side + end) % 3
        low, high = min(low, z[c, CENTRE]), max(high, z[c, CENTRE])
        second, third = w[c, SECOND], w[c, THIRD]
        free = second <= HALF
        if free:
            own = OF_CORNERS
        elif not smooth:
            loose = max(loose, OF_RING * (1 - (third if third > HALF else second)))
            if third <= HALF:
                one, two = curve_of(w, shape, c)
                least, most = min(least, z[c, one], z[c, two]), max(most, z[c, one], z[c, two])
        for i in range(shape[c, DEGREE]):
            under, over_it = min(under, z[c, i]), max(over_it, z[c, i])
            if smooth or free:
                least, most = min(least, z[c, i]), max(most, z[c, i])
    return -blended(-low, -least, -under, own, loose), blended(high, most, over_it, own, loose)


@inlined
def bounds(z, w, shape, r, side, net, stars, ordinates):
    """Return bounds on a side, or on the patch if that is negative.

    Return also what softness may have moved them by; −1 where they are those of a hull.
    """
    if side < 0:
        softness = regular_star(z, w, shape, r, stars, 0)
        for k in range(1, 3):
            if softness <= SOFTEST:
                softness = max(softness, regular_star(z, w, shape, r + k, stars, k))
        if softness <= SOFTEST:
            return regular_bounds(stars, softness, net, ordinates)
        low, high = patch_bounds(z, w, shape, r)
    else:
        low, high = side_bounds(z, w, shape, r, side)
    return low, high, -1.0


@inlined
def reached(placed, r):
    """Return the least and the largest value in the middles of a face's children, 0 among them."""
    a, b, c = placed[r, 0], placed[r + 1, 0], placed[r + 2, 0]
    low, high = min(a + b + c, 0.0), max(a + b + c, 0.0)
    for k in range(3):
        value = placed[r + k, CENTRE] + placed[r + k, 0] + placed[r + (k + 2) % 3, 0]
        low, high = min(low, value), max(high, value)
    return low / 3, high / 3


@inlined
def explored(
    z, placed, w, shape, beta, net, stars, ordinates, child, sides, side, above, enough, steps
):
    """Return bounds of values on a patch or a side of a face, whose stars are the first three.

    Args:
        z, placed, w, shape: the face's stars, and room for those of its descendants.
        beta, net: as of ``measure_faces``.
        stars, ordinates, child, sides: room.
        side: a side of the face; negative: the patch.
        above: whether values below 0 do not matter; they count as 0.
        enough: bounds below this are good enough.
        steps: so often faces may be refined.
    """
    if steps == 0:
        return patch_bounds(z, w, shape, 0) if side < 0 else side_bounds(z, w, shape, 0, side)
    low, high, spare = bounds(z, w, shape, 0, side, net, stars, ordinates)
    low = 0.0 if above else low
    worst, least = max(-low, high), 0.0
    if side < 0 and not above:
        least = min(abs(z[0, CENTRE]), abs(z[1, CENTRE]), abs(z[2, CENTRE]))
        if (z[0, CENTRE] > 0) != (z[1, CENTRE] > 0) or (z[0, CENTRE] > 0) != (z[2, CENTRE] > 0):
            least = 0.0
    if worst <= enough / 2 or (enough > 0 and least > FAR * enough):
        return low, high
    over = TIGHT * (worst - spare) - spare > enough
    if spare >= 0 and (worst <= enough or (over and (enough > 0 or spare <= LITTLE * worst))):
        return low, high
    lowest, highest, found_low, found_high = -enough / 2, enough / 2, math.inf, -math.inf
    level, sides[0], child[0] = 0, side, 0
    for c in range(3):
        refine_star(z, w, shape, beta, c, placed)
    if 0 <= spare <= LITTLE * worst:
        lowest, highest, steps = -enough, enough, 1
    elif side < 0 and not above:
        # Nearer than needed to tell whether it is to be split, and how it can be cut, takes long.
        lowest, highest = reached(placed, 0)
        far = max(-lowest, highest)
        near = BELOW if LEAST * far < enough < NEAR * far else NEAR
        spare = 0.0 if near == BELOW else enough / 8
        lowest, highest = near * lowest - spare, near * highest + spare
        if enough > 0 and enough <= LEAST * far:
            steps = 1
    while level >= 0:
        r, c = 3 * level, child[level]
        if c == 4:
            level -= 1
            continue
        child[level] += 1
        to, of_child = r + 3, -1
        if side >= 0:
            if c == sides[level]:
                of_child = 0
            elif c == (sides[level] + 1) % 3:
                of_child = 2
            else:
                continue
        if c < 3:
            after, before = r + (c + 1) % 3, r + (c + 2) % 3
            keep_star(placed, w, shape, r + c, z, to)
            middle_star(placed, w, shape, r + c, after, 0, z, to + 1)
            middle_star(placed, w, shape, before, r + c, 2, z, to + 2)
        else:
            for k in range(3):
                middle_star(placed, w, shape, r + k, r + (k + 1) % 3, 1, z, to + k)
        down, up, _ = bounds(z, w, shape, to, of_child, net, stars, ordinates)
        down = 0.0 if above else down
        if level + 1 < steps and (max(down, low) < lowest or min(up, high) > highest):
            level += 1
            child[level], sides[level] = 0, of_child
            for k in range(to, to + 3):
                refine_star(z, w, shape, beta, k, placed)
        else:
            found_low, found_high = min(found_low, down), max(found_high, up)
    return max(low, found_low), min(high, found_high)


@inlined
def set_values(points, corners, h, around, shape, direction, origin, z):
    """Write the values of a linear function at the stars of the corners h, h + 1, h + 2."""
    for c in range(3):
        z[c, CENTRE] = dot(direction, difference(row(points, corners[h + c]), origin))
        for j in range(shape[c, DEGREE]):
            z[c, j] = dot(direction, difference(row(points, around[c, j]), origin))


@kernel
def measure_faces(
    points: f8_2d,
    corners: u4_1d,
    corner_edges: u4_1d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    sharpness: f8_1d,
    valence: i4_1d,
    rules: f8_2d,
    beta: f8_1d,
    net: f8_2d,
    rows: i8_1d,
    triangles: f8_2d,
    compared: i4_2d,
    fenced: b1_2d,
    enough: float,
    steps: int,
    begin: int,
    end: int,
    numbers: f8_2d,
    ordinates: f8_1d,
    whole: i8_2d,
    to: f8_2d,
):
    """Write bounds of patches begin … end − 1 from triangles that stand for them.

    Args:
        points: control points.
        corners, corner_edges, half_edges, edge_class: the mesh.
        sharpness: (E,) of edges, 1 where there are not two faces.
        valence: (V,).
        rules: (V, 2) the weights of the rules of curves and of corners, and of the latter alone.
        beta: Loop's weight of one neighbour, for each valence.
        net: (12, N) weights of a regular face's control points in the ordinates of its quartics:
            of each corner, then of its neighbours 2, 3 and 4.
        rows: (N,) faces.
        triangles: (3 N, 3) corners of the triangles.
        compared: (N, 3) the triangle's side that each side of a face, from its corner on, is to be
            compared with as a curve; −1: none.
        fenced: (N, 3) sides of triangles beyond which no part of a patch is to be far.
        enough: bounds below this are good enough; 0: none is.
        steps: so often faces may be refined.
        numbers, whole: room of 9 (DEEPEST + 1) + 3 and 3 (DEEPEST + 1) + 8 rows, WIDTH wide.
        ordinates: (N,) room.
        to: (N, 4) out: least and largest height over the triangle's plane, or where the patch lies
            beyond a fenced side, minus and plus the distance from the triangle; how far curves
            are from their sides; 1 where the bounds are not known.
    """
    each = 3 * (DEEPEST + 1)
    z, placed, w = numbers[:each], numbers[each : 2 * each], numbers[2 * each : 3 * each]
    stars = numbers[3 * each :]
    around, edges, shape = whole[:3], whole[3:6], whole[6 : 6 + each]
    child, sides = whole[6 + each], whole[7 + each]
    for i in range(begin, end):
        p, q, r = row(triangles, 3 * i), row(triangles, 3 * i + 1), row(triangles, 3 * i + 2)
        n, _, _ = normal_and_area(p, q, r)
        flat = n[0] != 0 or n[1] != 0 or n[2] != 0
        known = True
        for c in range(3):
            h = 3 * rows[i] + c
            v = corners[h]
            k, gap = find_star(
                corners, corner_edges, half_edges, edge_class, h, around[c], edges[c]
            )
            shape[c, DEGREE], shape[c, GAP] = k, gap
            known = known and k > 1 and (rules[v, 0] >= 1 if gap >= 0 else k == valence[v])
            w[c, SECOND], w[c, THIRD] = rules[v, 0], rules[v, 1]
            for j in range(k):
                w[c, j] = sharpness[edges[c, j]]
                known = known and around[c, j] != v
        to[i, 0], to[i, 1], to[i, 2], to[i, 3] = 0.0, 0.0, 0.0, 0.0 if known else 1.0
        if not known:
            continue
        if not flat:
            # No plane: the distance from a corner is convex.
            for c in range(3):
                for j in range(shape[c, DEGREE]):
                    to[i, 1] = max(to[i, 1], norm(difference(row(points, around[c, j]), p)))
            continue
        set_values(points, corners, 3 * rows[i], around, shape, n, p, z)
        low, high = explored(
            z, placed, w, shape, beta, net, stars, ordinates, child, sides, -1, False, enough, steps
        )
        to[i, 0], to[i, 1] = min(low, 0.0), max(high, 0.0)
        for k in range(3):
            s = compared[i, k]
            if s < 0:
                continue
            origin = p if s == 0 else (q if s == 1 else r)
            target = q if s == 0 else (r if s == 1 else p)
            along = difference(target, origin)
            across_it = cross(over(along, divisor(along)), n)
            away = 0.0
            for direction in (n, across_it):
                set_values(points, corners, 3 * rows[i], around, shape, direction, origin, z)
                low, high = explored(
                    z,
                    placed,
                    w,
                    shape,
                    beta,
                    net,
                    stars,
                    ordinates,
                    child,
                    sides,
                    k,
                    False,
                    enough,
                    steps,
                )
                away += max(-low, high) ** 2
            to[i, 2] = max(to[i, 2], math.sqrt(away))
        beyond, height = 0.0, max(-to[i, 0], to[i, 1])
        for s in range(3):
            if not fenced[i, s]:
                continue
            origin = p if s == 0 else (q if s == 1 else r)
            along = difference(q if s == 0 else (r if s == 1 else p), origin)
            out = cross(over(along, divisor(along)), n)
            set_values(points, corners, 3 * rows[i], around, shape, out, origin, z)
            least = math.sqrt(max(enough**2 - height**2, enough**2 / 16))
            _, high = explored(
                z,
                placed,
                w,
                shape,
                beta,
                net,
                stars,
                ordinates,
                child,
                sides,
                -1,
                True,
                least,
                steps,
            )
            beyond = max(beyond, high)
        if beyond > 0:
            to[i, 0] = -math.sqrt(to[i, 0] ** 2 + beyond**2)
            to[i, 1] = math.sqrt(to[i, 1] ** 2 + beyond**2)
