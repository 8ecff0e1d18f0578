// The node: initialise, build, spin. Exit codes: 0 shut down, 2 refused a parameter or a file, or could not
// go on.
#include "muscle_node.h"

#include <ros/ros.h>

#include <cstdio>
#include <cstdlib>
#include <exception>

// Ends the process once the reason has been said. roscpp's threads are stopped first, and its static objects
// are left alone: destroyed while one of its threads still runs they abort the process, now and then.
[[noreturn]] static void give_up() {
    ros::shutdown();
    std::fflush(nullptr);
    std::_Exit(2);
}

int main(int argc, char **argv) {
    try {
        ros::init(argc, argv, "sph_muscle"); // throws for a node name that is none
        ros::start(); // else the handles of a node that throws take logging down with them, and the reason is
                      // not shown
        sph_muscle::MuscleNode node;
        ros::spin();
    } catch (const sph_muscle::Refused &refused) {
        ROS_FATAL("%s", refused.what());
        give_up();
    } catch (const std::exception &exception) { // roscpp's or the standard library's
        ROS_FATAL("the node ends: %s", exception.what());
        give_up();
    }
    return 0;
}
