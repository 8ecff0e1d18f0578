#include "muscle_topics.h"

#include "ros_parameters.h"

#include "sph_muscle/io.h"

#include <cstdio>

namespace sph_muscle {
namespace {

constexpr auto warning_period = std::chrono::seconds(2);
constexpr double attaching_s = 0.02; // simulated time in which an end that is attached comes to rest
constexpr auto markers_period = std::chrono::milliseconds(100);

sphm_context quiet_context() {
    sphm_context context{};
    return context;
}

// The end a message names; -1: none is called that.
int end_named(const std::string &name) {
    return name == "origin" ? SPHM_END_ORIGIN : name == "insertion" ? SPHM_END_INSERTION : -1;
}

sphm_status refuse_end(const std::string &name, sphm_context *context) {
    std::snprintf(context->message, sizeof context->message,
                  "there is no end '%.60s'; there are origin and insertion", name.c_str());
    return SPHM_REFUSED_ARGUMENT;
}

ros::NodeHandle handle_of(const std::string &name) {
    return name.empty() ? ros::NodeHandle() : ros::NodeHandle(name);
}

} // namespace

void log_to_ros(sphm_log_level level, const char *text, void *) {
    if (level == SPHM_LOG_WARNING) {
        ROS_WARN("%s", text);
    } else {
        ROS_INFO("%s", text);
    }
}

// Set-up --------------------------------------------------------------------------------------------------

MuscleTopics::MuscleTopics(const std::string &name, const std::vector<std::string> &names,
                           const tf2::BufferCore &frames)
    : name_(name), handle_(handle_of(name)),
      parameters_(read_parameters(ros::NodeHandle("~"), name, names, &context_)), ends_(parameters_, frames),
      colours_(parameters_.surface_field, parameters_.surface_field_min, parameters_.surface_field_max) {
    if (ends_.any() && parameters_.tissue != SPHM_TISSUE_SOLID)
        throw Refused("origin_frame and insertion_frame need tissue: solid, whose ends can be moved");
    create_muscle();
}

void MuscleTopics::create_muscle() {
    context_.log = log_to_ros;
    sphm_muscle *muscle = nullptr;
    if (sphm_io_create_muscle(&parameters_, &muscle, &context_) != SPHM_OK)
        throw Refused(std::string("cannot make the muscle: ") + context_.message);
    made_.reset(muscle);
    device_ = sphm_muscle_device(muscle);
    const sphm_body *body = sphm_muscle_body(muscle);
    ROS_INFO("%s%zu particles, %.2f mm apart, length %.1f mm, time step %.3g ms, on %s, %g ticks/s",
             name_.empty() ? "" : (name_ + ": ").c_str(), body->count, 1e3 * body->spacing_m,
             1e3 * body->length_m, 1e3 * sphm_muscle_time_step(muscle), device_.c_str(), parameters_.rate);
}

Simulation::Member MuscleTopics::hand_over() {
    return {name_, made_.release()};
}

void MuscleTopics::connect(Simulation *simulation, std::size_t index) {
    simulation_ = simulation;
    index_ = index;
    advertise();
    subscribe();
}

void MuscleTopics::advertise() {
    const ros::SubscriberStatusCallback greet = [this](const ros::SingleSubscriberPublisher &) {
        simulation_->request_publish();
    };
    particles_ = handle_.advertise<sensor_msgs::PointCloud2>("particles", 2, greet);
    surface_ = handle_.advertise<visualization_msgs::Marker>("surface", 2, greet);
    markers_ = handle_.advertise<visualization_msgs::MarkerArray>("markers", 2, greet);
    state_ = handle_.advertise<MuscleState>("state", 10, greet);
    if (parameters_.tissue != SPHM_TISSUE_SOLID)
        return;
    wrenches_[SPHM_END_ORIGIN] = handle_.advertise<geometry_msgs::WrenchStamped>("origin_wrench", 10, greet);
    wrenches_[SPHM_END_INSERTION] =
        handle_.advertise<geometry_msgs::WrenchStamped>("insertion_wrench", 10, greet);
}

void MuscleTopics::subscribe() {
    const auto prompt = ros::TransportHints().tcpNoDelay();
    stimulus_ = handle_.subscribe("stimulus", 100, &MuscleTopics::on_stimulus, this, prompt);
    stimulus_command_ =
        handle_.subscribe("stimulus_command", 100, &MuscleTopics::on_stimulus_command, this, prompt);
    external_force_ =
        handle_.subscribe("external_force", 100, &MuscleTopics::on_external_force, this, prompt);
    activation_command_ =
        handle_.subscribe("activation_command", 100, &MuscleTopics::on_activation_command, this, prompt);
    load_ = handle_.subscribe("load", 100, &MuscleTopics::on_load, this, prompt);
}

std::vector<ros::ServiceServer> MuscleTopics::advertise_services(const ros::NodeHandle &queued) {
    if (parameters_.tissue != SPHM_TISSUE_SOLID)
        return {};
    ros::NodeHandle handle(queued, name_);
    return {handle.advertiseService("attach", &MuscleTopics::attach, this),
            handle.advertiseService("release", &MuscleTopics::release, this)};
}

// Topics in -----------------------------------------------------------------------------------------------

void MuscleTopics::on_stimulus(const std_msgs::Float64 &message) {
    queue("stimulus", [message](sphm_muscle *muscle, sphm_context *context) {
        return sphm_muscle_stimulate(muscle, nullptr, message.data, 0, context);
    });
}

void MuscleTopics::on_stimulus_command(const StimulusCommand &message) {
    queue("stimulus_command", [message](sphm_muscle *muscle, sphm_context *context) {
        const char *electrode = message.electrode.empty() ? nullptr : message.electrode.c_str();
        return sphm_muscle_stimulate(muscle, electrode, message.current_ua_per_mm2, message.duration,
                                     context);
    });
}

void MuscleTopics::on_external_force(const ExternalForce &message) {
    queue("external_force", [message](sphm_muscle *muscle, sphm_context *context) {
        const double point_m[3] = {message.point.x, message.point.y, message.point.z};
        const double force_N[3] = {message.force.x, message.force.y, message.force.z};
        return sphm_muscle_apply_force(muscle, point_m, force_N, message.radius, message.duration, context);
    });
}

void MuscleTopics::on_activation_command(const std_msgs::Float64 &message) {
    queue("activation_command", [message](sphm_muscle *muscle, sphm_context *context) {
        return sphm_muscle_activate(muscle, message.data, 0, context);
    });
}

void MuscleTopics::on_load(const EndLoad &message) {
    queue("load", [message](sphm_muscle *muscle, sphm_context *context) {
        const int end = end_named(message.end);
        if (end < 0)
            return refuse_end(message.end, context);
        if (message.slide)
            return sphm_muscle_slide_end(muscle, end, message.pull, context);
        const double force_N[3] = {message.force.x, message.force.y, message.force.z};
        return sphm_muscle_set_end_load(muscle, end, force_N, context);
    });
}

void MuscleTopics::queue(const char *topic, const Attempt &attempt) {
    const std::string name = handle_.resolveName(topic);
    const bool queued = simulation_->post([this, name, attempt] {
        sphm_context context = quiet_context();
        if (attempt(muscle(), &context) != SPHM_OK)
            warn(name, std::string("message dropped: ") + context.message);
    });
    if (!queued)
        ROS_WARN_THROTTLE(2, "%s: dropped, commands come faster than the muscle steps", name.c_str());
}

// Throttled by the wall clock: ROS time may stand still or jump back.
void MuscleTopics::warn(const std::string &what, const std::string &text) {
    const WallTime now = WallClock::now();
    const auto last = warned_.find(what);
    if (last != warned_.end() && now - last->second < warning_period)
        return;
    warned_[what] = now;
    ROS_WARN("%s: %s", what.c_str(), text.c_str());
}

// Services ------------------------------------------------------------------------------------------------

bool MuscleTopics::call(const End::Request &request, End::Response *response, const char *done,
                        const EndAttempt &attempt) {
    sphm_context context = quiet_context();
    const int end = end_named(request.end);
    sphm_status status = end < 0 ? refuse_end(request.end, &context) : SPHM_OK;
    if (status == SPHM_OK && !simulation_->call([&] { status = attempt(muscle(), end, &context); })) {
        response->message = "the node is busy or shutting down; nothing was done";
        return true;
    }
    response->success = status == SPHM_OK;
    response->message = response->success ? done : context.message;
    return true;
}

bool MuscleTopics::attach(End::Request &request, End::Response &response) {
    return call(request, &response, "held where it is",
                [this](sphm_muscle *muscle, int end, sphm_context *context) {
                    sphm_end_pose here{};
                    sphm_status status = sphm_muscle_end_pose(muscle, end, &here, context);
                    for (int d = 0; d < 3; ++d) // it comes to rest
                        here.velocity_m_per_s[d] = here.angular_velocity_rad_per_s[d] = 0;
                    if (status == SPHM_OK)
                        status = sphm_muscle_set_end_pose(muscle, end, &here, attaching_s, context);
                    if (status == SPHM_OK)
                        ends_.recapture(end);
                    return status;
                });
}

bool MuscleTopics::release(End::Request &request, End::Response &response) {
    return call(request, &response, "free", [](sphm_muscle *muscle, int end, sphm_context *context) {
        return sphm_muscle_release_end(muscle, end, context);
    });
}

// tf ------------------------------------------------------------------------------------------------------

bool MuscleTopics::frames_known_at(const ros::Time &stamp, std::string *why) const {
    return ends_.known_at(stamp, why);
}

bool MuscleTopics::place(const ros::Time &now) {
    return !ends_.any() || ends_.place(muscle(), now);
}

void MuscleTopics::follow(double tick_s, const ros::Time &now) {
    if (!ends_.any())
        return;
    ends_.follow(muscle(), tick_s, now);
    warn_of_ends();
}

void MuscleTopics::warn_of_ends() {
    const char *const names[SPHM_END_COUNT] = {"origin", "insertion"};
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        if (!ends_.problem(end).empty())
            warn((name_.empty() ? "the " : name_ + ": the ") + names[end] +
                     " holds its pose, it cannot follow the tf frame '" + ends_.frame(end) + "'",
                 ends_.problem(end));
    }
}

