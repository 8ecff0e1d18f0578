// An arm of one hinge that muscles move: the forward dynamics of arm.launch.
//
// The robot description tells everything but the muscles: one revolute joint (its axis, limits, friction),
// the masses of what hangs on it, and fixed joints, among them the frames of the muscles and of their ends.
// Before each tick the wrenches at the ends that ride on the moving part, and gravity (along -z of the root
// link), give the torque about the hinge; the hinge advances by one tick; the muscles' ends then follow its
// frames through the same tick. So muscles and joint exchange motion and force once a tick, in lock-step.
#ifndef SPH_MUSCLE_NODE_ARM_H
#define SPH_MUSCLE_NODE_ARM_H

#include "coupling.h"
#include "hinge.h"

#include <ros/ros.h>
#include <tf2/LinearMath/Transform.h>
#include <urdf/model.h>

#include <string>
#include <vector>

namespace sph_muscle {

class Arm : public Coupling {
  public:
    // Reads robot_description and ~start_angle (rad). Throws
    // Refused.
    Arm();
    tf2::BufferCore &frames() override { return frames_; }
    ros::Time now() const override { return ros::Time(time_s_); }
    void advance(const Muscles &muscles, double tick_s) override;
    void publish(const ros::Time &stamp) override;
    void reset() override;

  private:
    void read_joint(const urdf::Model &model);
    void read_fixed_frames(const urdf::Model &model);
    void add_masses(const urdf::LinkConstSharedPtr &link);
    double gravity_torque() const;
    double muscle_torque(const Muscles &muscles) const;
    void place_child();

    ros::NodeHandle handle_;
    ros::Publisher joint_states_;
    tf2::BufferCore frames_{ros::Duration(1)};
    double time_s_ = 1; // of the frames; only its growth matters

    std::string joint_, parent_, child_, root_;
    std::vector<std::string> carried_;  // links that turn with the joint
    tf2::Transform joint_place_;        // of the joint in its parent
    tf2::Vector3 axis_;                 // unit vector, in the child's frame
    double mass_kg_ = 0;                // of what turns
    tf2::Vector3 moment_kg_m_{0, 0, 0}; // mass times its centre, in the child's frame
    Hinge hinge_;
    double start_rad_ = 0, torque_Nm_ = 0;
};

} // namespace sph_muscle
#endif
