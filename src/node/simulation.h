// The muscles of a node, most often one, on a thread of their own and one clock.
//
// The thread advances them in ticks of 1/rate simulated seconds, each cut into slices of about one
// integration step, and between slices does what others have queued. So nobody waits for a whole tick, and
// the muscles belong to one thread. Several muscles advance side by side, one processor each, and meet after
// every slice. Which slices a tick has depends on the muscles alone, never on the wall
// clock: two runs with the same commands at the same simulated times are alike.
#ifndef SPH_MUSCLE_NODE_SIMULATION_H
#define SPH_MUSCLE_NODE_SIMULATION_H

#include "pace.h"

#include "sph_muscle/muscle.h"

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace sph_muscle {

// A copy of what the thread knows about itself; for diagnostics.
struct Health {
    bool ready = false, paused = false, failed = false;
    std::string failure;
    double simulated_time_s = 0, real_time_factor = 0, tick_p99_s = 0, step_p99_s = 0, volume_ratio = 1;
    uint64_t ticks = 0, overruns = 0, steps = 0, nonfinite = 0;
};

class Simulation {
  public:
    using Command = std::function<void()>;
    struct Listener {
        // Before the muscles' start-up phases: puts their ends where they start. False: ask again soon.
        std::function<bool()> place;
        std::function<void(double tick_s)> prepare; // before a tick
        std::function<void(bool all)> publish;      // after a tick; all: publish even what is thinned out
        std::function<void(const std::string &)> failed; // the muscles stopped, and why
    };

    struct Member {
        std::string name; // for messages; may be empty
        sphm_muscle *muscle;
    };

    // Takes over the muscles, at least one. `log` is that of their contexts.
    Simulation(const std::vector<Member> &members, double rate_Hz, decltype(sphm_context::log) log);
    ~Simulation();
    void start(Listener listener);
    void stop();

    // From any thread -----------------------------------------------------------------------------------
    // Queues a command for the thread. False when it is full: commands came faster than slices end.
    bool post(Command command);
    // Queues it and waits until it is done. False when the simulation stops before that.
    bool call(const Command &command);
    // Runs `ticks` ticks of a paused muscle and waits for them. False with a message when refused,
    // interrupted by reset, restore or resume, or when the muscle failed.
    bool step(uint64_t ticks, std::string *message);
    void request_publish(); // for a listener that came while nothing moves
    Health health() const;

    // On the thread, that is inside commands and the listener -------------------------------------------
    std::size_t size() const { return muscles_.size(); }
    sphm_muscle *muscle(std::size_t index = 0) const { return muscles_[index].get(); }
    // Simulated time since the start, in whole ticks. Unlike the muscles' own it never goes back.
    double clock_s() const { return static_cast<double>(ticks_) * tick_s_; }
    bool ready() const { return !starting_; } // the start-up phases are over
    bool paused() const { return paused_; }
    bool failed() const { return !failure_.empty(); }
    double real_time_factor() const { return paused_ || failed() ? 0 : real_time_factor_.value(); }
    void set_paused(bool paused);
    // After a reset (starts: the start-up phases begin again) or a restored snapshot: healthy again, a new
    // tick begins.
    void state_replaced(bool starts);

  private:
    struct DestroyMuscle {
        void operator()(sphm_muscle *muscle) const { sphm_muscle_destroy(muscle); }
    };

    void run();
    void run_once();
    void do_commands();
    void start_up();
    bool wait(std::chrono::milliseconds longest);
    bool ticking() const { return !failed() && (!paused_ || ticks_to_step_ > 0); }
    bool wait_until_due(); // false if woken early
    void rest();
    void begin_tick();
    double slice_at_least() const;
    void advance_slice();
    using Advance = std::function<sphm_status(sphm_muscle *, sphm_context *)>;
    bool advance_all(const Advance &advance);
    uint64_t most_steps() const;
    void end_tick();
    void stop_muscle(const std::string &why); // until it is reset or restored
    void end_stepping(const std::string &problem);
    void refresh_health();

    std::vector<std::unique_ptr<sphm_muscle, DestroyMuscle>> muscles_;
    std::vector<std::string> names_;
    std::vector<sphm_context> contexts_; // one for each muscle
    const double tick_s_;
    Listener listener_;
    std::thread thread_;

    mutable std::mutex mutex_; // guards the next five
    std::condition_variable wake_;
    std::deque<Command> commands_;
    bool stopping_ = false, publish_requested_ = false;
    Health health_;

    // The thread's own.
    bool starting_ = true, placed_ = false, paused_ = false;
    std::string failure_;
    uint64_t ticks_to_step_ = 0, slices_left_ = 0, ticks_ = 0, overruns_ = 0;
    double slice_s_ = 0;
    std::function<void(const std::string &)> stepping_done_;
    WallTime tick_began_, health_refreshed_, start_shown_;
    Schedule schedule_;
    RealTimeFactor real_time_factor_;
    RecentValues tick_times_s_{600}, step_times_s_{2000};
};

} // namespace sph_muscle
#endif
