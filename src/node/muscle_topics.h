// The ROS face of one muscle: its parameters, topics, and tf frames. No physics, and nothing that waits: the
// muscle runs on the thread of `Simulation`, and callbacks queue commands for it.
#ifndef SPH_MUSCLE_NODE_MUSCLE_TOPICS_H
#define SPH_MUSCLE_NODE_MUSCLE_TOPICS_H

#include "end_frames.h"
#include "messages.h"
#include "simulation.h"

#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>
#include <sph_muscle/End.h>
#include <sph_muscle/EndLoad.h>
#include <sph_muscle/ExternalForce.h>
#include <sph_muscle/StimulusCommand.h>
#include <std_msgs/Float64.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace sph_muscle {

void log_to_ros(sphm_log_level level, const char *text, void *user);

class MuscleTopics {
  public:
    // `name`: namespace of topics and parameters below the node's, empty for the node's own; `names`: those
    // of all muscles of the node. `frames` is borrowed. Throws Refused.
    MuscleTopics(const std::string &name, const std::vector<std::string> &names,
                 const tf2::BufferCore &frames);
    const std::string &name() const { return name_; }
    const sphm_parameters &parameters() const { return parameters_; }
    const std::string &device() const { return device_; }
    // The muscle, once: to the simulation it becomes a member of.
    Simulation::Member hand_over();
    // Advertises and subscribes. `simulation` must outlive the object's last callback.
    void connect(Simulation *simulation, std::size_t index);
    // The services that wait for the simulation; `handle` carries the queue they are called from.
    std::vector<ros::ServiceServer> advertise_services(const ros::NodeHandle &handle);

    bool follows_frames() const { return ends_.any(); }
    bool frames_known_at(const ros::Time &stamp, std::string *why) const; // from any thread
    const std::string &frame_of(int end) const { return ends_.frame(end); }

    // On the simulation's thread.
    // Puts ends where they start; false: frames are missing.
    bool place(const ros::Time &now);
    void follow(double tick_s, const ros::Time &now);
    void restart() { ends_.restart(); } // after a reset or a restored snapshot
    // The muscle's action on the bone; false for the fluid.
    bool wrench(int end, const ros::Time &stamp, geometry_msgs::WrenchStamped *message);
    void publish_wrenches(const ros::Time &stamp);
    void publish(const ros::Time &stamp, bool all); // everything else; all: what is thinned out, too

  private:
    struct DestroyMuscle {
        void operator()(sphm_muscle *muscle) const { sphm_muscle_destroy(muscle); }
    };
    void create_muscle();
    void advertise();
    void subscribe();

    // Topics in; each queues what it was told.
    void on_stimulus(const std_msgs::Float64 &message);
    void on_stimulus_command(const StimulusCommand &message);
    void on_external_force(const ExternalForce &message);
    void on_activation_command(const std_msgs::Float64 &message);
    void on_load(const EndLoad &message);
    using Attempt = std::function<sphm_status(sphm_muscle *, sphm_context *)>;
    void queue(const char *topic, const Attempt &attempt);

    bool attach(End::Request &request, End::Response &response);
    bool release(End::Request &request, End::Response &response);
    using EndAttempt = std::function<sphm_status(sphm_muscle *, int end, sphm_context *)>;
    bool call(const End::Request &request, End::Response *response, const char *done,
              const EndAttempt &attempt);

    // On the simulation's thread.
    sphm_muscle *muscle() const { return simulation_->muscle(index_); }
    void warn_of_ends();
    void warn(const std::string &what, const std::string &text);
    void publish_surface(const ros::Time &stamp, bool late);
    uint8_t condition(int end) const; // MuscleState::HELD, ...
    sphm_status look(bool late, sphm_particles *particles, sphm_observation *observation,
                     sphm_context *context);
    std_msgs::Header header(const ros::Time &stamp, bool late);
    void describe(const sphm_observation &observation, MuscleState *state);

    std::string name_;
    ros::NodeHandle handle_;
    sphm_context context_{}; // of creation
    sphm_parameters parameters_;
    std::string device_;
    EndFrames ends_; // the simulation's thread only, but for frames_known_at()
    std::unique_ptr<sphm_muscle, DestroyMuscle> made_; // until it is handed over
    Simulation *simulation_ = nullptr;
    std::size_t index_ = 0;

    ros::Publisher particles_, surface_, markers_, state_;
    ros::Publisher wrenches_[SPHM_END_COUNT]; // of the solid; the fluid has no force to tell
    ros::Subscriber stimulus_, stimulus_command_, external_force_, activation_command_, load_;
    std::map<std::string, WallTime> warned_; // by what it was about; the simulation's thread only
    ColourRange colours_;
    WallTime markers_published_;
};

} // namespace sph_muscle
#endif
