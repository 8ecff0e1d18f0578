"""Blocks held at two faces: stretched, sheared, activated, against finite elements and closed forms."""
import matplotlib.pyplot as plt
import numpy as np
import sphm
import statics
from material import Material
from sphm import INSERTION

TITLE = "The material in a block: stretch, shear and activation against finite elements"
QUESTION = """A block of 20 x 20 mm, about 40 mm between its held faces, is stretched, compressed, sheared and activated;
a sheet six times as wide as long is stretched, which leaves its middle no way to narrow. Does the force at the moved face
agree with quadratic finite elements of the same block?"""

TABLE3 = {}
STRONG = dict(G1=1e4, G2=1e4)  # shear moduli twenty times those of Table 3
# name, body, constants, activation, shift of the face over the free length
CASES = [
    ("passive, stretched by 25 %", "block", TABLE3, 0.0, (0.25, 0, 0)),
    ("passive, stretched by 20 % and sheared by 25 %", "block", TABLE3, 0.0, (0.20, 0.25, 0)),
    ("activation 0.3, sheared by 25 %", "block", TABLE3, 0.3, (0, 0.25, 0)),
    ("activation 0.3, shortened by 10 %", "block", TABLE3, 0.3, (-0.10, 0, 0)),
    ("stiff matrix, activation 0.3, sheared by 25 %", "block", STRONG, 0.3, (0, 0.25, 0)),
    ("stiff matrix, passive, sheet stretched by 25 %", "sheet", STRONG, 0.0, (0.25, 0, 0)),
    ("volume-free law, activation 0.1", "block", dict(volume_free=True), 0.1, (0, 0, 0)),
]
QUICK = (0, 2)
SIZES = {"block": (0.056, 0.020, 0.020, 0.020), "sheet": (0.032, 0.060, 0.006, 0.005)}  # and the held plane


def law_of(constants):
    return Material(**constants)


def muscle(shape, spacing, law):
    length, width, thickness, plane = SIZES[shape]
    count = round(length / spacing) * round(width / spacing) * round(thickness / spacing)
    return sphm.held_at(plane, tissue="solid", preset="bar", belly_length=length, belly_width=width,
                        belly_thickness=thickness, particles=count, velocity_damping=100,
                        max_isometric_stress=law.sigma_max, along_fibre_shear=law.G1, cross_fibre_shear=law.G2,
                        bulk_modulus=law.K, fibre_coupling="volume_free" if law.volume_free else "true_stretch")


def particles(r, case, spacing):
    """(force on the moved face, distance of the clamps, spacing)"""
    name, shape, constants, alpha, shift = case
    m = muscle(shape, spacing, law_of(constants))
    free = m.clamps()[1] - m.clamps()[0]
    m.activate(alpha)
    for _ in range(4):
        m.move_end(INSERTION, np.array(shift) * free / 4, 0.02)
        m.advance(0.02)
    change = sphm.settle(m, 0.5, tolerance=2e-4, say=lambda t: r.say(f"{name}, {m.count} particles: {t}"))
    if change > 1e-3:
        r.note(f"{name}, {m.count} particles: still changing by {100 * change:.2g} % in 10 ms.")
    return -m.wrench(INSERTION)["force_N"], free, m.spacing


def end_vector(r, case, free, size):
    """Force on the moved face of finite elements, and how many they are."""
    import fem

    name, shape, constants, alpha, shift = case
    _, width, thickness, _ = SIZES[shape]
    body = fem.Body(fem.box_mesh(free, width, thickness, size), law_of(constants), 2)
    steps = 5
    for k in range(1, steps + 1):
        body.solve(alpha=alpha * k / steps, shift=np.array(shift) * free * k / steps, say=r.say)
    return body.end_vector().tolist(), body.cells


def finite_elements(r, case, free, size):
    """The same, for a length between the held faces that is known to a micrometre."""
    name, shape, constants, alpha, shift = case
    free = round(free, 6)
    part = f"elements_{CASES.index(case)}_{1e3 * free:g}mm_{1e3 * size:g}mm"
    return statics.part(r, part, lambda: end_vector(r, case, free, size), law_of(constants), (end_vector,), free=free, size=size,
                         section=SIZES[shape][1:3], alpha=alpha, shift=shift)


def run(r):
    cases = [CASES[k] for k in QUICK] if r.quick else CASES
    spacings = {"block": [0.002] if r.quick else [0.002, 0.00133333], "sheet": [0.001] if r.quick else [0.0015, 0.001]}
    sizes = {"block": 0.007 if r.quick else 0.005, "sheet": 0.004 if r.quick else 0.003}
    rows, errors = [], {}
    for case in cases:
        name, shape = case[:2]
        for spacing in spacings[shape]:
            force, free, actual = particles(r, case, spacing)
            reference, cells = finite_elements(r, case, free, sizes[shape])
            size = np.linalg.norm(reference)
            error = 100 * np.linalg.norm(force - reference) / size
            rows.append([name, 1e3 * actual, 1e3 * free, cells, *map(float, force[:2]), *map(float, reference[:2]), error])
            errors.setdefault(name, []).append((actual, error))
        r.check(f"{name}: force against finite elements, {1e3 * actual:.2g} mm spacing", error, below=12 if r.quick else 2)  # quick: coarse
    r.table("forces", "Force on the moved face (N): along the block and across, and the length of the difference.",
            ["case", "spacing (mm)", "between the clamps (mm)", "tetrahedra", "particles, along", "across",
             "finite elements, along", "across", "difference (%)"], rows)
    if not r.quick:
        figure, axes = plt.subplots(figsize=(6.4, 4.4))
        for k, (name, data) in enumerate(errors.items()):
            axes.plot([1e3 * s for s, _ in data], [e for _, e in data], "o-", label=name)
        axes.axhline(2, color="k", ls=":", lw=1)
        axes.set(xlabel="spacing (mm)", ylabel="difference to finite elements (%)")
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.legend(fontsize=7)
        r.figure("differences", figure, "Difference of the force to that of quadratic finite elements.")
