"""Surfaces of real muscles, which are not closed, as tetrahedra: cells of a body-centred lattice cut at the 0.5 level of the
generalized winding number (after Labelle and Shewchuk, Isosurface stuffing, 2007)."""
import ctypes

import numpy as np
from sphm import _STRUCTS, Context, library


def read_stl(path, scale=0.001):
    """(vertices in m, triangles) of a binary STL file; vertices are not welded."""
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little")
    facets = np.frombuffer(data, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")]), count, 84)
    return facets["corners"].reshape(-1, 3).astype(float) * scale, np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


class Winding:
    """The library's winding number of a muscle's surface; lives no longer than the muscle."""

    def __init__(self, muscle):
        self.muscle = muscle
        body = library().sphm_muscle_body(muscle._handle).contents
        self._tree, context = ctypes.c_void_p(), Context()
        library().sphm_winding_number.restype = ctypes.c_double
        if library().sphm_winding_create(ctypes.byref(body.surface), ctypes.byref(self._tree), ctypes.byref(context)):
            raise RuntimeError(context.message.decode())

    def __del__(self):
        library().sphm_winding_destroy(self._tree)

    def __call__(self, points):
        out, place = np.empty(len(points)), (ctypes.c_double * 3)()
        for k, point in enumerate(points):
            place[:] = point
            out[k] = library().sphm_winding_number(self._tree, place)
        return out


def lattice(lower, upper, size):
    """(points, tetrahedra) of a body-centred lattice over a box: around every face between two cells, four tetrahedra of the
    cells' middles and an edge of the face."""
    n = np.ceil((upper - lower) / size).astype(int) + 1
    corner = lambda i: np.ravel_multi_index(i, n + 1)
    centre = lambda i: np.prod(n + 1) + np.ravel_multi_index(i, n)
    grid = lambda shape: np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 3)
    points = lower + size * np.concatenate([grid(n + 1) - 0.5, grid(n)])
    cells = []
    for d in range(3):
        first = grid(n - np.eye(3, dtype=int)[d])
        step = np.eye(3, dtype=int)
        a, b = (d + 1) % 3, (d + 2) % 3
        face = [first + step[d] + i * step[a] + j * step[b] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
        ends = centre(tuple(first.T)), centre(tuple((first + step[d]).T))
        for k in range(4):
            cells.append(np.stack([*ends, corner(tuple(face[k].T)), corner(tuple(face[(k + 1) % 4].T))], 1))
    return points, np.concatenate(cells)


def cut_places(inside, points, edges, halvings=10):
    """Where edges from inside to outside cross the 0.5 level, as shares of their length."""
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    low, high = np.zeros(len(edges)), np.ones(len(edges))
    for _ in range(halvings):
        middle = (low + high) / 2
        within = inside(a + middle[:, None] * (b - a)) > 0.5
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return (low + high) / 2


def tetrahedra(inside, lower, upper, size):
    """(nodes, cells) of what lies inside the 0.5 level; `inside` gives the winding number at points."""
    points, cells = lattice(lower, upper, size)
    sign = np.where(inside(points) > 0.5, 1, -1)
    edges = np.unique(np.sort(np.concatenate([cells[:, [i, j]] for i in range(4) for j in range(i)]), 1), axis=0)
    edges = edges[sign[edges[:, 0]] != sign[edges[:, 1]]]
    edges = np.where((sign[edges[:, 0]] > 0)[:, None], edges, edges[:, ::-1])  # from inside out
    share = cut_places(inside, points, edges)
    cuts = points[edges[:, 0]] + share[:, None] * (points[edges[:, 1]] - points[edges[:, 0]])
    # A point nearer to a cut than 0.3 of the edge moves onto it, so that no sliver is cut off.
    best = np.full(len(points), 0.3)
    moved = points.copy()
    for end, distance in ((0, share), (1, 1 - share)):
        for k in np.nonzero(distance < 0.3)[0]:
            v = edges[k, end]
            if distance[k] < best[v]:
                best[v], moved[v], sign[v] = distance[k], cuts[k], 0
    numbers = {}
    for k, (a, b) in enumerate(edges):
        if sign[a] > 0 > sign[b]:
            numbers[a, b] = len(points) + k
    made = []
    for cell in cells[(sign[cells] > 0).any(1)]:
        made += clip(cell, sign, numbers)
    nodes, made = np.concatenate([moved, cuts]), np.array(made)
    used, made = np.unique(made, return_inverse=True)
    made = made.reshape(-1, 4)
    x = nodes[used][made]
    volume = np.linalg.det(x[:, 1:] - x[:, :1]) / 6
    made[volume < 0] = made[volume < 0][:, [1, 0, 2, 3]]
    return nodes[used], made[np.abs(volume) > 1e-4 * size**3]


def clip(cell, sign, numbers):
    """The part of a tetrahedron where the sign is not negative, as tetrahedra."""
    plus, zero, minus = ([v for v in cell if s(sign[v])] for s in (lambda s: s > 0, lambda s: s == 0, lambda s: s < 0))
    if not minus:
        return [list(cell)]
    cut = lambda a, b: numbers[a, b]
    if len(plus) == 1:
        return [plus + zero + [cut(plus[0], m) for m in minus]]
    if len(plus) == 2 and len(minus) == 2:
        (a, b), (c, d) = plus, minus
        return prism([a, cut(a, c), cut(a, d)], [b, cut(b, c), cut(b, d)])
    if len(plus) == 2:  # one on the surface, one outside: a pyramid
        (a, b), (c,), (z,) = plus, minus, zero
        ring = [a, b, cut(b, c), cut(a, c)]
        k = ring.index(min(ring))
        ring = ring[k:] + ring[:k]
        return [[ring[0], ring[1], ring[2], z], [ring[0], ring[2], ring[3], z]]
    return prism(plus, [cut(p, minus[0]) for p in plus])


def prism(top, bottom):
    """Three tetrahedra; the diagonals start at the face's lowest number, so that neighbours cut alike."""
    k = int(np.argmin(top + bottom))
    if k >= 3:
        top, bottom, k = bottom, top, k - 3
    (a, b, c), (d, e, f) = top[k:] + top[:k], bottom[k:] + bottom[:k]
    if min(b, f) < min(c, e):
        return [[a, b, c, f], [a, b, f, e], [a, e, f, d]]
    return [[a, b, c, e], [a, e, c, f], [a, e, f, d]]
