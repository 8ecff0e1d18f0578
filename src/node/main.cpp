// The node: initialise, build, spin. Exit codes: 0 shut down, 2 refused a parameter or a file.
#include "muscle_node.h"

#include <ros/ros.h>

int main(int argc, char **argv) {
    ros::init(argc, argv, "sph_muscle");
    ros::start(); // else the handles of a node that throws take logging down with them, and the reason is not
                  // shown
    try {
        sph_muscle::MuscleNode node;
        ros::spin();
    } catch (const sph_muscle::Refused &refused) {
        ROS_FATAL("%s", refused.what());
        return 2;
    }
    return 0;
}
