#include "muscle_node.h"

#include "sph_muscle/io.h"

#include <geometry_msgs/WrenchStamped.h>

#include <cmath>
#include <cstdlib>

namespace sph_muscle {
namespace {

void log_to_ros(sphm_log_level level, const char *text, void *) {
    if (level == SPHM_LOG_WARNING) {
        ROS_WARN("%s", text);
    } else {
        ROS_INFO("%s", text);
    }
}

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

constexpr auto warning_period = std::chrono::seconds(2);
constexpr auto markers_period = std::chrono::milliseconds(100);
constexpr double rtf_that_counts_as_one = 0.98;
constexpr const char *going_down = "the node is busy or shutting down; nothing was done";

} // namespace

// Set-up --------------------------------------------------------------------------------------------------

// Delegates, so that the object counts as constructed and the destructor also ends a node that was refused
// half way, with the simulation already running.
MuscleNode::MuscleNode() : MuscleNode(quiet_context()) {
    context_.log = log_to_ros;
    parameters_ = read_parameters(private_handle_, &context_);
    create_simulation();
    listen_to_frames();
    advertise();
    Simulation::Listener listener;
    listener.prepare = [this](double tick_s) { follow_frames(tick_s); };
    listener.publish = [this](bool all) { publish(all); };
    listener.failed = [](const std::string &why) {
        ROS_ERROR("the muscle has stopped: %s. The service reset brings it back.", why.c_str());
    };
    simulation_->start(listener);
    advertise_services();
    start_diagnostics();
}

MuscleNode::~MuscleNode() {
    if (simulation_)
        simulation_->stop(); // first, so that nobody waits for it any more
    if (service_spinner_)
        service_spinner_->stop();
}

void MuscleNode::create_simulation() {
    ROS_INFO("sph_muscle %s (%s)", sphm_version(), sphm_build_configuration());
    sphm_muscle *muscle = nullptr;
    if (sphm_io_create_muscle(&parameters_, &muscle, &context_) != SPHM_OK) {
        throw Refused(std::string("cannot make the muscle: ") + context_.message);
    }
    simulation_ = std::make_unique<Simulation>(muscle, parameters_.rate, &context_);
    device_ = sphm_muscle_device(muscle);
    colours_ = std::make_unique<ColourRange>(parameters_.surface_field, parameters_.surface_field_min,
                                             parameters_.surface_field_max);
    const sphm_body *body = sphm_muscle_body(muscle);
    ROS_INFO("%zu particles, %.2f mm apart, length %.1f mm, time step %.3g ms, on %s, %g ticks/s",
             body->count, 1e3 * body->spacing_m, 1e3 * body->length_m, 1e3 * sphm_muscle_time_step(muscle),
             device_.c_str(), parameters_.rate);
}

void MuscleNode::listen_to_frames() {
    ends_ = std::make_unique<EndFrames>(parameters_, frames_);
    if (!ends_->any())
        return;
    if (parameters_.tissue != SPHM_TISSUE_SOLID)
        throw Refused("origin_frame and insertion_frame need tissue: solid, whose ends can be moved");
    frames_listener_ = std::make_unique<tf2_ros::TransformListener>(frames_, handle_);
}

void MuscleNode::advertise() {
    const ros::SubscriberStatusCallback greet = [this](const ros::SingleSubscriberPublisher &) {
        simulation_->request_publish();
    };
    particles_ = handle_.advertise<sensor_msgs::PointCloud2>("particles", 2, greet);
    surface_ = handle_.advertise<visualization_msgs::Marker>("surface", 2, greet);
    markers_ = handle_.advertise<visualization_msgs::MarkerArray>("markers", 2, greet);
    state_ = handle_.advertise<MuscleState>("state", 10, greet);
    if (parameters_.tissue == SPHM_TISSUE_SOLID) {
        wrenches_[SPHM_END_ORIGIN] =
            handle_.advertise<geometry_msgs::WrenchStamped>("origin_wrench", 10, greet);
        wrenches_[SPHM_END_INSERTION] =
            handle_.advertise<geometry_msgs::WrenchStamped>("insertion_wrench", 10, greet);
    }
    const auto prompt = ros::TransportHints().tcpNoDelay();
    stimulus_ = handle_.subscribe("stimulus", 100, &MuscleNode::on_stimulus, this, prompt);
    stimulus_command_ =
        handle_.subscribe("stimulus_command", 100, &MuscleNode::on_stimulus_command, this, prompt);
    external_force_ = handle_.subscribe("external_force", 100, &MuscleNode::on_external_force, this, prompt);
    activation_command_ =
        handle_.subscribe("activation_command", 100, &MuscleNode::on_activation_command, this, prompt);
}

// Services wait for the simulation, so they have threads of their own: two, for reset must get through while
// a long step is under way.
void MuscleNode::advertise_services() {
    service_handle_.setCallbackQueue(&service_queue_);
    services_ = {service_handle_.advertiseService("reset", &MuscleNode::reset, this),
                 service_handle_.advertiseService("pause", &MuscleNode::pause, this),
                 service_handle_.advertiseService("step", &MuscleNode::step, this),
                 service_handle_.advertiseService("save_snapshot", &MuscleNode::save_snapshot, this),
                 service_handle_.advertiseService("load_snapshot", &MuscleNode::load_snapshot, this)};
    service_spinner_ = std::make_unique<ros::AsyncSpinner>(2, &service_queue_);
    service_spinner_->start();
}

void MuscleNode::start_diagnostics() {
    updater_ = std::make_unique<diagnostic_updater::Updater>(handle_, private_handle_);
    updater_->setHardwareID(device_);
    updater_->add("Timing", this, &MuscleNode::diagnose_timing);
    updater_->add("State", this, &MuscleNode::diagnose_state);
    updater_->add("Device", this, &MuscleNode::diagnose_device);
    // A wall timer: the updater's own pace follows ROS time, which may stand still or jump back.
    diagnostics_timer_ = handle_.createWallTimer(
        ros::WallDuration(1), [this](const ros::WallTimerEvent &) { updater_->force_update(); });
}

// Topics in -----------------------------------------------------------------------------------------------

void MuscleNode::on_stimulus(const std_msgs::Float64 &message) {
    queue("stimulus", [message](sphm_muscle *muscle, sphm_context *context) {
        return sphm_muscle_stimulate(muscle, nullptr, message.data, 0, context);
    });
}

void MuscleNode::on_stimulus_command(const StimulusCommand &message) {
    queue("stimulus_command", [message](sphm_muscle *muscle, sphm_context *context) {
        const char *electrode = message.electrode.empty() ? nullptr : message.electrode.c_str();
        return sphm_muscle_stimulate(muscle, electrode, message.current_ua_per_mm2, message.duration,
                                     context);
    });
}

void MuscleNode::on_external_force(const ExternalForce &message) {
    queue("external_force", [message](sphm_muscle *muscle, sphm_context *context) {
        const double point_m[3] = {message.point.x, message.point.y, message.point.z};
        const double force_N[3] = {message.force.x, message.force.y, message.force.z};
        return sphm_muscle_apply_force(muscle, point_m, force_N, message.radius, message.duration, context);
    });
}

void MuscleNode::on_activation_command(const std_msgs::Float64 &message) {
    queue("activation_command", [message](sphm_muscle *muscle, sphm_context *context) {
        return sphm_muscle_activate(muscle, message.data, 0, context);
    });
}

void MuscleNode::queue(const char *topic, const Attempt &attempt) {
    const std::string name = handle_.resolveName(topic);
    const bool queued = simulation_->post([this, name, attempt] {
        sphm_context context = quiet_context();
        if (attempt(simulation_->muscle(), &context) != SPHM_OK)
            warn(name, std::string("message dropped: ") + context.message);
    });
    if (!queued)
        ROS_WARN_THROTTLE(2, "%s: dropped, commands come faster than the muscle steps", name.c_str());
}

// Throttled by the wall clock: ROS time may stand still or jump back.
void MuscleNode::warn(const std::string &what, const std::string &text) {
    const WallTime now = WallClock::now();
    const auto last = warned_.find(what);
    if (last != warned_.end() && now - last->second < warning_period)
        return;
    warned_[what] = now;
    ROS_WARN("%s: %s", what.c_str(), text.c_str());
}

// After a reset or a restored snapshot; on the simulation's thread.
void MuscleNode::state_replaced() {
    ends_->restart();
    simulation_->state_replaced();
}

// tf ------------------------------------------------------------------------------------------------------

void MuscleNode::follow_frames(double tick_s) {
    if (!ends_->any())
        return;
    ends_->follow(simulation_->muscle(), tick_s, ros::Time::now());
    const std::string frames[SPHM_END_COUNT] = {parameters_.origin_frame, parameters_.insertion_frame};
    const char *const names[SPHM_END_COUNT] = {"origin", "insertion"};
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        if (!ends_->problem(end).empty())
            warn("the " + std::string(names[end]) + " holds its pose, it cannot follow the tf frame '" +
                     frames[end] + "'",
                 ends_->problem(end));
    }
}

