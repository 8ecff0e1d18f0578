/* sph_muscle_run: a muscle without ROS, from a configuration to files. */
#define _POSIX_C_SOURCE 200809L /* sigaction, mkdir */
#include "cli/common.h"
#include "cli/run_options.h"
#include "cli/run_progress.h"
#include "core/context.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* Everything a run has open. */
typedef struct run {
    const sphm_run_options *options;
    sphm_run_schedule *schedule;
    sphm_context context;
    sphm_muscle *muscle;
    sphm_timeseries *series;
    sphm_collection *particles, *surface;
    double start_s; /* simulated; above 0 after --restore */
    double wall_s;  /* spent in the simulation */
    size_t samples;
} run;

/* Signals
 * --------------------------------------------------------------------------------------------------*/

static volatile sig_atomic_t interrupted; /* the signal's number */

static void note_signal(int number) {
    interrupted = number;
}

/* The second Ctrl-C ends the program at once. */
static void catch_signals(void) {
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = note_signal;
    action.sa_flags = (int)SA_RESETHAND;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

/* Files
 * ----------------------------------------------------------------------------------------------------*/

/* The path of `name` in the results' folder; valid until the next call. */
static const char *in_out(const run *r, const char *name) {
    static char path[4096];
    snprintf(path, sizeof path, "%s/%s", r->options->out, name);
    return path;
}

/* mkdir -p */
static sphm_status make_folder(const char *path, sphm_context *context) {
    char copy[4096];
    if (snprintf(copy, sizeof copy, "%s/", path) >= (int)sizeof copy - 64)
        return sphm_fail(context, SPHM_REFUSED_FILE, "the path '%.60s...' is too long", path);
    for (char *slash = strchr(copy + 1, '/'); slash; slash = strchr(slash + 1, '/')) {
        *slash = '\0';
        if (mkdir(copy, 0777) != 0 && errno != EEXIST)
            return sphm_fail(context, SPHM_REFUSED_FILE, "cannot make the folder '%s': %s", copy,
                             strerror(errno));
        *slash = '/';
    }
    struct stat kind;
    if (stat(path, &kind) != 0 || !S_ISDIR(kind.st_mode))
        return sphm_fail(context, SPHM_REFUSED_FILE, "--out '%s' is not a folder", path);
    return SPHM_OK;
}

static sphm_status open_files(run *r) {
    sphm_status status = make_folder(r->options->out, &r->context);
    if (status == SPHM_OK)
        status = sphm_io_save_parameters(sphm_muscle_parameters(r->muscle), in_out(r, "parameters.yaml"),
                                         &r->context);
    if (status == SPHM_OK)
        status = sphm_io_timeseries_open(in_out(r, "timeseries.csv"), &r->series, &r->context);
    if (status != SPHM_OK || !r->options->vtk)
        return status;
    status = make_folder(in_out(r, "vtk"), &r->context);
    if (status == SPHM_OK)
        status = sphm_io_collection_open(in_out(r, "particles.pvd"), &r->particles, &r->context);
    if (status == SPHM_OK)
        status = sphm_io_collection_open(in_out(r, "surface.pvd"), &r->surface, &r->context);
    return status;
}

/* Closes everything; keeps the first failure. */
static sphm_status close_files(run *r, sphm_status status) {
    sphm_status closed[3];
    sphm_context *context = status == SPHM_OK ? &r->context : NULL;
    closed[0] = sphm_io_timeseries_close(r->series, context);
    closed[1] = sphm_io_collection_close(r->particles, context);
    closed[2] = sphm_io_collection_close(r->surface, context);
    for (int i = 0; i < 3 && status == SPHM_OK; i++)
        status = closed[i];
    return status;
}

static sphm_status write_vtk(run *r) {
    char name[64];
    double time_s = sphm_muscle_time(r->muscle);
    snprintf(name, sizeof name, "vtk/particles_%06zu.vtp", r->samples);
    sphm_status status = sphm_io_write_particles_vtk(r->muscle, in_out(r, name), &r->context);
    if (status == SPHM_OK)
        status = sphm_io_collection_add(r->particles, time_s, name, &r->context);
    snprintf(name, sizeof name, "vtk/surface_%06zu.vtp", r->samples);
    if (status == SPHM_OK)
        status = sphm_io_write_surface_vtk(r->muscle, in_out(r, name), &r->context);
    if (status == SPHM_OK)
        status = sphm_io_collection_add(r->surface, time_s, name, &r->context);
    return status;
}

/* A sample ends the stretch whose real-time factor it carries; the first one has none. */
static sphm_status write_sample(run *r, double real_time_factor) {
    sphm_observation observation;
    sphm_status status = sphm_muscle_observe(r->muscle, &observation, &r->context);
    if (status == SPHM_OK)
        status = sphm_io_timeseries_write(r->series, &observation, real_time_factor, &r->context);
    if (status == SPHM_OK && r->options->vtk)
        status = write_vtk(r);
    r->samples++;
    return status;
}

/* The run
 * --------------------------------------------------------------------------------------------------*/

/* Advances to start + time_s, stopping where the schedule says that something happens; a rest that is
 * rounding only is none. */
static sphm_status advance_to(run *r, double time_s, double *real_time_factor) {
    double end_s = r->start_s + time_s, left_s = end_s - sphm_muscle_time(r->muscle);
    double before = sphm_cli_now();
    sphm_status status = sphm_run_schedule_apply(r->schedule, r->muscle, &r->context);
    while (status == SPHM_OK && end_s - sphm_muscle_time(r->muscle) > 1e-9 * r->options->every_s) {
        double until_s = fmin(end_s, sphm_run_schedule_next(r->schedule));
        status = sphm_muscle_advance(r->muscle, until_s - sphm_muscle_time(r->muscle), &r->context);
        if (status == SPHM_OK)
            status = sphm_run_schedule_apply(r->schedule, r->muscle, &r->context);
    }
    double wall_s = sphm_cli_now() - before;
    r->wall_s += wall_s;
    *real_time_factor = wall_s > 0 ? left_s / wall_s : 0;
    return status;
}

static sphm_status simulate(run *r) {
    const sphm_run_options *o = r->options;
    /* Sample k is at k * every, not at a sum of k times every; the last one is at the end. */
    size_t count = (size_t)ceil(o->duration_s / o->every_s - 1e-9);
    sphm_run_schedule_begin(r->schedule, r->start_s);
    sphm_progress progress = sphm_progress_begin(o->duration_s, o->quiet);
    sphm_status status = write_sample(r, 0);
    for (size_t k = 1; k <= count && status == SPHM_OK && !interrupted; k++) {
        double time_s = k < count ? (double)k * o->every_s : o->duration_s, real_time_factor = 0;
        status = advance_to(r, time_s, &real_time_factor);
        if (status == SPHM_OK)
            status = write_sample(r, real_time_factor);
        sphm_progress_update(&progress, time_s);
    }
    sphm_progress_end(&progress);
    return status;
}

static void summarise(const run *r) {
    double simulated_s = sphm_muscle_time(r->muscle) - r->start_s;
    uint64_t steps = sphm_muscle_timing(r->muscle).steps;
    printf("%s%.6g s simulated in %.3g s (real-time factor %.3g), %llu steps of about %.3g s, %zu particles, "
           "%s\n"
           "%zu samples in %s\n",
           interrupted ? "interrupted: " : "", simulated_s, r->wall_s,
           r->wall_s > 0 ? simulated_s / r->wall_s : 0.0, (unsigned long long)steps,
           steps ? simulated_s / (double)steps : 0.0, sphm_muscle_body(r->muscle)->count,
           sphm_muscle_device(r->muscle), r->samples, r->options->out);
}

static sphm_status run_all(run *r) {
    catch_signals();
    sphm_status status = sphm_io_create_muscle(&r->options->parameters, &r->muscle, &r->context);
    if (status == SPHM_OK && r->options->restore)
        status = sphm_muscle_load(r->muscle, r->options->restore, &r->context);
    while (status == SPHM_OK && !sphm_muscle_ready(r->muscle) && !interrupted)
        status = sphm_muscle_start_up(r->muscle, 0.1, &r->context);
    if (status != SPHM_OK)
        return status;
    r->start_s = sphm_muscle_time(r->muscle);
    status = open_files(r);
    if (status == SPHM_OK)
        status = simulate(r);
    status = close_files(r, status);
    if (status == SPHM_OK && r->options->snapshot)
        status = sphm_muscle_save(r->muscle, r->options->snapshot, &r->context);
    if (status == SPHM_OK && !r->options->quiet)
        summarise(r);
    return status;
}

int main(int argc, char **argv) {
    sphm_run_options *options = malloc(sizeof *options);
    int exit_code = SPHM_EXIT_FAILED;
    if (options && sphm_run_options_parse(argc, argv, options, &exit_code)) {
        run r;
        memset(&r, 0, sizeof r);
        r.options = options;
        r.schedule = &options->schedule;
        r.context = sphm_cli_context(options->quiet);
        sphm_status status = run_all(&r);
        exit_code = sphm_cli_exit_code(status, &r.context);
        if (exit_code == SPHM_EXIT_BAD_INPUT && r.samples) /* a disk that filled up is no bad input */
            exit_code = SPHM_EXIT_FAILED;
        if (status == SPHM_OK && interrupted)
            exit_code = 128 + interrupted;
        sphm_muscle_destroy(r.muscle);
    }
    free(options);
    return exit_code;
}
