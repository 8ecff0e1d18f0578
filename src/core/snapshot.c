/* Snapshots: the whole changing part of a muscle in a file, and its hash.
 *
 *   8 bytes   "SPHMSNAP"
 *   u32       version
 *   model     what the muscle must share: precision, particle count, rest shape, constants, parameters by
 * name
 *   state     time, steps, diffusion due, the two ends, every STATE array of state_arrays.inc: name, type,
 * values by id drive     electrodes' commands, schedule, external forces, commands of the solid tissue u64
 * FNV-1a of everything before
 *
 * Everything little-endian, texts with their length. Slots are not kept: a back end's slot order is a
 * function of the listed_* positions, which are STATE. Loading parses the whole file into objects of its own
 * before it touches the muscle. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/context.h"
#include "core/file_bytes.h"
#include "core/muscle.h"

static const char MAGIC[8] = {'S', 'P', 'H', 'M', 'S', 'N', 'A', 'P'};
enum { VERSION = 4, ENTRY_BYTES = 4 + 5 * 8 + 8 };
enum { END_NUMBERS = SPHM_END_COUNT * (sizeof(sphm_end_body) / sizeof(double)) };
enum { SOLID_NUMBERS = sizeof(sphm_solid_commands) / sizeof(double) };

/* Arrays ------------------------------------------------------------------------------------------------- */

enum { ROLE_STATE, ROLE_REST, ROLE_SCRATCH };

/* One row of state_arrays.inc. */
typedef struct array_row {
    const char *name, *type;
    size_t size, offset;
    int role;
} array_row;

