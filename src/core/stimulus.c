/* Commands and schedules of the electrodes. */
#include "core/stimulus.h"
#include "core/context.h"
#include "core/electrodes.h"
#include "core/number.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Names of the electrodes for messages. */
#define ELECTRODES "belly, origin, insertion, both or sphere"
static const char form[] = "START:END:CURRENT[:ELECTRODE[:RATE_HZ:PULSE_S]]";

/* Parsing ------------------------------------------------------------------------------------------------ */

enum { MAX_FIELDS = 6, FIELD_SIZE = 64 };

/* One entry as text: its number (from 1) for messages, and its fields. */
typedef struct entry_text {
    size_t number;
    char whole[FIELD_SIZE * 2];
    int fields; /* how many there are, even beyond MAX_FIELDS */
    char field[MAX_FIELDS][FIELD_SIZE];
} entry_text;

static int blank(char c) {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

/* Copies begin ... end without the blanks around it, cut to the buffer. */
static void copy_trimmed(const char *begin, const char *end, char *to, size_t size) {
    while (begin < end && blank(*begin))
        begin++;
    while (begin < end && blank(end[-1]))
        end--;
    const size_t length = (size_t)(end - begin) < size - 1 ? (size_t)(end - begin) : size - 1;
    memcpy(to, begin, length);
    to[length] = '\0';
}

static void split_fields(const char *begin, const char *end, entry_text *e) {
    copy_trimmed(begin, end, e->whole, sizeof e->whole);
    e->fields = 0;
    for (const char *field = begin;; e->fields++) {
        const char *colon = memchr(field, ':', (size_t)(end - field));
        if (e->fields < MAX_FIELDS)
            copy_trimmed(field, colon ? colon : end, e->field[e->fields], FIELD_SIZE);
        if (!colon)
            break;
        field = colon + 1;
    }
    e->fields++;
}

static sphm_status refuse_field(const entry_text *e, int field, const char *name, const char *valid,
                                sphm_context *context) {
    return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "schedule entry %zu \"%s\": %s is \"%s\"; it must be %s",
                     e->number, e->whole, name, e->field[field], valid);
}

static sphm_status parse_times(const entry_text *e, sphm_stimulus_entry *entry, sphm_context *context) {
    if (!sphm_number_parse(e->field[0], &entry->start_s) || entry->start_s < 0)
        return refuse_field(e, 0, "START", "a time of 0 s or later", context);
    if (strcmp(e->field[1], "inf") == 0)
        entry->end_s = INFINITY;
    else if (!sphm_number_parse(e->field[1], &entry->end_s) || entry->end_s <= entry->start_s)
        return refuse_field(e, 1, "END", "a time in s later than START, or inf", context);
    if (!sphm_number_parse(e->field[2], &entry->current_uA_per_mm2))
        return refuse_field(e, 2, "CURRENT", "a finite number of uA/mm2", context);
    return SPHM_OK;
}

static sphm_status parse_train(const entry_text *e, sphm_stimulus_entry *entry, sphm_context *context) {
    if (!sphm_number_parse(e->field[4], &entry->rate_Hz) || entry->rate_Hz <= 0 || entry->rate_Hz > 1e6)
        return refuse_field(e, 4, "RATE_HZ", "above 0 and at most 1e6 Hz", context);
    if (!sphm_number_parse(e->field[5], &entry->pulse_s) || entry->pulse_s <= 0 ||
        entry->pulse_s * entry->rate_Hz >= 1)
        return refuse_field(e, 5, "PULSE_S", "above 0 s and shorter than the period 1/RATE_HZ", context);
    return SPHM_OK;
}

static sphm_status parse_entry(const entry_text *e, int default_electrode, sphm_stimulus_entry *entry,
                               sphm_context *context) {
    if (e->fields != 3 && e->fields != 4 && e->fields != 6)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "schedule entry %zu \"%s\" has %d fields; it must be %s", e->number, e->whole,
                         e->fields, form);
    memset(entry, 0, sizeof *entry);
    sphm_status status = parse_times(e, entry, context);
    if (status != SPHM_OK)
        return status;
    entry->electrode = e->fields > 3 ? sphm_electrode_find(e->field[3]) : default_electrode;
    if (entry->electrode < 0)
        return refuse_field(e, 3, "ELECTRODE", ELECTRODES, context);
    return e->fields == 6 ? parse_train(e, entry, context) : SPHM_OK;
}

