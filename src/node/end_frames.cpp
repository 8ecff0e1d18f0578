#include "end_frames.h"

#include <tf2/exceptions.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace sph_muscle {
namespace {

// An end that begins to follow, or that follows again, reaches its frame within this simulated time; and
// transforms farther apart than this do not tell a velocity.
constexpr double catch_up_s = 0.1;

tf2::Vector3 vector(const double v[3]) {
    return {v[0], v[1], v[2]};
}

tf2::Transform transform_of(const geometry_msgs::Transform &message) {
    const tf2::Quaternion turn(message.rotation.x, message.rotation.y, message.rotation.z,
                               message.rotation.w);
    const tf2::Vector3 shift(message.translation.x, message.translation.y, message.translation.z);
    return tf2::Transform(turn, shift);
}

tf2::Transform end_now(const sphm_muscle *muscle, int end) {
    sphm_end_pose pose{};
    (void)sphm_muscle_end_pose(muscle, end, &pose, nullptr); // refuses a fluid, which has no EndFrames
    const double *q = pose.orientation;
    return tf2::Transform(tf2::Quaternion(q[0], q[1], q[2], q[3]), vector(pose.position_m));
}

void store(const tf2::Vector3 &v, double out[3]) {
    out[0] = v.x();
    out[1] = v.y();
    out[2] = v.z();
}

sphm_end_pose pose_of(const tf2::Transform &target) {
    sphm_end_pose pose{};
    store(target.getOrigin(), pose.position_m);
    const tf2::Quaternion q = target.getRotation();
    const double orientation[4] = {q.x(), q.y(), q.z(), q.w()};
    std::copy(orientation, orientation + 4, pose.orientation);
    return pose;
}

// Mean velocities from one pose to the next.
void set_velocities(const tf2::Transform &from, const tf2::Transform &to, double time_s,
                    sphm_end_pose *pose) {
    store((to.getOrigin() - from.getOrigin()) / time_s, pose->velocity_m_per_s);
    tf2::Quaternion turn = to.getRotation() * from.getRotation().inverse();
    if (turn.w() < 0)
        turn = tf2::Quaternion(-turn.x(), -turn.y(), -turn.z(), -turn.w());
    const tf2::Vector3 axis(turn.x(), turn.y(), turn.z()); // times the sine of half the angle
    const double sine = axis.length();
    if (sine > 1e-12)
        store(axis * (2 * std::atan2(sine, turn.w()) / sine / time_s), pose->angular_velocity_rad_per_s);
}

bool given(const double offset[3]) {
    return offset[0] < SPHM_AUTO && offset[1] < SPHM_AUTO && offset[2] < SPHM_AUTO;
}

} // namespace

EndFrames::EndFrames(const sphm_parameters &parameters, const tf2::BufferCore &buffer)
    : buffer_(buffer), muscle_frame_(parameters.frame_id), timeout_s_(parameters.tf_timeout),
      along_line_(parameters.end_orientation == SPHM_END_ORIENTATION_LINE) {
    ends_[SPHM_END_ORIGIN].frame = parameters.origin_frame;
    ends_[SPHM_END_INSERTION].frame = parameters.insertion_frame;
    const double *offsets[SPHM_END_COUNT] = {parameters.origin_offset, parameters.insertion_offset};
    for (std::size_t end = 0; end < ends_.size(); ++end) {
        ends_[end].offset_given = given(offsets[end]);
        if (ends_[end].offset_given)
            ends_[end].offset = vector(offsets[end]);
    }
}

void EndFrames::restart() {
    for (End &end : ends_)
        end.commanded = false;
}

bool EndFrames::known_at(const ros::Time &stamp, std::string *why) const {
    for (const End &end : ends_) {
        if (!end.frame.empty() && !buffer_.canTransform(muscle_frame_, end.frame, stamp, why))
            return false;
    }
    return true;
}

// Starting ------------------------------------------------------------------------------------------------

bool EndFrames::place(sphm_muscle *muscle, const ros::Time &now) {
    std::array<tf2::Transform, SPHM_END_COUNT> starts;
    bool any = false, all = true;
    for (int e = 0; e < SPHM_END_COUNT; ++e) {
        const auto at = static_cast<std::size_t>(e);
        End &end = ends_[at];
        tf2::Transform frame;
        ros::Time stamp;
        starts[at] = end_now(muscle, e);
        if (end.frame.empty() || !(end.captured || end.offset_given))
            continue;
        if (!look_up(&end, now, &frame, &stamp)) {
            all = false;
            continue;
        }
        if (!end.captured)
            capture(muscle, e, frame);
        end.frame_seen = frame;
        end.problem.clear();
        starts[at] = frame * end.place;
        any = true;
    }
    if (!any)
        return all;
    if (along_line_)
        orient_along_line(muscle, &starts);
    for (int e = 0; e < SPHM_END_COUNT; ++e) {
        const sphm_end_pose pose = pose_of(starts[static_cast<std::size_t>(e)]);
        sphm_context context{};
        if (sphm_muscle_set_start_pose(muscle, e, &pose, &context) != SPHM_OK)
            ends_[static_cast<std::size_t>(e)].problem = context.message; // it follows from rest, if it can
    }
    return all;
}

// Following -----------------------------------------------------------------------------------------------

