"""Activation times against finite differences."""
import matplotlib.pyplot as plt
import numpy as np
from waves import HALF, PLATEAU, REST, THRESHOLD, passage_times, still

TITLE = "Monodomain: activation times against finite differences"
QUESTION = """The paper's comparison: a slab and a belly-shaped body, stimulated at both ends, with recovery. When does the
front pass each point, with particles and with second-order finite differences of the same equations?"""

CHI, CM = 50.0, 0.01
D = 0.893 * 0.67 / (0.893 + 0.67) / (CHI * CM)  # mm2/ms
C1, C2, B, DD = 0.175, 0.03, 0.011, 0.55
A = (THRESHOLD - REST) / (PLATEAU - REST)
DRIVEN_MS = 10.0


class Differences:
    """Cubes of `step` mm inside a shape; no flux through faces to the outside; Heun's method."""

    def __init__(self, inside, box_mm, step):
        self.step = step
        self.cells = np.round(np.array(box_mm) / step).astype(int)
        centre = [(np.arange(n) + 0.5) * step - 0.5 * n * step for n in self.cells]
        X, Y, Z = np.meshgrid(*centre, indexing="ij")
        self.inside = inside(X, Y, Z)
        self.x = np.stack([X[self.inside], Y[self.inside], Z[self.inside]], 1)
        # Open faces: both cells inside.
        self.open = [(self.inside.take(range(n - 1), k) & self.inside.take(range(1, n), k)).astype(np.float32)
                     * np.float32(D / step**2) for k, n in enumerate(self.cells)]

    def rate(self, V, w):
        lap = np.zeros_like(V)
        for k, face in enumerate(self.open):
            flux = face * np.diff(V, axis=k)
            low = [slice(None)] * 3
            high = [slice(None)] * 3
            low[k], high[k] = slice(0, -1), slice(1, None)
            lap[tuple(low)] += flux
            lap[tuple(high)] -= flux
        u = (V - np.float32(REST)) * np.float32(1 / (PLATEAU - REST))
        ion = np.float32(C1) * u * (u - np.float32(A)) * (u - 1) + np.float32(C2) * w
        return lap - ion * np.float32(1 / CM), np.float32(B) * (u - np.float32(DD) * w)

    def times(self, driven, until_ms, dt, say=None):
        """Passage times (ms) of the cells inside; `driven` is a mask of the cells held at the plateau at first."""
        V = np.where(self.inside, np.float32(REST), 0).astype(np.float32)
        w = np.zeros_like(V)
        passed = np.full(V.shape, np.nan, np.float32)
        passed[driven] = 0
        t = 0.0
        while t < until_ms and np.isnan(passed[self.inside]).any():
            on = t < DRIVEN_MS
            if on:
                V[driven] = PLATEAU
            before = V
            kv, kw = self.rate(V, w)
            kv2, kw2 = self.rate(V + np.float32(dt) * kv, w + np.float32(dt) * kw)
            V, w = V + np.float32(dt / 2) * (kv + kv2), w + np.float32(dt / 2) * (kw + kw2)
            if on:
                V[driven] = PLATEAU
            rise = (V >= HALF) & (before < HALF) & np.isnan(passed) & self.inside
            passed[rise] = t + dt * (HALF - before[rise]) / (V - before)[rise]
            t += dt
            if say:
                say(f"finite differences: {t:.0f} ms")
        return passed[self.inside]


def compare(r, name, parameters, inside, box_mm, step_mm, dt_ms):
    m = still(**parameters)
    x = 1e3 * m.rest
    m.stimulate("both", 8000, DRIVEN_MS * 1e-3)
    m.advance(1e-6)
    driven = m.particles()["membrane_potential_mV"] > HALF
    # The differences are driven up to the last particles that are, within half a cell.
    low = x[driven & (x[:, 0] < 0), 0].max() + step_mm / 2
    high = x[driven & (x[:, 0] > 0), 0].min() - step_mm / 2
    ours = 1e3 * passage_times(m, 1.0, 0.5e-3, say=r.say)
    fd = Differences(inside, box_mm, step_mm)
    X = np.zeros(fd.inside.shape, np.float32)
    X[fd.inside] = fd.x[:, 0]
    theirs = fd.times(fd.inside & ((X < low) | (X > high)), 1000.0, dt_ms, r.say)
    from scipy.spatial import cKDTree

    free = (x[:, 0] > low) & (x[:, 0] < high)
    distance, near = cKDTree(fd.x).query(x[free], k=4)
    weight = 1 / np.maximum(distance, 1e-6)
    there = np.sum(weight * theirs[near], 1) / weight.sum(1)
    travel = np.nanmax(theirs)
    rmse = np.sqrt(np.mean((ours[free] - there) ** 2))
    r.check(f"{name}: RMSE of the activation time over the travel time of {travel:.0f} ms ({m.count} particles of "
            f"{1e3 * m.spacing:.2f} mm)", 100 * rmse / travel, below=4 if r.quick else 2)
    return x[free], ours[free], there, travel


def slab(spacing):
    size = (60.0, 12.0, 12.0)
    count = round(size[0] / spacing) * round(size[1] / spacing) ** 2  # cells of about the spacing
    return (dict(preset="bar", belly_length=0.06, belly_width=0.012, belly_thickness=0.012, particles=count),
            lambda X, Y, Z: np.ones_like(X, bool), size)


def spindle(spacing):
    L, a, b, end = 60.0, 10.0, 7.0, 3.0
    radii = lambda X: np.sin(np.pi * np.clip(X / L + 0.5, 0, 1))
    ry, rz = lambda X: end + (a - end) * radii(X), lambda X: end + (b - end) * radii(X)
    s = np.linspace(-L / 2, L / 2, 2001)
    volume = np.trapz(np.pi * ry(s) * rz(s), s)
    return (dict(preset="belly", belly_length=0.06, belly_width=0.02, belly_thickness=0.014, belly_end_radius=0.003,
                 particles=round(volume / spacing**3)),
            lambda X, Y, Z: (Y / ry(X)) ** 2 + (Z / rz(X)) ** 2 <= 1, (L, 2 * a, 2 * b))


def draw(axis, name, x, ours, theirs, step, spacing):
    dots = dict(rasterized=True)  # thousands of them
    axis.plot(x[::3, 0], theirs[::3], "C7.", ms=3, label=f"finite differences, {step:.2f} mm", **dots)
    axis.plot(x[::3, 0], ours[::3], "C0.", ms=1.5, label=f"particles, {spacing} mm", **dots)
    axis.set(xlabel="along the body (mm)", ylabel="activation time (ms)", title=name)
    axis.legend(fontsize=7)


def run(r):
    spacing = 1.5 if r.quick else 1.0
    # A third of the spacing puts cells where the particles are; the longest stable step is 0.22 step^2 / mm2 ms.
    step, dt = (spacing / 3, 0.05) if r.quick else (spacing / 3, 0.023)
    figure, axes = plt.subplots(1, 2, figsize=(8.5, 3.6))
    for axis, (name, body) in zip(axes, (("slab", slab), ("belly", spindle))):
        parameters, inside, box = body(spacing)
        x, ours, theirs, travel = compare(r, name, parameters, inside, box, step, dt)
        draw(axis, name, x, ours, theirs, step, spacing)
        r.csv(name, ["x_mm", "y_mm", "z_mm", "particles_ms", "differences_ms"], np.column_stack([x, ours, theirs]))
    r.figure("activation_times", figure, "When the front passes: every third particle, and the finite differences "
             "at the same place. The fronts meet in the middle.")