static const array_row ARRAYS[] = {
#define ARRAY(type, name, role, unit, meaning)                                                               \
    {#name, #type, sizeof(type), offsetof(sphm_state, name), ROLE_##role},
#include "core/state_arrays.inc"
#undef ARRAY
};
enum { ARRAY_COUNT = sizeof ARRAYS / sizeof *ARRAYS };

static unsigned char *array_of(const sphm_state *state, const array_row *row) {
    unsigned char *array;
    memcpy(&array, (const unsigned char *)state + row->offset, sizeof array);
    return array;
}

static int is_real(const array_row *row) {
    return strcmp(row->type, "sphm_real") == 0;
}

/* The type's name in a file: that of the values, not of our typedef. */
static const char *stored_type(const array_row *row) {
    if (is_real(row))
        return row->size == 4 ? "float32" : "float64";
    return row->type;
}

/* slots[id]; NULL without memory. The caller frees it. */
static int32_t *slots_by_id(const sphm_state *state) {
    int32_t *slots = malloc((state->count + 1) * sizeof *slots);
    for (size_t s = 0; slots && s < state->count; ++s)
        slots[state->id[s]] = (int32_t)s;
    return slots;
}

uint64_t sphm_state_hash(const sphm_state *state) {
    int32_t *slots = slots_by_id(state);
    if (!slots)
        return 0;
    uint64_t hash = sphm_hash_numbers(SPHM_HASH_START, &state->time_s, 1, sizeof state->time_s);
    hash = sphm_hash_numbers(hash, &state->diffusion_due_s, 1, sizeof state->diffusion_due_s);
    hash = sphm_hash_numbers(hash, state->ends, END_NUMBERS, sizeof(double));
    for (int a = 0; a < ARRAY_COUNT; ++a) {
        const unsigned char *array = array_of(state, &ARRAYS[a]);
        for (size_t i = 0; ARRAYS[a].role == ROLE_STATE && i < state->count; ++i)
            hash = sphm_hash_numbers(hash, array + (size_t)slots[i] * ARRAYS[a].size, 1, ARRAYS[a].size);
    }
    free(slots);
    return hash;
}

/* The model's fingerprint -------------------------------------------------------------------------------- */

/* Parameters that do not change what a step computes, and those whose work is done once the body is built, or
 * once time has begun: body and state speak for themselves. */
static int is_fingerprinted(const sphm_parameter_info *row) {
    static const char *const skipped[] = {"backend",         "threads",     "seed",        "stimulus",
                                          "initial_stretch", "settle_time", "settle_speed"};
    for (size_t k = 0; k < sizeof skipped / sizeof *skipped; ++k)
        if (strcmp(row->name, skipped[k]) == 0)
            return 0;
    if (strcmp(row->group, "Geometry") == 0)
        return strcmp(row->name, "cell_size") == 0;
    return strcmp(row->group, "Node") != 0;
}

typedef struct body_print {
    const char *name;
    uint64_t hash;
} body_print;

enum { BODY_PRINTS = 4 };

static void print_body(const sphm_model *model, body_print prints[BODY_PRINTS]) {
    const sphm_body *body = &model->body;
    const size_t n = body->count;
    const uint64_t start = SPHM_HASH_START;
    const double constants[4] = {model->particle_mass_kg, body->support_radius_m, body->spacing_m,
                                 body->length_m};
    prints[0].name = "rest positions";
    prints[0].hash = sphm_hash_numbers(start, body->positions, 3 * n, sizeof(double));
    prints[1].name = "fibre directions";
    prints[1].hash = sphm_hash_numbers(start, body->fibres, 3 * n, sizeof(double));
    prints[2].name = "attachments or electrodes";
    prints[2].hash = sphm_hash_bytes(start, body->attachment, n);
    if (model->electrodes)
        prints[2].hash = sphm_hash_bytes(prints[2].hash, model->electrodes, n);
    prints[3].name = "particle mass, support radius, spacing or length";
    prints[3].hash = sphm_hash_numbers(start, constants, 4, sizeof(double));
}

static void write_model(sphm_writer *writer, const sphm_model *model) {
    body_print prints[BODY_PRINTS];
    print_body(model, prints);
    sphm_write_u32(writer, sizeof(sphm_real));
    sphm_write_u64(writer, model->body.count);
    for (int k = 0; k < BODY_PRINTS; ++k)
        sphm_write_u64(writer, prints[k].hash);
    uint32_t count = 0;
    for (size_t k = 0; k < sphm_parameter_count(); ++k)
        count += is_fingerprinted(sphm_parameter_row(k)) != 0;
    sphm_write_u32(writer, count);
    for (size_t k = 0; k < sphm_parameter_count(); ++k) {
        const sphm_parameter_info *row = sphm_parameter_row(k);
        char value[SPHM_TEXT_SIZE + 8];
        if (!is_fingerprinted(row))
            continue;
        if (sphm_parameters_get(&model->parameters, row->name, value, sizeof value, NULL) != SPHM_OK)
            value[0] = 0;
        sphm_write_text(writer, row->name);
        sphm_write_text(writer, value);
    }
}

static sphm_status foreign(const char *path, const char *what, const char *theirs, const char *ours,
                           sphm_context *context) {
    return sphm_fail(context, SPHM_REFUSED_FILE, "'%s' is a snapshot of another muscle: %s %s there, %s here",
                     path, what, theirs, ours);
}

static sphm_status cut_short(const char *path, const char *where, sphm_context *context) {
    return sphm_fail(context, SPHM_REFUSED_FILE, "'%s' is damaged: its %s cannot be read", path, where);
}

static sphm_status match_parameters(sphm_reader *reader, const sphm_model *model, const char *path,
                                    sphm_context *context) {
    uint32_t expected = 0;
    for (size_t k = 0; k < sphm_parameter_count(); ++k)
        expected += is_fingerprinted(sphm_parameter_row(k)) != 0;
    const uint32_t count = sphm_read_u32(reader);
    for (uint32_t k = 0; k < count && !reader->short_of; ++k) {
        char name[64], theirs[SPHM_TEXT_SIZE + 8], ours[SPHM_TEXT_SIZE + 8];
        sphm_read_text(reader, name, sizeof name);
        sphm_read_text(reader, theirs, sizeof theirs);
        if (reader->short_of)
            break;
        if (sphm_parameters_get(&model->parameters, name, ours, sizeof ours, NULL) != SPHM_OK)
            return foreign(path, name, theirs, "not a parameter", context);
        if (strcmp(theirs, ours) != 0)
            return foreign(path, name, theirs, ours, context);
    }
    if (reader->short_of || count != expected)
        return cut_short(path, "list of parameters", context);
    return SPHM_OK;
}

static sphm_status match_model(sphm_reader *reader, const sphm_model *model, const char *path,
                               sphm_context *context) {
    const uint32_t precision = sphm_read_u32(reader);
    if (precision != sizeof(sphm_real))
        return foreign(path, "precision", precision == 4 ? "single" : "double",
                       sizeof(sphm_real) == 4 ? "single" : "double", context);
    const uint64_t count = sphm_read_u64(reader);
    if (count != model->body.count)
        return sphm_fail(context, SPHM_REFUSED_FILE,
                         "'%s' is a snapshot of another muscle: %llu particles there, %zu here", path,
                         (unsigned long long)count, model->body.count);
    body_print prints[BODY_PRINTS];
    uint64_t theirs[BODY_PRINTS];
    print_body(model, prints);
    for (int k = 0; k < BODY_PRINTS; ++k)
        theirs[k] = sphm_read_u64(reader);
    const sphm_status status = match_parameters(reader, model, path, context);
    if (status != SPHM_OK) /* first, because a name and two values say most */
        return status;
    for (int k = 0; k < BODY_PRINTS; ++k)
        if (theirs[k] != prints[k].hash)
            return sphm_fail(context, SPHM_REFUSED_FILE, "'%s' is a snapshot of another muscle: %s differ",
                             path, prints[k].name);
    return SPHM_OK;
}

/* The state ---------------------------------------------------------------------------------------------- */

static void write_state(sphm_writer *writer, const sphm_state *state, const int32_t *slots) {
    uint32_t count = 0;
    for (int a = 0; a < ARRAY_COUNT; ++a)
        count += ARRAYS[a].role == ROLE_STATE;
    sphm_write_double(writer, state->time_s);
    sphm_write_u64(writer, state->steps);
    sphm_write_double(writer, state->diffusion_due_s);
    for (size_t k = 0; k < END_NUMBERS; ++k)
        sphm_write_number(writer, (const unsigned char *)state->ends + k * sizeof(double), sizeof(double));
    sphm_write_u32(writer, count);
    for (int a = 0; a < ARRAY_COUNT; ++a) {
        const unsigned char *array = array_of(state, &ARRAYS[a]);
        if (ARRAYS[a].role != ROLE_STATE)
            continue;
        sphm_write_text(writer, ARRAYS[a].name);
        sphm_write_text(writer, stored_type(&ARRAYS[a]));
        sphm_write_u64(writer, state->count);
        for (size_t i = 0; i < state->count; ++i)
            sphm_write_number(writer, array + (size_t)slots[i] * ARRAYS[a].size, ARRAYS[a].size);
    }
}

/* Values of one array, into slots that equal ids. */
static sphm_status read_array(sphm_reader *reader, const array_row *row, sphm_state *state, const char *path,
                              sphm_context *context) {
    char name[64], type[32];
    sphm_read_text(reader, name, sizeof name);
    sphm_read_text(reader, type, sizeof type);
    const uint64_t count = sphm_read_u64(reader);
    if (reader->short_of)
        return cut_short(path, row->name, context);
    if (strcmp(name, row->name) != 0 || strcmp(type, stored_type(row)) != 0 || count != state->count)
        return sphm_fail(context, SPHM_REFUSED_FILE,
                         "'%s' holds array %s (%s, %llu values) where this version keeps %s (%s, %zu values)",
                         path, name, type, (unsigned long long)count, row->name, stored_type(row),
                         state->count);
    unsigned char *array = array_of(state, row);
    for (size_t i = 0; i < state->count; ++i)
        sphm_read_number(reader, array + i * row->size, row->size);
    if (reader->short_of)
        return cut_short(path, row->name, context);
    for (size_t i = 0; is_real(row) && i < state->count; ++i)
        if (!isfinite(((const sphm_real *)array)[i]))
            return sphm_fail(context, SPHM_REFUSED_FILE, "'%s' holds a non-finite %s of particle %zu", path,
                             row->name, i);
    return SPHM_OK;
}

static sphm_status read_state(sphm_reader *reader, sphm_state *state, const char *path,
                              sphm_context *context) {
    state->time_s = sphm_read_double(reader);
    state->steps = sphm_read_u64(reader);
    state->diffusion_due_s = sphm_read_double(reader);
    for (size_t k = 0; k < END_NUMBERS; ++k) {
        const double number = sphm_read_double(reader);
        memcpy((unsigned char *)state->ends + k * sizeof number, &number, sizeof number);
        if (!isfinite(number))
            reader->short_of = 1;
    }
    uint32_t expected = 0;
    for (int a = 0; a < ARRAY_COUNT; ++a)
        expected += ARRAYS[a].role == ROLE_STATE;
    const uint32_t count = sphm_read_u32(reader);
    if (reader->short_of || !isfinite(state->time_s) || state->time_s < 0 ||
        !isfinite(state->diffusion_due_s) || state->diffusion_due_s < 0)
        return cut_short(path, "time", context);
    if (count != expected)
        return sphm_fail(context, SPHM_REFUSED_FILE, "'%s' holds %u arrays; this version keeps %u", path,
                         count, expected);
    for (int a = 0; a < ARRAY_COUNT; ++a) {
        const sphm_status status =
            ARRAYS[a].role == ROLE_STATE ? read_array(reader, &ARRAYS[a], state, path, context) : SPHM_OK;
        if (status != SPHM_OK)
            return status;
    }
    for (size_t i = 0; i < state->count; ++i)
        if (state->id[i] != (int32_t)i)
            return cut_short(path, "id", context);
    return SPHM_OK;
}

/* What drives the muscle --------------------------------------------------------------------------------- */

static void write_entry(sphm_writer *writer, const sphm_stimulus_entry *entry) {
    sphm_write_u32(writer, (uint32_t)entry->electrode);
    sphm_write_double(writer, entry->start_s);
    sphm_write_double(writer, entry->end_s);
    sphm_write_double(writer, entry->current_uA_per_mm2);
    sphm_write_double(writer, entry->rate_Hz);
    sphm_write_double(writer, entry->pulse_s);
    sphm_write_u64(writer, entry->arrival);
}

static void read_entry(sphm_reader *reader, sphm_stimulus_entry *entry) {
    entry->electrode = (int)sphm_read_u32(reader);
    entry->start_s = sphm_read_double(reader);
    entry->end_s = sphm_read_double(reader);
    entry->current_uA_per_mm2 = sphm_read_double(reader);
    entry->rate_Hz = sphm_read_double(reader);
    entry->pulse_s = sphm_read_double(reader);
    entry->arrival = sphm_read_u64(reader);
    if (entry->electrode < 0 || entry->electrode >= SPHM_ELECTRODE_COUNT ||
        !isfinite(entry->current_uA_per_mm2) || isnan(entry->start_s) || isnan(entry->end_s) ||
        !isfinite(entry->rate_Hz) || isnan(entry->pulse_s))
        reader->short_of = 1;
}

static void write_drive(sphm_writer *writer, const sphm_muscle *muscle) {
    const sphm_stimulus *stimulus = &muscle->stimulus;
    sphm_write_u64(writer, stimulus->arrivals);
    for (int e = 0; e < SPHM_ELECTRODE_COUNT; ++e)
        write_entry(writer, &stimulus->command[e]);
    sphm_write_u64(writer, stimulus->count);
    for (size_t k = 0; k < stimulus->count; ++k)
        write_entry(writer, &stimulus->entries[k]);
    sphm_write_u64(writer, muscle->force_count);
    for (size_t k = 0; k < muscle->force_count; ++k) {
        const sphm_timed_force *force = &muscle->forces[k];
        for (int a = 0; a < 3; ++a)
            sphm_write_double(writer, force->force.point_m[a]);
        for (int a = 0; a < 3; ++a)
            sphm_write_double(writer, force->force.force_N[a]);
        sphm_write_double(writer, force->force.radius_m);
        sphm_write_double(writer, force->end_s);
    }
    for (size_t k = 0; k < SOLID_NUMBERS; ++k)
        sphm_write_number(writer, (const unsigned char *)&muscle->solid + k * sizeof(double), sizeof(double));
}

/* What a file says drives the muscle. */
typedef struct loaded_drive {
    sphm_stimulus stimulus; /* its entries are ours until they are handed over */
    size_t force_count;
    sphm_timed_force forces[SPHM_MAX_FORCES];
    sphm_solid_commands solid;
} loaded_drive;

/* Only the activation (none) and its end (never) may be other than finite. */
static void read_solid(sphm_reader *reader, sphm_solid_commands *solid) {
    for (size_t k = 0; k < SOLID_NUMBERS; ++k) {
        const double number = sphm_read_double(reader);
        memcpy((unsigned char *)solid + k * sizeof number, &number, sizeof number);
        if (k > 1 && !isfinite(number))
            reader->short_of = 1;
    }
}

static sphm_status read_stimulus(sphm_reader *reader, const sphm_muscle *muscle, sphm_stimulus *stimulus,
                                 const char *path, sphm_context *context) {
    stimulus->default_electrode = muscle->stimulus.default_electrode; /* a parameter: it was compared */
    stimulus->arrivals = sphm_read_u64(reader);
    for (int e = 0; e < SPHM_ELECTRODE_COUNT; ++e)
        read_entry(reader, &stimulus->command[e]);
    const uint64_t count = sphm_read_u64(reader);
    if (reader->short_of || count > (reader->size - reader->at) / ENTRY_BYTES)
        return cut_short(path, "stimulus", context);
    stimulus->entries = malloc((size_t)(count + 1) * sizeof *stimulus->entries);
    if (!stimulus->entries)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for a schedule of %llu entries",
                         (unsigned long long)count);
    stimulus->count = (size_t)count;
    stimulus->capacity = (size_t)count + 1;
    for (size_t k = 0; k < stimulus->count; ++k)
        read_entry(reader, &stimulus->entries[k]);
    return reader->short_of ? cut_short(path, "schedule", context) : SPHM_OK;
}