// Services ------------------------------------------------------------------------------------------------

bool MuscleNode::reset(std_srvs::Trigger::Request &, std_srvs::Trigger::Response &response) {
    sphm_context context = quiet_context();
    const bool done = simulation_->call([&] {
        response.success = sphm_muscle_reset(simulation_->muscle(), &context) == SPHM_OK;
        if (response.success)
            state_replaced();
    });
    response.message = !done ? going_down : response.success ? "at rest, time 0" : context.message;
    return true;
}

bool MuscleNode::pause(std_srvs::SetBool::Request &request, std_srvs::SetBool::Response &response) {
    const bool pause = request.data;
    response.success = simulation_->call([&] { simulation_->set_paused(pause); });
    response.message = !response.success ? going_down : pause ? "paused" : "running";
    return true;
}

bool MuscleNode::step(Step::Request &request, Step::Response &response) {
    response.success = simulation_->step(request.ticks, &response.message);
    simulation_->call([&] { response.simulated_time = sphm_muscle_time(simulation_->muscle()); });
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
            state_replaced();
        response.simulated_time = sphm_muscle_time(simulation_->muscle());
    });
    response.message = !done ? going_down : response.success ? path : context.message;
    return true;
}

// Topics out: only what somebody listens to ---------------------------------------------------------------

