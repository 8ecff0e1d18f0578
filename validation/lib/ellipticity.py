"""Where a law lets layers localise in a state of finite elements: where the acoustic tensor of some direction has an eigenvalue
whose real part is below 0, so that a plane wave in that direction would grow instead of travel. Meshes do not converge to one
solution there (Hill, J. Mech. Phys. Solids 10 (1962) 1). The fibre term on the true stretch has no energy, its tensors are not
symmetric, and the condition for strong ellipticity, on their symmetric parts, is broken in twice as many points."""
import numpy as np

STEP = 1e-5  # of a deformation gradient


def deformation(field, points, step_m=2e-5):
    """F[..., 3, 3] at points, from a pointwise.Field of displacements (m)."""
    steps = step_m * np.eye(3)
    return np.eye(3) + np.stack([(field.at(points + d) - field.at(points - d)) / (2 * step_m) for d in steps], 2)


def directions(count):
    """Unit vectors spread evenly over half a sphere."""
    k = np.arange(count) + 0.5
    x, turn = 1 - k / count, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - x**2)
    return np.stack([x, across * np.cos(turn), across * np.sin(turn)], 1)


def localises(law, F, alpha, count=200):
    """Whether the acoustic tensor Q_ik = dP_ij/dF_kl N_j N_l of one of `count` directions N of the rest shape has an eigenvalue
    with a real part below 0; F[n, 3, 3]. True where F is inverted, too."""
    whole = np.linalg.det(F) > 0
    F = np.where(whole[:, None, None], F, np.eye(3))
    slope = np.empty((len(F), 3, 3, 3, 3))
    for k in range(3):
        for j in range(3):
            d = np.zeros((3, 3))
            d[k, j] = STEP
            slope[..., k, j] = (law.stress(F + d, alpha) - law.stress(F - d, alpha)) / (2 * STEP)
    least = np.full(len(F), np.inf)
    for N in directions(count):
        Q = np.einsum("pijkl,j,l->pik", slope, N, N)
        least = np.minimum(least, np.linalg.eigvals(Q).real.min(1))
    return (least < 0) | ~whole
