"""Surfaces of real muscles, which are not closed, as tetrahedra: cells of a body-centred lattice cut at the 0.5 level of the
generalized winding number (after Labelle and Shewchuk, Isosurface stuffing, 2007), between two sections across x."""
import ctypes
import hashlib

import numpy as np
from scipy.optimize import minimize
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from sphm import Context, Muscle, library

NEAR = 0.3  # a point of the lattice nearer to a cut than this share of the edge moves onto it, so that no sliver is cut off
FACES = ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))  # of a tetrahedron of positive volume, seen counter-clockwise from outside


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


class Shape:
    """The inside of a surface, in a frame whose x axis is the line of action, from its middle. By cubes of tissue, as the fluid
    is filled: nothing here depends on how the solid's ends are held. `axis`: another direction of the line."""

    FINE = 150000  # particles that say where volume is

    def __init__(self, path, axis=None):
        self.surface = read_stl(path)
        self.digest = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        fine = Muscle(self.surface, tissue="fluid", particles=self.FINE)
        self.middle = (fine.origin + fine.insertion) / 2
        if axis is None:
            axis = (fine.insertion - fine.origin) / fine.length
        self.ends = self.middle - axis * fine.length / 2, self.middle + axis * fine.length / 2
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        across /= np.linalg.norm(across)
        self.turn = np.stack([axis, across, np.cross(axis, across)])
        self.points, self.cube = self.here(fine.rest), fine.spacing
        self.winding = Winding(fine)

    def here(self, points):
        return (points - self.middle) @ self.turn.T

    def volume(self, low, high):
        """Between two sections; cubes that one passes count in part."""
        x = self.points[:, 0]
        part = np.minimum((high - x) / self.cube + 0.5, (x - low) / self.cube + 0.5)
        return self.cube**3 * np.clip(part, 0, 1).sum()

    def area(self, x):
        """Of the section at x."""
        return self.volume(x - 2 * self.cube, x + 2 * self.cube) / (4 * self.cube)

    def about_knots(self, knots):
        """Volume about each of some places along x, by hats as wide as the distance to the next ones; of the first and last one
        what lies between them."""
        x = self.points[:, 0]
        x = x[(x > knots[0]) & (x < knots[-1])]
        return self.cube**3 * hats(x, knots).sum(1)

    def section(self, share):
        """x below which lies this share of the volume."""
        whole, low, high = self.volume(-np.inf, np.inf), self.points[:, 0].min(), self.points[:, 0].max()
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (middle, high) if self.volume(-np.inf, middle) < share * whole else (low, middle)
        return float((low + high) / 2)

    def inside(self, points):
        return self.winding(points @ self.turn + self.middle)


# The lattice ------------------------------------------------------------------------------------------------

def lattice(n):
    """(points, tetrahedra, 0 or 1 for points in the first or last section, else -1) of a body-centred lattice over n cells of
    edge 1: around every face between two cells, four tetrahedra of the cells' middles and an edge of the face. At the first and
    last faces along x the middle of the face stands for that of the missing cell, so that the lattice ends flat there."""
    n = np.asarray(n)
    grid = lambda shape: np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 3)
    corners, centres, section = np.prod(n + 1), np.prod(n), n[1] * n[2]
    corner = lambda i: np.ravel_multi_index(tuple(i.T), n + 1)
    centre = lambda i: corners + np.ravel_multi_index(tuple(i.T), n)
    flat = grid((1, n[1], n[2]))
    points = np.concatenate([grid(n + 1), grid(n) + 0.5, flat + (0, 0.5, 0.5), flat + (n[0], 0.5, 0.5)])
    step, cells = np.eye(3, dtype=int), []

    def around(d, face, ends):
        a, b = step[(d + 1) % 3], step[(d + 2) % 3]
        ring = [corner(face), corner(face + a), corner(face + a + b), corner(face + b)]
        cells.extend(np.stack([*ends, ring[k], ring[(k + 1) % 4]], 1) for k in range(4))

    for d in range(3):
        first = grid(n - step[d])
        around(d, first + step[d], (centre(first), centre(first + step[d])))
    last = flat + (n[0] - 1, 0, 0)
    around(0, flat, (corners + centres + np.arange(section), centre(flat)))
    around(0, last + step[0], (centre(last), corners + centres + section + np.arange(section)))
    ends = np.where(points[:, 0] == 0, 0, np.where(points[:, 0] == n[0], 1, -1))
    return points, np.concatenate(cells), ends


def cut_places(inside, points, edges, halvings=10):
    """Where edges from inside to outside cross the 0.5 level, as shares of their length."""
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    low, high = np.zeros(len(edges)), np.ones(len(edges))
    for _ in range(halvings):
        middle = (low + high) / 2
        within = inside(a + middle[:, None] * (b - a)) > 0.5
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return (low + high) / 2