static sphm_status read_drive(sphm_reader *reader, const sphm_muscle *muscle, loaded_drive *drive,
                              const char *path, sphm_context *context) {
    const sphm_status status = read_stimulus(reader, muscle, &drive->stimulus, path, context);
    if (status != SPHM_OK)
        return status;
    const uint64_t count = sphm_read_u64(reader);
    if (count > SPHM_MAX_FORCES)
        return cut_short(path, "list of forces", context);
    drive->force_count = (size_t)count;
    for (size_t k = 0; k < drive->force_count; ++k) {
        double numbers[8];
        for (int a = 0; a < 8; ++a)
            numbers[a] = sphm_read_double(reader);
        for (int a = 0; a < 7; ++a)
            if (!isfinite(numbers[a]))
                reader->short_of = 1;
        memcpy(drive->forces[k].force.point_m, numbers, 3 * sizeof *numbers);
        memcpy(drive->forces[k].force.force_N, numbers + 3, 3 * sizeof *numbers);
        drive->forces[k].force.radius_m = numbers[6];
        drive->forces[k].end_s = numbers[7];
    }
    read_solid(reader, &drive->solid);
    if (reader->short_of || reader->at != reader->size)
        return cut_short(path, "list of forces", context);
    return SPHM_OK;
}

/* Whole files -------------------------------------------------------------------------------------------- */

