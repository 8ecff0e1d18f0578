#include "muscle_node.h"

#include "ros_parameters.h"

#include <ros/master.h>
#include <rosgraph_msgs/Clock.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace sph_muscle {
namespace {

sphm_context quiet_context() {
    sphm_context context{};
    return context;
}

// Paths in answers are whole ones: the node's working folder is seldom the caller's.
std::string full_path(const std::string &path) {
    if (path.empty() || path[0] == '/')
        return path;
    char *folder = realpath(".", nullptr);
    const std::string full = folder != nullptr ? std::string(folder) + "/" + path : path;
    std::free(folder);
    return full;
}

// Who publishes a topic already; empty: nobody.
std::string publisher_of(const std::string &topic) {
    XmlRpc::XmlRpcValue request, answer, state;
    request[0] = ros::this_node::getName();
    if (!ros::master::execute("getSystemState", request, answer, state, true))
        return "";
    for (int i = 0; i < state[0].size(); ++i) {
        if (static_cast<std::string>(state[0][i][0]) == topic && state[0][i][1].size() > 0)
            return static_cast<std::string>(state[0][i][1][0]);
    }
    return "";
}

constexpr double rtf_that_counts_as_one = 0.98;
constexpr auto longest_wait_for_frames = std::chrono::seconds(1);
constexpr const char *going_down = "the node is busy or shutting down; nothing was done";

} // namespace

// Set-up --------------------------------------------------------------------------------------------------

// Delegates, so that the object counts as constructed and the destructor also ends a node that was refused
// half way, with the simulation already running.
MuscleNode::MuscleNode(const std::vector<std::string> &names, std::unique_ptr<Coupling> coupling)
    : MuscleNode(Unstarted{}) {
    ROS_INFO("sph_muscle %s (%s)", sphm_version(), sphm_build_configuration());
    coupling_ = std::move(coupling);
    create_muscles(names);
    listen_to_frames();
    advertise_clock();
    create_simulation();
    advertise_services();
    start_diagnostics();
}

MuscleNode::~MuscleNode() {
    if (simulation_)
        simulation_->stop(); // first, so that nobody waits for it any more
    if (service_spinner_)
        service_spinner_->stop();
}

void MuscleNode::create_muscles(const std::vector<std::string> &names) {
    const tf2::BufferCore &frames = coupling_ ? coupling_->frames() : frames_;
    for (const std::string &name : names)
        muscles_.push_back(std::make_unique<MuscleTopics>(name, names, frames));
    for (const auto &muscle : muscles_) {
        const sphm_parameters &one = muscle->parameters();
        if (one.rate != parameters().rate || one.publish_rate != parameters().publish_rate ||
            one.publish_clock != parameters().publish_clock)
            throw Refused(
                "rate, publish_rate and publish_clock must be the same for all muscles of a node; " +
                muscle->name() + " has others than " + muscles_.front()->name());
    }
    const double between = std::round(parameters().rate / parameters().publish_rate);
    ticks_between_looks_ = between > 1 ? static_cast<uint64_t>(between) : 1;
}

void MuscleNode::create_simulation() {
    std::vector<Simulation::Member> members;
    for (const auto &muscle : muscles_)
        members.push_back(muscle->hand_over());
    simulation_ = std::make_unique<Simulation>(members, parameters().rate, log_to_ros);
    for (std::size_t i = 0; i < muscles_.size(); ++i)
        muscles_[i]->connect(simulation_.get(), i);
    Simulation::Listener listener;
    listener.place = [this] { return place(); };
    listener.prepare = [this](double tick_s) { prepare(tick_s); };
    listener.publish = [this](bool all) { publish(all); };
    listener.failed = [](const std::string &why) {
        ROS_ERROR("the muscle has stopped: %s. The service reset brings it back.", why.c_str());
    };
    simulation_->start(listener);
}

void MuscleNode::listen_to_frames() {
    const bool any = std::any_of(muscles_.begin(), muscles_.end(),
                                 [](const auto &muscle) { return muscle->follows_frames(); });
    if (any && !coupling_)
        frames_listener_ = std::make_unique<tf2_ros::TransformListener>(frames_, handle_);
}

void MuscleNode::advertise_clock() {
    if (!parameters().publish_clock)
        return;
    const std::string other = publisher_of("/clock");
    if (!other.empty())
        throw Refused("publish_clock is true, but " + other +
                      " publishes /clock already; there is one clock");
    clock_ = handle_.advertise<rosgraph_msgs::Clock>("/clock", 10);
    bool simulated = false;
    if (!handle_.getParam("/use_sim_time", simulated) || !simulated)
        ROS_WARN("publish_clock is true, but /use_sim_time is not: other nodes do not look at /clock");
}

