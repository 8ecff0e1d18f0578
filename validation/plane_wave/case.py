"""Speed of a plane wave against its closed form."""
import pathlib
import tempfile

import matplotlib.pyplot as plt
import numpy as np
from waves import passage_times, speed, still

TITLE = "Monodomain: a plane wave against its closed form"
QUESTION = """Without recovery a plane wave of this membrane runs at sqrt(D c1/2)(1 - 2a) = 0.2071 mm/ms. How near do
the particles come on a bar with free sides (80 x 6 x 6 mm), over spacing, support radius, jitter and anisotropy, and how
near does the paper's Laplacian (its equations 25 and 26)?"""

LENGTH, SIDE = 0.080, 0.006
D = 0.893 * 0.67 / (0.893 + 0.67) / (50 * 0.01)  # mm2/ms: sigma/(chi Cm), Table 1
C1 = 0.175 / (0.01 * 100)  # 1/ms: C1/(Cm (Vp - Vr))
EXACT = np.sqrt(D * C1 / 2) * (1 - 2 * 0.1)  # mm/ms = m/s


def error(r, spacing_mm, side=SIDE, ratio=1.0, across=False, **more):
    """Error of the speed in per cent."""
    sides = round(side * 1e3 / spacing_mm)
    count = round(LENGTH * 1e3 / spacing_mm) * sides**2
    parameters = dict(preset="bar", belly_length=LENGTH, belly_width=side, belly_thickness=side, particles=count,
                      excitation_decay=0, anisotropy_ratio=ratio, **more)
    with tempfile.TemporaryDirectory() as folder:
        if across:
            path = pathlib.Path(folder) / "fibres.txt"
            path.write_text("0 0 0 0 1 0\n")
            parameters.update(fibres="file", fibre_file=path)
        m = still(**parameters)
    m.stimulate("origin", 8000, 0.02)
    fit = (-0.005, 0.020)
    watch = (m.rest[:, 0] > fit[0]) & (m.rest[:, 0] < fit[1])
    exact = EXACT / (np.sqrt(ratio) if across else 1)
    times = passage_times(m, 1.2 * LENGTH / exact, 0.5e-3, watch,
                          lambda text: r.say(f"spacing {spacing_mm} mm: {text}"))
    return 100 * (speed(m, times, *fit) / exact - 1)


def run(r):
    rows = []

    def case(label, spacing, **more):
        e = error(r, spacing, **more)
        rows.append([label, spacing, e])
        return e

    ours = {s: case("corrected, support 2.6", s) for s in ([2.0, 1.0] if r.quick else [4.0, 3.0, 2.0, 1.5, 1.0])}
    if not r.quick:
        ours[0.5] = case("corrected, support 2.6, bar of 3 x 3 mm", 0.5, side=0.003)
    supports = {s: [ours[s]] for s in (1.0, 2.0)}
    for support in ([] if r.quick else [2.0, 3.0]):
        for s in (2.0, 1.0):
            supports[s].append(case(f"corrected, support {support:g}", s, smoothing_ratio=support))
    for s, bound in ((1.0, 0.5), (2.0, 1.5)):
        r.check(f"speed at {s:g} mm spacing" + ("" if r.quick else ", worst of supports 2, 2.6 and 3"),
                max(supports[s], key=abs), below=bound)
    for jitter in ([] if r.quick else [0.1, 0.2]):
        for s, bound in ((1.0, 0.5), (2.0, 1.5)):
            e = case(f"corrected, jitter {jitter}", s, jitter=jitter)
            r.check(f"speed at {s:g} mm spacing, jitter of {jitter} spacings", e, below=bound)
    for ratio in ([4.0] if r.quick else [2.0, 4.0, 6.0]):
        s = 2.0 if r.quick else 1.0
        along = case(f"corrected, anisotropy {ratio:g}, along the fibres", s, ratio=ratio)
        across = case(f"corrected, anisotropy {ratio:g}, across", s, ratio=ratio, across=True)
        if not r.quick:
            r.check(f"speed along and across at anisotropy {ratio:g}, worst", max(along, across, key=abs), below=1.5)
    papers = {s: case("the paper's, support 2", s, laplacian="paper", smoothing_ratio=2.0)
              for s in ([2.0] if r.quick else [4.0, 2.0, 1.0])}
    usual = {s: case("Brookshaw's, support 2", s, laplacian="brookshaw", smoothing_ratio=2.0)
             for s in ([2.0] if r.quick else [4.0, 2.0, 1.0])}
    r.check("the paper's Laplacian at 2 mm is farther off than ours, by", abs(papers[2.0]) - abs(ours[2.0]), above=5)

    figure, axes = plt.subplots()
    for data, label, style in ((ours, "corrected (default)", "C0o-"), (papers, "the paper's (25, 26)", "C3s--"),
                               (usual, "Brookshaw's", "C2^--")):
        axes.loglog(sorted(data), [abs(data[s]) for s in sorted(data)], style, label=label)
    axes.set(xlabel="spacing (mm)", ylabel="|error of the speed| (%)")
    axes.legend()
    r.figure("speed", figure, "Error of the wave's speed against the spacing.")
    r.table("speed", f"Speed against {EXACT:.4f} mm/ms.", ["Laplacian", "spacing (mm)", "error (%)"], rows)
