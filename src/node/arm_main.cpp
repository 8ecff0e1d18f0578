// The arm: several muscles (~muscles, a list of names) and the hinge they move, in one process on one clock.
#include "arm.h"
#include "ros_parameters.h"
#include "run_node.h"

#include <string>
#include <utility>
#include <vector>

static std::unique_ptr<sph_muscle::MuscleNode> make_arm() {
    std::vector<std::string> names;
    if (!ros::NodeHandle("~").getParam("muscles", names) || names.empty())
        throw sph_muscle::Refused("the private parameter muscles is to be a list of the muscles' names");
    return std::make_unique<sph_muscle::MuscleNode>(names, std::make_unique<sph_muscle::Arm>());
}

int main(int argc, char **argv) {
    return sph_muscle::run_node(argc, argv, "sph_muscle_arm", make_arm);
}