// Services wait for the simulation, so they have threads of their own: two, for reset must get through while
// a long step is under way. A snapshot is of one muscle.
void MuscleNode::advertise_services() {
    service_handle_.setCallbackQueue(&service_queue_);
    services_ = {service_handle_.advertiseService("reset", &MuscleNode::reset, this),
                 service_handle_.advertiseService("pause", &MuscleNode::pause, this),
                 service_handle_.advertiseService("step", &MuscleNode::step, this)};
    for (const auto &muscle : muscles_) {
        for (const ros::ServiceServer &server : muscle->advertise_services(service_handle_))
            services_.push_back(server);
    }
    if (muscles_.size() == 1) {
        services_.push_back(
            service_handle_.advertiseService("save_snapshot", &MuscleNode::save_snapshot, this));
        services_.push_back(
            service_handle_.advertiseService("load_snapshot", &MuscleNode::load_snapshot, this));
    }
    service_spinner_ = std::make_unique<ros::AsyncSpinner>(2, &service_queue_);
    service_spinner_->start();
}

void MuscleNode::start_diagnostics() {
    updater_ = std::make_unique<diagnostic_updater::Updater>(handle_, private_handle_);
    updater_->setHardwareID(muscles_.front()->device());
    updater_->add("Timing", this, &MuscleNode::diagnose_timing);
    updater_->add("State", this, &MuscleNode::diagnose_state);
    updater_->add("Device", this, &MuscleNode::diagnose_device);
    // A wall timer: the updater's own pace follows ROS time, which may stand still or jump back.
    diagnostics_timer_ = handle_.createWallTimer(
        ros::WallDuration(1), [this](const ros::WallTimerEvent &) { updater_->force_update(); });
}

// On the simulation's thread ------------------------------------------------------------------------------

// The time of what is published now. The node's own clock does not take the detour over /clock.
ros::Time MuscleNode::stamp() const {
    return clock_ ? ros::Time(simulation_->clock_s()) : ros::Time::now();
}

// Ends whose places in their frames are known start there. Frames that are not there yet are waited for, but
// not for ever: what comes later is followed from rest.
bool MuscleNode::place() {
    const WallTime wall = WallClock::now();
    if (placing_until_ == WallTime())
        placing_until_ = wall + longest_wait_for_frames;
    const ros::Time now = coupling_ ? coupling_->now() : stamp();
    bool all = true;
    for (const auto &muscle : muscles_)
        all = muscle->place(now) && all;
    if (!all && wall < placing_until_)
        return false;
    placing_until_ = WallTime();
    return true;
}

void MuscleNode::prepare(double tick_s) {
    if (coupling_)
        coupling_->advance(muscles_, tick_s);
    const ros::Time now = coupling_ ? coupling_->now() : stamp();
    for (const auto &muscle : muscles_)
        muscle->follow(tick_s, now);
}

void MuscleNode::publish(bool all) {
    const ros::Time now = stamp();
    if (clock_) {
        rosgraph_msgs::Clock clock;
        clock.clock = now;
        clock_.publish(clock);
    }
    if (coupling_)
        coupling_->publish(now);
    const bool look = all || ++ticks_since_look_ >= ticks_between_looks_;
    if (look)
        ticks_since_look_ = 0;
    for (const auto &muscle : muscles_) {
        if (simulation_->ready())
            muscle->publish_wrenches(now);
        if (look)
            muscle->publish(now, all);
    }
}

bool MuscleNode::reset_all(std::string *message) {
    sphm_context context = quiet_context();
    for (std::size_t i = 0; i < simulation_->size(); ++i) {
        if (sphm_muscle_reset(simulation_->muscle(i), &context) != SPHM_OK) {
            *message = context.message;
            return false;
        }
    }
    if (coupling_)
        coupling_->reset();
    state_replaced(true);
    *message = "at rest, time 0";
    return true;
}

// After a reset or a restored snapshot.
void MuscleNode::state_replaced(bool starts) {
    for (const auto &muscle : muscles_)
        muscle->restart();
    placing_until_ = WallTime();
    simulation_->state_replaced(starts);
}

// Services ------------------------------------------------------------------------------------------------

bool MuscleNode::reset(std_srvs::Trigger::Request &, std_srvs::Trigger::Response &response) {
    std::string message = going_down;
    simulation_->call([&] { response.success = reset_all(&message); });
    response.message = message;
    return true;
}

bool MuscleNode::pause(std_srvs::SetBool::Request &request, std_srvs::SetBool::Response &response) {
    const bool pause = request.data;
    response.success = simulation_->call([&] { simulation_->set_paused(pause); });
    response.message = !response.success ? going_down : pause ? "paused" : "running";
    return true;
}

bool MuscleNode::step(Step::Request &request, Step::Response &response) {
    uint64_t ticks = 0;
    response.success =
        ticks_of(request, &ticks, &response.message) &&
        (request.frames_at.isZero() || wait_for_frames(request.frames_at, &response.message)) &&
        simulation_->step(ticks, &response.message);
    simulation_->call([&] {
        response.simulated_time = sphm_muscle_time(simulation_->muscle());
        const ros::Time now = stamp();
        for (const auto &muscle : muscles_) {
            geometry_msgs::WrenchStamped origin, insertion;
            if (!muscle->wrench(SPHM_END_ORIGIN, now, &origin) ||
                !muscle->wrench(SPHM_END_INSERTION, now, &insertion))
                continue;
            response.origin_wrenches.push_back(origin);
            response.insertion_wrenches.push_back(insertion);
        }
    });
    return true;
}