sphm_status sphm_muscle_save(sphm_muscle *muscle, const char *path, sphm_context *context) {
    if (!path || !*path)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "no path to save to; it must be a file name");
    if (muscle->failed)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT,
                         "the muscle has failed and is not saved (%s); reset it or load a snapshot",
                         muscle->failure);
    const sphm_status started = sphm_muscle_finish_start(muscle, context);
    if (started != SPHM_OK)
        return started;
    const sphm_state *state = sphm_muscle_state(muscle);
    int32_t *slots = slots_by_id(state);
    sphm_writer writer = {NULL, 0, 0, slots == NULL};
    sphm_write_bytes(&writer, MAGIC, sizeof MAGIC);
    sphm_write_u32(&writer, VERSION);
    write_model(&writer, &muscle->model);
    if (slots)
        write_state(&writer, state, slots);
    write_drive(&writer, muscle);
    sphm_write_u64(&writer, writer.lost ? 0 : sphm_hash_bytes(SPHM_HASH_START, writer.data, writer.size));
    sphm_status status;
    if (writer.lost)
        status = sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for a snapshot of %zu particles",
                           state->count);
    else
        status = sphm_file_replace(path, writer.data, writer.size, context);
    free(slots);
    free(writer.data);
    return status;
}

/* Magic, version and checksum; leaves the reader behind them, and before the checksum. */
static sphm_status open_snapshot(sphm_reader *reader, const char *path, sphm_context *context) {
    if (reader->size < sizeof MAGIC + 4 + 8 || memcmp(reader->data, MAGIC, sizeof MAGIC) != 0)
        return sphm_fail(context, SPHM_REFUSED_FILE, "'%s' (%zu bytes) is not a snapshot of a muscle", path,
                         reader->size);
    reader->at = sizeof MAGIC;
    const uint32_t version = sphm_read_u32(reader);
    if (version != VERSION)
        return sphm_fail(context, SPHM_REFUSED_FILE,
                         "'%s' is a snapshot of version %u; this library reads version %d", path, version,
                         VERSION);
    sphm_reader end = {reader->data, reader->size, reader->size - 8, 0};
    reader->size -= 8;
    if (sphm_read_u64(&end) != sphm_hash_bytes(SPHM_HASH_START, reader->data, reader->size))
        return sphm_fail(context, SPHM_REFUSED_FILE,
                         "'%s' is truncated or damaged: its %zu bytes do not match its checksum", path,
                         end.size);
    return SPHM_OK;
}

