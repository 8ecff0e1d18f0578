/* sph_muscle_parity: does a back end compute what the CPU computes? Plain C on the public interface, for
 * machines that have a GPU and a compiler and nothing else.
 *
 * Each case makes the same muscle on the CPU and on the other back end, has both take the same steps under
 * the same commands, and compares every field of every particle, the wrenches and the limits on the step. The
 * other back end then does it again, looked at on the way and at the same time as a second muscle in another
 * thread: the same bits are asked for.
 *
 * Exit status: 0 all cases agree, 1 one does not or the back end is there and cannot be used, 2 bad input, 77
 * it is not there (and why). */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sph_muscle/muscle.h"

/* Tolerances are shares of a field's scale. Both back ends round a step alike but for the order of a row's
 * sums and for fused operations: about 1e-7 of what is summed. A muscle that contracts from rest amplifies
 * that by one to two orders of magnitude in 500 steps (velocities and pressures most, for they are small
 * differences), and the host emulation of the CUDA back end shows 2e-6 (test/cuda_solid_test.cpp,
 * test/cuda_fluid_test.cpp). 1e-4 leaves room for the device's own reciprocals and roots; a mistake in any
 * stage shows as 1e-2 and more. */
#define TOLERANCE 1e-4

/* The fluid's positions are single numbers relative to the middle of the muscle, where the solid has
 * displacements beside them: a unit in the last place at 0.1 m is 7.5e-9 m. Two of them are tolerated, and a
 * quarter of one a step as a velocity, for stiff pairs follow where particles are. */
#define ROUNDING_M 7.5e-9

enum { EXIT_AGREES = 0, EXIT_DIFFERS = 1, EXIT_BAD_INPUT = 2, EXIT_ABSENT = 77 };

typedef struct options {
    const char *backend;
    const char *particles;
    size_t steps;
    double tolerance;
    int set_count;
    const char *set[16]; /* NAME=VALUE, for the other back end only: to see what a difference looks like */
} options;

enum { FORCE = 1, DRIVE = 2 };

/* What happens in a case. */
typedef struct scenario {
    const char *name;
    const char *settings; /* "name=value name=value" */
    int commands;         /* besides the stimulus: FORCE, DRIVE (commanded activation and a moving end) */
} scenario;

static const scenario scenarios[] = {
    {"solid, both ends stimulated", "tissue=solid time_step=2e-5", 0},
    {"solid, every command",
     "tissue=solid time_step=2e-5 anisotropy_ratio=4 fibres=pennate pennation_angle=15 velocity_damping=20 "
     "gravity=[0,0,-9.81] settle_time=0 force_velocity=hill surface_pressure=200 tendon_ends=origin "
     "tendon_stiffness=2e4 "
     "tendon_slack_length=0.02",
     FORCE | DRIVE},
    {"solid, diffusion several times a step",
     "tissue=solid time_step=5e-5 mass_scaling=10 conduction_velocity=4 reaction_step=0.01", 0},
    {"fluid, both ends stimulated", "tissue=fluid time_step=1e-4", 0},
    {"fluid, every command",
     "tissue=fluid time_step=1e-4 anisotropy_ratio=4 fibres=laplace laplacian=brookshaw fibre_steering=0.3 "
     "gravity=[0.3,0,-9.81]",
     FORCE},
    {"fluid, electrical pressure", "tissue=fluid time_step=1e-4 coupling=pressure laplacian=paper", FORCE},
    {"fluid, diffusion several times a step",
     "tissue=fluid time_step=1e-4 conduction_velocity=4 reaction_step=0.02", 0},
};

static int is_fluid(const sphm_muscle *m) {
    return sphm_muscle_parameters(m)->tissue == SPHM_TISSUE_FLUID;
}

static int complain(const char *what, const char *why) {
    fprintf(stderr, "sph_muscle_parity: %s: %s\n", what, why);
    return 0;
}

