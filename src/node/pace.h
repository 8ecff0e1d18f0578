// Wall-clock bookkeeping of the ticks: when the next one is due, real-time factor, percentiles.
#ifndef SPH_MUSCLE_NODE_PACE_H
#define SPH_MUSCLE_NODE_PACE_H

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

namespace sph_muscle {

using WallClock = std::chrono::steady_clock;
using WallTime = WallClock::time_point;

inline double seconds(WallClock::duration duration) {
    return std::chrono::duration<double>(duration).count();
}

// The last `capacity` values; percentile() over them.
class RecentValues {
  public:
    explicit RecentValues(std::size_t capacity) : capacity_(capacity) { values_.reserve(capacity); }
    void add(double value) {
        if (values_.size() < capacity_) {
            values_.push_back(value);
        } else {
            values_[next_] = value;
        }
        next_ = (next_ + 1) % capacity_;
    }
    double percentile(double share) const {
        if (values_.empty())
            return 0;
        std::vector<double> sorted = values_;
        const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(sorted.size() - 1) + 0.5);
        std::nth_element(sorted.begin(), sorted.begin() + at, sorted.end());
        return sorted[static_cast<std::size_t>(at)];
    }

  private:
    std::size_t capacity_, next_ = 0;
    std::vector<double> values_;
};

// Simulated over wall time, mean of the last second (or of the last tick, if that took longer).
class RealTimeFactor {
  public:
    void restart(WallTime now, double simulated_s) { points_.assign(1, {now, simulated_s}); }
    void add(WallTime now, double simulated_s) {
        points_.emplace_back(now, simulated_s);
        while (points_.size() > 2 && now - points_[1].first >= std::chrono::seconds(1))
            points_.pop_front();
    }
    double value() const {
        if (points_.size() < 2)
            return 0;
        const double wall_s = seconds(points_.back().first - points_.front().first);
        return wall_s > 0 ? (points_.back().second - points_.front().second) / wall_s : 0;
    }

  private:
    std::deque<std::pair<WallTime, double>> points_;
};

// When ticks are due. A short delay is made up for; a longer one stretches time instead, or the muscle
// would race after every hiccup of the machine.
class Schedule {
  public:
    explicit Schedule(double period_s)
        : period_(std::chrono::duration_cast<WallClock::duration>(std::chrono::duration<double>(period_s))) {}
    void restart(WallTime now) { due_ = now; }
    WallTime due() const { return due_; }
    // Call at the end of a tick; true if it ended after the next one was due.
    bool finish(WallTime now) {
        due_ += period_;
        const bool late = now > due_;
        if (now - due_ > std::max<WallClock::duration>(period_, std::chrono::milliseconds(50)))
            due_ = now;
        return late;
    }

  private:
    WallClock::duration period_;
    WallTime due_;
};

} // namespace sph_muscle
#endif
