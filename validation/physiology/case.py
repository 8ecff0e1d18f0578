"""Conduction velocity, twitch and tetanus."""
import matplotlib.pyplot as plt
import numpy as np
from sphm import Muscle
from waves import passage_times, speed, still

TITLE = "Twitch, tetanus and conduction velocity"
QUESTION = """With conduction_velocity = 4 m/s: does the excitation run at 4 m/s whatever the resolution, and does a bar
held at its rest length answer single pulses with twitches and faster and faster pulses with unfused and fused tetanus?"""

RATES = (5, 10, 20, 50, 125)


def conduction(r, spacing_mm):
    side = 0.006
    count = round(0.080e3 / spacing_mm) * round(side * 1e3 / spacing_mm) ** 2
    m = still(preset="bar", belly_length=0.080, belly_width=side, belly_thickness=side, particles=count,
              conduction_velocity=4)
    m.stimulate("origin", 8000, 0.002)
    fit = (-0.010, 0.025)
    watch = (m.rest[:, 0] > fit[0]) & (m.rest[:, 0] < fit[1])
    return speed(m, passage_times(m, 0.06, 0.1e-3, watch, r.say), *fit)


def pull(r, schedule, seconds, sample=0.002):
    m = Muscle(tissue="solid", preset="bar", belly_length=0.06, belly_width=0.015, belly_thickness=0.015,
               particles=500, attachment_fraction=0.25, conduction_velocity=4, stimulus=schedule)
    rows = []
    while m.time < seconds - 1e-9:
        m.advance(sample)
        rows.append((m.time, m.pull(), m.observe().activation))
        r.say(f"{schedule}: t {m.time:.2f} s, {rows[-1][1]:.1f} N")
    return np.array(rows)


def run(r):
    speeds = [(s, conduction(r, s)) for s in ([2.0] if r.quick else [1.0, 2.0, 3.0])]
    for spacing, v in speeds:
        r.check(f"conduction velocity at {spacing:g} mm spacing against 4 m/s", 100 * (v / 4 - 1), below=4)
    r.table("conduction", "Conduction velocity asked for: 4 m/s.", ["spacing (mm)", "speed (m/s)"],
            [list(row) for row in speeds])

    twitch = pull(r, "0:0.002:8000:belly", 0.4)
    held = pull(r, "0:1:8000:belly", 0.4)
    most = held[:, 1].max()
    trains = {rate: pull(r, f"0:inf:8000:belly:{rate}:0.002", 0.5 if r.quick else 1.0)
              for rate in (RATES[1:] if r.quick else RATES)}
    peak, at = twitch[:, 1].max(), twitch[np.argmax(twitch[:, 1]), 0]
    after = twitch[twitch[:, 0] > at]
    half = after[np.argmax(after[:, 1] < peak / 2), 0] - at
    rows, means, ripples = [], [], []
    for rate, data in trains.items():
        late = data[data[:, 0] > data[-1, 0] - (0.2 if rate > 5 else 0.4)]
        means.append(late[:, 1].mean())
        ripples.append(100 * np.ptp(late[:, 1]) / late[:, 1].max())
        rows.append([rate, 100 * late[:, 1].mean() / most, 100 * late[:, 1].max() / most, ripples[-1]])
    r.check("the twitch is weaker than the tetanus: its peak over a held stimulus", 100 * peak / most, below=90)
    r.check("force of the trains rises with the pulse rate: least rise over the largest mean",
            100 * np.diff(means).min() / max(means), above=0.5)
    # Fusion index: least over largest force of the last pulses; 90 % counts as fused.
    r.check("ripple at 10 pulses a second (unfused)", ripples[list(trains).index(10)], above=20)
    r.check("ripple at 125 pulses a second (fused: a fusion index of 90 %)", ripples[list(trains).index(125)], below=10)
    r.table("trains", f"Twitch: peak {100 * peak / most:.0f} % of a held stimulus after {1e3 * at:.0f} ms, half relaxed "
            f"{1e3 * half:.0f} ms later. Trains of 2 ms pulses, over their last part, in per cent of a held stimulus.",
            ["pulses a second", "mean (%)", "peak (%)", "ripple (%)"], rows)
    figure, axes = plt.subplots()
    axes.plot(twitch[:, 0], 100 * twitch[:, 1] / most, "k", label="one pulse")
    for rate, data in trains.items():
        axes.plot(data[:, 0], 100 * data[:, 1] / most, label=f"{rate} a second")
        r.csv(f"train_{rate}", ["time_s", "force_N", "activation"], data)
    axes.set(xlabel="time (s)", ylabel="force (% of a held stimulus)")
    axes.legend(fontsize=8)
    r.figure("trains", figure, "Isometric force of a bar at rest length under pulses of 2 ms to the whole belly.")
    r.note("Activation is a first-order filter of the potential (10 ms up, 40 ms down), a model without calcium; human "
           "twitches of whole muscles rise for 40 to 100 ms, longer than this one, and fuse at lower rates (30 to 50 a "
           "second, where this muscle still has the ripple of the table).")