/* Puts what was read into the muscle; on a refusal by the back end the muscle is as it was. */
static sphm_status take_over(sphm_muscle *muscle, const sphm_state *state, loaded_drive *drive,
                             sphm_context *context) {
    const sphm_status status = sphm_muscle_restore(muscle, state, context);
    if (status != SPHM_OK)
        return status;
    const sphm_stimulus old = muscle->stimulus;
    muscle->stimulus = drive->stimulus;
    drive->stimulus = old; /* freed by the caller */
    muscle->force_count = drive->force_count;
    memcpy(muscle->forces, drive->forces, sizeof drive->forces);
    muscle->solid = drive->solid;
    return SPHM_OK;
}

static sphm_status load_bytes(sphm_muscle *muscle, sphm_reader *reader, const char *path,
                              sphm_context *context) {
    sphm_state state;
    loaded_drive drive;
    memset(&state, 0, sizeof state);
    memset(&drive, 0, sizeof drive);
    sphm_status status = open_snapshot(reader, path, context);
    if (status == SPHM_OK)
        status = match_model(reader, &muscle->model, path, context);
    if (status == SPHM_OK)
        status = sphm_state_create(&state, muscle->model.body.count, context);
    if (status == SPHM_OK)
        status = read_state(reader, &state, path, context);
    if (status == SPHM_OK)
        status = read_drive(reader, muscle, &drive, path, context);
    if (status == SPHM_OK)
        status = take_over(muscle, &state, &drive, context);
    sphm_state_free(&state);
    sphm_stimulus_free(&drive.stimulus);
    return status;
}

sphm_status sphm_muscle_load(sphm_muscle *muscle, const char *path, sphm_context *context) {
    if (!path || !*path)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "no path to load from; it must be a file name");
    unsigned char *data;
    size_t size;
    sphm_status status = sphm_file_read(path, &data, &size, context);
    if (status != SPHM_OK)
        return status;
    sphm_reader reader = {data, size, 0, 0};
    status = load_bytes(muscle, &reader, path, context);
    free(data);
    return status;
}

uint64_t sphm_muscle_hash(sphm_muscle *muscle) {
    return sphm_state_hash(sphm_muscle_state(muscle));
}
