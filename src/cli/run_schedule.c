/* Schedules of the runner; see run_schedule.h. */
#include "cli/run_schedule.h"

#include "core/context.h"
#include "core/number.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* An end that was loaded until now is braked within this time, and held. */
#define BRAKING_S 0.01

/* Reading ------------------------------------------------------------------------------------------------
 */

/* `count` numbers parted by `separator`, and nothing else. */
static int read_numbers(const char *text, char separator, int count, double *numbers) {
    for (int k = 0; k < count; ++k) {
        char piece[64];
        const char *stop = k + 1 < count ? strchr(text, separator) : text + strlen(text);
        if (!stop || stop - text >= (int)sizeof piece)
            return 0;
        memcpy(piece, text, (size_t)(stop - text));
        piece[stop - text] = '\0';
        if (!sphm_number_parse(piece, &numbers[k]))
            return 0;
        text = stop + 1;
    }
    return 1;
}

/* "origin..." or "insertion..."; *rest is what follows the name. -1: neither. */
static int read_end(const char *text, const char **rest) {
    static const char *const names[SPHM_END_COUNT] = {"origin", "insertion"};
    for (int end = 0; end < SPHM_END_COUNT; ++end) {
        *rest = text + strlen(names[end]);
        if (strncmp(text, names[end], strlen(names[end])) == 0)
            return end;
    }
    return -1;
}

static sphm_status append(sphm_run_schedule *schedule, const sphm_run_event *event, const char *option,
                          sphm_context *context) {
    if (schedule->count == SPHM_RUN_MOST_EVENTS)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "%s: more than %d events", option,
                         SPHM_RUN_MOST_EVENTS);
    schedule->events[schedule->count++] = *event;
    return SPHM_OK;
}

static sphm_status refuse(const char *option, const char *text, const char *form, sphm_context *context) {
    return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "%s is '%.80s'; it must be %s", option, text, form);
}

static sphm_status add_activation(sphm_run_schedule *schedule, const char *option, const char *text,
                                  sphm_context *context) {
    sphm_run_event event;
    double n[3];
    memset(&event, 0, sizeof event);
    if (!read_numbers(text, ':', 3, n) || n[0] < 0 || !(n[1] > n[0]) || n[2] < 0 || n[2] > 1)
        return refuse(option, text, "START:END:VALUE with 0 <= START < END (s) and VALUE within 0 ... 1",
                      context);
    event.action = SPHM_RUN_ACTIVATE;
    event.time_s = n[0];
    event.duration_s = n[1] - n[0];
    event.value[0] = n[2];
    return append(schedule, &event, option, context);
}

/* Cuts "@START:END" off; without one, from 0 for ever. Returns 0 where it is malformed. */
static int read_times(char *text, double times[2]) {
    char *at = strchr(text, '@');
    times[0] = 0;
    times[1] = INFINITY;
    if (!at)
        return 1;
    *at = '\0';
    return read_numbers(at + 1, ':', 2, times) && times[0] >= 0 && times[1] > times[0];
}

/* --move, --load, --slide and --release: what acts, and for all but moves what ends it. */
static sphm_status add_end(sphm_run_schedule *schedule, const char *option, const char *text, int action,
                           int numbers, const char *form, sphm_context *context) {
    sphm_run_event event;
    char copy[256];
    const char *rest;
    double times[2];
    memset(&event, 0, sizeof event);
    if (snprintf(copy, sizeof copy, "%s", text) >= (int)sizeof copy || !read_times(copy, times))
        return refuse(option, text, form, context);
    event.end = read_end(copy, &rest);
    if (event.end < 0 ||
        (numbers ? *rest != ':' || !read_numbers(rest + 1, ',', numbers, event.value) : *rest))
        return refuse(option, text, form, context);
    if (action == SPHM_RUN_MOVE && !isfinite(times[1]))
        return refuse(option, text, form, context);
    event.action = (sphm_run_action)action;
    event.time_s = times[0];
    event.duration_s = times[1] - times[0];
    sphm_status status = append(schedule, &event, option, context);
    if (status != SPHM_OK || action == SPHM_RUN_MOVE || !isfinite(times[1]))
        return status;
    event.action = SPHM_RUN_HOLD;
    event.time_s = times[1];
    event.duration_s = BRAKING_S;
    return append(schedule, &event, option, context);
}

