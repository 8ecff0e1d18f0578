// From the muscle's open structs to ROS messages. No ROS handles, no state but the colour range.
#ifndef SPH_MUSCLE_NODE_MESSAGES_H
#define SPH_MUSCLE_NODE_MESSAGES_H

#include "sph_muscle/muscle.h"

#include <geometry_msgs/Wrench.h>
#include <sensor_msgs/PointCloud2.h>
#include <sph_muscle/MuscleState.h>
#include <std_msgs/Header.h>
#include <visualization_msgs/Marker.h>
#include <visualization_msgs/MarkerArray.h>

namespace sph_muscle {

// x y z displacement (m) pressure (Pa) membrane_potential (mV) activation fibre_stretch, all float32.
void fill_cloud(const sphm_particles &particles, sensor_msgs::PointCloud2 *cloud);

void fill_state(const sphm_observation &observation, MuscleState *state);
// The force and the moment alone; the message's frame is the caller's affair.
void fill_wrench(const sphm_wrench &wrench, geometry_msgs::Wrench *message);

// The values that get the coldest and the hottest colour: fixed, or (minimum == maximum) following the data,
// never closer than what is worth seeing, so that a resting muscle does not show its rounding errors.
class ColourRange {
  public:
    ColourRange(int field, double minimum, double maximum);
    void follow(const float *values, std::size_t count);
    double share(double value) const;

  private:
    bool fixed_;
    double least_span_, minimum_, maximum_;
};

// The surface as triangles, coloured blue over white to red.
void fill_surface(const sphm_skin &skin, const ColourRange &range, visualization_msgs::Marker *marker);

// Displacement arrows of some particles, the attachment regions, the electrodes and a line of text.
visualization_msgs::MarkerArray make_markers(const sphm_muscle *muscle, const sphm_particles &particles,
                                             const MuscleState &state);

} // namespace sph_muscle
#endif
