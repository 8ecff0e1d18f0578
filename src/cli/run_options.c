/* Options of the runner. They apply in this order, whatever theirs is: defaults, --config, --set,
 * --stimulate. */
#define _GNU_SOURCE /* getopt_long */
#include "cli/run_options.h"

#include "cli/common.h"
#include "cli/run_table.h"
#include "core/context.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

static const char help[] =
    "Usage: sph_muscle_run --duration S --out DIR [OPTION]...\n"
    "\n"
    "Simulates a muscle without ROS and writes what it does into DIR.\n"
    "\n"
    "Which muscle:\n"
    "  -c, --config FILE          YAML file of parameters (config/ has examples); without it\n"
    "                             the defaults: the preset triceps_long_head\n"
    "  -s, --set NAME=VALUE       set one parameter, over the file; may be repeated\n"
    "  -p, --parameters           print the table of all parameters (Markdown) and exit\n"
    "      --restore FILE         begin from a snapshot of the same muscle\n"
    "\n"
    "What happens to it:\n"
    "  -d, --duration S           simulated seconds to run\n"
    "  -i, --stimulate START:END:CURRENT[:ELECTRODE[:RATE_HZ:PULSE_S]]\n"
    "                             current in uA/mm2 from START to END (simulated seconds);\n"
    "                             ELECTRODE is belly, origin, insertion, both or sphere (default:\n"
    "                             the parameter electrode); with RATE_HZ a train of pulses of\n"
    "                             PULSE_S seconds; may be repeated, adds to the parameter stimulus\n"
    "\n"
    "What happens to a solid muscle (tissue: solid; END is origin or insertion; times in s):\n"
    "      --activate START:END:VALUE\n"
    "                             command the activation, 0 ... 1, past the electrophysiology\n"
    "      --move END:DX,DY,DZ@START:END\n"
    "                             bring an end to DX, DY, DZ (m) from its rest place, and hold it\n"
    "      --end-motion FILE      moves from a CSV file: time_s,end,dx_m,dy_m,dz_m\n"
    "      --load END:FX,FY,FZ[@START:END]\n"
    "                             hang a constant force (N) on an end, which moves and turns freely\n"
    "      --slide END:FORCE[@START:END]\n"
    "                             let an end slide along the line of action, pulled by FORCE (N)\n"
    "      --release END[@START:END]\n"
    "                             let go of an end; after END it is held where it then is\n"
    "                             (all may be repeated)\n"
    "\n"
    "What is written:\n"
    "  -o, --out DIR              folder of the results, made if need be\n"
    "  -e, --every S              simulated seconds between samples (default 0.02)\n"
    "  -v, --vtk                  write particles and surface at every sample too\n"
    "      --snapshot FILE        save the state reached at the end\n"
    "  -q, --quiet                no progress bar, no summary; warnings and errors only\n"
    "\n"
    "  -h, --help                 this page\n"
    "  -V, --version              version and how it was built\n"
    "\n"
    "DIR receives timeseries.csv (one line a sample, units in the column names),\n"
    "parameters.yaml (every parameter as used: --config takes it again) and with --vtk\n"
    "particles.pvd and surface.pvd, which ParaView opens as animations.\n"
    "\n"
    "Exit status: 0 done, 2 bad input (the message says what would be valid), 3 the state\n"
    "became non-finite (files up to then are kept), 1 anything else that failed. Ctrl-C ends\n"
    "the run after the present sample with complete files and status 130.\n"
    "\n"
    "Examples:\n"
    "  sph_muscle_run --duration 2 --out results --stimulate 0.5:1.5:8000\n"
    "  sph_muscle_run --config config/paper.yaml --set particles=2231 --duration 1 --out paper --vtk\n";

enum {
    OPTION_RESTORE = 256,
    OPTION_SNAPSHOT,
    OPTION_ACTIVATE,
    OPTION_MOVE,
    OPTION_END_MOTION,
    OPTION_LOAD,
    OPTION_SLIDE,
    OPTION_RELEASE
};

static const struct option long_options[] = {
    {"config", required_argument, NULL, 'c'},
    {"set", required_argument, NULL, 's'},
    {"parameters", no_argument, NULL, 'p'},
    {"restore", required_argument, NULL, OPTION_RESTORE},
    {"duration", required_argument, NULL, 'd'},
    {"stimulate", required_argument, NULL, 'i'},
    {"activate", required_argument, NULL, OPTION_ACTIVATE},
    {"move", required_argument, NULL, OPTION_MOVE},
    {"end-motion", required_argument, NULL, OPTION_END_MOTION},
    {"load", required_argument, NULL, OPTION_LOAD},
    {"slide", required_argument, NULL, OPTION_SLIDE},
    {"release", required_argument, NULL, OPTION_RELEASE},
    {"out", required_argument, NULL, 'o'},
    {"every", required_argument, NULL, 'e'},
    {"vtk", no_argument, NULL, 'v'},
    {"snapshot", required_argument, NULL, OPTION_SNAPSHOT},
    {"quiet", no_argument, NULL, 'q'},
    {"help", no_argument, NULL, 'h'},
    {"version", no_argument, NULL, 'V'},
    {NULL, 0, NULL, 0},
};
static const char short_options[] = "c:s:pd:i:o:e:vqhV";

static int schedule(sphm_run_options *o, const char *option, int *exit_code) {
    sphm_context context = sphm_cli_context(1);
    const sphm_status status = sphm_run_schedule_add(&o->schedule, option, optarg, &context);
    *exit_code = status == SPHM_OK ? SPHM_EXIT_DONE : sphm_cli_exit_code(status, &context);
    return status == SPHM_OK;
}

