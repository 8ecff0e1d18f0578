"""Fields on tetrahedra at any point, from arrays (fem.elements): what particles are compared with, point by point."""
import numpy as np
from scipy.spatial import cKDTree

from febio import MIDDLES


class Field:
    """`values` at the nodes of linear or quadratic tetrahedra with straight edges."""

    def __init__(self, nodes, cells, values):
        self.cells, self.values = cells, values
        corners = nodes[cells[:, :4]]
        self.first = corners[:, 0]
        self.inverse = np.linalg.inv(np.stack([corners[:, k] - corners[:, 0] for k in (1, 2, 3)], 2))
        self.scale = np.ptp(corners, axis=1).mean(0)  # tetrahedra may be longer along one axis
        self.tree = cKDTree(corners.mean(1) / self.scale)

    def at(self, points, nearest=30):
        """Values at points; a point outside (a surface of flat faces cuts corners) continues the cell that is nearest in
        barycentric coordinates."""
        _, candidates = self.tree.query(points / self.scale, min(nearest, len(self.cells)))
        local = np.einsum("pcij,pcj->pci", self.inverse[candidates], points[:, None] - self.first[candidates])
        barycentric = np.concatenate([1 - local.sum(2, keepdims=True), local], 2)
        best = barycentric.min(2).argmax(1)
        row = np.arange(len(points))
        b, cells = barycentric[row, best], self.cells[candidates[row, best]]
        if cells.shape[1] == 10:
            b = np.concatenate([b * (2 * b - 1), np.stack([4 * b[:, i] * b[:, j] for i, j in MIDDLES], 1)], 1)
        return np.einsum("pn,pn...->p...", b, self.values[cells])

