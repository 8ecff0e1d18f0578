#include "messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>

namespace sph_muscle {
namespace {

using visualization_msgs::Marker;

std_msgs::ColorRGBA colour(float r, float g, float b, float a) {
    std_msgs::ColorRGBA c;
    c.r = r;
    c.g = g;
    c.b = b;
    c.a = a;
    return c;
}

geometry_msgs::Point point(double x, double y, double z) {
    geometry_msgs::Point p;
    p.x = x;
    p.y = y;
    p.z = z;
    return p;
}

geometry_msgs::Point point(const float *p) {
    return point(static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2]));
}

Marker new_marker(const char *space, int id, int type, const std_msgs::Header &header) {
    Marker marker;
    marker.header = header;
    marker.ns = space;
    marker.id = id;
    marker.type = type;
    marker.action = Marker::ADD;
    marker.pose.orientation.w = 1;
    marker.color = colour(1, 1, 1, 1);
    return marker;
}

void set_scale(Marker *marker, double x, double y, double z) {
    marker->scale.x = x;
    marker->scale.y = y;
    marker->scale.z = z;
}

bool finite3(const float *p) {
    return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

} // namespace

// Cloud and state -----------------------------------------------------------------------------------------

void fill_cloud(const sphm_particles &particles, sensor_msgs::PointCloud2 *cloud) {
    static const char *const names[] = {
        "x", "y", "z", "displacement", "pressure", "membrane_potential", "activation", "fibre_stretch"};
    constexpr uint32_t fields = 8;
    cloud->fields.resize(fields);
    for (uint32_t i = 0; i < fields; ++i) {
        cloud->fields[i].name = names[i];
        cloud->fields[i].offset = i * 4;
        cloud->fields[i].datatype = sensor_msgs::PointField::FLOAT32;
        cloud->fields[i].count = 1;
    }
    cloud->height = 1;
    cloud->width = static_cast<uint32_t>(particles.count);
    cloud->is_bigendian = 0;
    cloud->point_step = fields * 4;
    cloud->row_step = cloud->point_step * cloud->width;
    cloud->is_dense = 1;
    cloud->data.resize(cloud->row_step);
    for (std::size_t i = 0; i < particles.count; ++i) {
        const float *position = particles.position_m + 3 * i;
        const float record[fields] = {position[0],
                                      position[1],
                                      position[2],
                                      particles.displacement_m[i],
                                      particles.pressure_Pa[i],
                                      particles.membrane_potential_mV[i],
                                      particles.activation[i],
                                      particles.fibre_stretch[i]};
        if (!finite3(position))
            cloud->is_dense = 0;
        std::memcpy(cloud->data.data() + i * sizeof record, record, sizeof record);
    }
}

void fill_wrench(const sphm_wrench &wrench, geometry_msgs::Wrench *message) {
    message->force.x = wrench.force_N[0];
    message->force.y = wrench.force_N[1];
    message->force.z = wrench.force_N[2];
    message->torque.x = wrench.moment_Nm[0];
    message->torque.y = wrench.moment_Nm[1];
    message->torque.z = wrench.moment_Nm[2];
}

void fill_state(const sphm_observation &o, MuscleState *state) {
    state->simulated_time = o.time_s;
    state->stimulus_ua_per_mm2 = o.stimulus_uA_per_mm2;
    state->activation = o.activation;
    state->membrane_potential_mv = o.membrane_potential_mV;
    state->displacement_mean = o.displacement_mean_m;
    state->displacement_max = o.displacement_max_m;
    state->displacement_sections = o.displacement_sections_m;
    state->displacement_surface = o.displacement_surface_m;
    state->deformation_by_radius = o.deformation_by_radius;
    state->deformation_by_length = o.deformation_by_length;
    state->length = o.length_m;
    state->lengthening_speed = o.lengthening_speed_m_per_s;
    state->shortening = o.shortening;
    state->bulge = o.bulge;
    state->volume_ratio = o.volume_ratio;
    state->pressure_mean = o.pressure_mean_Pa;
    state->electrical_pressure_mean = o.electrical_pressure_mean_Pa;
    state->kinetic_energy = o.kinetic_energy_J;
    state->speed_max = o.speed_max_m_per_s;
    state->nonfinite = o.nonfinite;
    state->force = o.force_N;
    state->force_active = o.force_active_N;
    state->force_passive = o.force_passive_N;
    state->force_damping = o.force_damping_N;
    state->attachment_distance = o.attachment_distance_m;
    state->normalised_fibre_length = o.normalised_fibre_length;
    for (std::size_t region = 0; region < 3; ++region) {
        state->membrane_potential_region_mv[region] = o.membrane_potential_region_mV[region];
        state->displacement_region[region] = o.displacement_region_m[region];
        state->pressure_region[region] = o.pressure_region_Pa[region];
    }
}

