// The ROS face of one muscle: parameters, topics, services, diagnostics. No physics, and nothing that waits:
// the muscle runs on the thread of `Simulation`, and callbacks queue commands for it.
#ifndef SPH_MUSCLE_NODE_MUSCLE_NODE_H
#define SPH_MUSCLE_NODE_MUSCLE_NODE_H

#include "end_frames.h"
#include "messages.h"
#include "ros_parameters.h"
#include "simulation.h"

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sph_muscle/ExternalForce.h>
#include <sph_muscle/Snapshot.h>
#include <sph_muscle/Step.h>
#include <sph_muscle/StimulusCommand.h>
#include <std_msgs/Float64.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <map>
#include <memory>
#include <string>

namespace sph_muscle {

class MuscleNode {
  public:
    MuscleNode(); // throws Refused
    ~MuscleNode();

  private:
    explicit MuscleNode(const sphm_context &context) : context_(context) {}

    // Set-up.
    void create_simulation();
    void listen_to_frames();
    void advertise();
    void advertise_services();
    void start_diagnostics();

    // Topics in; each queues what it was told.
    void on_stimulus(const std_msgs::Float64 &message);
    void on_stimulus_command(const StimulusCommand &message);
    void on_external_force(const ExternalForce &message);
    void on_activation_command(const std_msgs::Float64 &message);
    using Attempt = std::function<sphm_status(sphm_muscle *, sphm_context *)>;
    void queue(const char *topic, const Attempt &attempt);
    void warn(const std::string &what, const std::string &text);

    // Services; each waits for the simulation's answer.
    bool reset(std_srvs::Trigger::Request &request, std_srvs::Trigger::Response &response);
    bool pause(std_srvs::SetBool::Request &request, std_srvs::SetBool::Response &response);
    bool step(Step::Request &request, Step::Response &response);
    bool save_snapshot(Snapshot::Request &request, Snapshot::Response &response);
    bool load_snapshot(Snapshot::Request &request, Snapshot::Response &response);

    // On the simulation's thread.
    void follow_frames(double tick_s);
    void state_replaced();
    void publish(bool all);
    void publish_surface(const std_msgs::Header &header);
    void publish_wrench(int end, const std_msgs::Header &header);
    bool observe(const std_msgs::Header &header, MuscleState *state);

    // Diagnostics.
    void diagnose_timing(diagnostic_updater::DiagnosticStatusWrapper &status);
    void diagnose_state(diagnostic_updater::DiagnosticStatusWrapper &status);
    void diagnose_device(diagnostic_updater::DiagnosticStatusWrapper &status);

    ros::NodeHandle handle_, private_handle_{"~"}, service_handle_;
    sphm_context context_; // of creation, then of the simulation's thread
    sphm_parameters parameters_;
    std::string device_;

    ros::Publisher particles_, surface_, markers_, state_;
    ros::Publisher wrenches_[SPHM_END_COUNT]; // of the solid; the fluid has no force to tell
    ros::Subscriber stimulus_, stimulus_command_, external_force_, activation_command_;
    std::map<std::string, WallTime> warned_; // by what it was about; the simulation's thread only
    tf2_ros::Buffer frames_;
    std::unique_ptr<tf2_ros::TransformListener> frames_listener_; // none when no end follows a frame
    std::unique_ptr<EndFrames> ends_;                             // the simulation's thread only
    std::unique_ptr<ColourRange> colours_;
    WallTime markers_published_;

    // Below all that its thread uses, so that the thread has ended before any of that is destroyed; above the
    // services, whose threads wait for it.
    std::unique_ptr<Simulation> simulation_;

    ros::CallbackQueue service_queue_;
    std::unique_ptr<ros::AsyncSpinner> service_spinner_;
    std::vector<ros::ServiceServer> services_;

    std::unique_ptr<diagnostic_updater::Updater> updater_;
    ros::WallTimer diagnostics_timer_;
    uint64_t overruns_reported_ = 0;
};

} // namespace sph_muscle
#endif
