// The parameter server hands over typed XML-RPC values; the table reads text. So each value is written as it
// would stand in a YAML file and goes the same way as one, with the same checks and the same messages.
#include "ros_parameters.h"

#include "sph_muscle/io.h"

#include <XmlRpcValue.h>

#include <cstdio>
#include <sstream>
#include <vector>

namespace sph_muscle {
namespace {

// Private names that are not rows of the table: `config` is read here, the others elsewhere or by libraries.
const char *const other_names[] = {"config", "diagnostic_period", "muscles", "start_angle"};

bool is_other_name(const std::string &name) {
    for (const char *other : other_names) {
        if (name == other)
            return true;
    }
    return false;
}

std::string real_text(double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", value);
    return text;
}

// Lists are vectors ("[1, 2, 3]") or, for text such as a stimulus schedule, entries joined by ';'.
std::string value_text(XmlRpc::XmlRpcValue &value, const std::string &name, bool is_text) {
    switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean:
        return static_cast<bool>(value) ? "true" : "false";
    case XmlRpc::XmlRpcValue::TypeInt:
        return std::to_string(static_cast<int>(value));
    case XmlRpc::XmlRpcValue::TypeDouble:
        return real_text(static_cast<double>(value));
    case XmlRpc::XmlRpcValue::TypeString:
        return static_cast<std::string>(value);
    case XmlRpc::XmlRpcValue::TypeArray: {
        std::string joined;
        for (int i = 0; i < value.size(); ++i) {
            if (i > 0)
                joined += is_text ? "; " : ", ";
            joined += value_text(value[i], name, is_text);
        }
        return is_text ? joined : "[" + joined + "]";
    }
    default:
        throw Refused("parameter ~" + name + " is neither a number, a text, a boolean nor a list of these");
    }
}

// The names below the node's private namespace, without it.
std::vector<std::string> private_names(const ros::NodeHandle &handle) {
    std::vector<std::string> all, mine;
    handle.getParamNames(all);
    const std::string prefix = handle.getNamespace() + "/";
    for (const std::string &name : all) {
        if (name.compare(0, prefix.size(), prefix) == 0)
            mine.push_back(name.substr(prefix.size()));
    }
    return mine;
}

void check(sphm_status status, const std::string &what, const sphm_context *context) {
    if (status != SPHM_OK)
        throw Refused(what + ": " + context->message);
}

// Where the parameters' file is; empty: none is given. roscpp's getParam for text would take a number or a
// list here for an absent parameter, and the muscle would be another one than was asked for.
std::string config_path(const ros::NodeHandle &handle) {
    XmlRpc::XmlRpcValue value;
    if (!handle.getParam("config", value))
        return "";
    if (value.getType() != XmlRpc::XmlRpcValue::TypeString) {
        std::ostringstream message;
        message << "private parameter " << handle.resolveName("config") << ": " << value
                << " is not a text; the path of a YAML file of parameters is wanted";
        throw Refused(message.str());
    }
    return static_cast<std::string>(value);
}

} // namespace

namespace {

bool below_one_of(const std::vector<std::string> &groups, const std::string &name) {
    for (const std::string &group : groups) {
        if (!group.empty() && name.compare(0, group.size() + 1, group + "/") == 0)
            return true;
    }
    return false;
}

void take_over(const ros::NodeHandle &handle, const std::vector<std::string> &groups,
               sphm_parameters *parameters, sphm_context *context) {
    const std::string config = config_path(handle);
    if (!config.empty()) {
        check(sphm_io_load_parameters(config.c_str(), parameters, context), "~config", context);
    }
    for (const std::string &name : private_names(handle)) {
        if (is_other_name(name) || below_one_of(groups, name))
            continue;
        XmlRpc::XmlRpcValue value;
        if (!handle.getParam(name, value))
            continue; // deleted since it was listed
        const sphm_parameter_info *info = sphm_parameter_find(name.c_str());
        const bool is_text = info != nullptr && info->kind == SPHM_KIND_TEXT;
        // An unknown name goes on to the table as well: its message suggests the nearest one.
        const std::string text = info == nullptr ? "" : value_text(value, name, is_text);
        check(sphm_parameters_set(parameters, name.c_str(), text.c_str(), context),
              "private parameter " + handle.resolveName(name), context);
    }
}

} // namespace

sphm_parameters read_parameters(const ros::NodeHandle &handle, const std::string &group,
                                const std::vector<std::string> &groups, sphm_context *context) {
    sphm_parameters parameters = sphm_parameters_default();
    take_over(handle, groups, &parameters, context);
    if (!group.empty())
        take_over(ros::NodeHandle(handle, group), {}, &parameters, context);
    check(sphm_parameters_check(&parameters, context), "parameters", context);
    return parameters;
}

} // namespace sph_muscle
