// What the muscles of one process move, and what moves their frames in turn: a joint, say. Everything happens
// on the simulation's thread, between ticks.
#ifndef SPH_MUSCLE_NODE_COUPLING_H
#define SPH_MUSCLE_NODE_COUPLING_H

#include "muscle_topics.h"

#include <tf2/buffer_core.h>

#include <memory>
#include <vector>

namespace sph_muscle {

using Muscles = std::vector<std::unique_ptr<MuscleTopics>>;

class Coupling {
  public:
    virtual ~Coupling() = default;
    // The frames the muscles follow, and the time of the newest.
    virtual tf2::BufferCore &frames() = 0;
    virtual ros::Time now() const = 0;
    // Before a tick: takes the wrenches and puts the frames where they will be at its end.
    virtual void advance(const Muscles &muscles, double tick_s) = 0;
    virtual void publish(const ros::Time &stamp) = 0; // after a tick
    virtual void reset() = 0;
};

} // namespace sph_muscle
#endif
