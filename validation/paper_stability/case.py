"""The paper's stability table: deformation over support radius, cell size and number of particles."""
import pathlib

import matplotlib.pyplot as plt
import numpy as np
from sphm import Muscle, Refused

TITLE = "The paper's stability table (fluid)"
QUESTION = """The paper found deformations of 7 to more than 70 % and instability, depending on the support radius h, the
cell size of its search grid and the number of particles (its section 4.3). What does the fluid tissue with the paper's
set-up do (config/paper.yaml, stimulated for 0.25 s at both ends)? The cell size must make no difference, since it only
changes how neighbours are found: nothing but the order of sums. The paper's steering turns a velocity towards the nearer of
the two directions of its fibre, and where the velocity is across the fibre rounding decides which: how far do two runs that
differ in rounding only come apart, with steering and without?"""

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAPER = {  # (h, cell): what its section 4.3 reports
    (0.02, 0.02): "7 %", (0.02, 0.04): "7 %", (0.04, 0.04): "20 to 26 %", (0.04, 0.08): "37 %",
    (0.08, 0.08): "above 70 %", (0.08, 0.16): "unstable within 100 steps"}

SAID = {0.02: 7, 0.04: 23, 0.08: 70}  # %, with cells of h; the last "more than"


def configuration():
    lines = (ROOT / "config" / "paper.yaml").read_text().splitlines()
    pairs = (line.split("#")[0].partition(":") for line in lines)
    return {name.strip(): value.strip() for name, _, value in pairs if value.strip()}


def deformation(r, particles, h, cell, seconds, **more):
    """The largest mean displacement while it contracts, over mid-belly radius and length (%); how it ended."""
    parameters = {**configuration(), "particles": particles, "paper_h": h, "stimulus": "0:0.25:8000", **more}
    m = Muscle(**parameters)
    unit = m.support / h  # metres of the paper's unit
    if abs(cell - h) > 1e-9:
        m = Muscle(**{**parameters, "cell_size": cell * unit})
    by_radius = by_length = 0.0
    try:
        while m.time < seconds:
            m.advance(0.02)
            o = m.observe()
            by_radius, by_length = max(by_radius, o.deformation_by_radius), max(by_length, o.deformation_by_length)
            r.say(f"{m.count} particles, h {h}, cell {cell}: t {m.time:.2f} s, {100 * o.deformation_by_radius:.1f} %")
    except Refused as end:
        return m, 100 * by_radius, 100 * by_length, f"stopped: {end}"
    return m, 100 * by_radius, 100 * by_length, "stable"


# Two runs that differ in rounding ---------------------------------------------------------------------------

STEPS = (1, 10, 100, 300, 700)


def pair(r, h, steering, change):
    """Two runs, the second with one parameter changed: rows of (steps, largest difference of a position, mean displacement
    (m), difference of the mean displacements (%))."""
    common = {**configuration(), "particles": 2231, "paper_h": h, "stimulus": "0:0.25:8000", "fibre_steering": steering}
    unit = Muscle(**common).support / h
    changed = {k: v * unit if k == "cell_size" else v for k, v in change.items()}
    made = [Muscle(**common), Muscle(**{**common, **changed})]
    rows = []
    for steps in STEPS:
        r.say(f"h {h}, steering {steering}, step {steps}")
        for m in made:
            m.step(steps - m.steps)
        places = [m.particles()["position_m"] - m.rest for m in made]
        means = [np.linalg.norm(u, axis=1).mean() for u in places]
        rows.append((steps, np.abs(places[0] - places[1]).max(), means[0], 100 * abs(means[1] / means[0] - 1)))
    return rows


def rounding(r):
    """The cell size with steering off, where it must change rounding only; with steering on, beside another change of
    rounding's size."""
    table, off, apart = [], [], []
    for h, steering, change in ((0.02, 0, {"cell_size": 0.04}), (0.04, 0, {"cell_size": 0.08}), (0.08, 0, {"cell_size": 0.16}),
                                (0.04, 1, {"cell_size": 0.08}), (0.04, 1, {"jitter": 1e-6})):
        rows = pair(r, h, steering, change)
        name, value = next(iter(change.items()))
        said = f"cell {value} for {h}" if name == "cell_size" else f"filling moved by {value:g} spacings"
        table += [[h, "on" if steering else "off", said, n, 1e9 * moved, 1e6 * mean, percent] for n, moved, mean, percent in rows]
        if not steering:
            off.append(rows[-1][3])
            apart.append(100 * rows[-1][1] / rows[-1][2])
    r.check(f"no steering: the cell size changes the mean displacement after {STEPS[-1]} steps by, worst of three supports",
            max(off), below=0.1)
    r.check("the same: a position by, over the mean displacement", max(apart), below=1)
    r.table("rounding", "Two runs of 2231 particles that differ in rounding only: largest difference of a position, mean "
            "displacement, difference of the two means.",
            ["h", "steering", "change", "steps", "position (nm)", "mean displacement (um)", "difference of means (%)"], table)


