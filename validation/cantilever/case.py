"""A cantilever under its weight against finite elements, with the beam solution beside them."""
import dataclasses

import matplotlib.pyplot as plt
import numpy as np
import sphm
import statics
from material import Material
from sphm import INSERTION

TITLE = "A cantilever against finite elements and the beam solution"
QUESTION = """A bar with fibres that are equally stiff in tension and compression (optimal stretch 1, a compressive stiffness
equal to the tensile one) is held at one end and bends under its weight. Does the deflection converge, as the spacing
falls, to that of quadratic finite elements of the same bar? Timoshenko's beam, whose sections are free to narrow and
widen where the bar is held, stands beside them; elements of a tissue with hardly any bulk modulus, to which that freedom
is worth nothing, have to agree with it."""

LENGTH, SIDE = 0.120, 0.020
GRAVITY = 0.6  # m/s2: deflections of three thousandths of the length
DENSITY = 1112.0
E_FIBRE = 1e6
LAW = Material(sigma_max=E_FIBRE / 0.33, optimal=1.0, P1=0.05, P2=6.6, compressive=E_FIBRE, G1=2e5, G2=2e5, K=1e6)
LOOSE = dataclasses.replace(LAW, K=1e3)  # the same moduli of bending: Poisson's ratio is 1/2 with any bulk modulus


def moduli():
    """(Young's modulus along the fibres, shear modulus along them), by small steps of the material."""
    d = 1e-5
    young = (LAW.uniaxial(1 + d)[0] - LAW.uniaxial(1 - d)[0]) / (2 * d)
    F = np.eye(3)
    F[1, 0] = d
    return young, LAW.stress(F)[1, 0] / d


def beam(length, tip_length):
    """Deflection (m) at the end of the elastic part, which carries a stiff block of tip_length."""
    E, G = moduli()
    A, inertia, kappa = SIDE**2, SIDE**4 / 12, 5 / 6
    q = DENSITY * A * GRAVITY
    W, M = q * tip_length, q * tip_length**2 / 2
    bending = q * length**4 / 8 + W * length**3 / 3 + M * length**2 / 2
    return bending / (E * inertia) + (q * length**2 / 2 + W * length) / (kappa * G * A)


def elements(say, law, length, tip_length, size):
    """(deflection in m where the stiff block of tip_length begins, how many elements the half with y > 0 has)"""
    import fem

    body = fem.Body(fem.box_mesh(length, SIDE, SIDE, size, block=tip_length, half=True), law, half=True, drag_Pa_per_m2=0,
                    block_from=length)
    body.body_force.value = 0, 0, -DENSITY * GRAVITY
    body.solve(tolerance_N=1e-9, say=say)  # the whole weighs 0.03 N
    x, u = body.points()
    return -float(u[np.abs(x[:, 0] - length) < 1e-9, 2].mean()), body.cells


def finite_elements(r, law, length, tip_length, size):
    """The same, as a part of the case, for lengths known to a micrometre."""
    length, tip_length = round(length, 6), round(tip_length, 6)
    part = f"elements_{law.K:g}Pa_{1e3 * length:g}mm_{1e3 * size:g}mm"
    return statics.part(r, part, lambda: elements(r.say, law, length, tip_length, size), law, (elements,), length=length,
                        tip_length=tip_length, size=size, side=SIDE, weight=DENSITY * GRAVITY)


def sag(r, cells):
    """(spacing, deflection measured, length between the clamps, length of the block) with `cells` particles across."""
    spacing = SIDE / cells
    count = round(LENGTH / spacing) * cells**2
    m = sphm.Muscle(tissue="solid", preset="bar", belly_length=LENGTH, belly_width=SIDE, belly_thickness=SIDE,
                    particles=count, attachment_fraction=0.1, velocity_damping=60, settle_time=0, gravity=f"[0, 0, {-GRAVITY}]",
                    max_isometric_stress=LAW.sigma_max, optimal_fibre_stretch=LAW.optimal, bulk_modulus=LAW.K,
                    passive_compressive_stiffness=LAW.compressive, along_fibre_shear=LAW.G1, cross_fibre_shear=LAW.G2,
                    density=DENSITY)
    x = m.rest[:, 0]
    root, tip = m.clamps()
    m.release_end(INSERTION)
    beside = np.abs(x - tip) < 0.6 * spacing  # the block's last two layers, half a layer on either side
    drop = lambda: (m.rest - m.particles()["position_m"])[beside, 2].mean()
    before, change = 0.0, 1.0
    while m.time < 1.5 and (m.time < 0.3 or abs(change) > 1e-4):
        m.advance(0.03)
        now = drop()
        change, before = (now - before) / now, now
        r.say(f"{m.count} particles: t {m.time:.2f} s, {1e3 * now:.4f} mm")
    return m.spacing, before, tip - root, LENGTH / 2 - tip