def move_onto(points, sign, edges, share, cuts, ends):
    """Moves points of the lattice onto cuts near them; their sign becomes 0. What lies in a section stays in it: without a
    cut near it in there it keeps its place, and counts as one of the surface all the same."""
    best, moved = np.full(len(points), np.inf), points.copy()
    for end, distance in ((0, share), (1, 1 - share)):
        other = edges[:, 1 - end]
        for k in np.nonzero(distance < 0.5)[0]:
            v = edges[k, end]
            stays = ends[v] >= 0 and ends[v] != ends[other[k]]
            if distance[k] < NEAR:
                sign[v] = 0
            if not stays and distance[k] < min(best[v], NEAR if ends[v] < 0 else 0.5):
                best[v], moved[v] = distance[k], cuts[k]
    moved[sign != 0] = points[sign != 0]
    return moved


# Tetrahedra -------------------------------------------------------------------------------------------------

def tetrahedra(inside, lower, upper, size, elongation=1):
    """(nodes, cells) of what lies inside the 0.5 level between the sections x = lower[0] and upper[0], with edges of `size`
    across and `elongation` times that along x, about; `inside` gives the winding number at points. Only the largest piece that
    hangs together by faces."""
    n = np.ceil((upper - lower) / size).astype(int)
    n[0] = max(2, round((upper[0] - lower[0]) / (size * elongation)))
    step = np.array([(upper[0] - lower[0]) / n[0], size, size])
    start = np.array([lower[0], *((lower + upper)[1:] / 2 - n[1:] * size / 2)])
    points, cells, ends = lattice(n)
    within = lambda p: inside(start + p * step)
    sign = np.where(within(points) > 0.5, 1, -1)
    edges = np.unique(np.sort(np.concatenate([cells[:, [i, j]] for i in range(4) for j in range(i)]), 1), axis=0)
    edges = edges[sign[edges[:, 0]] != sign[edges[:, 1]]]
    edges = np.where((sign[edges[:, 0]] > 0)[:, None], edges, edges[:, ::-1])  # from inside out
    share = cut_places(within, points, edges)
    cuts = points[edges[:, 0]] + share[:, None] * (points[edges[:, 1]] - points[edges[:, 0]])
    moved = move_onto(points, sign, edges, share, cuts, ends)
    numbers = {(a, b): len(points) + k for k, (a, b) in enumerate(edges) if sign[a] > 0 > sign[b]}
    made = [part for cell in cells[(sign[cells] > 0).any(1)] for part in clip(cell, sign, numbers)]
    nodes = np.concatenate([moved, cuts])
    made = turned(nodes, np.array(made))
    nodes, made = tidy(nodes, made[largest(made)])
    return start + evened(nodes, made, within) * step, made


def volumes(nodes, cells):
    x = nodes[cells]
    return np.linalg.det(x[:, 1:] - x[:, :1]) / 6


def turned(nodes, cells):
    """With positive volumes."""
    wrong = volumes(nodes, cells) < 0
    cells[wrong] = cells[wrong][:, [1, 0, 2, 3]]
    return cells


def tidy(nodes, cells):
    """Without the nodes that no cell has."""
    used, cells = np.unique(cells, return_inverse=True)
    return nodes[used], cells.reshape(-1, 4)


def faces(cells):
    """(faces, cell of each, how many cells have it)."""
    found = np.concatenate([cells[:, f] for f in FACES])
    _, which, count = np.unique(np.sort(found, 1), axis=0, return_inverse=True, return_counts=True)
    return found, which.ravel(), count


def largest(cells):
    """Cells of the largest piece that hangs together by faces."""
    _, which, count = faces(cells)
    if count.max() > 2:
        raise ValueError("a face of three tetrahedra")
    order = np.argsort(which, kind="stable")
    shared = np.nonzero(np.diff(which[order]) == 0)[0]
    pairs = order[shared] % len(cells), order[shared + 1] % len(cells)
    _, piece = connected_components(coo_matrix((np.ones(len(shared)), pairs), shape=(len(cells),) * 2), False)
    return piece == np.bincount(piece).argmax()


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


# Their shape ------------------------------------------------------------------------------------------------

EDGES = [(i, j) for i in range(4) for j in range(i)]
REGULAR = 6**1.5 * 6 * 2**0.5


