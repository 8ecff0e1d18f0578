/* The command line of sph_muscle_bench. */
#ifndef SPHM_CLI_BENCH_OPTIONS_H
#define SPHM_CLI_BENCH_OPTIONS_H

#include "sph_muscle/parameters.h"

typedef struct sphm_bench_options {
    sphm_parameters parameters;
    size_t steps, batch, repeat, warm_up;
} sphm_bench_options;

/* Returns 1 to go on; 0 to end with *exit_code. */
int sphm_bench_options_parse(int argc, char **argv, sphm_bench_options *options, int *exit_code);

#endif
