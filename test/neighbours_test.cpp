// Cell sort and neighbour rows against the sum over all pairs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <vector>

#include "cpu/grid.h"
#include "cpu/neighbours.h"

namespace {

struct Cloud {
    std::vector<sphm_real> x, y, z;
    std::vector<int32_t> id;
    sphm_grid grid{};
    sphm_neighbours rows{};

    Cloud(size_t count, unsigned seed, double length = 0.2, double width = 0.05)
        : x(count), y(count), z(count) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<double> unit(-0.5, 0.5);
        for (size_t i = 0; i < count; ++i) {
            x[i] = static_cast<sphm_real>(width * unit(random));
            y[i] = static_cast<sphm_real>(length * unit(random));
            z[i] = static_cast<sphm_real>(width * unit(random));
            id.push_back(static_cast<int32_t>(count - 1 - i));
        }
    }
    ~Cloud() {
        sphm_grid_free(&grid);
        sphm_neighbours_free(&rows);
    }
    template <class T> void permute(std::vector<T> &values) {
        const std::vector<T> old = values;
        for (size_t slot = 0; slot < old.size(); ++slot)
            values[slot] = old[static_cast<size_t>(grid.order[slot])];
    }
    sphm_status build(double radius, double edge, int threads = 1) {
        sphm_context context{};
        sphm_status status =
            sphm_grid_sort(&grid, x.data(), y.data(), z.data(), id.data(), x.size(), edge, &context);
        if (status != SPHM_OK)
            return status;
        permute(x);
        permute(y);
        permute(z);
        permute(id);
        return sphm_neighbours_build(&rows, &grid, x.data(), y.data(), z.data(), x.size(), radius, threads,
                                     &context);
    }
    std::vector<int32_t> row(size_t slot) const {
        const int32_t *begin = rows.slot + rows.row_start[slot];
        return std::vector<int32_t>(begin, begin + rows.row_count[slot]);
    }
    std::vector<int32_t> row_by_search(size_t slot, double radius) const {
        const auto limit = static_cast<sphm_real>(radius * radius);
        std::vector<int32_t> found;
        for (size_t j = 0; j < x.size(); ++j) {
            const sphm_real dx = x[slot] - x[j], dy = y[slot] - y[j], dz = z[slot] - z[j];
            if (j != slot && dx * dx + dy * dy + dz * dz <= limit)
                found.push_back(static_cast<int32_t>(j));
        }
        return found;
    }
};

TEST(Neighbours, MatchTheSumOverAllPairsForAnyCell) {
    for (double edge : {0.004, 0.011, 0.02, 0.07, 1.0}) {
        Cloud cloud(700, 3);
        ASSERT_EQ(cloud.build(0.011, edge), SPHM_OK);
        for (size_t slot = 0; slot < cloud.x.size(); ++slot)
            ASSERT_EQ(cloud.row(slot), cloud.row_by_search(slot, 0.011))
                << "cell " << edge << ", slot " << slot;
    }
}

TEST(Neighbours, RowsArePaddedWithTheirOwnSlotAndAligned) {
    Cloud cloud(600, 5);
    ASSERT_EQ(cloud.build(0.015, 0.0075), SPHM_OK);
    EXPECT_EQ(reinterpret_cast<uintptr_t>(cloud.rows.slot) % 64, 0u);
    for (size_t slot = 0; slot < cloud.x.size(); ++slot) {
        EXPECT_EQ(cloud.rows.row_start[slot] % SPHM_ROW_ALIGN, 0u);
        EXPECT_GE(cloud.rows.row_start[slot + 1] - cloud.rows.row_start[slot],
                  static_cast<size_t>(cloud.rows.row_count[slot]));
        for (size_t k = cloud.rows.row_start[slot] + static_cast<size_t>(cloud.rows.row_count[slot]);
             k < cloud.rows.row_start[slot + 1]; ++k)
            EXPECT_EQ(cloud.rows.slot[k], static_cast<int32_t>(slot));
    }
}

TEST(Neighbours, OrderIsByCellThenIdWhateverTheOldOrder) {
    Cloud one(500, 7), two(500, 7);
    std::mt19937 random(11);
    std::vector<size_t> shuffle(500);
    for (size_t i = 0; i < 500; ++i)
        shuffle[i] = i;
    std::shuffle(shuffle.begin(), shuffle.end(), random);
    for (size_t i = 0; i < 500; ++i) {
        two.x[i] = one.x[shuffle[i]];
        two.y[i] = one.y[shuffle[i]];
        two.z[i] = one.z[shuffle[i]];
        two.id[i] = one.id[shuffle[i]];
    }
    ASSERT_EQ(one.build(0.012, 0.012), SPHM_OK);
    ASSERT_EQ(two.build(0.012, 0.012), SPHM_OK);
    EXPECT_EQ(one.id, two.id);
    EXPECT_EQ(one.x, two.x);
    EXPECT_EQ(one.grid.cells.axis[0], 1) << "the longest side is the slow one";
}

TEST(Neighbours, AnyNumberOfThreadsFindsTheSameRows) {
    Cloud one(1500, 9), three(1500, 9);
    ASSERT_EQ(one.build(0.012, 0.006, 1), SPHM_OK);
    ASSERT_EQ(three.build(0.012, 0.006, 3), SPHM_OK);
    const size_t entries = one.rows.row_start[1500];
    ASSERT_EQ(entries, three.rows.row_start[1500]);
    EXPECT_TRUE(std::equal(one.rows.slot, one.rows.slot + entries, three.rows.slot));
}

TEST(Neighbours, DuplicateIsolatedAndRunawayParticlesAreFine) {
    Cloud cloud(300, 13);
    cloud.x[10] = cloud.x[20]; // duplicates are each other's neighbours
    cloud.y[10] = cloud.y[20];
    cloud.z[10] = cloud.z[20];
    cloud.x[30] = 40; // far away: cells must grow, not the memory
    cloud.y[40] = -1000;
    ASSERT_EQ(cloud.build(0.011, 0.011), SPHM_OK);
    EXPECT_LE(cloud.grid.cells.count, 8u * 300 + 64);
    for (size_t slot = 0; slot < cloud.x.size(); ++slot)
        ASSERT_EQ(cloud.row(slot), cloud.row_by_search(slot, 0.011));
}

TEST(Neighbours, OneParticleHasNone) {
    Cloud cloud(1, 1);
    ASSERT_EQ(cloud.build(0.011, 0.011), SPHM_OK);
    EXPECT_EQ(cloud.rows.row_count[0], 0);
}

TEST(Neighbours, CountWithinIgnoresTheSkin) {
    Cloud cloud(400, 21);
    ASSERT_EQ(cloud.build(0.015, 0.015), SPHM_OK);
    size_t expected = 0;
    for (size_t slot = 0; slot < cloud.x.size(); ++slot)
        expected += cloud.row_by_search(slot, 0.012).size();
    EXPECT_EQ(
        sphm_neighbours_count_within(&cloud.rows, cloud.x.data(), cloud.y.data(), cloud.z.data(), 0.012),
        expected);
}

} // namespace
