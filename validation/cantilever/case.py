"""A cantilever under its weight against the beam solution."""
import matplotlib.pyplot as plt
import numpy as np
import sphm
from material import Material
from sphm import INSERTION

TITLE = "A cantilever against the beam solution"
QUESTION = """A bar with fibres that are equally stiff in tension and compression (optimal stretch 1, a compressive stiffness
equal to the tensile one) is held at one end and bends under its weight. Does the deflection converge, as the spacing
falls, to Timoshenko's beam?"""

LENGTH, SIDE = 0.120, 0.020
GRAVITY = 0.6  # m/s2: deflections of one or two per cent of the length
DENSITY = 1112.0
E_FIBRE = 1e6
LAW = Material(sigma_max=E_FIBRE / 0.33, optimal=1.0, P1=0.05, P2=6.6, compressive=E_FIBRE, G1=2e5, G2=2e5, K=1e6)


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


def sag(r, cells):
    """(spacing, deflection measured, beam's) with `cells` particles across."""
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
    return m.spacing, before, beam(tip - root, LENGTH / 2 - tip)


def run(r):
    rows = [sag(r, cells) for cells in ([4, 6] if r.quick else [4, 6, 8, 12])]
    errors = [100 * (measured / exact - 1) for _, measured, exact in rows]
    # Errors of second order: what is left when the spacing goes to zero, by the last two spacings.
    (s1, d1, b1), (s2, d2, b2) = rows[-2:]
    q1, q2 = d1 / b1, d2 / b2
    limit = 100 * ((q2 * s1**2 - q1 * s2**2) / (s1**2 - s2**2) - 1)
    r.check("deflection against the beam, extrapolated to no spacing at second order", limit, below=10 if r.quick else 3)
    r.check("each finer filling is nearer to the beam: least fall of the error", min(
        100 * (1 - abs(fine / coarse)) for coarse, fine in zip(errors, errors[1:])), above=10)
    if not r.quick:
        r.check(f"deflection at {1e3 * s2:.3g} mm spacing, {round(SIDE / s2)} particles across", errors[-1], below=10)
    r.table("deflection", "Deflection at the inner end of the block that closes the free end.",
            ["spacing (mm)", "cells across", "deflection (mm)", "beam (mm)", "error (%)"],
            [[1e3 * s, round(SIDE / s), 1e3 * d, 1e3 * b, e] for (s, d, b), e in zip(rows, errors)])
    figure, axes = plt.subplots()
    axes.plot([1e3 * s for s, _, _ in rows], errors, "o-")
    axes.axhline(0, color="k", lw=1)
    axes.set(xlabel="spacing (mm)", ylabel="error of the deflection (%)")
    axes.set_xlim(left=0)
    r.figure("deflection", figure, "Deflection against Timoshenko's beam over the spacing.")
    E, G = moduli()
    r.note(f"Young's modulus along the fibres {E:.3g} Pa and shear modulus along them {G:.3g} Pa, from the material. "
           "The beam begins half a layer behind the last held one, where the library clamps the tissue.")
