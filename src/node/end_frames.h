// Ends of a muscle that follow tf frames.
//
// An end belongs to its frame as a tendon belongs to its bone: where it is in the frame is taken over when
// the frame is first seen, or given. From then on every new transform becomes a pose for the end to reach.
// The end moves there with continuous velocity (core/end_motion.h) in as much simulated time as lies between
// the last two transforms, so that it runs one transform behind but does not stop between them. Late, missing
// or refused transforms leave it at its last pose.
#ifndef SPH_MUSCLE_NODE_END_FRAMES_H
#define SPH_MUSCLE_NODE_END_FRAMES_H

#include "sph_muscle/muscle.h"

#include <ros/time.h>
#include <tf2/LinearMath/Transform.h>
#include <tf2/buffer_core.h>

#include <array>
#include <string>

namespace sph_muscle {

class EndFrames {
  public:
    // `buffer` is borrowed, and may be filled by another thread.
    EndFrames(const sphm_parameters &parameters, const tf2::BufferCore &buffer);
    bool any() const {
        return !ends_[SPHM_END_ORIGIN].frame.empty() || !ends_[SPHM_END_INSERTION].frame.empty();
    }

    // On the thread of the muscle, before its start-up phase: the ends whose places in their frames are given
    // or known from before start there. False: not all of these frames are to be seen.
    bool place(sphm_muscle *muscle, const ros::Time &now);
    // On the thread of the muscle, before a tick of tick_s: sends the ends towards the newest transforms.
    // `now` is what transforms' stamps are compared with.
    void follow(sphm_muscle *muscle, double tick_s, const ros::Time &now);
    // After a reset or a restored snapshot: places in the frames stay, motions start anew.
    void restart();
    // Forgets an end's place in its frame; it is taken over again from where the end is then.
    void recapture(int end) {
        ends_[static_cast<std::size_t>(end)].captured = ends_[static_cast<std::size_t>(end)].commanded =
            false;
    }
    // Does the end follow its frame? If it has one and does not, why.
    const std::string &frame(int end) const { return ends_[static_cast<std::size_t>(end)].frame; }
    bool following(int end) const {
        const End &e = ends_[static_cast<std::size_t>(end)];
        return e.captured && !e.let_go && e.problem.empty();
    }
    const std::string &problem(int end) const { return ends_[end].problem; }

    // Can the frames be had at `stamp`? From any thread.
    bool known_at(const ros::Time &stamp, std::string *why) const;

    // Turns a wrench about the end's point in the muscle's frame into one about the origin of the frame that
    // is returned, in its axes: the end's frame, or the muscle's for an end without one.
    std::string express(const sphm_muscle *muscle, int end, sphm_wrench *wrench) const;

  private:
    struct End {
        std::string frame;
        bool offset_given = false;
        tf2::Vector3 offset;
        bool captured = false;
        tf2::Transform place;      // of the end in its frame
        tf2::Transform frame_seen; // of the frame in the muscle's, the newest used
        ros::Time stamp;           // of that; 0: a static one
        bool commanded = false;    // target and time below are of a pose the end was sent to
        tf2::Transform target;     // in the muscle's frame
        double commanded_s = 0;    // simulated time
        bool let_go = false;       // carries a load, or nothing holds it: it follows again once it is held
        std::string problem;
    };
    bool look_up(End *end, const ros::Time &now, tf2::Transform *frame, ros::Time *stamp) const;
    void capture(const sphm_muscle *muscle, int end, const tf2::Transform &frame);
    void orient_along_line(const sphm_muscle *muscle,
                           std::array<tf2::Transform, SPHM_END_COUNT> *targets) const;
    void send(sphm_muscle *muscle, int end, const tf2::Transform &target, double tick_s);

    const tf2::BufferCore &buffer_;
    std::string muscle_frame_;
    double timeout_s_;
    bool along_line_;
    std::array<End, SPHM_END_COUNT> ends_;
};

} // namespace sph_muscle
#endif
