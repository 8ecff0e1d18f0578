// The node of one muscle.
#include "run_node.h"

int main(int argc, char **argv) {
    return sph_muscle::run_node(argc, argv, "sph_muscle",
                                [] { return std::make_unique<sph_muscle::MuscleNode>(); });
}
