"""The stand-in belly against finite elements, isometric and isotonic."""
import matplotlib.pyplot as plt
import numpy as np
import sphm
import statics
from lattice import Lattice, bulge
from material import Material
from sphm import ORIGIN

TITLE = "A belly against finite elements"
QUESTION = """A spindle of 0.20 m (mid half axes 25 and 18 mm, ends 6 mm, straight fibres along x) is held at both ends,
10 % of its volume each, and activated to 0.1, 0.3 and 0.5. Does the muscle pull, bulge and move as quadratic finite
elements of the same law say? Do both end forces and three sections agree, and how do results change with the spacing?
The fibre law acts on the volume-free stretch (Blemker and Delp); Table 3; one hourglass coefficient, the default's."""

ALPHAS = (0.1, 0.3, 0.5)
PLANE = 0.0576  # m from the middle: beyond it lie 10 % of the volume at each end
VOLUME = 168.65e-6
COUNTS = (2231, 4944, 9888, 18475)
# Edges of tetrahedra across the fibres (m), and along them over those across.
MESHES = ((0.008, 1), (0.0055, 1), (0.004, 8), (0.003, 8), (0.002, 8), (0.0015, 8))
MESHES_QUICK = ((0.004, 8),)
HALVED = (2231, 18475, 147800)
MESHES_TRUE_STRETCH = ((0.004, 8), (0.002, 8))
ALPHAS_TRUE_STRETCH = (0.1, 0.3, 0.5, 1.0)
SECTIONS = (-0.025, 0.0, 0.025)  # m, between two layers near these
MID = 0.010  # m: width of the Gaussian section in which the bulge is measured


# Finite elements ------------------------------------------------------------------------------------------

def fem_row(body, alpha):
    """A quarter of the free part between the held faces; means over the whole belly."""
    high, low = body.end_force()
    return {"alpha": alpha, "cells": body.cells, "force": high, "balance": abs(high / low - 1),
            "mean_u": 4 * body.volume * body.mean_displacement() / VOLUME, "bulge": body.bulge(0.1, MID),
            "pressure": body.mean_pressure() * 4 * body.volume / VOLUME, "J": body.volume_ratio()}


def equilibria(r, size, elongation, law, order, alphas):
    import fem
    import snap

    body = snap.Body(fem.belly_mesh(size, 0.1 - PLANE, 0.1 + PLANE, elongation=elongation), law, order, quarter=True)
    rows = [{"size": size, "elongation": elongation, **fem_row(body, alpha)} for alpha in snap.climb(body, alphas, r.say)]
    if body.end:
        r.note(f"{'Volume-free' if law.volume_free else 'True'} stretch, no equilibrium of finite elements of {body.end}.")
    return rows


def finite_elements(r, size, elongation, law, order=2, alphas=ALPHAS):
    import snap

    coupling = "volume_free" if law.volume_free else "true_stretch"
    return statics.part(r, f"elements_{coupling}_p{order}_{1e3 * size:g}mm_{elongation}",
                        lambda: equilibria(r, size, elongation, law, order, alphas), law, (equilibria, fem_row, snap),
                        plane=PLANE, volume=VOLUME, middle=MID, size=size, elongation=elongation, order=order, alphas=alphas)


def elements_of(r, law, meshes, alphas):
    return [row for size, elongation in meshes for row in finite_elements(r, size, elongation, law, alphas=alphas)]


def finest(rows, alpha):
    """The row of the finest mesh that has an equilibrium at this activation."""
    return min(of(rows, alpha), key=lambda x: x["size"])


# Particles ------------------------------------------------------------------------------------------------

def belly(particles, coupling="volume_free", **more):
    return sphm.held_at(PLANE, **{**dict(tissue="solid", preset="belly", particles=particles,
                                         fibre_coupling=coupling, velocity_damping=40), **more})


def relax(m, r, seconds=0.07, mean_over=0.02):
    """Lets the muscle come to rest; end forces as means over the last part of it, positions at its end."""
    ends, samples = np.zeros(2), 8
    for _ in range(5):
        m.advance((seconds - mean_over) / 5)
        r.say(f"{m.count} particles, t {m.time:.2f} s, {m.pull():.2f} N")
    spread = []
    for _ in range(samples):
        m.advance(mean_over / samples)
        pair = np.array([m.wrench(ORIGIN)["force_N"][0], m.pull()])
        spread.append(pair)
        r.say(f"{m.count} particles, t {m.time:.2f} s, {pair[1]:.2f} N")
    ends = np.mean(spread, axis=0)
    return ends, np.ptp(spread, axis=0).max()


