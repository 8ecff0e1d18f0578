/* Messages, numbers and name=value for the command-line programs. */
#define _GNU_SOURCE /* program_invocation_short_name */
#include "cli/common.h"

#include "core/context.h"
#include "core/number.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

void sphm_cli_complain(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fprintf(stderr, "%s: ", program_invocation_short_name);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

int sphm_cli_exit_code(sphm_status status, const sphm_context *context) {
    if (status == SPHM_OK)
        return SPHM_EXIT_DONE;
    sphm_cli_complain("%s", context->message);
    if (status == SPHM_FAILED_NONFINITE)
        return SPHM_EXIT_NONFINITE;
    if (status == SPHM_REFUSED_MEMORY || status < 0)
        return SPHM_EXIT_FAILED;
    return SPHM_EXIT_BAD_INPUT;
}

static void log_all(sphm_log_level level, const char *text, void *user) {
    (void)user;
    sphm_cli_complain("%s%s", level == SPHM_LOG_WARNING ? "warning: " : "", text);
}

static void log_warnings(sphm_log_level level, const char *text, void *user) {
    if (level == SPHM_LOG_WARNING)
        log_all(level, text, user);
}

sphm_context sphm_cli_context(int quiet) {
    sphm_context context;
    memset(&context, 0, sizeof context);
    context.log = quiet ? log_warnings : log_all;
    return context;
}

int sphm_cli_positive(const char *option, const char *text, int allow_zero, double *value) {
    if (sphm_number_parse(text, value) && (*value > 0 || (allow_zero && *value == 0)))
        return 1;
    sphm_cli_complain("%s is '%s'; it must be a number %s 0", option, text,
                      allow_zero ? "not below" : "above");
    return 0;
}

int sphm_cli_count(const char *option, const char *text, double least, size_t *value) {
    double number;
    if (sphm_number_parse(text, &number) && number == floor(number) && number >= least && number <= 1e15) {
        *value = (size_t)number;
        return 1;
    }
    sphm_cli_complain("%s is '%s'; it must be a whole number from %g", option, text, least);
    return 0;
}

sphm_status sphm_cli_set(sphm_parameters *parameters, const char *assignment, sphm_context *context) {
    const char *equals = strchr(assignment, '=');
    char name[128];
    if (!equals || equals == assignment || (size_t)(equals - assignment) >= sizeof name)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "--set '%.100s' is not of the form name=value, as in --set particles=4944",
                         assignment);
    memcpy(name, assignment, (size_t)(equals - assignment));
    name[equals - assignment] = '\0';
    return sphm_parameters_set(parameters, name, equals + 1, context);
}

void sphm_cli_print_version(const char *program) {
    printf("%s %s\n%s\nfiles: meshes %s, YAML %s\n", program, sphm_version(), sphm_build_configuration(),
           sphm_io_has_mesh() ? "yes" : "no (built without assimp)",
           sphm_io_has_yaml() ? "yes" : "no (built without libyaml)");
}

double sphm_cli_now(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
