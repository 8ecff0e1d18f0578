// Private ROS parameters to sphm_parameters: every row of the parameter table may be set as `~name`.
#ifndef SPH_MUSCLE_NODE_ROS_PARAMETERS_H
#define SPH_MUSCLE_NODE_ROS_PARAMETERS_H

#include "sph_muscle/parameters.h"

#include <ros/node_handle.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace sph_muscle {

// What the user gave cannot be used; what() names the value and what would be valid.
class Refused : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

// Defaults, overridden by the YAML file `~config` names, overridden by the private parameters. With a `group`
// these hold for all groups of the node, and are overridden by the same below `~GROUP/`; `groups` are all
// there are. Throws Refused on an unknown name, a wrong type or a value out of range.
sphm_parameters read_parameters(const ros::NodeHandle &private_handle, const std::string &group,
                                const std::vector<std::string> &groups, sphm_context *context);

} // namespace sph_muscle
#endif