def particle_rows(r, particles, law, alphas=ALPHAS, **more):
    m = belly(particles, "volume_free" if law.volume_free else "true_stretch", **more)
    lattice, rows = Lattice(m), []
    mean = lambda field: np.average(field, weights=m.volumes)
    for alpha in alphas:
        m.activate(alpha)
        (origin, insertion), unrest = relax(m, r)
        now = m.particles()["position_m"]
        u = now - m.rest
        F = lattice.deformation(u)
        P = law.stress(F, alpha)
        J = np.linalg.det(F)
        pressure = -np.einsum("nij,nij->n", P, F) / (3 * J)
        free = m.attachment == 0
        rows.append({"count": m.count, "spacing": m.spacing, "plane": m.clamps()[1], "alpha": alpha,
                     "origin": origin, "force": insertion, "unrest": unrest,
                     "sections": [lattice.section_force(P, s) for s in SECTIONS],
                     "mean_u": mean(np.linalg.norm(u, axis=1)), "bulge": bulge(m.rest, now, m.volumes, 0, MID),
                     "pressure": mean(free * pressure), "J": mean(J),
                     "stretch": (np.linalg.norm(F[:, :, 0], axis=1).min(), np.linalg.norm(F[:, :, 0], axis=1).max())})
    return rows


def percent(a, b):
    return 100 * (a / b - 1)


def of(rows, alpha, **where):
    return [x for x in rows if x["alpha"] == alpha and all(x[k] == v for k, v in where.items())]


def balance(row):
    """How far ends and sections are from their mean, in per cent, worst."""
    forces = np.array([row["origin"], row["force"], *row["sections"]])
    return 100 * np.abs(forces / forces.mean() - 1).max()


# The case -------------------------------------------------------------------------------------------------

def run(r):
    law = Material(volume_free=True)
    alphas = ALPHAS[:2] if r.quick else ALPHAS
    counts = COUNTS[:1] if r.quick else COUNTS
    elements = elements_of(r, law, MESHES_QUICK if r.quick else MESHES, alphas)
    report_elements(r, elements, alphas)
    particles = [row for n in counts for row in particle_rows(r, n, law, alphas)]
    report_particles(r, particles, elements, alphas)
    judge(r, particles, elements, alphas)
    figure(r, particles, elements, alphas)
    if not r.quick:
        halving(r)
    full_activation(r)


FEM_COLUMNS = ["edge across (mm)", "along over across", "tetrahedra (quarter)", "activation", "end force (N)",
               "mean displacement (mm)", "bulge (%)", "mean pressure (Pa)", "mean J of the free part"]


def fem_table(rows):
    return [[1e3 * x["size"], x["elongation"], x["cells"], x["alpha"], x["force"], 1e3 * x["mean_u"], 100 * x["bulge"],
             x["pressure"], x["J"]] for x in rows]


def report_elements(r, rows, alphas):
    r.table("finite_elements", "Quadratic tetrahedra (dolfinx), a quarter of the free part, held in the planes "
            "x = +-57.6 mm; means over the whole belly.",
            FEM_COLUMNS, fem_table(rows))
    if len({x["size"] for x in rows}) > 1:
        for key, what in (("force", "end force"), ("mean_u", "mean displacement"), ("bulge", "bulge")):
            last = [sorted(of(rows, a), key=lambda x: -x["size"])[-2:] for a in alphas]
            change = max((abs(percent(pair[0][key], pair[1][key])) for pair in last if len(pair) == 2), default=np.nan)
            r.check(f"finite elements: {what} of the last two meshes", change, below=2)


def report_particles(r, rows, elements, alphas):
    table = []
    for x in rows:
        f = finest(elements, x["alpha"])
        table.append([x["count"], x["alpha"], x["origin"], x["force"], *x["sections"], balance(x),
                      percent(x["force"], f["force"]), percent(x["mean_u"], f["mean_u"]),
                      percent(x["bulge"], f["bulge"]), x["pressure"], x["J"], *x["stretch"]])
    r.table("particles", "Particles: forces at the ends and through three sections (N), and what finite elements say "
            "less (%).", ["particles", "activation", "origin", "insertion", "section 1", "2", "3",
                          "spread of the five (%)", "force (%)", "mean displacement (%)", "bulge (%)",
                          "mean pressure (Pa)", "mean J", "least stretch", "largest"], table)
    r.table("held_planes", "Where the ends are held: where the tissue is felt to be clamped, behind the last held layer.",
            ["particles", "spacing (mm)", "plane (mm)", "asked for (mm)"],
            [[x["count"], 1e3 * x["spacing"], 1e3 * x["plane"], 1e3 * PLANE] for x in rows if x["alpha"] == alphas[0]])


