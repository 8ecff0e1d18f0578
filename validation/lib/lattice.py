"""Deformation gradients and section forces from a muscle's particles, computed apart from the library.

The corrected gradient of total-Lagrangian SPH (weights of support h, whose scale B cancels):
  w_ij = (1 - R/h)^4,  B_i = (sum_j w X X^T)^-1,  F_i = 1 + [sum_j w (u_j - u_i) X^T] B_i,  X = X_j - X_i, R = |X|.
"""
import numpy as np
from scipy.spatial import cKDTree


class Lattice:
    def __init__(self, muscle):
        self.muscle, self.rest = muscle, muscle.rest
        pairs = cKDTree(self.rest).query_pairs(muscle.support * (1 - 1e-6), output_type="ndarray")
        self.i = np.concatenate([pairs[:, 0], pairs[:, 1]])
        self.j = np.concatenate([pairs[:, 1], pairs[:, 0]])
        self.X = self.rest[self.j] - self.rest[self.i]
        R = np.linalg.norm(self.X, axis=1)
        self.w = (1 - R / muscle.support) ** 4
        M = self._sum(self.w[:, None, None] * self.X[:, :, None] * self.X[:, None, :])
        self.B = np.linalg.inv(M)

    def _sum(self, values):
        n = len(self.rest)
        flat = values.reshape(len(values), -1)
        return np.stack([np.bincount(self.i, flat[:, k], n) for k in range(flat.shape[1])], 1).reshape(
            n, *values.shape[1:])

    def deformation(self, displacement):
        """F of every particle."""
        du = displacement[self.j] - displacement[self.i]
        return np.eye(3) + self._sum(self.w[:, None, None] * du[:, :, None] * self.X[:, None, :]) @ self.B

    def section_force(self, P, near):
        """Integral of P.N over the plane between two layers nearest to x = near: the mean of the two layers on either
        side of it. Force along x, N."""
        m = self.muscle
        layers = np.unique(np.round(self.rest[:, 0], 9))
        step = np.median(np.diff(layers))
        plane = layers[np.argmin(np.abs(layers - near))] + 0.5 * step
        amid = np.abs(self.rest[:, 0] - plane) < 2 * step
        return np.sum(m.volumes[amid] * P[amid, 0, 0]) / (4 * step)


def bulge(rest, now, volumes, middle, width):
    """Mean radius about the x axis over its rest value, minus one, in a section of Gaussian weight."""
    weight = volumes * np.exp(-((rest[:, 0] - middle) / width) ** 2)
    radius = lambda x: np.hypot(x[:, 1], x[:, 2])
    return np.sum(weight * radius(now)) / np.sum(weight * radius(rest)) - 1