def crookedness(nodes, cells, power):
    """(k of each tetrahedron, sum of k^power, its gradient): k is (sum of the squared edges)^1.5 over the volume, 1 for a regular
    one; None where one has no volume."""
    p = nodes[cells]
    a, b, c = (p[:, k] - p[:, 0] for k in (1, 2, 3))
    by_a, by_b, by_c = np.cross(b, c) / 6, np.cross(c, a) / 6, np.cross(a, b) / 6
    volume = np.einsum("ni,ni->n", a, by_a)
    if volume.min() <= 0:
        return None
    squares = sum(((p[:, i] - p[:, j]) ** 2).sum(1) for i, j in EDGES)
    k = squares**1.5 / volume / REGULAR
    slope = np.stack([-by_a - by_b - by_c, by_a, by_b, by_c], 1) * (-k / volume)[:, None, None]
    for i, j in EDGES:
        along = (3 * k / squares)[:, None] * (p[:, i] - p[:, j])
        slope[:, i] += along
        slope[:, j] -= along
    gradient = np.zeros_like(nodes)
    np.add.at(gradient, cells, (power * k ** (power - 1))[:, None, None] * slope)
    return k, (k**power).sum(), gradient


def surface_normals(nodes, cells):
    """(unit normals of nodes of the surface, 0 of others, whether nodes lie in an end section). Those of an end section have
    normals in it."""
    found, which, count = faces(cells)
    rim = found[count[which] == 1]
    ends = nodes[:, 0].min(), nodes[:, 0].max()
    in_end = [np.abs(nodes[:, 0] - e) < 1e-9 * (ends[1] - ends[0]) for e in ends]
    rim = rim[~(in_end[0][rim].all(1) | in_end[1][rim].all(1))]
    area = np.cross(nodes[rim[:, 1]] - nodes[rim[:, 0]], nodes[rim[:, 2]] - nodes[rim[:, 0]])
    normal = np.zeros_like(nodes)
    np.add.at(normal, rim, area[:, None])
    flat = in_end[0] | in_end[1]
    normal[flat, 0] = 0
    return unit(normal), flat


def unit(vectors):
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def evened(nodes, cells, inside, rounds=4, power=5):
    """Nodes moved so that no tetrahedron is flat: those cut beside the end sections are, where points of the lattice had to stay
    in the section. Nodes of the surface slide along it and are put back onto the 0.5 level; end sections stay flat."""
    for _ in range(rounds):
        normal, flat = surface_normals(nodes, cells)
        before = nodes
        k, start, _ = crookedness(nodes, cells, power)
        stiff = np.zeros(len(nodes))
        np.add.at(stiff, cells, (power * (power + 1) * k ** (power + 2))[:, None])
        scale = 1 / np.sqrt(stiff)[:, None]

        def sliding(y):
            y = y.reshape(-1, 3)
            y = y - normal * np.einsum("ni,ni->n", normal, y)[:, None]
            y[flat, 0] = 0
            return scale * y

        def cost(y):
            found = crookedness(before + sliding(y), cells, power)
            return (10 * start, 0 * y) if found is None else (found[1], sliding(found[2]).ravel())

        nodes = before + sliding(minimize(cost, np.zeros(nodes.size), jac=True, method="L-BFGS-B", options={"maxiter": 60}).x)
        gone = (nodes[:, 0] < before[:, 0].min()) | (nodes[:, 0] > before[:, 0].max())  # past an end section
        nodes[gone] = before[gone]
        nodes = put_back(nodes, cells, inside, before, power)
    return nodes


def put_back(nodes, cells, inside, before, power, reach=0.35):
    """Nodes of the surface along their normals to the 0.5 level, or as far towards it as leaves every tetrahedron a volume."""
    if crookedness(nodes, cells, power) is None:
        return before
    normal, _ = surface_normals(nodes, cells)
    on = np.nonzero(normal.any(1))[0]
    low, high = nodes[on] - reach * normal[on], nodes[on] + reach * normal[on]
    crosses = (inside(low) > 0.5) & ~(inside(high) > 0.5)
    on, low, high = on[crosses], low[crosses], high[crosses]
    to = nodes.copy()
    share = cut_places(inside, np.concatenate([low, high]), np.arange(2 * len(on)).reshape(2, -1).T)
    to[on] = low + share[:, None] * (high - low)
    ends = nodes[:, 0].min(), nodes[:, 0].max()
    to[:, 0] = np.clip(to[:, 0], *ends)
    worst = 2 * crookedness(nodes, cells, power)[1]
    for share in 0.5 ** np.arange(10):
        found = crookedness(nodes + share * (to - nodes), cells, power)
        if found is not None and found[1] < worst:
            return nodes + share * (to - nodes)
    return nodes


def flattest(nodes, cells, elongation):
    """Least volume over that of a regular tetrahedron with the same longest edge, seen shortened along x."""
    x = (nodes / (elongation, 1, 1))[cells]
    longest = np.max([np.linalg.norm(x[:, i] - x[:, j], axis=1) for i, j in EDGES], 0)
    return float((2**0.5 * np.linalg.det(x[:, 1:] - x[:, :1]) / longest**3).min())


