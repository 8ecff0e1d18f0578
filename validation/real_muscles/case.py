"""Real muscle surfaces, solid tissue against finite elements; only where the surfaces are."""
import importlib.util
import os
import pathlib

import numpy as np
import real_mesh
import sphm
import statics
from presets import PLANES, REGIONS

spec = importlib.util.spec_from_file_location("triceps", pathlib.Path(__file__).parents[1] / "triceps" / "case.py")
triceps = importlib.util.module_from_spec(spec)
spec.loader.exec_module(triceps)

TITLE = "Two real muscles against finite elements (opt-in)"
QUESTION = """The surfaces of the two muscles that the paper used (BodyParts3D, not part of this project, not watertight) are
filled with particles, and with tetrahedra inside the 0.5 level of their winding number. Held at 10 % of the volume at each
end and activated: displacement, pressure and end force of the solid tissue against quadratic finite elements of the same law
(Table 3, fibre term on the true stretch)."""

FILES = {"triceps long head": "triceps_long_head_right_FMA37699.stl", "vastus lateralis": "vastus_lateralis_right_FMA38930.stl"}
QUICK = False
LEVELS = (0.1, 0.3)
COUNTS = (2231, 4944, 9888)
ELEMENTS = ((1, 6000), (1, 20000), (2, 2500))  # order and tetrahedra, about


def folder():
    """Where SPH_MUSCLE_DATA says the surfaces are, or None."""
    named = os.environ.get("SPH_MUSCLE_DATA")
    return pathlib.Path(named) if named and all((pathlib.Path(named) / f).exists() for f in FILES.values()) else None


def available():
    return folder() is not None


class Turned:
    """A muscle in a frame whose x axis is its line of action, from the middle of it."""

    def __init__(self, muscle):
        self.muscle, self.count, self.region, self.attachment = muscle, muscle.count, muscle.region, muscle.attachment
        self.spacing, self.volume = muscle.spacing, muscle.volume
        axis = (muscle.insertion - muscle.origin) / np.linalg.norm(muscle.insertion - muscle.origin)
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        across /= np.linalg.norm(across)
        self.turn = np.stack([axis, across, np.cross(axis, across)])
        self.middle = (muscle.origin + muscle.insertion) / 2
        self.sections = muscle.sections - self.middle @ axis
        self.rest = self.here(muscle.rest)

    def here(self, points):
        return (points - self.middle) @ self.turn.T

    def there(self, points):
        return points @ self.turn + self.middle

    def section(self, share):
        order = np.argsort(self.muscle.axial_fraction)
        return np.interp(share, self.muscle.axial_fraction[order], self.rest[order, 0])

    def held(self):
        """Where the tissue is clamped."""
        return tuple(self.sections)


def filled(surface, count):
    return sphm.Muscle(surface, tissue="solid", particles=count, fibre_coupling="true_stretch", velocity_damping=40)


def mesh(turned, about):
    """About that many tetrahedra, and the share of the muscle's volume that they have."""
    import fem

    winding = real_mesh.Winding(turned.muscle)
    inside = lambda points: winding(turned.there(points))
    size = (turned.volume / about * 12) ** (1 / 3)  # a lattice cell has twelve tetrahedra
    margin = 2 * turned.spacing
    lower, upper = turned.rest.min(0) - margin, turned.rest.max(0) + margin
    nodes, cells = real_mesh.tetrahedra(inside, lower, upper, size)
    x = nodes[cells]
    return fem.mesh_of(nodes, cells), np.linalg.det(x[:, 1:] - x[:, :1]).sum() / 6 / turned.volume


def at_rest(turned, alpha):
    state = triceps.at_rest(turned.muscle, alpha)
    wrench = turned.muscle.wrench(sphm.INSERTION)["force_N"]
    return {**state, "u": state["u"] @ turned.turn.T, "force": -float(wrench @ turned.turn[0])}


def one(r, name, path, tables):
    surface = real_mesh.read_stl(path)
    first = Turned(filled(surface, COUNTS[-1]))
    held, bodies = first.held(), []
    for order, about in ELEMENTS:
        grid, share = mesh(first, about)
        made = statics.Reference(statics.follow(r.say, grid, order, triceps.law_of("true_stretch"), LEVELS,
                                                (first.section(0.2), first.section(0.8)), held=held))
        if made.end:
            r.note(f"{name}: no equilibrium of finite elements of {made.end}.")
        bodies.append(made)
        r.check(f"{name}, {made.whole} tetrahedra: volume less that of the surface", 100 * (share - 1), below=3)
        tables["elements"] += [[name, made.kind, made.whole, 100 * share, s["alpha"], s["force"], 1e3 * s["mean_u"],
                                1e3 * s["max_u"], s["pressure"], s["seconds"]] for s in made.states]
    for count in COUNTS:
        turned = Turned(filled(surface, count))
        for alpha in LEVELS:
            try:
                state = at_rest(turned, alpha)
            except sphm.Refused as end:
                r.note(f"{name}, {turned.count} particles stopped at activation {alpha}: {end}")
                break
            r.say(f"{name}, {turned.count} particles, activation {alpha}")
            for made in (x for x in bodies if x.at(alpha)):
                got = triceps.measures(turned, made, made.at(alpha), state)
                tables["pairs"].append([name, turned.count, made.kind, made.whole, alpha, 1e3 * got["rms"], got["rms_share"],
                                        got["pressure"], got["pressure_share"], got["force"]])
                if made.order == 2:
                    tables["regions"] += [[name, turned.count, alpha, region, *(1e3 * got[region, p] for p in PLANES),
                                           got[region, "pressure"]] for region in REGIONS]


def run(r):
    if not available():
        raise FileNotFoundError("SPH_MUSCLE_DATA names no folder with " + " and ".join(FILES.values()))
    tables = {"elements": [], "pairs": [], "regions": []}
    for name, file in FILES.items():
        one(r, name, folder() / file, tables)
    for name in FILES:
        rows = [x for x in tables["pairs"] if x[0] == name and x[2] == "tet10"]
        for alpha in LEVELS:
            found = [x for x in rows if x[4] == alpha]
            if not found:
                r.check(f"{name}, activation {alpha}: there is something to compare", 0, above=1, unit="")
                continue
            last = max(found, key=lambda x: x[1])
            r.check(f"{name}, {last[1]} particles, activation {alpha}: displacement RMSE over the peak", last[6], below=10)
            r.check(f"{name}, {last[1]} particles, activation {alpha}: end force", last[9], below=10)
    r.table("pairs", "Particles against finite elements.",
            ["muscle", "particles", "elements", "tetrahedra", "activation", "RMSE (mm)", "over the peak (%)",
             "pressure, difference (Pa)", "over the peak (%)", "end force (%)"], tables["pairs"])
    r.table("elements", "Finite elements of the whole muscle.",
            ["muscle", "elements", "tetrahedra", "volume over the surface's (%)", "activation", "end force (N)",
             "mean displacement (mm)", "largest (mm)", "mean pressure (Pa)", "time (s)"], tables["elements"])
    r.table("regions", "RMSE by region and plane (x along the line of action), against quadratic elements.",
            ["muscle", "particles", "activation", "region", "xy (mm)", "yz (mm)", "xz (mm)", "pressure, difference (Pa)"],
            tables["regions"])
