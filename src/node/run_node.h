// What the programs have in common: initialise, build, spin. Exit codes: 0 shut down, 2 refused a parameter
// or a file, or could not go on.
#ifndef SPH_MUSCLE_NODE_RUN_NODE_H
#define SPH_MUSCLE_NODE_RUN_NODE_H

#include "muscle_node.h"

#include <functional>
#include <memory>

namespace sph_muscle {

int run_node(int argc, char **argv, const char *name,
             const std::function<std::unique_ptr<MuscleNode>()> &make);

} // namespace sph_muscle
#endif