/* One option that is not about parameters. Returns 1 to go on. */
static int take_option(int option, sphm_run_options *o, int *exit_code) {
    *exit_code = SPHM_EXIT_DONE;
    switch (option) {
    case 'h':
        fputs(help, stdout);
        return 0;
    case 'V':
        sphm_cli_print_version("sph_muscle_run");
        return 0;
    case 'p':
        sphm_cli_print_table(stdout);
        return 0;
    case 'o':
        o->out = optarg;
        return 1;
    case 'v':
        o->vtk = 1;
        return 1;
    case 'q':
        o->quiet = 1;
        return 1;
    case OPTION_RESTORE:
        o->restore = optarg;
        return 1;
    case OPTION_SNAPSHOT:
        o->snapshot = optarg;
        return 1;
    case 'd':
    case 'e':
        *exit_code = SPHM_EXIT_BAD_INPUT;
        return option == 'd' ? sphm_cli_positive("--duration", optarg, 0, &o->duration_s)
                             : sphm_cli_positive("--every", optarg, 0, &o->every_s);
    case OPTION_ACTIVATE:
        return schedule(o, "--activate", exit_code);
    case OPTION_MOVE:
        return schedule(o, "--move", exit_code);
    case OPTION_END_MOTION:
        return schedule(o, "--end-motion", exit_code);
    case OPTION_LOAD:
        return schedule(o, "--load", exit_code);
    case OPTION_SLIDE:
        return schedule(o, "--slide", exit_code);
    case OPTION_RELEASE:
        return schedule(o, "--release", exit_code);
    case 'c':
    case 's':
    case 'i':
        return 1; /* gone through again, in their own order */
    default:      /* getopt has said what is wrong */
        fputs("Try 'sph_muscle_run --help'.\n", stderr);
        *exit_code = SPHM_EXIT_BAD_INPUT;
        return 0;
    }
}

/* Adds to the schedule of the parameters, so that parameters.yaml describes the whole run. */
static sphm_status add_stimulus(sphm_parameters *parameters, const char *entry, sphm_context *context) {
    size_t used = strlen(parameters->stimulus), length = strlen(entry);
    if (used + length + 3 > sizeof parameters->stimulus)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "--stimulate '%.60s': the schedule is longer than %d bytes; a train of pulses "
                         "(START:END:CURRENT:ELECTRODE:RATE_HZ:PULSE_S) is one entry",
                         entry, SPHM_TEXT_SIZE - 1);
    if (strspn(entry, " ;") == length)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "--stimulate is empty; it must be START:END:CURRENT");
    sprintf(parameters->stimulus + used, "%s%s", used ? "; " : "", entry);
    return SPHM_OK;
}

/* All --config, then all --set, then all --stimulate. */
static sphm_status take_parameters(int argc, char **argv, sphm_run_options *o, sphm_context *context) {
    static const char passes[] = "csi";
    o->parameters = sphm_parameters_default();
    for (const char *pass = passes; *pass; pass++) {
        optind = 0; /* glibc: begin again */
        for (int option; (option = getopt_long(argc, argv, short_options, long_options, NULL)) != -1;) {
            sphm_status status = SPHM_OK;
            if (option != *pass)
                continue;
            if (option == 'c')
                status = sphm_io_load_parameters(optarg, &o->parameters, context);
            else if (option == 's')
                status = sphm_cli_set(&o->parameters, optarg, context);
            else
                status = add_stimulus(&o->parameters, optarg, context);
            if (status != SPHM_OK)
                return status;
        }
    }
    return SPHM_OK;
}

static int refuse_incomplete(const sphm_run_options *o) {
    if (o->duration_s > 0 && o->out && o->out[0])
        return 0;
    sphm_cli_complain("%s is missing%s", o->duration_s > 0 ? "--out DIR" : "--duration S",
                      o->duration_s > 0 ? ", the folder to write into" : ", the simulated seconds to run");
    fputs("Try 'sph_muscle_run --help'.\n", stderr);
    return 1;
}

static int refuse_too_many_samples(const sphm_run_options *o) {
    const double most = 1e9, samples = o->duration_s / o->every_s;
    if (o->duration_s <= 1e9 && samples <= most)
        return 0;
    sphm_cli_complain("--duration is %g s and --every %g s; the duration must be at most 1e9 s, and the "
                      "samples, %g, at most %g",
                      o->duration_s, o->every_s, samples, most);
    return 1;
}

int sphm_run_options_parse(int argc, char **argv, sphm_run_options *o, int *exit_code) {
    memset(o, 0, sizeof *o);
    o->every_s = 0.02;
    for (int option; (option = getopt_long(argc, argv, short_options, long_options, NULL)) != -1;)
        if (!take_option(option, o, exit_code))
            return 0;
    *exit_code = SPHM_EXIT_BAD_INPUT;
    if (optind < argc) {
        sphm_cli_complain("'%s' is not an option; try 'sph_muscle_run --help'", argv[optind]);
        return 0;
    }
    if (refuse_incomplete(o) || refuse_too_many_samples(o))
        return 0;
    sphm_context context = sphm_cli_context(1);
    sphm_status status = take_parameters(argc, argv, o, &context);
    if (status == SPHM_OK && o->schedule.count && o->parameters.tissue != SPHM_TISSUE_SOLID)
        status = sphm_fail(&context, SPHM_REFUSED_ARGUMENT,
                           "--activate, --move, --end-motion, --load, --slide and --release need tissue: "
                           "solid (--set tissue=solid)");
    *exit_code = status == SPHM_OK ? SPHM_EXIT_DONE : sphm_cli_exit_code(status, &context);
    return status == SPHM_OK;
}
