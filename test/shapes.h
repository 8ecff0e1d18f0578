/* Surfaces with known volumes, and a body that frees itself, for the tests of geometry. */
#ifndef SPHM_TEST_SHAPES_H
#define SPHM_TEST_SHAPES_H

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "sph_muscle/geometry.h"

namespace shapes {

/* A surface in malloc's memory, as the library wants it. */
struct Surface {
    sphm_surface surface;
    Surface(const std::vector<double> &vertices, const std::vector<int32_t> &triangles) {
        surface.vertex_count = vertices.size() / 3;
        surface.triangle_count = triangles.size() / 3;
        surface.vertices = static_cast<double *>(std::malloc((vertices.size() + 1) * sizeof(double)));
        surface.triangles = static_cast<int32_t *>(std::malloc((triangles.size() + 1) * sizeof(int32_t)));
        std::copy(vertices.begin(), vertices.end(), surface.vertices);
        std::copy(triangles.begin(), triangles.end(), surface.triangles);
    }
    Surface(Surface &&other) : surface(other.surface) {
        std::memset(&other.surface, 0, sizeof other.surface);
    }
    Surface(const Surface &) = delete;
    ~Surface() { sphm_surface_free(&surface); }
    /* Keeps the triangles whose middle passes. */
    template <class Test> void keep(Test test) {
        size_t kept = 0;
        for (size_t t = 0; t < surface.triangle_count; t++) {
            double middle[3] = {0, 0, 0};
            for (size_t c = 0; c < 3; c++)
                for (size_t k = 0; k < 3; k++)
                    middle[k] += surface.vertices[3 * (size_t)surface.triangles[3 * t + c] + k] / 3;
            if (test(middle))
                std::memmove(&surface.triangles[3 * kept++], &surface.triangles[3 * t], 3 * sizeof(int32_t));
        }
        surface.triangle_count = kept;
    }
};

/* A cube of edge 2 half about `centre`, 12 triangles. */
inline Surface cube(double half, double cx = 0, double cy = 0, double cz = 0) {
    std::vector<double> v;
    for (int i = 0; i < 8; i++) {
        v.push_back(cx + (i & 1 ? half : -half));
        v.push_back(cy + (i & 2 ? half : -half));
        v.push_back(cz + (i & 4 ? half : -half));
    }
    return Surface(v, {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                       2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5});
}

/* An octahedron, every triangle divided in four `levels` times and pushed out to the sphere; a soup, like an
 * STL file: every triangle has vertices of its own. */
inline Surface sphere(double radius, int levels) {
    struct P {
        double x, y, z;
    };
    auto middle = [](P a, P b) {
        P m = {a.x + b.x, a.y + b.y, a.z + b.z};
        double l = std::sqrt(m.x * m.x + m.y * m.y + m.z * m.z);
        return P{m.x / l, m.y / l, m.z / l};
    };
    std::vector<P> soup;
    for (int o = 0; o < 8; o++) {
        P x = {o & 1 ? -1. : 1., 0, 0}, y = {0, o & 2 ? -1. : 1., 0}, z = {0, 0, o & 4 ? -1. : 1.};
        bool even = ((o & 1) + (o >> 1 & 1) + (o >> 2 & 1)) % 2 == 0;
        soup.insert(soup.end(), {x, even ? y : z, even ? z : y});
    }
    for (int level = 0; level < levels; level++) {
        std::vector<P> finer;
        for (size_t t = 0; t < soup.size(); t += 3) {
            P a = soup[t], b = soup[t + 1], c = soup[t + 2];
            P ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            finer.insert(finer.end(), {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca});
        }
        soup.swap(finer);
    }
    std::vector<double> v;
    std::vector<int32_t> t;
    for (const P &p : soup) {
        v.insert(v.end(), {radius * p.x, radius * p.y, radius * p.z});
        t.push_back((int32_t)t.size());
    }
    return Surface(v, t);
}

struct Body {
    sphm_body body;
    sphm_context context;
    std::string log;
    sphm_status status;
    explicit Body(const sphm_parameters &parameters, const sphm_surface *mesh = nullptr) {
        std::memset(&context, 0, sizeof context);
        context.user = &log;
        context.log = [](sphm_log_level, const char *text, void *user) {
            *static_cast<std::string *>(user) += std::string(text) + "\n";
        };
        status = sphm_body_create(&parameters, mesh, &body, &context);
    }
    ~Body() { sphm_body_free(&body); }
    Body(const Body &) = delete;
};

/* The same bits whatever the number of threads. */
inline void expect_threads_do_not_matter(sphm_parameters parameters) {
    parameters.threads = 1;
    const Body one(parameters);
    parameters.threads = 3;
    const Body three(parameters);
    ASSERT_EQ(one.status, SPHM_OK) << one.context.message;
    ASSERT_EQ(one.body.count, three.body.count);
    const size_t size = one.body.count * sizeof(double);
    EXPECT_EQ(std::memcmp(one.body.positions, three.body.positions, 3 * size), 0);
    EXPECT_EQ(std::memcmp(one.body.fibres, three.body.fibres, 3 * size), 0);
    EXPECT_EQ(std::memcmp(one.body.volumes, three.body.volumes, size), 0);
}

} // namespace shapes

#endif
