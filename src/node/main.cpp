// The node: initialise, build, spin. Exit codes: 0 shut down, 2 refused a parameter or a file.
#include "muscle_node.h"

#include <ros/ros.h>

int main(int argc, char **argv) {
    ros::init(argc, argv, "sph_muscle");
    try {
        sph_muscle::MuscleNode node;
        ros::spin();
    } catch (const sph_muscle::Refused &refused) {
        ROS_FATAL("%s", refused.what());
        return 2;
    }
    return 0;
}
