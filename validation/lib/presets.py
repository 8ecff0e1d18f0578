"""The two presets as bodies of finite elements (src/core/belly.c has the numbers too), followed along their activation."""
import time

import numpy as np

SHAPES = {
    "triceps_long_head": dict(length=0.2632, width=0.042, thickness=0.029, end=0.007, bow=0.012, exponent=1.776),
    "vastus_lateralis": dict(length=0.4427, width=0.0765, thickness=0.035, end=0.007, bow=0.015, exponent=2.130)}
MOST_SOLVES = 250  # of a linear system, after which a failed step is the last one


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

    def mesh(self, tetrahedra, plane):
        """About that many in the whole of x = -plane ... plane; meshes a half."""
        import fem

        volume = self.volume * (1 - 2 * np.interp(self.length / 2 - plane, self._x, self._below) / self.volume)
        size = (volume / tetrahedra / 0.17) ** (1 / 3)  # as gmsh fills it; 0.118 were regular tetrahedra
        mesh = fem.belly_mesh(size, self.length / 2 - plane, self.length / 2 + plane, quarter=False, half=True, **self.shape)
        mesh.geometry.x[:, 0] -= self.length / 2
        return mesh


def state(body, preset, alpha, seconds):
    """What is compared: displacement at the nodes, end force, pressures over the whole free part and its regions."""
    borders = [-np.inf, preset.section(0.2), preset.section(0.8), np.inf]
    return {"alpha": alpha, "u": body.points()[1], "force": body.end_force()[0], "mean_u": body.mean_displacement(),
            "max_u": np.linalg.norm(body.points()[1], axis=1).max(), "pressure": body.mean_pressure(),
            "regions": [body.mean_pressure(a, b) for a, b in zip(borders, borders[1:])],
            "peak_pressure": np.abs(body.cell_pressures()).max(), "J": body.volume_ratio(), "seconds": seconds}


def follow(r, preset, mesh, order, law, levels, **body_is):
    """Equilibria at the levels that are reached; (body, states, where it ended or None)."""
    import fem

    began = time.process_time()
    body = fem.Body(mesh, law, order, **(body_is or {"half": True}))
    states, now, step = [], 0.0, 0.03
    for level in levels:
        while now < level - 1e-9:
            goal = min(now + step, level)
            try:
                body.solve(alpha=goal, say=r.say)
            except fem.NoSolution as end:
                step /= 3
                if step < 0.01 or body.solves > MOST_SOLVES:
                    return body, states, f"order {order}, {body.share * body.cells} tetrahedra: none above {now:.3f} ({end})"
                continue
            now, step = goal, min(2 * step, 0.1)
        states.append(state(body, preset, level, time.process_time() - began))
    return body, states, None


# Particles against elements ---------------------------------------------------------------------------------

PLANES = {"xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
REGIONS = ("origin", "centre", "insertion")


class Comparison:
    """Displacements of free particles less those of elements at the same places of the rest shape (m)."""

    def __init__(self, muscle, body):
        import fem
        from pointwise import Field

        self.free = muscle.attachment == 0
        self.region = muscle.region[self.free]
        points = muscle.rest[self.free]
        self.side = np.where((points[:, 1] < 0) & (1 in body.planes), -1.0, 1.0)
        self.places = points * np.stack([np.ones(len(points)), self.side, np.ones(len(points))], 1)
        self.nodes, self.cells = fem.elements(body)
        self._field = Field

    def elements(self, state):
        u = self._field(self.nodes, self.cells, state["u"]).at(self.places)
        u[:, 1] *= self.side
        return u

    def difference(self, u, state):
        return u[self.free] - self.elements(state)


def rms(vectors):
    """Root mean square length."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=-1))))