def run(r):
    fillings = [sag(r, cells) for cells in ([4, 6] if r.quick else [4, 6, 8, 12])]
    size = 0.005 if r.quick else 0.0025
    rows = [(spacing, drop, finite_elements(r, LAW, *lengths, size)[0], beam(*lengths)) for spacing, drop, *lengths in fillings]
    errors = [100 * (drop / reference - 1) for _, drop, reference, _ in rows]
    excess = [100 * (exact / reference - 1) for _, _, reference, exact in rows]
    # Errors of second order: what is left when the spacing goes to zero, by the last two spacings.
    (s1, d1, e1, _), (s2, d2, e2, _) = rows[-2:]
    q1, q2 = d1 / e1, d2 / e2
    limit = 100 * ((q2 * s1**2 - q1 * s2**2) / (s1**2 - s2**2) - 1)
    r.check("deflection against finite elements, extrapolated to no spacing at second order", limit, below=10 if r.quick else 3)
    r.check("each finer filling is nearer to finite elements: least fall of the error", min(
        100 * (1 - abs(fine / coarse)) for coarse, fine in zip(errors, errors[1:])), above=10)
    if not r.quick:
        r.check(f"deflection at {1e3 * s2:.3g} mm spacing, {round(SIDE / s2)} particles across", errors[-1], below=10)
    check_elements(r, *fillings[-1][2:], size, 1 if r.quick else 0.5)
    r.table("deflection", "Deflection at the inner end of the block that closes the free end.",
            ["spacing (mm)", "cells across", "deflection (mm)", "finite elements (mm)", "error (%)", "beam (mm)",
             "beam above finite elements (%)"],
            [[1e3 * s, round(SIDE / s), 1e3 * d, 1e3 * e, error, 1e3 * b, more]
             for (s, d, e, b), error, more in zip(rows, errors, excess)])
    plot(r, [1e3 * s for s, *_ in rows], errors, excess)
    E, G = moduli()
    r.note(f"Young's modulus along the fibres {E:.3g} Pa and shear modulus along them {G:.3g} Pa, from the material. "
           "Elements and beam begin some way behind the last held layer, where the library clamps the tissue, and end in a "
           "stiff block with the weight of what lies beyond.")
    r.note(f"The beam bends {min(excess):.2g} to {max(excess):.2g} % more than the elements, for a bar this stubby has ends that "
           "a beam has not. Tissue that is stretched along the fibres narrows by half of that in either direction; where the "
           "clamp and the block forbid it, its bulk modulus resists as well, and it is up to "
           f"{(E + LAW.K) / E:.2g} times as stiff, at the clamp just where the bending moment is greatest.")


def check_elements(r, length, tip_length, fine, change):
    """How far elements are from converged, and from the beam where its assumptions hold."""
    sizes = [2 * fine, 1.4 * fine, fine]
    exact = beam(length, tip_length)
    found = [(law, size, *finite_elements(r, law, length, tip_length, size)) for law, size in
             [(LAW, size) for size in sizes] + [(LOOSE, fine)]]
    drops = [drop for _, _, drop, _ in found]
    r.check(f"finite elements of {1e3 * sizes[0]:g} against {1e3 * fine:g} mm", 100 * (drops[0] / drops[2] - 1), below=change)
    r.check(f"finite elements against the beam, bulk modulus {LOOSE.K:g} Pa", 100 * (drops[3] / exact - 1), below=1)
    r.table("elements", f"Finite elements of the bar with {1e3 * length:.4g} mm between the clamps.",
            ["bulk modulus (Pa)", "edge (mm)", "tetrahedra of a half", "deflection (mm)", "beam (mm)",
             "finite elements against the beam (%)"],
            [[law.K, 1e3 * size, cells, 1e3 * drop, 1e3 * exact, 100 * (drop / exact - 1)] for law, size, drop, cells in found])


def plot(r, spacings, errors, excess):
    figure, axes = plt.subplots()
    axes.plot(spacings, errors, "o-", label="particles")
    axes.plot(spacings, excess, "s:", color="grey", label="Timoshenko's beam of the same length")
    axes.axhline(0, color="k", lw=1)
    axes.set(xlabel="spacing (mm)", ylabel="deflection above that of finite elements (%)")
    axes.set_xlim(left=0)
    axes.legend()
    r.figure("deflection", figure, "Deflection against that of quadratic finite elements over the spacing.")
