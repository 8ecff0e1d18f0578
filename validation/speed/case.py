"""The paper's timings."""
import os

import matplotlib.pyplot as plt
from sphm import Muscle, default, library

TITLE = "The paper's timings"
QUESTION = """The paper's Figure 12 times the stages of a step at four particle counts: 3.7 steps a second on its CPU and 70.1
on its GPU (Titan X) at 18,475 particles. How many steps a second does this machine do, with one thread and with all,
with both tissues, and where does the time go?"""
QUICK = False  # a time is worth nothing beside other work

STAGES = ("neighbours_s", "intermediate_velocity_s", "density_pressure_s", "forces_s", "diffusion_s", "cell_model_s",
          "integration_s")


def measure(tissue, particles, threads, seconds=1.5):
    # The library's default stiffness, not Table 3 alone, under which particles go flat and steps get short (doc/solid.md).
    stiffness = "passive_compressive_stiffness"
    more = dict(electrode="both") if tissue == "fluid" else {stiffness: default(stiffness)}
    m = Muscle(tissue=tissue, particles=particles, threads=threads, stimulus="0:1:8000", **more)
    m._do("sphm_muscle_step", m._handle, 5)
    library().sphm_muscle_reset_timing(m._handle)
    while m.timing().total_s < seconds:
        m._do("sphm_muscle_step", m._handle, 5)
    t = m.timing()
    return m, t


def run(r):
    rows, best = [], {}
    for tissue in ("fluid", "solid"):
        for particles in (2231, 4944, 9888, 18475):
            for threads in (1, os.cpu_count()):
                r.say(f"{tissue}, {particles} particles, {threads} threads")
                m, t = measure(tissue, particles, threads)
                rate = t.steps / t.total_s
                stages = [1e3 * getattr(t, s) / t.steps for s in STAGES]
                other = 1e3 * t.total_s / t.steps - sum(stages)
                rows.append([tissue, m.count, threads, rate, rate * m.count / 1e6, float(t.neighbours_per_particle),
                             rate * m.time_step, *stages, other])
                best[tissue, particles] = rate
    r.table("stages", "Steps a second, million particle-steps a second, real-time factor, and milliseconds a step by "
            "stage, while contracting.",
            ["tissue", "particles", "threads", "steps/s", "M particle-steps/s", "neighbours", "RTF",
             *(s[:-2] for s in STAGES), "other"], rows)
    r.check("fluid, 18,475 particles: steps a second over the paper's CPU (3.7)", best["fluid", 18475] / 3.7, above=1,
            unit="times")
    figure, axes = plt.subplots()
    for tissue in ("fluid", "solid"):
        axes.loglog(*zip(*[(p, best[tissue, p]) for p in (2231, 4944, 9888, 18475)]), "o-", label=f"{tissue}, all threads")
    axes.plot([18475], [3.7], "kx", label="the paper's CPU")
    axes.plot([18475], [70.1], "k+", ms=8, label="the paper's GPU (Titan X)")
    axes.set(xlabel="particles", ylabel="steps a second")
    axes.legend()
    r.figure("steps", figure, "Steps a second on the machine of this run.")