/* Storage ------------------------------------------------------------------------------------------------ */

static sphm_status append(sphm_stimulus *s, const sphm_stimulus_entry *entry, sphm_context *context) {
    if (s->count == s->capacity) {
        const size_t capacity = s->capacity ? 2 * s->capacity : 8;
        sphm_stimulus_entry *grown = realloc(s->entries, capacity * sizeof *grown);
        if (!grown)
            return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for %zu schedule entries", capacity);
        s->entries = grown;
        s->capacity = capacity;
    }
    s->entries[s->count] = *entry;
    s->entries[s->count++].arrival = ++s->arrivals;
    return SPHM_OK;
}

/* Entries that are over can never be heard again: a muscle that is fed schedules for days stays small. */
static void drop_ended(sphm_stimulus *s, double now_s) {
    size_t kept = 0;
    for (size_t k = 0; k < s->count; k++)
        if (s->entries[k].end_s > now_s - SPHM_STIMULUS_TOLERANCE_S)
            s->entries[kept++] = s->entries[k];
    s->count = kept;
}

sphm_status sphm_stimulus_schedule(sphm_stimulus *s, double now_s, const char *schedule,
                                   sphm_context *context) {
    if (!schedule)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "the schedule is NULL; it must be %s", form);
    drop_ended(s, now_s);
    const size_t before = s->count;
    size_t number = 0;
    for (const char *begin = schedule; *begin;) {
        const char *end = begin + strcspn(begin, ";");
        const char *text = begin;
        begin = *end ? end + 1 : end;
        number++;
        while (text < end && blank(*text))
            text++;
        if (text == end) /* a trailing ';', or nothing at all */
            continue;
        entry_text e;
        e.number = number;
        split_fields(text, end, &e);
        sphm_stimulus_entry entry;
        sphm_status status = parse_entry(&e, s->default_electrode, &entry, context);
        if (status == SPHM_OK)
            status = append(s, &entry, context);
        if (status != SPHM_OK) {
            s->count = before; /* all of a schedule or nothing */
            return status;
        }
    }
    return SPHM_OK;
}

sphm_status sphm_stimulus_check(const char *schedule, sphm_context *context) {
    sphm_stimulus scratch;
    memset(&scratch, 0, sizeof scratch);
    const sphm_status status = sphm_stimulus_schedule(&scratch, 0, schedule, context);
    sphm_stimulus_free(&scratch);
    return status;
}

sphm_status sphm_stimulus_create(sphm_stimulus *s, const sphm_parameters *parameters, sphm_context *context) {
    memset(s, 0, sizeof *s);
    s->default_electrode = parameters->electrode;
    const sphm_status status = sphm_stimulus_schedule(s, 0, parameters->stimulus, context);
    if (status != SPHM_OK)
        sphm_stimulus_free(s);
    return status;
}

void sphm_stimulus_free(sphm_stimulus *s) {
    free(s->entries);
    memset(s, 0, sizeof *s);
}

sphm_status sphm_stimulus_reset(sphm_stimulus *s, const sphm_parameters *parameters, sphm_context *context) {
    sphm_stimulus fresh;
    const sphm_status status = sphm_stimulus_create(&fresh, parameters, context);
    if (status != SPHM_OK)
        return status;
    sphm_stimulus_free(s);
    *s = fresh;
    return SPHM_OK;
}

/* Commands ----------------------------------------------------------------------------------------------- */

