/* Options of the benchmark. All but the counts are parameters under a shorter name; they apply in the order
 * given. */
#define _GNU_SOURCE /* getopt_long */
#include "cli/bench_options.h"

#include "cli/common.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

static const char help[] =
    "Usage: sph_muscle_bench [OPTION]...\n"
    "\n"
    "Measures how fast a muscle is computed and prints one JSON object on one line.\n"
    "Both ends are driven with 8000 uA/mm2, so that every stage has work. A repetition is:\n"
    "a fresh or reset muscle, warm up, then the timed steps; all repetitions compute the\n"
    "same states, and the one with the median time is reported.\n"
    "\n"
    "      --tissue NAME        tissue model (default solid)\n"
    "      --backend NAME       auto, cpu or cuda (default auto)\n"
    "  -n, --particles N        (default 2231)\n"
    "  -t, --threads N          0 is all there are (default 0)\n"
    "  -N, --steps N            timed steps of a repetition (default 200)\n"
    "  -w, --warm-up N          steps before them (default a tenth, at least 10)\n"
    "  -b, --batch N            steps of a call, which a GPU takes without the host (default 1)\n"
    "  -r, --repeat R           repetitions (default 5)\n"
    "  -c, --config FILE        YAML file of parameters\n"
    "  -s, --set NAME=VALUE     any other parameter; may be repeated\n"
    "  -h, --help               this page\n"
    "  -V, --version            version and how it was built\n"
    "\n"
    "Keys: particle_steps_per_s counts particles times steps; rtf is simulated over wall\n"
    "time; stage_us is the mean wall time of each stage of a step, other is what no stage\n"
    "claims; cpu_us_per_step is the processor time of all threads over the steps (the median\n"
    "repetition; cpu_us_per_step_least the best one, cpu_us_min the best single step) and,\n"
    "unlike wall time, says something on a throttled or shared machine, save that threads may\n"
    "wait busily for each other; step_us_min is the wall time of the best single step;\n"
    "memory_bytes_per_particle is what the muscle allocated, peak_memory_bytes what the whole\n"
    "process needed at most.\n"
    "\n"
    "Exit status: 0 done, 2 bad input, 3 the state became non-finite, 1 anything else.\n"
    "\n"
    "Example: the paper's size, h = 0.04 in its units, on two threads\n"
    "  sph_muscle_bench --particles 18475 --set paper_units=true --threads 2\n";

enum { OPTION_TISSUE = 256, OPTION_BACKEND };

static const struct option long_options[] = {
    {"tissue", required_argument, NULL, OPTION_TISSUE},
    {"backend", required_argument, NULL, OPTION_BACKEND},
    {"particles", required_argument, NULL, 'n'},
    {"threads", required_argument, NULL, 't'},
    {"steps", required_argument, NULL, 'N'},
    {"warm-up", required_argument, NULL, 'w'},
    {"batch", required_argument, NULL, 'b'},
    {"repeat", required_argument, NULL, 'r'},
    {"config", required_argument, NULL, 'c'},
    {"set", required_argument, NULL, 's'},
    {"help", no_argument, NULL, 'h'},
    {"version", no_argument, NULL, 'V'},
    {NULL, 0, NULL, 0},
};

static int take_parameter(int option, sphm_parameters *p, int *exit_code) {
    sphm_context context = sphm_cli_context(1);
    sphm_status status = SPHM_OK;
    if (option == OPTION_TISSUE)
        status = sphm_parameters_set(p, "tissue", optarg, &context);
    else if (option == OPTION_BACKEND)
        status = sphm_parameters_set(p, "backend", optarg, &context);
    else if (option == 'n')
        status = sphm_parameters_set(p, "particles", optarg, &context);
    else if (option == 't')
        status = sphm_parameters_set(p, "threads", optarg, &context);
    else if (option == 'c')
        status = sphm_io_load_parameters(optarg, p, &context);
    else
        status = sphm_cli_set(p, optarg, &context);
    *exit_code = sphm_cli_exit_code(status, &context);
    return status == SPHM_OK;
}

static int take_option(int option, sphm_bench_options *o, int *exit_code) {
    *exit_code = SPHM_EXIT_BAD_INPUT;
    switch (option) {
    case 'N':
        return sphm_cli_count("--steps", optarg, 1, &o->steps);
    case 'w':
        return sphm_cli_count("--warm-up", optarg, 0, &o->warm_up);
    case 'b':
        return sphm_cli_count("--batch", optarg, 1, &o->batch);
    case 'r':
        return sphm_cli_count("--repeat", optarg, 1, &o->repeat);
    case 'h':
        fputs(help, stdout);
        *exit_code = SPHM_EXIT_DONE;
        return 0;
    case 'V':
        sphm_cli_print_version("sph_muscle_bench");
        *exit_code = SPHM_EXIT_DONE;
        return 0;
    case '?':
        fputs("Try 'sph_muscle_bench --help'.\n", stderr);
        return 0;
    default:
        return take_parameter(option, &o->parameters, exit_code);
    }
}

int sphm_bench_options_parse(int argc, char **argv, sphm_bench_options *o, int *exit_code) {
    memset(o, 0, sizeof *o);
    o->parameters = sphm_parameters_default();
    o->steps = 200;
    o->batch = 1;
    o->repeat = 5;
    o->warm_up = SIZE_MAX;
    for (int option; (option = getopt_long(argc, argv, "n:t:N:w:b:r:c:s:hV", long_options, NULL)) != -1;)
        if (!take_option(option, o, exit_code))
            return 0;
    if (optind < argc) {
        sphm_cli_complain("'%s' is not an option; try 'sph_muscle_bench --help'", argv[optind]);
        *exit_code = SPHM_EXIT_BAD_INPUT;
        return 0;
    }
    if (o->warm_up == SIZE_MAX)
        o->warm_up = o->steps / 10 > 10 ? o->steps / 10 : 10;
    return 1;
}
