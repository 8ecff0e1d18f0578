#include "run_node.h"

#include "ros_parameters.h"

#include <ros/ros.h>

#include <cstdio>
#include <cstdlib>
#include <exception>

namespace sph_muscle {
namespace {

// Ends the process once the reason has been said. roscpp's threads are stopped first, and its static objects
// are left alone: destroyed while one of its threads still runs they abort the process, now and then.
[[noreturn]] void give_up() {
    ros::shutdown();
    std::fflush(nullptr);
    std::_Exit(2);
}

} // namespace

int run_node(int argc, char **argv, const char *name,
             const std::function<std::unique_ptr<MuscleNode>()> &make) {
    try {
        ros::init(argc, argv, name); // throws for a node name that is none
        ros::start(); // else the handles of a node that throws take logging down with them, and the reason is
                      // not shown
        const std::unique_ptr<MuscleNode> node = make();
        ros::spin();
    } catch (const Refused &refused) {
        ROS_FATAL("%s", refused.what());
        give_up();
    } catch (const std::exception &exception) { // roscpp's or the standard library's
        ROS_FATAL("the node ends: %s", exception.what());
        give_up();
    }
    return 0;
}

} // namespace sph_muscle