sphm_status sphm_stimulus_command(sphm_stimulus *s, double now_s, const char *electrode,
                                  double current_uA_per_mm2, double duration_s, sphm_context *context) {
    const int e = electrode ? sphm_electrode_find(electrode) : s->default_electrode;
    if (e < 0)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "unknown electrode \"%s\"; it must be %s", electrode,
                         ELECTRODES);
    if (!isfinite(current_uA_per_mm2))
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "the stimulus is %g uA/mm2; it must be a finite number", current_uA_per_mm2);
    if (!isfinite(duration_s) || duration_s < 0)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "the duration is %g s; it must be 0 (until replaced) or a positive number",
                         duration_s);
    sphm_stimulus_entry *command = &s->command[e];
    memset(command, 0, sizeof *command);
    command->electrode = e;
    command->start_s = now_s;
    command->end_s = duration_s > 0 ? now_s + duration_s : INFINITY;
    command->current_uA_per_mm2 = current_uA_per_mm2;
    command->arrival = ++s->arrivals;
    return SPHM_OK;
}

/* At a time ---------------------------------------------------------------------------------------------- */

static int covers(const sphm_stimulus_entry *entry, double time_s) {
    return entry->start_s <= time_s && time_s < entry->end_s;
}

/* Number of the pulse that has begun last, and the time since. The product and the quotient may differ by a
 * rounding, hence the tolerance. */
static double pulse_start(const sphm_stimulus_entry *entry, double time_s) {
    const double number = floor((time_s - entry->start_s) * entry->rate_Hz);
    const double next = entry->start_s + (number + 1) / entry->rate_Hz;
    return next <= time_s ? next : entry->start_s + number / entry->rate_Hz;
}

static double current_within(const sphm_stimulus_entry *entry, double time_s) {
    if (entry->rate_Hz > 0 && time_s >= pulse_start(entry, time_s) + entry->pulse_s)
        return 0;
    return entry->current_uA_per_mm2;
}

double sphm_stimulus_current(const sphm_stimulus *s, int electrode, double time_s) {
    if (electrode < 0 || electrode >= SPHM_ELECTRODE_COUNT)
        return 0;
    const double t = time_s + SPHM_STIMULUS_TOLERANCE_S;
    const sphm_stimulus_entry *winner = &s->command[electrode];
    if (winner->arrival == 0 || !covers(winner, t))
        winner = NULL;
    for (size_t k = 0; k < s->count; k++) {
        const sphm_stimulus_entry *entry = &s->entries[k];
        if (entry->electrode == electrode && covers(entry, t) &&
            (!winner || entry->arrival > winner->arrival))
            winner = entry;
    }
    return winner ? current_within(winner, t) : 0;
}

void sphm_stimulus_drive(const sphm_stimulus *s, double time_s, sphm_drive *drive) {
    for (int e = 0; e < SPHM_ELECTRODE_COUNT; e++) {
        drive->current_uA_per_mm2[e] = sphm_stimulus_current(s, e, time_s);
        drive->driven[e] = drive->current_uA_per_mm2[e] != 0;
    }
}

static double earlier_after(double best, double candidate, double time_s) {
    return candidate > time_s && candidate < best ? candidate : best;
}

/* When `entry` by itself changes next after time_s; other entries may hide the change. */
static double entry_change(const sphm_stimulus_entry *entry, double time_s) {
    double best = earlier_after(INFINITY, entry->start_s, time_s);
    best = earlier_after(best, entry->end_s, time_s);
    if (entry->rate_Hz > 0 && covers(entry, time_s)) {
        const double begin = pulse_start(entry, time_s);
        best = earlier_after(best, begin + entry->pulse_s, time_s);
        best = earlier_after(best, begin + 1 / entry->rate_Hz, time_s);
    }
    return best;
}

double sphm_stimulus_next_change(const sphm_stimulus *s, double time_s) {
    const double t = time_s + SPHM_STIMULUS_TOLERANCE_S;
    double best = INFINITY;
    for (int e = 0; e < SPHM_ELECTRODE_COUNT; e++)
        if (s->command[e].arrival)
            best = fmin(best, entry_change(&s->command[e], t));
    for (size_t k = 0; k < s->count; k++)
        best = fmin(best, entry_change(&s->entries[k], t));
    return best;
}