void EndFrames::follow(sphm_muscle *muscle, double tick_s, const ros::Time &now) {
    std::array<tf2::Transform, SPHM_END_COUNT> targets;
    std::array<bool, SPHM_END_COUNT> seen{};
    bool news = false;
    for (int e = 0; e < SPHM_END_COUNT; ++e) {
        End &end = ends_[static_cast<std::size_t>(e)];
        targets[static_cast<std::size_t>(e)] = end.commanded ? end.target : end_now(muscle, e);
        tf2::Transform frame;
        ros::Time stamp;
        end.let_go = sphm_muscle_end_condition(muscle, e, nullptr) != SPHM_END_HELD;
        if (end.let_go) {
            end.commanded = false;
            end.problem.clear();
            targets[static_cast<std::size_t>(e)] = end_now(muscle, e);
            continue;
        }
        if (end.frame.empty() || !look_up(&end, now, &frame, &stamp))
            continue;
        if (!end.captured)
            capture(muscle, e, frame);
        seen[static_cast<std::size_t>(e)] = true;
        news = news || !end.commanded || stamp != end.stamp || stamp.isZero();
        end.stamp = stamp;
        end.frame_seen = frame;
        targets[static_cast<std::size_t>(e)] = frame * end.place;
    }
    if (!news)
        return;
    if (along_line_)
        orient_along_line(muscle, &targets);
    for (int e = 0; e < SPHM_END_COUNT; ++e) {
        const auto at = static_cast<std::size_t>(e);
        if (seen[at] || (along_line_ && ends_[at].frame.empty() && !ends_[at].let_go))
            send(muscle, e, targets[at], tick_s);
    }
}

// The newest transform from the end's frame to the muscle's. False, with the reason in end->problem, when
// there is none or it is late.
bool EndFrames::look_up(End *end, const ros::Time &now, tf2::Transform *frame, ros::Time *stamp) const {
    try {
        const geometry_msgs::TransformStamped found =
            buffer_.lookupTransform(muscle_frame_, end->frame, ros::Time(0));
        const double age_s = found.header.stamp.isZero() ? 0 : (now - found.header.stamp).toSec();
        if (age_s <= timeout_s_) {
            *frame = transform_of(found.transform);
            *stamp = found.header.stamp;
            return true;
        }
        char text[80];
        std::snprintf(text, sizeof text, "the last transform is %.3g s old", age_s);
        end->problem = text;
    } catch (const tf2::TransformException &exception) {
        end->problem = exception.what();
    }
    end->commanded = false;
    return false;
}

void EndFrames::capture(const sphm_muscle *muscle, int e, const tf2::Transform &frame) {
    End &end = ends_[static_cast<std::size_t>(e)];
    end.place = frame.inverse() * end_now(muscle, e);
    if (end.offset_given)
        end.place.setOrigin(end.offset);
    end.captured = true;
}

// Both ends turn by the shortest rotation that takes the line of action at rest to where it is now.
void EndFrames::orient_along_line(const sphm_muscle *muscle,
                                  std::array<tf2::Transform, SPHM_END_COUNT> *targets) const {
    const tf2::Vector3 line =
        (*targets)[SPHM_END_INSERTION].getOrigin() - (*targets)[SPHM_END_ORIGIN].getOrigin();
    if (!(line.length() > 0))
        return;
    const tf2::Quaternion turn =
        tf2::shortestArcQuat(vector(sphm_muscle_body(muscle)->axis), line.normalized());
    for (tf2::Transform &target : *targets)
        target.setRotation(turn);
}

void EndFrames::send(sphm_muscle *muscle, int e, const tf2::Transform &target, double tick_s) {
    End &end = ends_[static_cast<std::size_t>(e)];
    const double now_s = sphm_muscle_time(muscle), since_s = now_s - end.commanded_s;
    sphm_end_pose pose = pose_of(target);
    double duration_s = std::max(tick_s, catch_up_s);
    if (end.commanded && since_s > 0 && since_s <= duration_s) {
        duration_s = std::max(tick_s, since_s);
        set_velocities(end.target, target, since_s, &pose);
    }
    sphm_context context{};
    if (sphm_muscle_set_end_pose(muscle, e, &pose, duration_s, &context) != SPHM_OK) {
        end.problem = context.message;
        end.commanded = false;
        return;
    }
    end.problem.clear();
    end.target = target;
    end.commanded_s = now_s;
    end.commanded = true;
}

// Wrenches ------------------------------------------------------------------------------------------------

std::string EndFrames::express(const sphm_muscle *muscle, int e, sphm_wrench *wrench) const {
    const End &end = ends_[static_cast<std::size_t>(e)];
    const tf2::Transform pose = end_now(muscle, e);
    // Where the frame is now: it goes with the end, which may still be on its way to the newest transform.
    tf2::Transform frame = tf2::Transform::getIdentity();
    if (end.captured && along_line_) {
        frame.setBasis(end.frame_seen.getBasis());
        frame.setOrigin(pose.getOrigin() - frame.getBasis() * end.place.getOrigin());
    } else if (end.captured) {
        frame = pose * end.place.inverse();
    }
    const tf2::Matrix3x3 into = frame.getBasis().transpose();
    const tf2::Vector3 arm = pose.getOrigin() - frame.getOrigin();
    double *const forces[] = {wrench->force_N, wrench->active_N, wrench->passive_N, wrench->damping_N};
    double *const moments[] = {wrench->moment_Nm, wrench->active_Nm, wrench->passive_Nm, wrench->damping_Nm};
    for (int part = 0; part < 4; ++part) {
        const tf2::Vector3 force = vector(forces[part]);
        store(into * (vector(moments[part]) + arm.cross(force)), moments[part]);
        store(into * force, forces[part]);
    }
    return end.captured ? end.frame : muscle_frame_;
}

} // namespace sph_muscle
