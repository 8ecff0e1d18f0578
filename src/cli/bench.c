/* sph_muscle_bench: how fast, as one JSON object on one line. */
#define _DEFAULT_SOURCE /* getrusage, clock_gettime */
#include "cli/bench_options.h"
#include "cli/common.h"
#include "core/context.h"
#include "core/number.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

/* One repetition: wall time of each step, and where it went. Processor time beside it, of all threads: on a
 * machine whose host gives it only a share of its processors, wall time says little. */
typedef struct repetition {
    double *step_s; /* [steps] */
    double wall_s, cpu_s, cpu_step_min_s, simulated_s;
    sphm_timing timing;
} repetition;

static int compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static int compare_repetitions(const void *a, const void *b) {
    return compare_doubles(&((const repetition *)a)->wall_s, &((const repetition *)b)->wall_s);
}

static double processor_time_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int compare_processor_time(const void *a, const void *b) {
    return compare_doubles(&((const repetition *)a)->cpu_s, &((const repetition *)b)->cpu_s);
}

/* Measuring
 * ------------------------------------------------------------------------------------------------*/

/* Drives both ends: a held belly would leave the diffusion nothing to do. A fresh muscle is not made again,
 * which at ten million particles takes longer than all steps. */
static sphm_status prepare(sphm_muscle *muscle, int fresh, size_t warm_up, sphm_context *context) {
    sphm_status status = fresh ? SPHM_OK : sphm_muscle_reset(muscle, context);
    if (status == SPHM_OK)
        status = sphm_muscle_stimulate(muscle, "both", 8000, 0, context);
    if (status == SPHM_OK && warm_up)
        status = sphm_muscle_step(muscle, warm_up, context);
    return status;
}

static sphm_status measure(sphm_muscle *muscle, const sphm_bench_options *o, int fresh, repetition *r,
                           sphm_context *context) {
    sphm_status status = prepare(muscle, fresh, o->warm_up, context);
    sphm_muscle_reset_timing(muscle);
    double simulated_s = sphm_muscle_time(muscle), start = sphm_cli_now(), last = start;
    double cpu_start = processor_time_s(), cpu_last = cpu_start;
    r->cpu_step_min_s = INFINITY;
    for (size_t i = 0; i < o->steps && status == SPHM_OK;) {
        const size_t call = o->batch < o->steps - i ? o->batch : o->steps - i;
        status = sphm_muscle_step(muscle, call, context);
        double now = sphm_cli_now();
        double cpu_now = processor_time_s();
        for (size_t end = i + call; i < end; i++) /* the mean of a call's steps */
            r->step_s[i] = (now - last) / (double)call;
        r->cpu_step_min_s = fmin(r->cpu_step_min_s, (cpu_now - cpu_last) / (double)call);
        last = now;
        cpu_last = cpu_now;
    }
    r->wall_s = last - start;
    r->cpu_s = cpu_last - cpu_start;
    r->simulated_s = sphm_muscle_time(muscle) - simulated_s;
    r->timing = sphm_muscle_timing(muscle);
    return status;
}

/* Printing
 * -------------------------------------------------------------------------------------------------*/

static void print_text(const char *key, const char *text) {
    printf("\"%s\": \"", key);
    for (; *text; text++) {
        if (*text == '"' || *text == '\\')
            putchar('\\');
        if ((unsigned char)*text >= 0x20)
            putchar(*text);
    }
    fputs("\", ", stdout);
}

/* JSON knows no infinity; six digits are more than a clock is good for. */
static void print_number(const char *key, double value, const char *after) {
    char text[SPHM_NUMBER_SIZE];
    sphm_number_print_digits(value, 6, text);
    printf("\"%s\": %s%s", key, value - value == 0 ? text : "null", after);
}

static void print_count(const char *key, size_t value) {
    printf("\"%s\": %zu, ", key, value);
}

static void print_stages(const sphm_timing *t, double wall_s) {
    const double us = t->steps ? 1e6 / (double)t->steps : 0;
    double known_s = t->neighbours_s + t->intermediate_velocity_s + t->density_pressure_s + t->forces_s +
                     t->diffusion_s + t->cell_model_s + t->integration_s;
    fputs("\"stage_us\": {", stdout);
    print_number("neighbours", t->neighbours_s * us, ", ");
    print_number("intermediate_velocity", t->intermediate_velocity_s * us, ", ");
    print_number("density_pressure", t->density_pressure_s * us, ", ");
    print_number("forces", t->forces_s * us, ", ");
    print_number("diffusion", t->diffusion_s * us, ", ");
    print_number("cell_model", t->cell_model_s * us, ", ");
    print_number("integration", t->integration_s * us, ", ");
    print_number("other", (wall_s - known_s) * us, "}, ");
}

/* Where a back end has timed its launches one by one: of all kinds that there were, a step's share. */
static void print_launches(const sphm_timing *t) {
    const double us = t->steps ? 1e6 / (double)t->steps : 0;
    const char *between = "";
    if (t->launch_kinds == 0)
        return;
    fputs("\"launch_us\": {", stdout);
    for (size_t k = 0; k < t->launch_kinds; k++) {
        if (!(t->launch_s[k] > 0))
            continue;
        fputs(between, stdout);
        print_number(t->launch_name[k], t->launch_s[k] * us, "");
        between = ", ";
    }
    fputs("}, ", stdout);
}

