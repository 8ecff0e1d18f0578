// The node: one muscle, or several on one clock, with services, diagnostics and /clock.
#ifndef SPH_MUSCLE_NODE_MUSCLE_NODE_H
#define SPH_MUSCLE_NODE_MUSCLE_NODE_H

#include "coupling.h"
#include "muscle_topics.h"
#include "simulation.h"

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sph_muscle/Snapshot.h>
#include <sph_muscle/Step.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <memory>
#include <string>
#include <vector>

namespace sph_muscle {

class MuscleNode {
  public:
    // One muscle, in the node's namespace, whose ends follow tf. Throws Refused.
    MuscleNode() : MuscleNode({""}, nullptr) {}
    // Several, in namespaces of these names; their ends follow the frames of `coupling` (none: tf).
    MuscleNode(const std::vector<std::string> &names, std::unique_ptr<Coupling> coupling);
    ~MuscleNode();

  private:
    struct Unstarted {};
    explicit MuscleNode(Unstarted) {}

    // Set-up.
    void create_muscles(const std::vector<std::string> &names);
    void create_simulation();
    void listen_to_frames();
    void advertise_clock();
    void advertise_services();
    void start_diagnostics();

    // Services; each waits for the simulation's answer.
    bool reset(std_srvs::Trigger::Request &request, std_srvs::Trigger::Response &response);
    bool pause(std_srvs::SetBool::Request &request, std_srvs::SetBool::Response &response);
    bool step(Step::Request &request, Step::Response &response);
    bool save_snapshot(Snapshot::Request &request, Snapshot::Response &response);
    bool load_snapshot(Snapshot::Request &request, Snapshot::Response &response);
    bool ticks_of(const Step::Request &request, uint64_t *ticks, std::string *message) const;
    bool wait_for_frames(const ros::Time &stamp, std::string *message) const;

    // On the simulation's thread.
    bool place();
    void prepare(double tick_s);
    void publish(bool all);
    bool reset_all(std::string *message);
    void state_replaced(bool starts);
    ros::Time stamp() const;

    // Diagnostics.
    void diagnose_timing(diagnostic_updater::DiagnosticStatusWrapper &status);
    void diagnose_state(diagnostic_updater::DiagnosticStatusWrapper &status);
    void diagnose_device(diagnostic_updater::DiagnosticStatusWrapper &status);

    const sphm_parameters &parameters() const { return muscles_.front()->parameters(); } // of all alike

    ros::NodeHandle handle_, private_handle_{"~"}, service_handle_;
    std::unique_ptr<Coupling> coupling_; // may be none
    tf2_ros::Buffer frames_;
    std::unique_ptr<tf2_ros::TransformListener> frames_listener_; // none when no end follows tf
    ros::Publisher clock_;                                        // none unless asked for
    Muscles muscles_;
    WallTime placing_until_; // how long the frames of the ends' start poses are waited for; 0: not yet
    uint64_t ticks_between_looks_ = 1, ticks_since_look_ = 0;

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