// Surface -------------------------------------------------------------------------------------------------

ColourRange::ColourRange(int field, double minimum, double maximum)
    : fixed_(minimum != maximum), minimum_(minimum), maximum_(maximum) {
    static const double least_spans[SPHM_FIELD_COUNT] = {1e-3, 500, 20, 0.2, 0.05}; // m, Pa, mV, -, -
    static const double rest_values[SPHM_FIELD_COUNT] = {0, 0, -85, 0, 1};
    least_span_ = least_spans[field];
    if (!fixed_)
        minimum_ = maximum_ = rest_values[field];
}

void ColourRange::follow(const float *values, std::size_t count) {
    if (fixed_ || count == 0)
        return;
    double lowest = HUGE_VAL, highest = -HUGE_VAL;
    for (std::size_t i = 0; i < count; ++i) {
        if (!std::isfinite(values[i]))
            continue;
        lowest = std::min(lowest, static_cast<double>(values[i]));
        highest = std::max(highest, static_cast<double>(values[i]));
    }
    if (lowest > highest)
        return;
    // Widens at once, narrows slowly: colours stay comparable from one frame to the next.
    constexpr double narrowing = 0.01;
    minimum_ = lowest < minimum_ ? lowest : minimum_ + narrowing * (lowest - minimum_);
    maximum_ = highest > maximum_ ? highest : maximum_ + narrowing * (highest - maximum_);
}

double ColourRange::share(double value) const {
    const double missing = fixed_ ? 0 : std::max(0.0, least_span_ - (maximum_ - minimum_)) / 2;
    const double low = minimum_ - missing, high = maximum_ + missing;
    const double s = (value - low) / (high - low);
    return std::isfinite(s) ? std::min(1.0, std::max(0.0, s)) : 0;
}

namespace {

// Blue (0) over near-white (0.5) to red (1), after Moreland's diverging map.
std_msgs::ColorRGBA cold_to_warm(double share) {
    static const float stops[5][3] = {{0.23F, 0.30F, 0.75F},
                                      {0.55F, 0.69F, 0.99F},
                                      {0.87F, 0.87F, 0.87F},
                                      {0.96F, 0.60F, 0.48F},
                                      {0.71F, 0.02F, 0.15F}};
    const double place = share * 4;
    const auto low = static_cast<std::size_t>(std::min(3.0, std::floor(place)));
    const auto t = static_cast<float>(place - static_cast<double>(low));
    std::array<float, 3> mixed{};
    for (std::size_t c = 0; c < 3; ++c)
        mixed[c] = stops[low][c] + t * (stops[low + 1][c] - stops[low][c]);
    return colour(mixed[0], mixed[1], mixed[2], 0.45F);
}

} // namespace

void fill_surface(const sphm_skin &skin, const ColourRange &range, Marker *marker) {
    marker->ns = "surface";
    marker->type = Marker::TRIANGLE_LIST;
    marker->action = Marker::ADD;
    marker->pose.orientation.w = 1;
    set_scale(marker, 1, 1, 1);
    marker->color = colour(1, 1, 1, 0.45F);
    marker->points.resize(3 * skin.triangle_count);
    marker->colors.resize(3 * skin.triangle_count);
    for (std::size_t i = 0; i < 3 * skin.triangle_count; ++i) {
        const auto vertex = static_cast<std::size_t>(skin.triangles[i]);
        marker->points[i] = point(skin.vertices_m + 3 * vertex);
        marker->colors[i] = cold_to_warm(range.share(static_cast<double>(skin.field[vertex])));
    }
}