static size_t peak_memory_bytes(void) {
    struct rusage usage;
    return getrusage(RUSAGE_SELF, &usage) == 0 ? 1024 * (size_t)usage.ru_maxrss : 0;
}

/* The number in "cpu, 2 threads"; what the back end took, not what was asked for. */
static size_t thread_count(const char *device) {
    const char *comma = strrchr(device, ',');
    long threads = comma ? strtol(comma + 1, NULL, 10) : 0;
    return threads > 0 ? (size_t)threads : 1;
}

static void print_choice(const sphm_parameters *parameters, const char *name) {
    char text[64] = "";
    sphm_parameters_get(parameters, name, text, sizeof text, NULL);
    print_text(name, text);
}

/* Of all repetitions: the median of the processor time, and the best single step. */
static void print_processor_time(const sphm_bench_options *o, repetition *all) {
    double step_s = INFINITY, cpu_step_s = INFINITY;
    for (size_t k = 0; k < o->repeat; k++) {
        cpu_step_s = fmin(cpu_step_s, all[k].cpu_step_min_s);
        for (size_t i = 0; i < o->steps; i++)
            step_s = fmin(step_s, all[k].step_s[i]);
    }
    qsort(all, o->repeat, sizeof *all, compare_processor_time);
    print_number("step_us_min", 1e6 * step_s, ", ");
    print_number("cpu_us_per_step", 1e6 * all[(o->repeat - 1) / 2].cpu_s / (double)o->steps, ", ");
    print_number("cpu_us_per_step_least", 1e6 * all[0].cpu_s / (double)o->steps, ", ");
    print_number("cpu_us_min", 1e6 * cpu_step_s, ", ");
}

static void print_result(const sphm_muscle *muscle, const sphm_bench_options *o, repetition *all) {
    repetition *r = &all[(o->repeat - 1) / 2];
    size_t particles = sphm_muscle_body(muscle)->count;
    const char *device = sphm_muscle_device(muscle);
    double steps_per_s = (double)o->steps / r->wall_s, particle_steps = steps_per_s * (double)particles;
    double neighbours = r->timing.neighbours_per_particle;
    qsort(r->step_s, o->steps, sizeof *r->step_s, compare_doubles);
    putchar('{');
    print_choice(sphm_muscle_parameters(muscle), "tissue");
    print_text("backend", strncmp(device, "cpu", 3) == 0 ? "cpu" : "cuda");
    print_text("device", device);
    print_count("threads", thread_count(device));
    print_count("particles", particles);
    print_number("neighbours_per_particle", neighbours, ", ");
    print_number("steps_per_s", steps_per_s, ", ");
    print_number("particle_steps_per_s", particle_steps, ", ");
    print_number("ns_per_neighbour_pair", 1e9 / (particle_steps * neighbours), ", ");
    print_number("rtf", r->simulated_s / r->wall_s, ", ");
    print_stages(&r->timing, r->wall_s);
    print_launches(&r->timing);
    print_number("step_us_median", 1e6 * r->step_s[o->steps / 2], ", ");
    print_number("step_us_p99", 1e6 * r->step_s[(o->steps - 1) * 99 / 100], ", ");
    print_count("peak_memory_bytes", peak_memory_bytes());
    print_number("memory_bytes_per_particle", (double)r->timing.memory_bytes / (double)particles, ", ");
    print_count("steps", o->steps);
    print_count("batch", o->batch);
    print_count("repeat", o->repeat);
    print_number("time_step_s", r->simulated_s / (double)o->steps, ", ");
    print_number("support_radius_m", sphm_muscle_body(muscle)->support_radius_m, ", ");
    print_number("neighbour_rebuilds", (double)r->timing.neighbour_rebuilds, ", ");
    print_processor_time(o, all); /* the last: reorders the repetitions */
    printf("\"precision\": \"%s\", \"version\": \"%s\"}\n", sizeof(sphm_real) == 4 ? "single" : "double",
           sphm_version());
}

static sphm_status bench(const sphm_bench_options *o, double *step_s, repetition *repetitions,
                         sphm_context *context) {
    sphm_muscle *muscle = NULL;
    sphm_status status = sphm_io_create_muscle(&o->parameters, &muscle, context);
    for (size_t i = 0; i < o->repeat && status == SPHM_OK; i++) {
        repetitions[i].step_s = step_s + i * o->steps;
        status = measure(muscle, o, i == 0, &repetitions[i], context);
    }
    if (status == SPHM_OK) {
        qsort(repetitions, o->repeat, sizeof *repetitions, compare_repetitions);
        print_result(muscle, o, repetitions);
    }
    sphm_muscle_destroy(muscle);
    return status;
}

int main(int argc, char **argv) {
    sphm_bench_options *o = malloc(sizeof *o);
    int exit_code = SPHM_EXIT_FAILED;
    if (o && sphm_bench_options_parse(argc, argv, o, &exit_code)) {
        sphm_context context = sphm_cli_context(1);
        double *step_s = calloc(o->steps * o->repeat, sizeof *step_s);
        repetition *repetitions = calloc(o->repeat, sizeof *repetitions);
        sphm_status status = SPHM_REFUSED_MEMORY;
        if (step_s && repetitions)
            status = bench(o, step_s, repetitions, &context);
        else
            sphm_fail(&context, status, "no memory for %zu times %zu steps", o->repeat, o->steps);
        exit_code = sphm_cli_exit_code(status, &context);
        free(repetitions);
        free(step_s);
    }
    free(o);
    return exit_code;
}