/* Lines "time_s,end,dx_m,dy_m,dz_m" after a header. Each line is a move that begins with the line before of
 * the same end; at a line the end passes with the mean velocity between its neighbours, and it stops at the
 * last. */
static sphm_status add_file(sphm_run_schedule *schedule, const char *option, const char *path,
                            sphm_context *context) {
    static const char form[] = "time_s,end,dx_m,dy_m,dz_m";
    FILE *file = fopen(path, "r");
    if (!file)
        return sphm_fail(context, SPHM_REFUSED_FILE, "%s: cannot open '%s': %s", option, path,
                         strerror(errno));
    size_t last[SPHM_END_COUNT] = {SIZE_MAX, SIZE_MAX};
    double before_last[SPHM_END_COUNT][3] = {{0, 0, 0}, {0, 0, 0}};
    char line[256];
    sphm_status status = SPHM_OK;
    for (int number = 1; status == SPHM_OK && fgets(line, sizeof line, file); ++number) {
        line[strcspn(line, "\r\n")] = '\0';
        if ((number == 1 && strncmp(line, "time_s", 6) == 0) || !line[0])
            continue;
        sphm_run_event event;
        memset(&event, 0, sizeof event);
        event.action = SPHM_RUN_MOVE;
        char *comma = strchr(line, ',');
        const char *rest = "";
        if (comma)
            *comma = '\0';
        event.end = comma ? read_end(comma + 1, &rest) : -1;
        double arrival = -1;
        if (event.end < 0 || *rest != ',' || !sphm_number_parse(line, &arrival) ||
            !read_numbers(rest + 1, ',', 3, event.value)) {
            status = sphm_fail(context, SPHM_REFUSED_FILE,
                               "%s: '%s', line %d; it must be %s, end origin or "
                               "insertion",
                               option, path, number, form);
            break;
        }
        sphm_run_event *before = last[event.end] == SIZE_MAX ? NULL : &schedule->events[last[event.end]];
        event.time_s = before ? before->time_s + before->duration_s : 0;
        event.duration_s = arrival - event.time_s;
        if (!(event.duration_s > 0)) {
            status = sphm_fail(context, SPHM_REFUSED_FILE, "%s: '%s', line %d: time %g s is not after %g s",
                               option, path, number, arrival, event.time_s);
            break;
        }
        for (int d = 0; before && d < 3; ++d) { /* now that a line follows, it passes through */
            const double came_from = before_last[event.end][d];
            before->velocity[d] = (event.value[d] - came_from) / (before->duration_s + event.duration_s);
            before_last[event.end][d] = before->value[d];
        }
        last[event.end] = schedule->count;
        status = append(schedule, &event, option, context);
    }
    fclose(file);
    return status;
}

sphm_status sphm_run_schedule_add(sphm_run_schedule *schedule, const char *option, const char *text,
                                  sphm_context *context) {
    if (strcmp(option, "--activate") == 0)
        return add_activation(schedule, option, text, context);
    if (strcmp(option, "--end-motion") == 0)
        return add_file(schedule, option, text, context);
    if (strcmp(option, "--move") == 0)
        return add_end(schedule, option, text, SPHM_RUN_MOVE, 3,
                       "origin:DX,DY,DZ@START:END or insertion:... (m from its rest place, s)", context);
    if (strcmp(option, "--load") == 0)
        return add_end(schedule, option, text, SPHM_RUN_LOAD, 3,
                       "origin:FX,FY,FZ[@START:END] or insertion:... (N, s)", context);
    if (strcmp(option, "--slide") == 0)
        return add_end(schedule, option, text, SPHM_RUN_SLIDE, 1,
                       "origin:FORCE[@START:END] or insertion:... (N away from the belly, s)", context);
    return add_end(schedule, option, text, SPHM_RUN_RELEASE, 0, "origin[@START:END] or insertion[@START:END]",
                   context);
}