// A duration must be whole ticks: in lock-step a rest would add up.
bool MuscleNode::ticks_of(const Step::Request &request, uint64_t *ticks, std::string *message) const {
    *ticks = request.ticks;
    if (request.duration == 0)
        return true;
    const double exact = request.duration * parameters().rate, whole = std::round(exact);
    if (request.ticks == 0 && whole >= 1 && whole < 1e9 && std::fabs(exact - whole) <= 1e-6 * whole) {
        *ticks = static_cast<uint64_t>(whole);
        return true;
    }
    char text[200];
    std::snprintf(
        text, sizeof text,
        "duration %g s with ticks %u; give ticks alone, or a duration that is a whole number of ticks of "
        "%.9g s (parameter rate)",
        request.duration, request.ticks, 1 / parameters().rate);
    *message = text;
    return false;
}

bool MuscleNode::wait_for_frames(const ros::Time &stamp, std::string *message) const {
    const WallTime end = WallClock::now() + longest_wait_for_frames;
    for (const auto &muscle : muscles_) {
        while (!muscle->frames_known_at(stamp, message)) {
            if (WallClock::now() > end) {
                *message = "waited in vain for the frames at frames_at: " + *message;
                return false;
            }
            ros::WallDuration(0.001).sleep();
        }
    }
    return true;
}

bool MuscleNode::save_snapshot(Snapshot::Request &request, Snapshot::Response &response) {
    const std::string path = full_path(request.path);
    sphm_context context = quiet_context();
    const bool done = simulation_->call([&] {
        response.success = sphm_muscle_save(simulation_->muscle(), path.c_str(), &context) == SPHM_OK;
        response.simulated_time = sphm_muscle_time(simulation_->muscle());
    });
    response.message = !done ? going_down : response.success ? path : context.message;
    return true;
}

bool MuscleNode::load_snapshot(Snapshot::Request &request, Snapshot::Response &response) {
    const std::string path = full_path(request.path);
    sphm_context context = quiet_context();
    const bool done = simulation_->call([&] {
        response.success = sphm_muscle_load(simulation_->muscle(), path.c_str(), &context) == SPHM_OK;
        if (response.success)
            state_replaced(false);
        response.simulated_time = sphm_muscle_time(simulation_->muscle());
    });
    response.message = !done ? going_down : response.success ? path : context.message;
    return true;
}

// Diagnostics ---------------------------------------------------------------------------------------------

void MuscleNode::diagnose_timing(diagnostic_updater::DiagnosticStatusWrapper &status) {
    using diagnostic_msgs::DiagnosticStatus;
    const Health health = simulation_->health();
    if (health.failed || health.paused) {
        status.summary(DiagnosticStatus::OK, health.failed ? "stopped" : "paused");
    } else if (health.real_time_factor >= rtf_that_counts_as_one) {
        status.summary(DiagnosticStatus::OK, "real time");
    } else {
        status.summaryf(DiagnosticStatus::WARN, "slower than real time: factor %.3f",
                        health.real_time_factor);
    }
    status.addf("real-time factor", "%.3f", health.real_time_factor);
    status.addf("tick p99 (ms)", "%.3f", 1e3 * health.tick_p99_s);
    status.addf("step p99 (ms)", "%.3f", 1e3 * health.step_p99_s);
    status.addf("tick period (ms)", "%.3f", 1e3 / parameters().rate);
    status.add("ticks", health.ticks);
    status.add("overruns", health.overruns);
    status.add("overruns since last report", health.overruns - overruns_reported_);
    overruns_reported_ = health.overruns;
}

void MuscleNode::diagnose_state(diagnostic_updater::DiagnosticStatusWrapper &status) {
    using diagnostic_msgs::DiagnosticStatus;
    const Health health = simulation_->health();
    const double drift = health.volume_ratio - 1;
    if (health.failed) {
        status.summary(DiagnosticStatus::ERROR, health.failure);
    } else if (std::fabs(drift) > 0.1) {
        status.summaryf(DiagnosticStatus::WARN, "volume changed by %.1f %%", 100 * drift);
    } else {
        status.summary(DiagnosticStatus::OK, health.ready ? "finite" : "starting up");
    }
    status.add("ready", health.ready);
    status.add("non-finite particles", health.nonfinite);
    status.addf("volume drift", "%.5f", drift);
    status.addf("simulated time (s)", "%.3f", health.simulated_time_s);
    status.add("steps", health.steps);
}

void MuscleNode::diagnose_device(diagnostic_updater::DiagnosticStatusWrapper &status) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, muscles_.front()->device());
    status.add("version", sphm_version());
    status.add("build", sphm_build_configuration());
    status.add("device", muscles_.front()->device());
    int64_t particles = 0;
    for (const auto &muscle : muscles_)
        particles += muscle->parameters().particles;
    status.add("particles", particles);
}

} // namespace sph_muscle
