/* What is done to a solid muscle when: activation, poses and loads of its ends, from the command line. */
#ifndef SPHM_CLI_RUN_SCHEDULE_H
#define SPHM_CLI_RUN_SCHEDULE_H

#include "sph_muscle/muscle.h"

enum { SPHM_RUN_MOST_EVENTS = 4096 };

typedef enum sphm_run_action {
    SPHM_RUN_ACTIVATE,
    SPHM_RUN_MOVE,
    SPHM_RUN_LOAD,
    SPHM_RUN_SLIDE,
    SPHM_RUN_RELEASE,
    SPHM_RUN_HOLD
} sphm_run_action;

typedef struct sphm_run_event {
    double time_s, duration_s;
    sphm_run_action action;
    int end;
    double value[3];    /* activation; displacement from rest (m); load (N) */
    double velocity[3]; /* when it arrives (m/s) */
} sphm_run_event;

typedef struct sphm_run_schedule {
    size_t count, next;
    sphm_run_event events[SPHM_RUN_MOST_EVENTS];
} sphm_run_schedule;

/* Adds what one option says; `option` is its name, for messages:
 *   --activate START:END:VALUE       --move END:DX,DY,DZ@START:END        --end-motion FILE
 *   --load END:FX,FY,FZ[@START:END]  --slide END:FORCE[@START:END]        --release END[@START:END] */
sphm_status sphm_run_schedule_add(sphm_run_schedule *schedule, const char *option, const char *text,
                                  sphm_context *context);
/* By time; those of one time stay in the order they were given. Leaves out what is before start_s. */
void sphm_run_schedule_begin(sphm_run_schedule *schedule, double start_s);
/* The time of the next event, or infinity. */
double sphm_run_schedule_next(const sphm_run_schedule *schedule);
/* Carries out the events up to now. */
sphm_status sphm_run_schedule_apply(sphm_run_schedule *schedule, sphm_muscle *muscle, sphm_context *context);

#endif
