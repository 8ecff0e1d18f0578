/* The command line of sph_muscle_run. */
#ifndef SPHM_CLI_RUN_OPTIONS_H
#define SPHM_CLI_RUN_OPTIONS_H

#include "cli/run_schedule.h"

typedef struct sphm_run_options {
    sphm_parameters parameters; /* of the configuration, with every --set and --stimulate applied */
    const char *out, *snapshot, *restore;
    double duration_s, every_s;
    int vtk, quiet;
    sphm_run_schedule schedule;
} sphm_run_options;

/* Returns 1 to go on; 0 to end with *exit_code (help was asked for, or something was wrong and said). */
int sphm_run_options_parse(int argc, char **argv, sphm_run_options *options, int *exit_code);

#endif
