/* What runner and benchmark share: exit codes, messages on stderr, name=value. */
#ifndef SPHM_CLI_COMMON_H
#define SPHM_CLI_COMMON_H

#include "sph_muscle/io.h"

/* Beside these, 128 + signal number for a run that was ended by Ctrl-C or SIGTERM. */
enum { SPHM_EXIT_DONE = 0, SPHM_EXIT_FAILED = 1, SPHM_EXIT_BAD_INPUT = 2, SPHM_EXIT_NONFINITE = 3 };

/* "PROGRAM: text" as a line on stderr. */
void sphm_cli_complain(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* Says what happened and returns the exit code for it. */
int sphm_cli_exit_code(sphm_status status, const sphm_context *context);
/* A context whose notes and warnings go to stderr; `quiet` leaves out the notes. */
sphm_context sphm_cli_context(int quiet);

/* Reads a number above (or, with `allow_zero`, not below) 0; complains, naming `option`, and returns 0 if it
 * is none. */
int sphm_cli_positive(const char *option, const char *text, int allow_zero, double *value);
/* The same for whole numbers from `least`. */
int sphm_cli_count(const char *option, const char *text, double least, size_t *value);
/* Applies "name=value". */
sphm_status sphm_cli_set(sphm_parameters *parameters, const char *assignment, sphm_context *context);
/* Version and how the library was built. */
void sphm_cli_print_version(const char *program);

/* Monotonic wall time, s. */
double sphm_cli_now(void);

#endif