# The table --------------------------------------------------------------------------------------------------

def run(r):
    rounding(r)
    if r.quick:  # the excitation needs most of a second to cross the muscle
        return
    stability(r)
    pressures(r)


def pressures(r):
    """The paper does not give the pressure that its excitation adds."""
    rows = []
    for kappa in (10, 30, 100, 300, 1000):
        for steering in (1, 0):
            m, radius, length, end = deformation(r, 2231, 0.08, 0.08, 0.3, electrical_pressure=kappa, fibre_steering=steering)
            rows.append([kappa, "on" if steering else "off", m.count, radius, length, end])
    r.table("pressures", "By the pressure of excitation, h 0.08, in the first 0.3 s.",
            ["kappa (Pa/mV)", "steering", "particles", "over radius (%)", "over length (%)", ""], rows)
    r.note("The deformations are far below the paper's: they grow with the pressure that a millivolt of excitation adds "
           "(kappa), which the paper does not give and which is at its default in the table.")


def stability(r):
    counts = [2231, 4944, 9888, 18475]
    most = {0.02: 9888, 0.04: 18475, 0.08: 4944}  # at 0.08 each of 18475 has 600 neighbours
    seconds = 0.6  # the two waves meet before
    rows, cells_differ, curves = [], [], {}
    for h, cells in ((0.02, (0.02, 0.04)), (0.04, (0.04, 0.08)), (0.08, (0.08, 0.16))):
        for n in (c for c in counts if c <= most[h]):
            results = []
            for cell in cells if n == counts[0] else cells[:1]:
                m, radius, length, end = deformation(r, n, h, cell, seconds)
                results.append(radius)
                per = m.timing().neighbours_per_particle
                rows.append([h, cell, m.count, float(per), int(m.isolated), radius, length, end, PAPER[(h, cell)]])
            curves.setdefault(h, []).append((m.count, radius))
            if len(results) == 2:
                cells_differ.append(100 * abs(results[1] / results[0] - 1) if results[0] else 0.0)
    plain = [deformation(r, counts[0], 0.04, cell, seconds, fibre_steering=0)[1] for cell in (0.04, 0.08)]
    r.check("no steering: the cell size changes the deformation of the whole run by (h 0.04)", 100 * abs(plain[1] / plain[0] - 1),
            below=0.1)
    r.note("With the paper's steering the deformation with the second cell size differs by " +
           ", ".join(f"{d:.2g} %" for d in cells_differ) + " (h 0.02, 0.04, 0.08): a velocity across its fibre is an unstable "
           "point of the steering, which turns it to the side that the last digit says. The table of runs that "
           "differ in rounding only shows that the cell size has no other part in it: runs that differ in rounding for another reason part in the same way, and without "
           "steering there is no difference.")
    r.table("table", "Mean displacement at its largest, over the rest mid-belly radius and over the length; h and cell "
            "in the paper's units (the longest side is 2).",
            ["h", "cell", "particles", "neighbours", "isolated", "over radius (%)", "over length (%)", "", "the paper"],
            rows)
    figure, axes = plt.subplots()
    for k, (h, data) in enumerate(curves.items()):
        moved = [d for d in data if d[1] > 1e-3]  # particles without neighbours do not move
        axes.semilogy(*zip(*moved), "o-", color=f"C{k}", label=f"h = {h}")
        axes.axhline(SAID[h], color=f"C{k}", ls=":", label=f"the paper, h = {h}")
    axes.set(xlabel="particles", ylabel="mean displacement over mid-belly radius (%)")
    axes.legend(ncol=3, loc="upper center", bbox_to_anchor=(0.5, 1.22))
    r.figure("deformation", figure, "Deformation over the number of particles, on a logarithmic axis; dotted: what the paper saw at "
             "h with cells of h (relative to what, it does not say; at 0.08, more than that). Left out: runs in which every "
             "particle is isolated.")
    r.note("The paper does not say what its deformation is relative to: both measures are given. What it saw change "
           "with the cell size is its neighbour search missing neighbours; here the cells change rounding only.")
