/* Small vectors and matrices, in double: sums over particles and the best rotation. Matrices are row by row,
 * m[3 * row + column]. */
#ifndef SPHM_KERNELS_VECTOR_H
#define SPHM_KERNELS_VECTOR_H

#include <math.h>

#include "kernels/qualifiers.h"

SPHM_FN double sphm_dot3(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* out = m v */
SPHM_FN void sphm_multiply3(const double m[9], const double v[3], double out[3]) {
    for (int i = 0; i < 3; ++i)
        out[i] = m[3 * i] * v[0] + m[3 * i + 1] * v[1] + m[3 * i + 2] * v[2];
}

/* out may be a or b */
SPHM_FN void sphm_cross3(const double a[3], const double b[3], double out[3]) {
    const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

/* out = m^T v */
SPHM_FN void sphm_multiply3_transposed(const double m[9], const double v[3], double out[3]) {
    for (int i = 0; i < 3; ++i)
        out[i] = m[i] * v[0] + m[3 + i] * v[1] + m[6 + i] * v[2];
}

SPHM_FN void sphm_multiply33(const double a[9], const double b[9], double out[9]) {
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

/* v + first r x v + second r x (r x v) */
SPHM_FN void sphm_twist3(const double r[3], double first, double second, const double v[3], double out[3]) {
    double once[3], twice[3];
    sphm_cross3(r, v, once);
    sphm_cross3(r, once, twice);
    for (int d = 0; d < 3; ++d)
        out[d] = v[d] + first * once[d] + second * twice[d];
}

/* Rodrigues: the rotation by |r| about r. */
SPHM_FN void sphm_rotation_of(const double r[3], double out[9]) {
    const double angle = sqrt(sphm_dot3(r, r));
    const double first = angle > 1e-8 ? sin(angle) / angle : 1;
    const double half = angle > 1e-8 ? sin(angle / 2) / (angle / 2) : 1, second = half * half / 2;
    for (int j = 0; j < 3; ++j) {
        double unit[3] = {j == 0 ? 1.0 : 0.0, j == 1 ? 1.0 : 0.0, j == 2 ? 1.0 : 0.0}, column[3];
        sphm_twist3(r, first, second, unit, column);
        for (int i = 0; i < 3; ++i)
            out[3 * i + j] = column[i];
    }
}

/* One Jacobi rotation of the symmetric 4 x 4 matrix `a` that zeroes a[p][q]; `v` collects the eigenvectors in
 * its columns (Golub and Van Loan, Matrix Computations, section 8.5). */
SPHM_FN void sphm_jacobi_rotate4(double a[4][4], double v[4][4], int p, int q) {
    if (a[p][q] == 0)
        return;
    const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
    const double t = (theta < 0 ? -1.0 : 1.0) / (fabs(theta) + sqrt(theta * theta + 1));
    const double c = 1 / sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < 4; ++k) {
        const double kp = a[k][p], kq = a[k][q];
        a[k][p] = c * kp - s * kq;
        a[k][q] = s * kp + c * kq;
    }
    for (int k = 0; k < 4; ++k) {
        const double pk = a[p][k], qk = a[q][k];
        a[p][k] = c * pk - s * qk;
        a[q][k] = s * pk + c * qk;
    }
    a[p][q] = a[q][p] = 0;
    for (int k = 0; k < 4; ++k) {
        const double kp = v[k][p], kq = v[k][q];
        v[k][p] = c * kp - s * kq;
        v[k][q] = s * kp + c * kq;
    }
}

/* Eigenvalues on the diagonal of `a`, eigenvectors in the columns of `v`, of the leading size x size block
 * (size 3 or 4) of the symmetric matrix `a`, whose entries should be of order one. Cyclic Jacobi converges
 * quadratically: five sweeps reach rounding, and the bound on them holds for NaN too. */
SPHM_FN void sphm_symmetric_eigen(double a[4][4], double v[4][4], int size) {
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
            v[i][j] = i == j;
    for (int sweep = 0; sweep < 12; ++sweep) {
        double off = 0;
        for (int p = 0; p + 1 < size; ++p)
            for (int q = p + 1; q < size; ++q)
                off += a[p][q] * a[p][q];
        if (off < 1e-40)
            break;
        for (int p = 0; p + 1 < size; ++p)
            for (int q = p + 1; q < size; ++q)
                sphm_jacobi_rotate4(a, v, p, q);
    }
}

/* The rotation that carries a rest shape best: r maximises tr(r^T a) for the moment matrix
 * a = sum m (x - x0) (X - X0)^T, current times rest. Where a has full rank and a positive determinant this is
 * the r of the polar decomposition a = r s.
 *
 * By the quaternion of the largest eigenvalue of a symmetric 4 x 4 matrix (B. K. P. Horn, J. Opt. Soc. Am. A
 * 4, 629, 1987), because that is a proper rotation, determinant +1, for every a: flat, thread-like, mirrored
 * or zero, where Newton's iteration for the polar factor breaks down or ends in a reflection. Where several
 * rotations are equally good (a thread may turn about itself) it takes the one nearest to the identity. `a`
 * symmetric and positive gives exactly the identity. */
SPHM_FN void sphm_best_rotation(const double a[9], double r[9]) {
    double largest = 0;
    for (int i = 0; i < 9; ++i)
        largest = fabs(a[i]) > largest ? fabs(a[i]) : largest;
    const double scale = largest > 0 ? 1 / largest : 0;
    const double xx = a[0], xy = a[3], xz = a[6]; /* s_ij = sum X_i x_j */
    const double yx = a[1], yy = a[4], yz = a[7];
    const double zx = a[2], zy = a[5], zz = a[8];
    double n[4][4] = {{xx + yy + zz, yz - zy, zx - xz, xy - yx},
                      {yz - zy, xx - yy - zz, xy + yx, zx + xz},
                      {zx - xz, xy + yx, yy - xx - zz, yz + zy},
                      {xy - yx, zx + xz, yz + zy, zz - xx - yy}};
    for (int i = 0; i < 16; ++i) /* after the differences, which are exactly 0 for a symmetric matrix */
        n[i / 4][i % 4] *= scale;
    double v[4][4];
    sphm_symmetric_eigen(n, v, 4);

    int best = 0;
    for (int i = 1; i < 4; ++i)
        best = n[i][i] > n[best][best] ? i : best;
    double w[4] = {0, 0, 0, 0}; /* the identity, projected on the eigenspace of the largest eigenvalue */
    for (int i = 0; i < 4; ++i)
        if (n[i][i] >= n[best][best] - 1e-12)
            for (int k = 0; k < 4; ++k)
                w[k] += v[0][i] * v[k][i];
    double length = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + w[3] * w[3]);
    if (!(length > 1e-6)) { /* half a turn: no rotation is nearest */
        for (int k = 0; k < 4; ++k)
            w[k] = v[k][best];
        length = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + w[3] * w[3]);
    }
    const double qw = w[0] / length, qx = w[1] / length, qy = w[2] / length, qz = w[3] / length;
    r[0] = 1 - 2 * (qy * qy + qz * qz);
    r[1] = 2 * (qx * qy - qw * qz);
    r[2] = 2 * (qx * qz + qw * qy);
    r[3] = 2 * (qx * qy + qw * qz);
    r[4] = 1 - 2 * (qx * qx + qz * qz);
    r[5] = 2 * (qy * qz - qw * qx);
    r[6] = 2 * (qx * qz - qw * qy);
    r[7] = 2 * (qy * qz + qw * qx);
    r[8] = 1 - 2 * (qx * qx + qy * qy);
}

#endif
