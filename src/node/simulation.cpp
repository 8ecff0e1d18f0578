#include "simulation.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

namespace sph_muscle {
namespace {

constexpr std::size_t max_queued_commands = 1000;
constexpr auto republish_period = std::chrono::milliseconds(500);
// A start-up phase goes on for so long, of its own time, before commands are looked at; and so often it is
// shown.
constexpr double start_up_slice_s = 4e-3;
constexpr auto start_up_shown_every = std::chrono::milliseconds(100);
// Threads that sleep until the others are there take some 50 us to meet: several muscles meet this seldom, in
// simulated seconds.
constexpr double shortest_shared_slice_s = 4e-3;

} // namespace

Simulation::Simulation(const std::vector<Member> &members, double rate_Hz, decltype(sphm_context::log) log)
    : tick_s_(1 / rate_Hz), schedule_(1 / rate_Hz) {
    for (const Member &member : members) {
        muscles_.emplace_back(member.muscle);
        names_.push_back(member.name);
        sphm_context context{};
        context.log = log;
        contexts_.push_back(context);
    }
}

Simulation::~Simulation() {
    stop();
}

void Simulation::start(Listener listener) {
    listener_ = std::move(listener);
    thread_ = std::thread(&Simulation::run, this);
}

void Simulation::stop() {
    {
        std::lock_guard<std::mutex> lock(mutex_);
        stopping_ = true;
    }
    wake_.notify_all();
    if (thread_.joinable())
        thread_.join();
    // Whoever still waits for an answer sees a broken promise.
    std::lock_guard<std::mutex> lock(mutex_);
    commands_.clear();
    stepping_done_ = nullptr;
}

// Commands ------------------------------------------------------------------------------------------------

bool Simulation::post(Command command) {
    {
        std::lock_guard<std::mutex> lock(mutex_);
        if (stopping_ || commands_.size() >= max_queued_commands)
            return false;
        commands_.push_back(std::move(command));
    }
    wake_.notify_all();
    return true;
}

bool Simulation::call(const Command &command) {
    auto done = std::make_shared<std::promise<void>>();
    std::future<void> answer = done->get_future();
    const bool posted = post([command, done] {
        command();
        done->set_value();
    });
    if (!posted)
        return false;
    done.reset(); // so that a dropped command breaks the promise
    try {
        answer.get();
        return true;
    } catch (const std::future_error &) {
        return false;
    }
}

bool Simulation::step(uint64_t ticks, std::string *message) {
    auto done = std::make_shared<std::promise<std::string>>();
    std::future<std::string> answer = done->get_future();
    const bool posted = post([this, ticks, done] {
        if (failed()) {
            done->set_value("the muscle has stopped (" + failure_ + "); reset it first");
        } else if (!paused_) {
            done->set_value("the muscle is running; pause it first");
        } else if (ticks_to_step_ > 0) {
            done->set_value("another step is under way");
        } else if (ticks == 0) {
            done->set_value("");
        } else {
            ticks_to_step_ = ticks;
            stepping_done_ = [done](const std::string &problem) { done->set_value(problem); };
        }
    });
    *message = "the node is busy or shutting down";
    if (!posted)
        return false;
    done.reset();
    try {
        *message = answer.get();
        return message->empty();
    } catch (const std::future_error &) {
        return false;
    }
}

void Simulation::request_publish() {
    {
        std::lock_guard<std::mutex> lock(mutex_);
        publish_requested_ = true;
    }
    wake_.notify_all();
}

Health Simulation::health() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return health_;
}

// The thread ----------------------------------------------------------------------------------------------

void Simulation::run() {
    schedule_.restart(WallClock::now());
    real_time_factor_.restart(WallClock::now(), sphm_muscle_time(muscle()));
    for (;;) {
        {
            std::lock_guard<std::mutex> lock(mutex_);
            if (stopping_)
                return;
        }
        try {
            run_once();
        } catch (const std::exception &problem) { // out of memory, say; the node and its services stay
            stop_muscle(problem.what());
        }
    }
}