static int set_pair(sphm_parameters *p, const char *pair, size_t length) {
    char name[SPHM_TEXT_SIZE];
    sphm_context context;
    memset(&context, 0, sizeof context);
    if (length >= sizeof name)
        return complain(pair, "too long");
    memcpy(name, pair, length);
    name[length] = '\0';
    char *equals = strchr(name, '=');
    if (!equals)
        return complain(name, "not of the form name=value");
    *equals = '\0';
    return sphm_parameters_set(p, name, equals + 1, &context) == SPHM_OK ? 1
                                                                         : complain(pair, context.message);
}

static int set_all(sphm_parameters *p, const char *settings) {
    while (*settings) {
        const size_t length = strcspn(settings, " ");
        if (!set_pair(p, settings, length))
            return 0;
        settings += length + (settings[length] == ' ');
    }
    return 1;
}

/* NULL, with *status and a message in `context`. */
static sphm_muscle *make(const options *o, const scenario *s, int reference, sphm_status *status,
                         sphm_context *context) {
    sphm_parameters *p = malloc(sizeof *p);
    sphm_muscle *muscle = NULL;
    memset(context, 0, sizeof *context);
    *status = SPHM_REFUSED_ARGUMENT;
    if (!p)
        return NULL;
    *p = sphm_parameters_default();
    int good = set_all(p, s->settings) &&
               sphm_parameters_set(p, "particles", o->particles, context) == SPHM_OK &&
               sphm_parameters_set(p, "backend", reference ? "cpu" : o->backend, context) == SPHM_OK;
    for (int k = 0; k < o->set_count && !reference; k++)
        good = good && set_pair(p, o->set[k], strlen(o->set[k]));
    if (good)
        *status = sphm_muscle_create(p, NULL, &muscle, context);
    free(p);
    return muscle;
}

/* Commands of a case, at a quarter and at half of the steps. */
static sphm_status command(sphm_muscle *m, const scenario *s, size_t step, size_t steps,
                           sphm_context *context) {
    const sphm_body *body = sphm_muscle_body(m);
    const double force[3] = {0, 1, 2};
    double middle[3];
    sphm_end_pose pose;
    sphm_status status = SPHM_OK;
    if (step == 0)
        status = sphm_muscle_stimulate(m, "both", 8000, 0, context);
    if (!s->commands || status != SPHM_OK)
        return status;
    for (int d = 0; d < 3; d++)
        middle[d] = (body->origin_m[d] + body->insertion_m[d]) / 2;
    if (step == steps / 4 && s->commands & FORCE)
        status = sphm_muscle_apply_force(m, middle, force, body->length_m / 10, 0, context);
    if (step == steps / 2 && s->commands & DRIVE) {
        memset(&pose, 0, sizeof pose);
        memcpy(pose.position_m, body->insertion_m, sizeof pose.position_m);
        pose.position_m[0] -= 0.005 * body->length_m;
        pose.orientation[2] = sin(0.02);
        pose.orientation[3] = cos(0.02);
        status = sphm_muscle_activate(m, 0.4, 0, context);
        if (status == SPHM_OK)
            status =
                sphm_muscle_set_end_pose(m, SPHM_END_INSERTION, &pose,
                                         (double)(steps / 4) * sphm_muscle_parameters(m)->time_step, context);
    }
    return status;
}

/* Takes `steps` steps. With `looking` the muscle is looked at on the way, which waits for nothing but the
 * first time and changes nothing. */
static sphm_status run(sphm_muscle *m, int looking, const scenario *s, size_t steps, sphm_context *context) {
    const size_t quarter = steps / 4 ? steps / 4 : 1;
    sphm_particles particles;
    sphm_observation observation;
    sphm_status status = SPHM_OK;
    for (size_t done = 0; done < steps && status == SPHM_OK;) {
        const size_t call = steps - done < quarter ? steps - done : quarter;
        status = command(m, s, done, steps, context);
        if (status == SPHM_OK)
            status = sphm_muscle_advance(m, (double)call * sphm_muscle_parameters(m)->time_step, context);
        if (status == SPHM_OK && looking)
            status = sphm_muscle_glance(m, &particles, &observation, context);
        done += call;
    }
    return status;
}