// Topics out: only what somebody listens to ---------------------------------------------------------------

bool MuscleTopics::wrench(int end, const ros::Time &stamp, geometry_msgs::WrenchStamped *message) {
    sphm_wrench wrench{};
    if (sphm_muscle_wrench(muscle(), end, &wrench, nullptr) != SPHM_OK)
        return false;
    message->header.stamp = stamp;
    message->header.frame_id = ends_.express(muscle(), end, &wrench);
    fill_wrench(wrench, &message->wrench);
    return true;
}

void MuscleTopics::publish_wrenches(const ros::Time &stamp) {
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        geometry_msgs::WrenchStamped message;
        if (wrenches_[end].getNumSubscribers() > 0 && wrench(end, stamp, &message))
            wrenches_[end].publish(message);
    }
}

// While it runs, the last look that has finished: a GPU is not waited for. What stands still is shown as it
// is.
sphm_status MuscleTopics::look(bool late, sphm_particles *particles, sphm_observation *observation,
                               sphm_context *context) {
    if (late)
        return sphm_muscle_glance(muscle(), particles, observation, context);
    sphm_status status = SPHM_OK;
    if (observation != nullptr)
        status = sphm_muscle_observe(muscle(), observation, context);
    if (status == SPHM_OK && particles != nullptr)
        status = sphm_muscle_particles(muscle(), particles, context);
    return status;
}