void Simulation::run_once() {
    do_commands();
    if (starting_ && !failed()) {
        start_up();
        return;
    }
    if (!ticking()) {
        rest();
        return;
    }
    if (slices_left_ == 0) {
        if (!wait_until_due())
            return;
        begin_tick();
    }
    advance_slice();
    if (slices_left_ == 0 && !failed())
        end_tick();
}

// Paused or not: a paused muscle is one that is ready for its first tick.
void Simulation::start_up() {
    placed_ = placed_ || listener_.place();
    if (!placed_) {
        wait(std::chrono::milliseconds(10));
    } else if (!advance_all([](sphm_muscle *muscle, sphm_context *context) {
                   return sphm_muscle_start_up(muscle, start_up_slice_s, context);
               })) {
        return;
    }
    starting_ = !placed_ || std::any_of(muscles_.begin(), muscles_.end(),
                                        [](const auto &each) { return sphm_muscle_ready(each.get()) == 0; });
    if (!starting_) {
        schedule_.restart(WallClock::now());
        real_time_factor_.restart(WallClock::now(), sphm_muscle_time(muscle()));
    } else if (WallClock::now() - start_shown_ < start_up_shown_every) {
        return;
    }
    start_shown_ = WallClock::now();
    refresh_health();
    listener_.publish(true);
}

void Simulation::do_commands() {
    std::deque<Command> commands;
    {
        std::lock_guard<std::mutex> lock(mutex_);
        commands.swap(commands_);
    }
    for (Command &command : commands) {
        command();
        command = nullptr;
    }
}

bool Simulation::wait_until_due() {
    if (paused_)
        return true; // stepping does not keep to the wall clock
    std::unique_lock<std::mutex> lock(mutex_);
    return !wake_.wait_until(lock, schedule_.due(), [this] { return stopping_ || !commands_.empty(); });
}

// Nothing moves. What is shown is sent again now and then, and at once to somebody new, so that an rviz
// opened now has a muscle to show. (A latched topic would not do: nothing is published while nobody listens.)
void Simulation::rest() {
    refresh_health();
    if (wait(republish_period))
        listener_.publish(true);
}

// For a command, somebody who wants to see the muscle, or the end of the wait. False: do not publish.
bool Simulation::wait(std::chrono::milliseconds longest) {
    std::unique_lock<std::mutex> lock(mutex_);
    const bool woken = wake_.wait_for(
        lock, longest, [this] { return stopping_ || publish_requested_ || !commands_.empty(); });
    if (stopping_ || (woken && !publish_requested_))
        return false;
    publish_requested_ = false;
    return true;
}

void Simulation::begin_tick() {
    tick_began_ = WallClock::now();
    listener_.prepare(tick_s_);
    const double slices = std::ceil(tick_s_ / slice_at_least() - 1e-9);
    slices_left_ = std::isfinite(slices) && slices > 1 ? static_cast<uint64_t>(std::min(slices, 1e9)) : 1;
    slice_s_ = tick_s_ / static_cast<double>(slices_left_);
}

double Simulation::slice_at_least() const {
    double longest_s = size() > 1 ? shortest_shared_slice_s : 0;
    for (const auto &each : muscles_)
        longest_s = std::max(longest_s, sphm_muscle_time_step(each.get()));
    return longest_s;
}

uint64_t Simulation::most_steps() const {
    uint64_t most = 0;
    for (const auto &each : muscles_)
        most = std::max(most, sphm_muscle_steps(each.get()));
    return most;
}

// `advance` for every muscle. Muscles side by side have one thread each: nested teams are off in OpenMP
// unless somebody asks for them, and results do not depend on the number of threads.
bool Simulation::advance_all(const Advance &advance) {
    const int count = static_cast<int>(size());
    std::vector<sphm_status> statuses(size(), SPHM_OK);
    if (count == 1) {
        statuses[0] = advance(muscle(), &contexts_[0]);
    } else {
#pragma omp parallel for num_threads(count) schedule(static, 1)
        for (int i = 0; i < count; ++i) {
            const auto at = static_cast<std::size_t>(i);
            statuses[at] = advance(muscle(at), &contexts_[at]);
        }
    }
    for (std::size_t i = 0; i < size(); ++i) {
        if (statuses[i] == SPHM_OK)
            continue;
        const char *message = contexts_[i].message;
        stop_muscle((names_[i].empty() ? "" : names_[i] + ": ") +
                    (message[0] != '\0' ? message : sphm_status_name(statuses[i])));
        return false;
    }
    return true;
}