# The volume -------------------------------------------------------------------------------------------------

def fitted(nodes, cells, knots, shape):
    """Nodes with the surface pushed outwards across x, by what varies linearly between `knots` along x, the first and last of
    which are the end sections: until these have the shape's areas, and the rest its volume about each of the knots between them.
    Flat faces cut corners, and long ones cut off more in one section than they do in the next; what the ends pull goes with
    their areas."""
    normal, _ = surface_normals(nodes, cells)
    normal = unit(normal * (0, 1, 1))
    along, ends, parts = hats(nodes[:, 0], knots), end_faces(nodes, cells), parts_about(nodes, cells, knots)  # x stays
    pushed = lambda by: nodes + (by @ along)[:, None] * normal
    measured = lambda by: np.concatenate([areas_across(pushed(by), ends), (parts @ volumes(pushed(by), cells))[1:-1]])
    wanted = np.concatenate([[shape.area(knots[0]), shape.area(knots[-1])], shape.about_knots(knots)[1:-1]])
    by, little = np.zeros(len(knots)), 1e-3 * volumes(nodes, cells).sum() ** (1 / 3)
    for _ in range(20):
        now = measured(by)
        off = np.abs(now / wanted - 1).max()
        if off < 1e-4:
            break
        slope = np.stack([(measured(by + step) - now) / little for step in little * np.eye(len(knots))], 1)
        by += np.linalg.solve(slope, wanted - now)
    else:
        raise ValueError(f"sections and volumes of the tetrahedra stay {off:.2g} off the shape's")
    if volumes(pushed(by), cells).min() <= 0:
        raise ValueError(f"pushed out by {1e3 * by.min():.3g} to {1e3 * by.max():.3g} mm, tetrahedra turn inside out")
    return pushed(by)


def end_faces(nodes, cells):
    """Faces in the first and in the last section."""
    found, which, count = faces(cells)
    rim, low, high = found[count[which] == 1], nodes[:, 0].min(), nodes[:, 0].max()
    return [rim[(np.abs(nodes[rim][:, :, 0] - end) < 1e-9 * (high - low)).all(1)] for end in (low, high)]


def areas_across(nodes, sections):
    """Areas across x of lists of faces."""
    corners = [nodes[flat] for flat in sections]
    return np.array([np.abs(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])[:, 0]).sum() / 2 for x in corners])


def hats(x, knots):
    """[knots, places]: functions that are 1 at one knot, 0 at the others, and linear in between, at places x."""
    return np.array([np.interp(x, knots, row) for row in np.eye(len(knots))])


def sampled(nodes, cells, samples=64):
    """[cells, samples]: x of points in the tetrahedra."""
    return nodes[cells][:, :, 0] @ np.random.default_rng(1).dirichlet(np.ones(4), samples).T


def parts_about(nodes, cells, knots):
    """[knots, cells]: the part of each tetrahedron's volume that counts to a knot, by hats as wide as the distance to the next."""
    x = sampled(nodes, cells)
    return hats(x.ravel(), knots).reshape(len(knots), *x.shape).mean(2)


# Of a muscle ----------------------------------------------------------------------------------------------

def free_mesh(shape, held, about, elongation):
    """(nodes, tetrahedra of what lies between the held shares of the volume, about that many, what they had of its volume before
    they were fitted to it)."""
    low, high = shape.section(held), shape.section(1 - held)
    volume = shape.volume(low, high)
    size = (volume / elongation / about * 12) ** (1 / 3)  # a lattice cell has twelve tetrahedra
    free = shape.points[(shape.points[:, 0] > low) & (shape.points[:, 0] < high)]
    lower, upper = np.array([low, *free.min(0)[1:] - size]), np.array([high, *free.max(0)[1:] + size])
    nodes, cells = tetrahedra(shape.inside, lower, upper, size, elongation)
    share = volumes(nodes, cells).sum() / volume
    knots = np.linspace(low, high, max(2, round((high - low) / (size * elongation))) + 1)
    return fitted(nodes, cells, knots, shape), cells, share


def slabs(shape, held, nodes, cells, count=8):
    """Volume of tetrahedra less that of the shape, in slabs of the free part, in per cent; by points in each tetrahedron."""
    x = sampled(nodes, cells)
    volume = np.broadcast_to(volumes(nodes, cells)[:, None] / x.shape[1], x.shape)
    borders = np.linspace(shape.section(held), shape.section(1 - held), count + 1)
    ours, _ = np.histogram(x, borders, weights=volume)
    return [100 * (v / shape.volume(a, b) - 1) for v, a, b in zip(ours, borders, borders[1:])]
