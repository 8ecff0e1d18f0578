#include "arm.h"

#include "ros_parameters.h"

#include <sensor_msgs/JointState.h>

#include <algorithm>
#include <cmath>

namespace sph_muscle {
namespace {

constexpr double gravity_m_per_s2 = 9.81;

tf2::Vector3 vector(const urdf::Vector3 &v) {
    return {v.x, v.y, v.z};
}

tf2::Transform transform_of(const urdf::Pose &pose) {
    double x, y, z, w;
    pose.rotation.getQuaternion(x, y, z, w);
    return tf2::Transform(tf2::Quaternion(x, y, z, w), vector(pose.position));
}

tf2::Transform transform_of(const geometry_msgs::Transform &m) {
    return tf2::Transform(tf2::Quaternion(m.rotation.x, m.rotation.y, m.rotation.z, m.rotation.w),
                          tf2::Vector3(m.translation.x, m.translation.y, m.translation.z));
}

void set_frame(tf2::BufferCore *frames, const std::string &parent, const std::string &child,
               const tf2::Transform &place, const ros::Time &stamp, bool fixed) {
    geometry_msgs::TransformStamped message;
    message.header.stamp = stamp;
    message.header.frame_id = parent;
    message.child_frame_id = child;
    message.transform.translation.x = place.getOrigin().x();
    message.transform.translation.y = place.getOrigin().y();
    message.transform.translation.z = place.getOrigin().z();
    const tf2::Quaternion turn = place.getRotation();
    message.transform.rotation.x = turn.x();
    message.transform.rotation.y = turn.y();
    message.transform.rotation.z = turn.z();
    message.transform.rotation.w = turn.w();
    frames->setTransform(message, "arm", fixed);
}

tf2::Transform place_of(const tf2::BufferCore &frames, const std::string &frame, const std::string &in) {
    return transform_of(frames.lookupTransform(in, frame, ros::Time(0)).transform);
}

// About an axis through the link's origin: n.R I R^T.n + m |n x c|^2
double inertia_about(const tf2::Vector3 &axis, const urdf::Inertial &inertial, const tf2::Transform &place) {
    const tf2::Matrix3x3 I(inertial.ixx, inertial.ixy, inertial.ixz, inertial.ixy, inertial.iyy, inertial.iyz,
                           inertial.ixz, inertial.iyz, inertial.izz);
    const tf2::Vector3 n = place.getBasis().transpose() * axis;
    return n.dot(I * n) + inertial.mass * axis.cross(place.getOrigin()).length2();
}

} // namespace

// Set-up --------------------------------------------------------------------------------------------------

Arm::Arm() {
    urdf::Model model;
    if (!model.initParam("robot_description"))
        throw Refused("the parameter robot_description is missing or is no URDF");
    root_ = model.getRoot()->name;
    read_joint(model);
    read_fixed_frames(model);
    place_child();
    add_masses(model.getLink(child_));
    if (!(hinge_.inertia_kg_m2 > 0))
        throw Refused("nothing that turns with joint '" + joint_ +
                      "' has a mass: give its links an <inertial>");
    joint_states_ = handle_.advertise<sensor_msgs::JointState>("joint_states", 100);
    ROS_INFO("arm: joint %s from %.2f to %.2f rad, inertia %.4f kg m2, friction %.3g Nm s/rad",
             joint_.c_str(), hinge_.lower_rad, hinge_.upper_rad, hinge_.inertia_kg_m2, hinge_.damping_Nm_s);
}

void Arm::read_joint(const urdf::Model &model) {
    std::vector<urdf::JointSharedPtr> moving;
    for (const auto &entry : model.joints_) {
        if (entry.second->type != urdf::Joint::FIXED)
            moving.push_back(entry.second);
    }
    if (moving.size() != 1 || moving[0]->type != urdf::Joint::REVOLUTE || !moving[0]->limits)
        throw Refused("robot_description has " + std::to_string(moving.size()) +
                      " joints that move; the arm needs exactly one, revolute and with limits");
    const urdf::Joint &joint = *moving[0];
    joint_ = joint.name;
    parent_ = joint.parent_link_name;
    child_ = joint.child_link_name;
    joint_place_ = transform_of(joint.parent_to_joint_origin_transform);
    axis_ = vector(joint.axis).normalized();
    hinge_.lower_rad = joint.limits->lower;
    hinge_.upper_rad = joint.limits->upper;
    hinge_.damping_Nm_s = joint.dynamics ? joint.dynamics->damping : 0;
    hinge_.inertia_kg_m2 = 0; // added up below
    ros::NodeHandle("~").param("start_angle", start_rad_, (hinge_.lower_rad + hinge_.upper_rad) / 2);
    if (!(start_rad_ >= hinge_.lower_rad && start_rad_ <= hinge_.upper_rad))
        throw Refused("start_angle is " + std::to_string(start_rad_) + " rad; joint '" + joint_ +
                      "' goes from " + std::to_string(hinge_.lower_rad) + " to " +
                      std::to_string(hinge_.upper_rad));
    hinge_.angle_rad = start_rad_;
}

void Arm::read_fixed_frames(const urdf::Model &model) {
    for (const auto &entry : model.joints_) {
        const urdf::Joint &joint = *entry.second;
        if (joint.type == urdf::Joint::FIXED)
            set_frame(&frames_, joint.parent_link_name, joint.child_link_name,
                      transform_of(joint.parent_to_joint_origin_transform), ros::Time(0), true);
    }
}

void Arm::add_masses(const urdf::LinkConstSharedPtr &link) {
    carried_.push_back(link->name);
    if (link->inertial) {
        const tf2::Transform place =
            (link->name == child_ ? tf2::Transform::getIdentity() : place_of(frames_, link->name, child_)) *
            transform_of(link->inertial->origin);
        hinge_.inertia_kg_m2 += inertia_about(axis_, *link->inertial, place);
        mass_kg_ += link->inertial->mass;
        moment_kg_m_ += link->inertial->mass * place.getOrigin();
    }
    for (const urdf::LinkSharedPtr &child : link->child_links)
        add_masses(child);
}

// Dynamics ------------------------------------------------------------------------------------------------

void Arm::place_child() {
    tf2::Transform turned(tf2::Quaternion(axis_, hinge_.angle_rad), tf2::Vector3(0, 0, 0));
    set_frame(&frames_, parent_, child_, joint_place_ * turned, ros::Time(time_s_), false);
}

double Arm::gravity_torque() const {
    const tf2::Transform child = place_of(frames_, child_, root_);
    const tf2::Vector3 down = child.getBasis().transpose() * tf2::Vector3(0, 0, -gravity_m_per_s2);
    return axis_.dot(moment_kg_m_.cross(down));
}

// About the hinge, of all ends that turn with it.
double Arm::muscle_torque(const Muscles &muscles) const {
    double sum = 0;
    for (const auto &muscle : muscles) {
        for (int end = 0; end < SPHM_END_COUNT; ++end) {
            geometry_msgs::WrenchStamped wrench;
            if (std::find(carried_.begin(), carried_.end(), muscle->frame_of(end)) == carried_.end() ||
                !muscle->wrench(end, ros::Time(), &wrench) || wrench.header.frame_id != muscle->frame_of(end))
                continue;
            const tf2::Transform place = place_of(frames_, wrench.header.frame_id, child_);
            const auto &f = wrench.wrench.force;
            const auto &m = wrench.wrench.torque;
            const tf2::Vector3 force = place.getBasis() * tf2::Vector3(f.x, f.y, f.z);
            const tf2::Vector3 moment = place.getBasis() * tf2::Vector3(m.x, m.y, m.z);
            sum += axis_.dot(moment + place.getOrigin().cross(force));
        }
    }
    return sum;
}

void Arm::advance(const Muscles &muscles, double tick_s) {
    torque_Nm_ = muscle_torque(muscles);
    hinge_.advance(torque_Nm_ + gravity_torque(), tick_s);
    time_s_ += tick_s;
    place_child();
}

void Arm::reset() {
    hinge_.angle_rad = start_rad_;
    hinge_.rate_rad_per_s = 0;
    torque_Nm_ = 0;
    time_s_ += 1e-3;
    place_child();
}

void Arm::publish(const ros::Time &stamp) {
    sensor_msgs::JointState state;
    state.header.stamp = stamp;
    state.name = {joint_};
    state.position = {hinge_.angle_rad};
    state.velocity = {hinge_.rate_rad_per_s};
    state.effort = {torque_Nm_};
    joint_states_.publish(state);
}

} // namespace sph_muscle