void Simulation::advance_slice() {
    const uint64_t steps = most_steps();
    const WallTime began = WallClock::now();
    const double slice_s = slice_s_;
    if (!advance_all([slice_s](sphm_muscle *muscle, sphm_context *context) {
            return sphm_muscle_advance(muscle, slice_s, context);
        })) {
        listener_.publish(true);
        return;
    }
    const uint64_t taken = most_steps() - steps;
    if (taken > 0)
        step_times_s_.add(seconds(WallClock::now() - began) / static_cast<double>(taken));
    --slices_left_;
}

void Simulation::end_tick() {
    ++ticks_;
    if (ticks_to_step_ > 0) {
        --ticks_to_step_;
        listener_.publish(ticks_to_step_ == 0);
        if (ticks_to_step_ == 0)
            end_stepping("");
    } else {
        real_time_factor_.add(WallClock::now(), sphm_muscle_time(muscle()));
        listener_.publish(false);
        if (schedule_.finish(WallClock::now()))
            ++overruns_;
    }
    tick_times_s_.add(seconds(WallClock::now() - tick_began_));
    if (WallClock::now() - health_refreshed_ > std::chrono::milliseconds(500))
        refresh_health();
}

void Simulation::stop_muscle(const std::string &why) {
    slices_left_ = 0;
    failure_ = why;
    end_stepping("the muscle has stopped: " + failure_);
    refresh_health();
    listener_.failed(failure_);
}

void Simulation::end_stepping(const std::string &problem) {
    ticks_to_step_ = 0;
    if (stepping_done_)
        stepping_done_(problem);
    stepping_done_ = nullptr;
}

void Simulation::set_paused(bool paused) {
    if (paused == paused_ && ticks_to_step_ == 0)
        return;
    end_stepping("interrupted by the service pause");
    paused_ = paused;
    slices_left_ = 0; // the rest of the tick that was under way is dropped
    schedule_.restart(WallClock::now());
    real_time_factor_.restart(WallClock::now(), sphm_muscle_time(muscle()));
    refresh_health();
    listener_.publish(true);
}

void Simulation::state_replaced(bool starts) {
    end_stepping("interrupted by a reset or a restored snapshot");
    failure_.clear();
    slices_left_ = 0;
    starting_ = starts;
    placed_ = !starts;
    schedule_.restart(WallClock::now());
    real_time_factor_.restart(WallClock::now(), sphm_muscle_time(muscle()));
    refresh_health();
    listener_.publish(true);
}

void Simulation::refresh_health() {
    Health fresh;
    for (const auto &each : muscles_) {
        sphm_observation observation{};
        if (paused_ || failed())
            sphm_muscle_observe(each.get(), &observation, nullptr);
        else
            sphm_muscle_glance(each.get(), nullptr, &observation, nullptr); // nobody waits for a GPU
        if (!(std::fabs(observation.volume_ratio - 1) <= std::fabs(fresh.volume_ratio - 1)))
            fresh.volume_ratio = observation.volume_ratio; // the worst
        fresh.nonfinite += observation.nonfinite;
    }
    fresh.ready = ready();
    fresh.paused = paused_;
    fresh.failed = failed();
    fresh.failure = failure_;
    fresh.simulated_time_s = sphm_muscle_time(muscle());
    fresh.real_time_factor = real_time_factor();
    fresh.tick_p99_s = tick_times_s_.percentile(0.99);
    fresh.step_p99_s = step_times_s_.percentile(0.99);
    fresh.ticks = ticks_;
    fresh.overruns = overruns_;
    fresh.steps = most_steps();
    health_refreshed_ = WallClock::now();
    std::lock_guard<std::mutex> lock(mutex_);
    health_ = fresh;
}

} // namespace sph_muscle