// Markers -------------------------------------------------------------------------------------------------

namespace {

constexpr std::size_t arrow_count = 100;
constexpr std::size_t attachment_points = 600;

void add_arrows(const sphm_body &body, const sphm_particles &particles, const std_msgs::Header &header,
                visualization_msgs::MarkerArray *markers) {
    const double thickness_m = 0.004 * body.length_m;
    const std::size_t stride = std::max<std::size_t>(1, particles.count / arrow_count);
    int id = 0;
    for (std::size_t i = stride / 2; i < particles.count; i += stride, ++id) {
        const float *tip = particles.position_m + 3 * i;
        const float *vector = particles.displacement_vector_m + 3 * i;
        Marker arrow = new_marker("displacement", id, Marker::ARROW, header);
        // Below a hundredth of the spacing there is nothing to see, and rviz complains of arrows without
        // length.
        const bool worth_showing = finite3(tip) && finite3(vector) &&
                                   static_cast<double>(particles.displacement_m[i]) > 0.01 * body.spacing_m;
        if (worth_showing) {
            arrow.points = {point(static_cast<double>(tip[0] - vector[0]),
                                  static_cast<double>(tip[1] - vector[1]),
                                  static_cast<double>(tip[2] - vector[2])),
                            point(tip)};
            set_scale(&arrow, 0.5 * thickness_m, thickness_m, 0);
            arrow.color = colour(1, 0.85F, 0.2F, 0.9F);
        } else {
            arrow.action = Marker::DELETE;
        }
        markers->markers.push_back(arrow);
    }
}

void add_tendons(const sphm_muscle *muscle, const sphm_body &body, const std_msgs::Header &header,
                 visualization_msgs::MarkerArray *markers) {
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        double belly[3], bone[3];
        if (sphm_muscle_tendon(muscle, end, belly, bone) == 0)
            continue;
        Marker tendon = new_marker("tendons", end, Marker::LINE_LIST, header);
        set_scale(&tendon, 0.03 * body.length_m, 0, 0);
        tendon.color = colour(0.93F, 0.91F, 0.84F, 1);
        tendon.points = {point(belly[0], belly[1], belly[2]), point(bone[0], bone[1], bone[2])};
        markers->markers.push_back(tendon);
    }
}

void add_attachments(const sphm_body &body, const sphm_particles &particles, const std_msgs::Header &header,
                     visualization_msgs::MarkerArray *markers) {
    for (int end : {SPHM_ATTACHED_ORIGIN, SPHM_ATTACHED_INSERTION}) {
        Marker region = new_marker("attachments", end, Marker::SPHERE_LIST, header);
        set_scale(&region, 0.6 * body.spacing_m, 0.6 * body.spacing_m, 0.6 * body.spacing_m);
        region.color = colour(0.9F, 0.88F, 0.8F, 0.8F); // tendon
        std::size_t attached = 0;
        for (std::size_t i = 0; i < body.count; ++i)
            attached += body.attachment[i] == end;
        const std::size_t stride = std::max<std::size_t>(1, attached / attachment_points);
        std::size_t seen = 0;
        for (std::size_t i = 0; i < body.count; ++i) {
            if (body.attachment[i] != end || seen++ % stride != 0)
                continue;
            if (finite3(particles.position_m + 3 * i))
                region.points.push_back(point(particles.position_m + 3 * i));
        }
        if (region.points.empty())
            region.action = Marker::DELETE;
        markers->markers.push_back(region);
    }
}