void MuscleNode::publish(bool all) {
    std_msgs::Header header;
    header.stamp = ros::Time::now();
    header.frame_id = parameters_.frame_id;
    const WallTime now = WallClock::now();
    // Arrows and text need not come at the full rate, and rviz pays for each of them.
    const bool with_markers =
        markers_.getNumSubscribers() > 0 && (all || now - markers_published_ >= markers_period);
    MuscleState state;
    if (state_.getNumSubscribers() > 0 || with_markers) {
        if (observe(header, &state) && state_.getNumSubscribers() > 0)
            state_.publish(state);
    }
    if (particles_.getNumSubscribers() > 0 || with_markers) {
        sphm_particles particles{};
        sphm_context context = quiet_context();
        if (sphm_muscle_particles(simulation_->muscle(), &particles, &context) != SPHM_OK) {
            warn(particles_.getTopic(), context.message);
        } else {
            if (particles_.getNumSubscribers() > 0) {
                sensor_msgs::PointCloud2 cloud;
                cloud.header = header;
                fill_cloud(particles, &cloud);
                particles_.publish(cloud);
            }
            if (with_markers) {
                markers_.publish(make_markers(simulation_->muscle(), particles, state));
                markers_published_ = now;
            }
        }
    }
    if (surface_.getNumSubscribers() > 0)
        publish_surface(header);
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        if (wrenches_[end].getNumSubscribers() > 0)
            publish_wrench(end, header);
    }
}

bool MuscleNode::observe(const std_msgs::Header &header, MuscleState *state) {
    sphm_observation observation{};
    sphm_context context = quiet_context();
    state->header = header;
    const sphm_status status = sphm_muscle_observe(simulation_->muscle(), &observation, &context);
    if (status > SPHM_OK) {
        warn(state_.getTopic(), context.message);
        return false;
    }
    fill_state(observation, state);
    state->paused = simulation_->paused();
    state->origin_following = ends_->following(SPHM_END_ORIGIN);
    state->insertion_following = ends_->following(SPHM_END_INSERTION);
    state->failed = simulation_->failed();
    state->real_time_factor = simulation_->real_time_factor();
    state->steps = sphm_muscle_steps(simulation_->muscle());
    return true;
}

void MuscleNode::publish_surface(const std_msgs::Header &header) {
    sphm_skin skin{};
    sphm_context context = quiet_context();
    if (sphm_muscle_skin(simulation_->muscle(), parameters_.surface_field, &skin, &context) != SPHM_OK) {
        warn(surface_.getTopic(), context.message);
        return;
    }
    colours_->follow(skin.field, skin.vertex_count);
    visualization_msgs::Marker marker;
    marker.header = header;
    fill_surface(skin, *colours_, &marker);
    surface_.publish(marker);
}

void MuscleNode::publish_wrench(int end, const std_msgs::Header &header) {
    sphm_wrench wrench{};
    sphm_context context = quiet_context();
    if (sphm_muscle_wrench(simulation_->muscle(), end, &wrench, &context) != SPHM_OK) {
        warn(wrenches_[end].getTopic(), context.message);
        return;
    }
    geometry_msgs::WrenchStamped message;
    message.header.stamp = header.stamp;
    message.header.frame_id = ends_->express(simulation_->muscle(), end, &wrench);
    fill_wrench(wrench, &message.wrench);
    wrenches_[end].publish(message);
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
    status.addf("tick period (ms)", "%.3f", 1e3 / parameters_.rate);
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
        status.summary(DiagnosticStatus::OK, "finite");
    }
    status.add("non-finite particles", health.nonfinite);
    status.addf("volume drift", "%.5f", drift);
    status.addf("simulated time (s)", "%.3f", health.simulated_time_s);
    status.add("steps", health.steps);
}

void MuscleNode::diagnose_device(diagnostic_updater::DiagnosticStatusWrapper &status) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, device_);
    status.add("version", sphm_version());
    status.add("build", sphm_build_configuration());
    status.add("device", device_);
    status.add("particles", parameters_.particles);
}

} // namespace sph_muscle
