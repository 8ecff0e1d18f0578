"""Excitation of a muscle whose tissue stands still: when each particle's potential passes half way."""
import numpy as np
from sphm import Muscle

# No tension and no viscosity: the fluid rests, and its steps are those of the membrane.
STILL = dict(tissue="fluid", coupling="fibre_tension", fibre_tension=0, viscosity=0, stiffness=0.01,
             shape_matching_rate=0, pair_matching=0)
REST, PLATEAU, THRESHOLD = -85.0, 15.0, -75.0
HALF = 0.5 * (REST + PLATEAU)


def still(**parameters):
    return Muscle(**{**STILL, **parameters})


def passage_times(m, until_s, sample_s, watch=None, say=None):
    """Time (s) at which every particle's potential rises through half way, by linear interpolation between samples;
    NaN where it did not until `until_s`. Stops when all of `watch` (a mask) have."""
    passed = np.full(m.count, np.nan)
    watch = np.ones(m.count, bool) if watch is None else watch
    before, time = m.particles()["membrane_potential_mV"], m.time
    passed[before > HALF] = time
    while m.time < until_s and np.isnan(passed[watch]).any():
        m.advance(sample_s)
        now = m.particles()["membrane_potential_mV"]
        rises = np.isnan(passed) & (now >= HALF) & (before < HALF)
        passed[rises] = time + sample_s * (HALF - before[rises]) / (now - before)[rises]
        before, time = now, m.time
        if say:
            say(f"{m.count} particles, {1e3 * time:.0f} ms")
    return passed


def speed(m, times, low, high):
    """Speed along x between two positions (m), m/s, by a line through the passage times."""
    x = m.rest[:, 0]
    amid = (x > low) & (x < high)
    if np.isnan(times[amid]).any():
        return np.nan
    return 1 / np.polyfit(x[amid], times[amid], 1)[0]
