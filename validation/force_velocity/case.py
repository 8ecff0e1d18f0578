"""Force against velocity of a fibre bar."""

import matplotlib.pyplot as plt
import numpy as np
from material import Material
from sphm import INSERTION, Muscle

TITLE = "Force and velocity of a fibre bar"
QUESTION = """A fully active bar with force_velocity = hill is shortened and lengthened at constant speeds. Does its active
force, over what it would be at the same stretch without motion, follow Hill's hyperbola (1 - V)/(1 + V/k), k = 0.25, with
V the shortening speed over its maximum of 4 optimal lengths a second, and beyond V = 0 its eccentric branch?"""

LENGTH, WIDTH, HELD = 0.12, 0.015, 0.125
FREE = LENGTH * (1 - 2 * HELD)
MOST, CURVATURE, PLATEAU, OPTIMAL = 4.0, 0.25, 1.4, 1.07


def hill(V):
    V = np.asarray(V, float)
    corner = (PLATEAU - 1) / (1 + 1 / CURVATURE)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(V > 1, 0, np.where(V >= 0, (1 - V) / (1 + V / CURVATURE), 1 + (PLATEAU - 1) * -V / (-V + corner)))


def ratio(r, V):
    """(V amid the bar, active force over its isometric value at the same stretch)"""
    m = Muscle(tissue="solid", preset="bar", belly_length=LENGTH, belly_width=WIDTH, belly_thickness=WIDTH,
               particles=1000, attachment_fraction=HELD, force_velocity="hill", shortening_speed_max=MOST,
               hill_curvature=CURVATURE, eccentric_force=PLATEAU, rate_filter=0.01, passive_coefficient=0,
               velocity_damping=20, mass_scaling=9, max_pose_jump=1)
    speed = V * MOST * OPTIMAL * FREE
    # Slowly: active fibres that are drawn out fast, beyond the optimum, neck, for neither curve resists it.
    m.move_end(INSERTION, [(OPTIMAL - 1) * FREE + 0.03 * speed, 0, 0], 0.2)
    m.activate(1)
    m.advance(0.25)
    m.move_end(INSERTION, [-0.08 * speed, 0, 0], 0.08, [-speed, 0, 0])
    m.advance(0.06)
    p = m.particles()
    x = m.rest[:, 0]
    amid = np.abs(x) < 0.1 * LENGTH
    stretch = 1 + np.polyfit(x[amid], (p["position_m"][:, 0] - x)[amid], 1)[0]
    rate = np.polyfit(x[amid], p["velocity_m_per_s"][amid, 0], 1)[0]
    law = Material()
    still = float(law.sigma_max * law.active(stretch / OPTIMAL)) / OPTIMAL * WIDTH**2
    r.say(f"V {V:.2f}: stretch {stretch:.3f}")
    return -rate / (MOST * OPTIMAL), -m.wrench(INSERTION)["active_N"][0] / still, stretch


def run(r):
    asked = (-0.1, 0.1, 0.3) if r.quick else (-0.3, -0.2, -0.1, -0.05, 0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
    rows = [(V, *ratio(r, V)) for V in asked]
    off = [100 * (force - float(hill(V))) for _, V, force, _ in rows]
    r.check("active force against Hill's hyperbola, worst, in per cent of the isometric force", max(off, key=abs),
            below=5)
    r.table("force_velocity", "V asked for and found amid the bar; force over the isometric force at the same stretch.",
            ["V asked for", "V", "stretch", "force", "Hill", "difference (% of isometric)"],
            [[a, V, stretch, force, float(hill(V)), o] for (a, V, force, stretch), o in zip(rows, off)])
    figure, axes = plt.subplots()
    V = np.linspace(-0.4, 1, 300)
    axes.plot(V, hill(V), "C7-", label="Hill (1938), with its eccentric branch")
    axes.plot([row[1] for row in rows], [row[2] for row in rows], "C0o", mfc="none", label="particles")
    axes.set(xlabel="V: shortening speed over its maximum", ylabel="active force over isometric")
    axes.legend()
    r.figure("force_velocity", figure, "Active force against the shortening speed.")
    r.note("Speeds and stretches are those amid the bar. Inertia is scaled by 9 so that the bar is uniform; passive "
           "fibre stress is off, so that the active part stands alone.")
