"""The solid's material a second time, written from its energy: the library's own formulas are not used here.

Blemker and Delp (2005) with the paper's Table 3. C = F^T F, f0 the rest fibre along x, lambda = |F f0|, J = det F:
  W1 = G1 (I5/I4^2 - 1),  W2 = G2 acosh(x)^2 with x = (I1 I4 - I5)/(2 sqrt I4) of J^(-2/3) C,  W3 = K/2 (ln J)^2,
and a fibre of Cauchy stress s = sigma_max (alpha f_active(r) + f_passive(r)) r, r = lambda/lambda_ofl, either added
whole (true stretch) or on the volume-free stretch and its deviator only (volume free).
The gradients of the energies are taken by complex steps, exact to rounding.
"""
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq


@dataclass
class Material:
    G1: float = 500.0
    G2: float = 500.0
    K: float = 1e5
    sigma_max: float = 3e5
    optimal: float = 1.07
    P1: float = 0.05
    P2: float = 6.6
    linear_from: float = 1.4
    compressive: float = 0.0  # stiffness of fibres below their rest length
    volume_free: bool = False

    def active(self, r):
        d = np.abs(r - 1)
        return np.where(d < 0.4, 1 - 4 * d**2, 9 * np.clip(0.6 - d, 0, None) ** 2)

    def passive(self, r):
        top = self.linear_from
        inside = self.P1 * (np.exp(self.P2 * (np.clip(r, 1, top) - 1)) - 1)
        slope = self.P1 * self.P2 * np.exp(self.P2 * (top - 1))
        return inside + slope * np.clip(r - top, 0, None)

    def fibre(self, stretch, alpha):
        """Cauchy stress along the fibre, Pa."""
        r = stretch / self.optimal
        return (self.sigma_max * (alpha * self.active(r) + self.passive(r)) * r
                - self.compressive * np.clip(1 - stretch, 0, None))

    def energy(self, F):
        """W1 + W2 + W3 of F[..., 3, 3], J/m3 of rest volume; F may be complex."""
        C = np.einsum("...ki,...kj->...ij", F, F)
        J = (F[..., 0, 0] * (F[..., 1, 1] * F[..., 2, 2] - F[..., 1, 2] * F[..., 2, 1])
             - F[..., 0, 1] * (F[..., 1, 0] * F[..., 2, 2] - F[..., 1, 2] * F[..., 2, 0])
             + F[..., 0, 2] * (F[..., 1, 0] * F[..., 2, 1] - F[..., 1, 1] * F[..., 2, 0]))
        I1 = C[..., 0, 0] + C[..., 1, 1] + C[..., 2, 2]
        I4 = C[..., 0, 0]
        I5 = C[..., 0, 0] ** 2 + C[..., 0, 1] ** 2 + C[..., 0, 2] ** 2
        x = (I1 * I4 - I5) / (2 * np.sqrt(I4) * J)
        e = x - 1
        far = np.where(e.real > 0.02, e, 0.02)
        angle2 = np.where(e.real > 0.02, np.log(1 + far + np.sqrt(far * (2 + far))) ** 2,
                          e * (2 + e * (-1 / 3 + e * (4 / 45 + e * (-1 / 35 + e * 16 / 1575)))))
        return self.G1 * (I5 / I4**2 - 1) + self.G2 * angle2 + 0.5 * self.K * np.log(J) ** 2

    def stress(self, F, alpha=0.0):
        """First Piola-Kirchhoff stress P[..., 3, 3], Pa."""
        F = np.asarray(F, float)
        P = np.empty_like(F)
        for i in range(3):
            for j in range(3):
                G = F.astype(complex)
                G[..., i, j] += 1e-30j
                P[..., i, j] = self.energy(G).imag / 1e-30
        J, a = np.linalg.det(F), F[..., :, 0]
        stretch = np.sqrt(np.sum(a**2, -1))
        along = np.zeros_like(F)
        along[..., :, 0] = a / stretch[..., None] ** 2
        if self.volume_free:
            s = self.fibre(stretch * J ** (-1 / 3), alpha)
            inverse = np.swapaxes(np.linalg.inv(F), -1, -2)
            return P + s[..., None, None] * (along - inverse / 3)
        s = self.fibre(stretch, alpha)
        return P + (J * s)[..., None, None] * along

    # Closed states, up to one scalar root ------------------------------------------------------------------

    def uniaxial(self, stretch, alpha=0.0):
        """(force over rest area along the fibre, lateral stretch) of a bar with free sides."""
        def lateral(w):
            return float(self.stress(np.diag([stretch, w, w]), alpha)[1, 1])
        w = brentq(lateral, 0.2 / np.sqrt(stretch), 3 / np.sqrt(stretch), xtol=1e-12)
        return float(self.stress(np.diag([stretch, w, w]), alpha)[0, 0]), w
