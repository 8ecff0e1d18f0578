/* What drives the electrodes when: commands and schedules, and the drive at a time. Times are simulated
 * seconds.
 *
 * Who wins, for each electrode by itself: of a command and the schedule entries that cover a moment, the one
 * that arrived last. A command takes the place of the electrode's earlier command; when a timed one ends,
 * the schedule is heard again. An entry rules from START to END, also in the gaps of its pulse train.
 * Particles of several driven electrodes get the sum of the currents. */
#ifndef SPHM_CORE_STIMULUS_H
#define SPHM_CORE_STIMULUS_H

#include "core/drive.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Moments closer than this count as one: steps are cut at the changes, and the sum of the step lengths meets
 * them to rounding only. */
#define SPHM_STIMULUS_TOLERANCE_S 1e-9

typedef struct sphm_stimulus_entry {
    int electrode;
    double start_s, end_s; /* end may be infinite */
    double current_uA_per_mm2;
    double rate_Hz, pulse_s; /* rate 0: one pulse from start to end */
    uint64_t arrival;
} sphm_stimulus_entry;

typedef struct sphm_stimulus {
    int default_electrode;
    sphm_stimulus_entry command[SPHM_ELECTRODE_COUNT]; /* arrival 0: none */
    sphm_stimulus_entry *entries;                      /* in order of arrival */
    size_t count, capacity;
    uint64_t arrivals;
} sphm_stimulus;

/* Makes `stimulus` (overwritten) hold the schedule of the parameters. On a refusal it is left zeroed. */
sphm_status sphm_stimulus_create(sphm_stimulus *stimulus, const sphm_parameters *parameters,
                                 sphm_context *context);
void sphm_stimulus_free(sphm_stimulus *stimulus);
/* Forgets commands and added entries, and starts again with the schedule of the parameters. */
sphm_status sphm_stimulus_reset(sphm_stimulus *stimulus, const sphm_parameters *parameters,
                                sphm_context *context);

/* As sphm_muscle_stimulate() and sphm_muscle_schedule() in muscle.h, at time now_s. */
sphm_status sphm_stimulus_command(sphm_stimulus *stimulus, double now_s, const char *electrode,
                                  double current_uA_per_mm2, double duration_s, sphm_context *context);
sphm_status sphm_stimulus_schedule(sphm_stimulus *stimulus, double now_s, const char *schedule,
                                   sphm_context *context);
/* Reads a schedule and drops it again: for checking parameters. */
sphm_status sphm_stimulus_check(const char *schedule, sphm_context *context);

/* Current of an electrode at time_s, uA/mm2. */
double sphm_stimulus_current(const sphm_stimulus *stimulus, int electrode, double time_s);
/* Fills driven and current of `drive`; its forces are left alone. */
void sphm_stimulus_drive(const sphm_stimulus *stimulus, double time_s, sphm_drive *drive);
/* The first time after time_s at which the drive may change; infinite if it never does. */
double sphm_stimulus_next_change(const sphm_stimulus *stimulus, double time_s);

#ifdef __cplusplus
}
#endif
#endif