def judge(r, rows, elements, alphas):
    most = max(x["count"] for x in rows)
    loose = 2 if r.quick else 1  # a coarse filling is not held to the bars of the fine one
    for key, what, bound in (("force", "end force", 3), ("bulge", "mid-belly bulge", 5),
                             ("mean_u", "volume-mean displacement", 5)):
        for a in alphas:
            x, f = of(rows, a, count=most)[0], finest(elements, a)
            r.check(f"{most} particles, activation {a}: {what} against finite elements", percent(x[key], f[key]),
                    below=bound * loose * (2 if r.quick and key != "force" else 1))
    r.check(f"{most} particles: two ends and three sections, worst from their mean",
            max(balance(x) for x in rows if x["count"] == most), below=1)
    if len({x["count"] for x in rows}) > 1:
        least = min(x["count"] for x in rows)
        for a in alphas:
            coarse, fine = of(rows, a, count=least)[0], of(rows, a, count=most)[0]
            check_halved(r, f"activation {a}", coarse, fine)


def halved(coarse, fine):
    """Changes of the end force and the middle section, in per cent."""
    return percent(coarse["force"], fine["force"]), percent(coarse["sections"][1], fine["sections"][1])


def check_halved(r, what, coarse, fine):
    for name, change in zip(("end force", "middle section"), halved(coarse, fine)):
        r.check(f"{what}: {name} when the spacing halves ({coarse['count']} to {fine['count']} particles)", change, below=2)


def halving(r):
    """The forces as the spacing halves, twice, with the constants that users get: the law on the true stretch, and fibres that
    resist compression."""
    stiffness = sphm.default("passive_compressive_stiffness")
    law = Material(compressive=stiffness)
    counts = [particle_rows(r, n, law, passive_compressive_stiffness=stiffness) for n in HALVED]
    changes = []
    for coarse, fine in zip(counts, counts[1:]):
        for x, y in zip(coarse, fine):
            force, section = halved(x, y)
            changes.append([x["count"], y["count"], x["alpha"], x["force"], y["force"], force, x["sections"][1], y["sections"][1],
                            section, balance(y)])
            if fine is counts[-1]:
                check_halved(r, f"default constants, activation {x['alpha']}", x, y)
    r.table("halving", "Forces (N) as the spacing halves, default constants.",
            ["particles", "twice as fine", "activation", "end force", "finer", "change (%)", "middle section", "finer", "change (%)",
             "finer: spread of ends and sections (%)"], changes)


def figure(r, rows, elements, alphas):
    fig, axes = plt.subplots(1, 3, figsize=(9.5, 3.2))
    for axis, (key, label, scale) in zip(axes, (("force", "end force (N)", 1), ("mean_u", "mean displacement (mm)", 1e3),
                                                ("bulge", "mid-belly bulge (%)", 100))):
        for k, a in enumerate(alphas):
            x = of(rows, a)
            axis.plot([1e3 * p["spacing"] for p in x], [scale * p[key] for p in x], f"C{k}o-",
                      label=f"particles, {a}")
            for style, x in (("^--", [p for p in of(elements, a) if p["elongation"] > 1]),
                             ("x:", [p for p in of(elements, a) if p["elongation"] == 1])):
                if x:
                    axis.plot([1e3 * p["size"] for p in x], [scale * p[key] for p in x], f"C{k}{style}", mfc="none",
                              label=f"{'long' if style == '^--' else 'even'} tetrahedra, {a}")
        axis.set(xlabel="spacing; edge of a tetrahedron across (mm)", title=label)
        axis.set_xlim(left=0)
        axis.set_ylim(bottom=0)
    axes[0].legend(fontsize=5)
    r.figure("convergence", fig, "Particles and quadratic finite elements against their resolution; activations 0.1, "
             "0.3, 0.5.")


def full_activation(r):
    """True stretch: finite elements as far as they go, and the volume at full activation."""
    law = Material()
    rows = elements_of(r, law, MESHES_QUICK if r.quick else MESHES_TRUE_STRETCH, ALPHAS[:1] if r.quick else ALPHAS_TRUE_STRETCH)
    r.table("finite_elements_true_stretch", "The fibre law on the true stretch: quadratic tetrahedra as above.", FEM_COLUMNS,
            fem_table(rows))
    x = particle_rows(r, 2231 if r.quick else 4944, law, (1.0,))[0]
    r.check("true stretch, activation 1: volume over its rest value", 100 * (x["J"] - 1), below=2)
    r.table("true_stretch", "The fibre law on the true stretch, activation 1.",
            ["particles", "end force (N)", "mean J", "least stretch", "largest"],
            [[x["count"], x["force"], x["J"], *x["stretch"]]])