void add_electrode(const char *name, int id, const geometry_msgs::Point &centre, double radius_m,
                   const sphm_muscle *muscle, const std_msgs::Header &header,
                   visualization_msgs::MarkerArray *markers) {
    Marker marker = new_marker("electrodes", id, Marker::SPHERE, header);
    marker.pose.position = centre;
    set_scale(&marker, 2 * radius_m, 2 * radius_m, 2 * radius_m);
    const bool driven =
        sphm_muscle_stimulus(muscle, name) != 0 || (id < 2 && sphm_muscle_stimulus(muscle, "both") != 0);
    marker.color = driven ? colour(1, 0.9F, 0.1F, 0.9F) : colour(0.35F, 0.35F, 0.35F, 0.6F);
    markers->markers.push_back(marker);
}

// The electrode `belly` is every particle, so it has no place of its own: the text tells whether it is
// driven.
void add_electrodes(const sphm_muscle *muscle, const sphm_body &body, const std_msgs::Header &header,
                    visualization_msgs::MarkerArray *markers) {
    const double radius_m = 0.02 * body.length_m;
    add_electrode("origin", 0, point(body.origin_m[0], body.origin_m[1], body.origin_m[2]), radius_m, muscle,
                  header, markers);
    add_electrode("insertion", 1, point(body.insertion_m[0], body.insertion_m[1], body.insertion_m[2]),
                  radius_m, muscle, header, markers);
    const sphm_parameters *parameters = sphm_muscle_parameters(muscle);
    if (parameters->electrode != SPHM_ELECTRODE_SPHERE && sphm_muscle_stimulus(muscle, "sphere") == 0)
        return;
    double centre[3];
    for (int c = 0; c < 3; ++c) {
        const double given = parameters->electrode_centre[c];
        centre[c] = given < SPHM_AUTO ? given : (body.origin_m[c] + body.insertion_m[c]) / 2;
    }
    add_electrode("sphere", 2, point(centre[0], centre[1], centre[2]), parameters->electrode_radius, muscle,
                  header, markers);
}

__attribute__((format(printf, 1, 2))) std::string formatted(const char *format, ...) {
    char line[160];
    va_list values;
    va_start(values, format);
    std::vsnprintf(line, sizeof line, format, values);
    va_end(values);
    return line;
}

void add_text(const sphm_muscle *muscle, const sphm_body &body, const MuscleState &state,
              visualization_msgs::MarkerArray *markers) {
    Marker text = new_marker("text", 0, Marker::TEXT_VIEW_FACING, state.header);
    set_scale(&text, 0, 0, 0.035 * body.length_m);
    text.pose.position =
        point((body.lower_m[0] + body.upper_m[0]) / 2, (body.lower_m[1] + body.upper_m[1]) / 2,
              body.upper_m[2] + 0.2 * body.length_m);
    text.text = formatted("t %.2f s   stimulus %g uA/mm2   %.0f mV\n", state.simulated_time,
                          state.stimulus_ua_per_mm2, state.membrane_potential_mv);
    if (sphm_muscle_parameters(muscle)->tissue == SPHM_TISSUE_SOLID)
        text.text += formatted("force %.1f N   shortening %.1f %%   bulge %.1f %%\n", state.force,
                               100 * state.shortening, 100 * state.bulge);
    else
        text.text +=
            formatted("displacement mean %.1f mm, max %.1f mm   bulge %.1f %%\n",
                      1e3 * state.displacement_mean, 1e3 * state.displacement_max, 100 * state.bulge);
    text.text += state.failed   ? "STOPPED: the state is not finite"
                 : state.paused ? "paused"
                                : formatted("real-time factor %.2f", state.real_time_factor);
    markers->markers.push_back(text);
}

} // namespace

visualization_msgs::MarkerArray make_markers(const sphm_muscle *muscle, const sphm_particles &particles,
                                             const MuscleState &state) {
    visualization_msgs::MarkerArray markers;
    const sphm_body &body = *sphm_muscle_body(muscle);
    add_arrows(body, particles, state.header, &markers);
    add_attachments(body, particles, state.header, &markers);
    add_tendons(muscle, body, state.header, &markers);
    add_electrodes(muscle, body, state.header, &markers);
    add_text(muscle, body, state, &markers);
    return markers;
}

} // namespace sph_muscle