/* A muscle that takes its steps in a thread of its own. */
typedef struct neighbour {
    sphm_muscle *muscle;
    const scenario *scenario;
    size_t steps;
    sphm_status status;
    sphm_context context;
} neighbour;

static void *run_neighbour(void *of_thread) {
    neighbour *n = (neighbour *)of_thread;
    n->status = run(n->muscle, 0, n->scenario, n->steps, &n->context);
    return NULL;
}

static double now_s(void) {
    struct timespec now;
    timespec_get(&now, TIME_UTC);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Comparing ---------------------------------------------------------------------------------------------- */

/* Returns 1 where the largest difference is within the tolerance of `scale`; 0: the largest reference value.
 */
static int compare(const options *o, const char *what, const double *reference, const double *other, size_t n,
                   double scale) {
    double worst = 0, largest = 0;
    int finite = 1;
    for (size_t i = 0; i < n; i++) {
        const double difference = fabs(other[i] - reference[i]);
        finite = finite && isfinite(difference);
        worst = difference > worst ? difference : worst;
        largest = fabs(reference[i]) > largest ? fabs(reference[i]) : largest;
    }
    const double unit = scale > 0 ? scale : largest;
    const double share = unit > 0 ? worst / unit : worst;
    const int good = finite && share <= o->tolerance;
    printf("  %-24s largest difference %.2e of %.3g%s\n", what, share, unit,
           good     ? ""
           : finite ? "  <- MORE THAN TOLERATED"
                    : "  <- NOT FINITE");
    return good;
}

static int compare_floats(const options *o, const char *what, const float *reference, const float *other,
                          size_t n, double scale) {
    double *both = malloc(2 * n * sizeof *both);
    if (!both)
        return complain(what, "no memory");
    for (size_t i = 0; i < n; i++) {
        both[i] = (double)reference[i];
        both[n + i] = (double)other[i];
    }
    const int good = compare(o, what, both, both + n, n, scale);
    free(both);
    return good;
}

static int compare_particles(const options *o, sphm_muscle *reference, sphm_muscle *other) {
    sphm_particles a, b;
    sphm_context context;
    memset(&context, 0, sizeof context);
    if (sphm_muscle_particles(reference, &a, &context) != SPHM_OK ||
        sphm_muscle_particles(other, &b, &context) != SPHM_OK)
        return complain("particles", context.message);
    const size_t n = a.count;
    double moved = 0; /* positions are compared on the scale of how far particles moved */
    double speed = 0;
    for (size_t i = 0; i < 3 * n; i++) {
        moved = fmax(moved, fabs((double)a.displacement_vector_m[i]));
        speed = fmax(speed, fabs((double)a.velocity_m_per_s[i]));
    }
    if (is_fluid(reference)) { /* see ROUNDING */
        moved = fmax(moved, 2 * ROUNDING_M / TOLERANCE);
        speed = fmax(speed, ROUNDING_M / 4 / sphm_muscle_parameters(reference)->time_step / TOLERANCE);
    }
    int good =
        compare_floats(o, "displacement", a.displacement_vector_m, b.displacement_vector_m, 3 * n, moved);
    good &= compare_floats(o, "position", a.position_m, b.position_m, 3 * n, fmax(moved, 1e-2));
    good &= compare_floats(o, "velocity", a.velocity_m_per_s, b.velocity_m_per_s, 3 * n, speed);
    good &= compare_floats(o, "pressure", a.pressure_Pa, b.pressure_Pa, n, 0);
    good &=
        compare_floats(o, "electrical pressure", a.electrical_pressure_Pa, b.electrical_pressure_Pa, n, 0);
    good &= compare_floats(o, "density", a.density_kg_per_m3, b.density_kg_per_m3, n, 0);
    good &= compare_floats(o, "membrane potential", a.membrane_potential_mV, b.membrane_potential_mV, n, 100);
    good &= compare_floats(o, "recovery", a.recovery, b.recovery, n, 1);
    good &= compare_floats(o, "activation", a.activation, b.activation, n, 1);
    good &= compare_floats(o, "fibre stretch", a.fibre_stretch, b.fibre_stretch, n, 1);
    return good;
}

static int compare_wrenches(const options *o, sphm_muscle *reference, sphm_muscle *other) {
    int good = 1;
    for (int end = 0; end < SPHM_END_COUNT; end++) {
        sphm_wrench a, b;
        if (sphm_muscle_wrench(reference, end, &a, NULL) != SPHM_OK ||
            sphm_muscle_wrench(other, end, &b, NULL) != SPHM_OK)
            return complain("wrench", "refused");
        const double newton = fmax(fmax(fabs(a.force_N[0]), fabs(a.force_N[1])), fabs(a.force_N[2]));
        const double lever = newton * sphm_muscle_body(reference)->length_m;
        good &= compare(o, end ? "insertion force" : "origin force", a.force_N, b.force_N, 3, newton);
        good &= compare(o, "  moment", a.moment_Nm, b.moment_Nm, 3, lever);
        good &= compare(o, "  active, passive, damping", a.active_N, b.active_N, 9, newton);
        good &= compare(o, "  their moments", a.active_Nm, b.active_Nm, 9, lever);
    }
    return good;
}

static int compare_rest(const options *o, sphm_muscle *reference, sphm_muscle *other) {
    const double a[2] = {sphm_muscle_time(reference), sphm_muscle_time_step_limits(reference).smallest};
    const double b[2] = {sphm_muscle_time(other), sphm_muscle_time_step_limits(other).smallest};
    int good = compare(o, "time", a, b, 1, 0);
    good &= compare(o, "limit on the step", a + 1, b + 1, 1, 0);
    if (sphm_muscle_steps(reference) != sphm_muscle_steps(other))
        good = complain("steps", "one took more than the other");
    return good;
}

/* Cases -------------------------------------------------------------------------------------------------- */

/* Both at once, each in a thread of its own. */
static int run_two(sphm_muscle *again, neighbour *beside, sphm_context *context) {
    pthread_t thread;
    if (pthread_create(&thread, NULL, run_neighbour, beside) != 0)
        return complain("a second muscle", "no thread for it");
    const sphm_status status = run(again, 1, beside->scenario, beside->steps, context);
    (void)pthread_join(thread, NULL);
    if (status != SPHM_OK)
        return complain("a muscle beside another", context->message);
    return beside->status == SPHM_OK ? 1 : complain("a second muscle", beside->context.message);
}

/* `alone_s`: what one of them took by itself. */
static int same_bits(const options *o, const scenario *s, uint64_t hash, double alone_s) {
    sphm_context context;
    sphm_status status;
    neighbour beside;
    memset(&beside, 0, sizeof beside);
    beside.scenario = s;
    beside.steps = o->steps;
    sphm_muscle *again = make(o, s, 0, &status, &context);
    beside.muscle = again ? make(o, s, 0, &status, &context) : NULL;
    const double start_s = now_s();
    int good = 0;
    if (!beside.muscle)
        (void)complain("a second muscle", context.message);
    else
        good = run_two(again, &beside, &context);
    const double both_s = now_s() - start_s;
    if (good && (sphm_muscle_hash(again) != hash || sphm_muscle_hash(beside.muscle) != hash))
        good = complain("determinism", "two muscles at once, one looked at, gave other bits");
    if (good)
        printf(
            "  two muscles at once, one looked at: the same bits (%016llx), in %.2f times what one takes\n",
            (unsigned long long)hash, both_s / alone_s);
    sphm_muscle_destroy(again);
    sphm_muscle_destroy(beside.muscle);
    return good;
}

static int run_case(const options *o, const scenario *s) {
    sphm_context context;
    sphm_status status;
    sphm_muscle *reference = make(o, s, 1, &status, &context), *other = NULL;
    if (reference)
        other = make(o, s, 0, &status, &context);
    int good = 0;
    if (!other) {
        (void)complain(s->name, context.message);
    } else {
        printf("%s: %zu particles, %.1f neighbours, %zu steps; %s against %s\n", s->name,
               sphm_muscle_body(other)->count, sphm_muscle_timing(other).neighbours_per_particle, o->steps,
               sphm_muscle_device(other), sphm_muscle_device(reference));
        good = run(reference, 0, s, o->steps, &context) == SPHM_OK;
        const double start_s = now_s();
        good = good && run(other, 0, s, o->steps, &context) == SPHM_OK;
        const double alone_s = now_s() - start_s;
        if (!good)
            (void)complain(s->name, context.message);
        else {
            const uint64_t hash = sphm_muscle_hash(other);
            good = compare_rest(o, reference, other);
            good &= compare_particles(o, reference, other);
            if (!is_fluid(reference)) /* a fluid has none */
                good &= compare_wrenches(o, reference, other);
            good &= same_bits(o, s, hash, alone_s);
        }
    }
    sphm_muscle_destroy(reference);
    sphm_muscle_destroy(other);
    printf("%s: %s\n\n", s->name, good ? "agrees" : "DIFFERS");
    return good;
}

/* EXIT_ABSENT only where nothing answers: a device that is there and cannot make a muscle is a failure. */
static int find_backend(const options *o) {
    const scenario smallest = {"", "tissue=solid particles=50", 0};
    options few = *o;
    sphm_context context;
    sphm_status status = SPHM_OK;
    few.particles = "50";
    few.set_count = 0;
    sphm_muscle *muscle = make(&few, &smallest, 0, &status, &context);
    sphm_muscle_destroy(muscle);
    if (muscle)
        return EXIT_AGREES;
    if (status != SPHM_REFUSED_UNSUPPORTED) {
        (void)complain("the back end cannot be used", context.message);
        return EXIT_DIFFERS;
    }
    printf("skipped: %s\n", context.message);
    return EXIT_ABSENT;
}

/* Command line ------------------------------------------------------------------------------------------- */

static int take(options *o, const char *name, const char *value) {
    char *end = NULL;
    if (strcmp(name, "--backend") == 0)
        o->backend = value;
    else if (strcmp(name, "--particles") == 0)
        o->particles = value;
    else if (strcmp(name, "--steps") == 0 && strtoul(value, &end, 10) > 0 && !*end)
        o->steps = strtoul(value, NULL, 10);
    else if (strcmp(name, "--tolerance") == 0 && strtod(value, &end) >= 0 && !*end)
        o->tolerance = strtod(value, NULL);
    else if (strcmp(name, "--set") == 0 && o->set_count < 16)
        o->set[o->set_count++] = value;
    else
        return complain(name, "unknown, or its value is not usable");
    return 1;
}

int main(int argc, char **argv) {
    options o = {"cuda", "2231", 500, TOLERANCE, 0, {NULL}};
    for (int k = 1; k < argc; k += 2)
        if (k + 1 == argc || !take(&o, argv[k], argv[k + 1])) {
            fprintf(stderr, "usage: sph_muscle_parity [--backend cuda] [--particles 2231] [--steps 500] "
                            "[--tolerance 1e-4] [--set NAME=VALUE]...\n");
            return EXIT_BAD_INPUT;
        }
    setvbuf(stdout, NULL, _IOLBF, 0); /* whoever stops this wants to know where it was */
    const int found = find_backend(&o);
    if (found != EXIT_AGREES)
        return found;
    int good = 1;
    for (size_t k = 0; k < sizeof scenarios / sizeof *scenarios; k++)
        good &= run_case(&o, &scenarios[k]);
    printf("%s\n", good ? "all cases agree" : "NOT ALL CASES AGREE");
    return good ? EXIT_AGREES : EXIT_DIFFERS;
}
