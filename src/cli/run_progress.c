/* One line, drawn over itself: bar, simulated time, real-time factor, time left. */
#define _POSIX_C_SOURCE 200809L /* isatty */
#include "cli/run_progress.h"

#include "cli/common.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { WIDTH = 30 };

sphm_progress sphm_progress_begin(double duration_s, int quiet) {
    sphm_progress p;
    p.shown = !quiet && isatty(STDERR_FILENO);
    p.start_wall_s = sphm_cli_now();
    p.drawn_wall_s = 0;
    p.duration_s = duration_s;
    return p;
}

/* "1:05" or "2:03:20". */
static void print_clock(char *text, size_t size, double seconds) {
    long s = (long)ceil(seconds);
    if (s >= 3600)
        snprintf(text, size, "%ld:%02ld:%02ld", s / 3600, s / 60 % 60, s % 60);
    else
        snprintf(text, size, "%ld:%02ld", s / 60, s % 60);
}

void sphm_progress_update(sphm_progress *p, double done_s) {
    double now = sphm_cli_now(), wall_s = now - p->start_wall_s;
    if (!p->shown || (now - p->drawn_wall_s < 0.1 && done_s < p->duration_s))
        return;
    p->drawn_wall_s = now;
    double fraction = done_s / p->duration_s;
    char bar[WIDTH + 1], left[32] = "?";
    int filled = (int)(WIDTH * (fraction > 1 ? 1 : fraction));
    memset(bar, '.', WIDTH);
    memset(bar, '#', (size_t)filled);
    bar[WIDTH] = '\0';
    if (done_s > 0)
        print_clock(left, sizeof left, wall_s * (p->duration_s - done_s) / done_s);
    fprintf(stderr, "\r[%s] %.3f of %g s, real-time factor %.3g, %s left \033[K", bar, done_s, p->duration_s,
            wall_s > 0 ? done_s / wall_s : 0.0, left);
    fflush(stderr);
}

void sphm_progress_end(sphm_progress *p) {
    if (p->shown)
        fputs("\r\033[K", stderr);
}