/* Running ------------------------------------------------------------------------------------------------
 */

/* Insertion sort: stable, and schedules are short or sorted already. */
void sphm_run_schedule_begin(sphm_run_schedule *schedule, double start_s) {
    for (size_t k = 1; k < schedule->count; ++k) {
        const sphm_run_event event = schedule->events[k];
        size_t at = k;
        for (; at > 0 && schedule->events[at - 1].time_s > event.time_s; --at)
            schedule->events[at] = schedule->events[at - 1];
        schedule->events[at] = event;
    }
    while (schedule->next < schedule->count && schedule->events[schedule->next].time_s < start_s - 1e-9)
        ++schedule->next;
}

double sphm_run_schedule_next(const sphm_run_schedule *schedule) {
    return schedule->next < schedule->count ? schedule->events[schedule->next].time_s : INFINITY;
}

/* Displacements count from the rest place of the end's frame: beyond the tendon, if there is one. */
static sphm_status move_end(sphm_muscle *muscle, const sphm_run_event *event, sphm_context *context) {
    const sphm_body *body = sphm_muscle_body(muscle);
    const sphm_parameters *p = sphm_muscle_parameters(muscle);
    const int origin = event->end == SPHM_END_ORIGIN;
    const int tendon =
        p->tendon_stiffness > 0 && (p->tendon_ends == SPHM_TENDON_BOTH ||
                                    p->tendon_ends == (origin ? SPHM_TENDON_ORIGIN : SPHM_TENDON_INSERTION));
    sphm_end_pose pose;
    sphm_status status = sphm_muscle_end_pose(muscle, event->end, &pose, context);
    if (status != SPHM_OK)
        return status;
    memset(&pose, 0, sizeof pose);
    pose.orientation[3] = 1;
    for (int d = 0; d < 3; ++d) {
        const double out = tendon ? (origin ? -1 : 1) * p->tendon_slack_length * body->axis[d] : 0;
        pose.position_m[d] = (origin ? body->origin_m[d] : body->insertion_m[d]) + out + event->value[d];
        pose.velocity_m_per_s[d] = event->velocity[d];
    }
    return sphm_muscle_set_end_pose(muscle, event->end, &pose, event->duration_s, context);
}

static sphm_status hold_end(sphm_muscle *muscle, const sphm_run_event *event, sphm_context *context) {
    sphm_end_pose pose;
    const sphm_status status = sphm_muscle_end_pose(muscle, event->end, &pose, context);
    if (status != SPHM_OK)
        return status;
    memset(pose.velocity_m_per_s, 0, sizeof pose.velocity_m_per_s);
    memset(pose.angular_velocity_rad_per_s, 0, sizeof pose.angular_velocity_rad_per_s);
    return sphm_muscle_set_end_pose(muscle, event->end, &pose, event->duration_s, context);
}

static sphm_status carry_out(sphm_muscle *muscle, const sphm_run_event *event, sphm_context *context) {
    switch (event->action) {
    case SPHM_RUN_ACTIVATE:
        return sphm_muscle_activate(muscle, event->value[0], event->duration_s, context);
    case SPHM_RUN_MOVE:
        return move_end(muscle, event, context);
    case SPHM_RUN_LOAD:
        return sphm_muscle_set_end_load(muscle, event->end, event->value, context);
    case SPHM_RUN_SLIDE:
        return sphm_muscle_slide_end(muscle, event->end, event->value[0], context);
    case SPHM_RUN_RELEASE:
        return sphm_muscle_release_end(muscle, event->end, context);
    case SPHM_RUN_HOLD:
        return hold_end(muscle, event, context);
    }
    return SPHM_OK;
}

sphm_status sphm_run_schedule_apply(sphm_run_schedule *schedule, sphm_muscle *muscle, sphm_context *context) {
    sphm_status status = SPHM_OK;
    while (status == SPHM_OK && sphm_run_schedule_next(schedule) <= sphm_muscle_time(muscle) + 1e-9)
        status = carry_out(muscle, &schedule->events[schedule->next++], context);
    return status;
}