std_msgs::Header MuscleTopics::header(const ros::Time &stamp, bool late) {
    std_msgs::Header header;
    const double age_s = late ? sphm_muscle_time(muscle()) - sphm_muscle_glance_time(muscle()) : 0;
    header.stamp = age_s > 0 && age_s < stamp.toSec() ? stamp - ros::Duration(age_s) : stamp;
    header.frame_id = parameters_.frame_id;
    return header;
}

void MuscleTopics::publish(const ros::Time &stamp, bool all) {
    const WallTime now = WallClock::now();
    // Arrows and text need not come at the full rate, and rviz pays for each of them.
    const bool with_markers =
        markers_.getNumSubscribers() > 0 && (all || now - markers_published_ >= markers_period);
    const bool with_state = state_.getNumSubscribers() > 0 || with_markers;
    const bool with_particles = particles_.getNumSubscribers() > 0 || with_markers;
    if (with_state || with_particles) {
        sphm_particles particles{};
        sphm_observation observation{};
        sphm_context context = quiet_context();
        const sphm_status status =
            look(!all, with_particles ? &particles : nullptr, with_state ? &observation : nullptr, &context);
        if (status > SPHM_OK) {
            warn((with_state ? state_ : particles_).getTopic(), context.message);
            return;
        }
        MuscleState state;
        state.header = header(stamp, !all);
        if (with_state)
            describe(observation, &state);
        if (state_.getNumSubscribers() > 0)
            state_.publish(state);
        if (particles_.getNumSubscribers() > 0) {
            sensor_msgs::PointCloud2 cloud;
            cloud.header = state.header;
            fill_cloud(particles, &cloud);
            particles_.publish(cloud);
        }
        if (with_markers) {
            markers_.publish(make_markers(muscle(), particles, state));
            markers_published_ = now;
        }
    }
    if (surface_.getNumSubscribers() > 0)
        publish_surface(stamp, !all);
}

uint8_t MuscleTopics::condition(int end) const {
    const int condition = sphm_muscle_end_condition(muscle(), end, nullptr);
    return condition < 0 ? 0 : static_cast<uint8_t>(condition); // the fluid's ends are held
}

void MuscleTopics::describe(const sphm_observation &observation, MuscleState *state) {
    fill_state(observation, state);
    state->ready = simulation_->ready();
    state->paused = simulation_->paused();
    state->origin_following = ends_.following(SPHM_END_ORIGIN);
    state->insertion_following = ends_.following(SPHM_END_INSERTION);
    state->origin_condition = condition(SPHM_END_ORIGIN);
    state->insertion_condition = condition(SPHM_END_INSERTION);
    state->mass_scaling = parameters_.mass_scaling;
    state->failed = simulation_->failed();
    state->real_time_factor = simulation_->real_time_factor();
    state->steps = sphm_muscle_steps(muscle());
}

void MuscleTopics::publish_surface(const ros::Time &stamp, bool late) {
    sphm_skin skin{};
    sphm_context context = quiet_context();
    const auto get = late ? sphm_muscle_glance_skin : sphm_muscle_skin;
    if (get(muscle(), parameters_.surface_field, &skin, &context) != SPHM_OK) {
        warn(surface_.getTopic(), context.message);
        return;
    }
    colours_.follow(skin.field, skin.vertex_count);
    visualization_msgs::Marker marker;
    marker.header = header(stamp, late);
    fill_surface(skin, colours_, &marker);
    surface_.publish(marker);
}

} // namespace sph_muscle
