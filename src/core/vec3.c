/* The symmetric 3x3 eigenproblem and linear system. */
#include "core/vec3.h"

static void rotate(double a[3][3], double v[3][3], int p, int q) {
    if (a[p][q] == 0)
        return;
    /* The smaller root of t^2 + 2 t theta - 1 = 0 keeps the rotation below 45 degrees (Golub and Van Loan,
     * section 8.5). */
    double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
    double t = (theta < 0 ? -1 : 1) / (fabs(theta) + sqrt(theta * theta + 1));
    double c = 1 / sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < 3; k++) {
        double x = a[k][p], y = a[k][q];
        a[k][p] = c * x - s * y;
        a[k][q] = s * x + c * y;
    }
    for (int k = 0; k < 3; k++) {
        double x = a[p][k], y = a[q][k];
        a[p][k] = c * x - s * y;
        a[q][k] = s * x + c * y;
    }
    for (int k = 0; k < 3; k++) {
        double x = v[p][k], y = v[q][k];
        v[p][k] = c * x - s * y;
        v[q][k] = s * x + c * y;
    }
}

void sphm_eigen_symmetric3(double matrix[3][3], double values[3], double vectors[3][3]) {
    double a[3][3], v[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int i = 0; i < 9; i++)
        a[i / 3][i % 3] = matrix[i / 3][i % 3];
    double scale = fabs(a[0][0]) + fabs(a[1][1]) + fabs(a[2][2]);
    for (int sweep = 0; sweep < 50; sweep++) {
        if (fabs(a[0][1]) + fabs(a[0][2]) + fabs(a[1][2]) <= 1e-15 * scale)
            break;
        rotate(a, v, 0, 1);
        rotate(a, v, 0, 2);
        rotate(a, v, 1, 2);
    }
    int order[3] = {0, 1, 2};
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2 - i; j++)
            if (a[order[j + 1]][order[j + 1]] > a[order[j]][order[j]]) {
                int swap = order[j];
                order[j] = order[j + 1];
                order[j + 1] = swap;
            }
    for (int i = 0; i < 3; i++) {
        values[i] = a[order[i]][order[i]];
        for (int k = 0; k < 3; k++)
            vectors[i][k] = v[order[i]][k];
    }
    sphm_cross3(vectors[0], vectors[1], vectors[2]);
}

int sphm_solve_symmetric3(double m[3][3], const double right[3], double x[3]) {
    double adjugate[3][3];
    sphm_cross3(m[1], m[2], adjugate[0]);
    sphm_cross3(m[2], m[0], adjugate[1]);
    sphm_cross3(m[0], m[1], adjugate[2]);
    double determinant = sphm_dot3(m[0], adjugate[0]);
    double trace = m[0][0] + m[1][1] + m[2][2];
    if (!(fabs(determinant) > 1e-9 * trace * trace * trace))
        return 0;
    for (int k = 0; k < 3; k++)
        x[k] =
            (adjugate[0][k] * right[0] + adjugate[1][k] * right[1] + adjugate[2][k] * right[2]) / determinant;
    return 1;
}
