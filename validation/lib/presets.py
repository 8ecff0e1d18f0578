"""The two presets as bodies of finite elements (src/core/belly.c has the numbers too), and particles against elements."""
import numpy as np
from pointwise import Field

SHAPES = {
    "triceps_long_head": dict(length=0.2632, width=0.042, thickness=0.029, end=0.007, bow=0.012, exponent=1.776),
    "vastus_lateralis": dict(length=0.4427, width=0.0765, thickness=0.035, end=0.007, bow=0.015, exponent=2.130)}

HELD = 0.9  # share of the volume below the upper held plane, and above the lower one


class Preset:
    """Volume and sections of a preset; x = 0 in its middle, as in the library."""

    def __init__(self, name):
        import fem

        self.name, self.shape = name, SHAPES[name]
        self.length = self.shape["length"]
        self._x = np.linspace(0, self.length, 4001)
        ry, rz = fem.belly_radii(self._x, **self.shape)
        area = np.pi * ry * rz
        self._below = np.concatenate([[0], np.cumsum((area[1:] + area[:-1]) / 2 * np.diff(self._x))])
        self.volume = self._below[-1]

    def section(self, share):
        """x below which lies this share of the volume."""
        return np.interp(share * self.volume, self._below, self._x) - self.length / 2

    def mesh(self, tetrahedra, plane, elongation):
        """About that many in the whole of x = -plane ... plane, longer along x by a factor; meshes a half."""
        import fem

        volume = self.volume * (1 - 2 * np.interp(self.length / 2 - plane, self._x, self._below) / self.volume)
        size = (volume / elongation / tetrahedra / 0.17) ** (1 / 3)  # as gmsh fills it; 0.118 were regular tetrahedra
        mesh = fem.belly_mesh(size, self.length / 2 - plane, self.length / 2 + plane, quarter=False, half=True,
                              elongation=elongation, **self.shape)
        mesh.geometry.x[:, 0] -= self.length / 2
        return mesh


# Particles against elements ---------------------------------------------------------------------------------

PLANES = {"xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
REGIONS = ("origin", "centre", "insertion")


class Comparison:
    """Displacements of free particles less those of elements at the same places of the rest shape (m)."""

    def __init__(self, muscle, reference):
        self.free = muscle.attachment == 0
        self.region = muscle.region[self.free]
        points = muscle.rest[self.free]
        self.side = np.where((points[:, 1] < 0) & (1 in reference.planes), -1.0, 1.0)
        self.places = points * np.stack([np.ones(len(points)), self.side, np.ones(len(points))], 1)
        self.reference = reference

    def elements(self, state):
        u = Field(self.reference.nodes, self.reference.cells, state["u"]).at(self.places)
        u[:, 1] *= self.side
        return u

    def difference(self, u, state):
        return u[self.free] - self.elements(state)


def mean_pressures(muscle, pressure):
    """Volume means of the free particles' pressure: of all, and by region."""
    free = muscle.attachment == 0
    mean = lambda where: np.average(pressure[where], weights=muscle.volumes[where])
    return {"pressure": mean(free), "regions": [mean(free & (muscle.region == k)) for k in range(len(REGIONS))]}


def rms(vectors):
    """Root mean square length."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=-1))))
