/* A progress bar on stderr where that is a terminal; nothing elsewhere. */
#ifndef SPHM_CLI_RUN_PROGRESS_H
#define SPHM_CLI_RUN_PROGRESS_H

typedef struct sphm_progress {
    int shown;
    double start_wall_s, drawn_wall_s; /* of sphm_cli_now() */
    double duration_s;                 /* simulated */
} sphm_progress;

sphm_progress sphm_progress_begin(double duration_s, int quiet);
/* `done_s` simulated seconds of the run are over; draws at most ten times a second. */
void sphm_progress_update(sphm_progress *progress, double done_s);
/* Takes the bar away. */
void sphm_progress_end(sphm_progress *progress);

#endif
