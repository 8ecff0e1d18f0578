/* The parameter table at work: defaults, access by name, range checks and the rules between parameters.
 * Everything about a single parameter comes from parameter_list.inc. */
#include "sph_muscle/parameters.h"

#include "core/context.h"
#include "core/number.h"

#include <ctype.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { MARKER = 0x53504831 }; /* "SPH1" */

/* The enums of parameters.h against the choices of the list
 * ------------------------------------------------*/

/* A choice without a CHOICES_ line here, or one that says something else than the list, does not compile. */
#define SAME(choices, expected) (__builtin_strcmp(choices, expected) == 0)
#define CHOICES_tissue(c) SAME(c, "fluid|solid") && SPHM_TISSUE_FLUID == 0 && SPHM_TISSUE_SOLID == 1
#define CHOICES_backend(c)                                                                                   \
    SAME(c, "auto|cpu|cuda") && SPHM_BACKEND_AUTO == 0 && SPHM_BACKEND_CPU == 1 && SPHM_BACKEND_CUDA == 2
#define CHOICES_preset(c)                                                                                    \
    SAME(c, "triceps_long_head|vastus_lateralis|belly|bar") && SPHM_PRESET_TRICEPS_LONG_HEAD == 0 &&         \
        SPHM_PRESET_VASTUS_LATERALIS == 1 && SPHM_PRESET_BELLY == 2 && SPHM_PRESET_BAR == 3
#define CHOICES_fibres(c)                                                                                    \
    SAME(c, "parallel|pennate|file|laplace") && SPHM_FIBRES_PARALLEL == 0 && SPHM_FIBRES_PENNATE == 1 &&     \
        SPHM_FIBRES_FILE == 2 && SPHM_FIBRES_LAPLACE == 3
#define CHOICES_laplacian(c)                                                                                 \
    SAME(c, "corrected|brookshaw|paper") && SPHM_LAPLACIAN_CORRECTED == 0 &&                                 \
        SPHM_LAPLACIAN_BROOKSHAW == 1 && SPHM_LAPLACIAN_PAPER == 2
#define CHOICES_electrode(c)                                                                                 \
    SAME(c, "belly|origin|insertion|both|sphere") && SPHM_ELECTRODE_BELLY == 0 &&                            \
        SPHM_ELECTRODE_ORIGIN == 1 && SPHM_ELECTRODE_INSERTION == 2 && SPHM_ELECTRODE_BOTH == 3 &&           \
        SPHM_ELECTRODE_SPHERE == 4 && SPHM_ELECTRODE_COUNT == 5
#define CHOICES_coupling(c)                                                                                  \
    SAME(c, "pressure|fibre_tension") && SPHM_COUPLING_PRESSURE == 0 && SPHM_COUPLING_FIBRE_TENSION == 1
#define CHOICES_fibre_coupling(c)                                                                            \
    SAME(c, "true_stretch|volume_free") && SPHM_FIBRE_TRUE_STRETCH == 0 && SPHM_FIBRE_VOLUME_FREE == 1
#define CHOICES_force_velocity(c)                                                                            \
    SAME(c, "off|hill") && SPHM_FORCE_VELOCITY_OFF == 0 && SPHM_FORCE_VELOCITY_HILL == 1
#define CHOICES_tendon_ends(c)                                                                               \
    SAME(c, "insertion|origin|both") && SPHM_TENDON_INSERTION == 0 && SPHM_TENDON_ORIGIN == 1 &&             \
        SPHM_TENDON_BOTH == 2
#define CHOICES_end_orientation(c)                                                                           \
    SAME(c, "frame|line") && SPHM_END_ORIENTATION_FRAME == 0 && SPHM_END_ORIENTATION_LINE == 1
#define CHOICES_time_step_policy(c)                                                                          \
    SAME(c, "reduce|refuse") && SPHM_TIME_STEP_REDUCE == 0 && SPHM_TIME_STEP_REFUSE == 1
#define CHOICES_surface_field(c)                                                                             \
    SAME(c, "displacement|pressure|membrane_potential|activation|fibre_stretch") &&                          \
        SPHM_FIELD_DISPLACEMENT == 0 && SPHM_FIELD_PRESSURE == 1 && SPHM_FIELD_MEMBRANE_POTENTIAL == 2 &&    \
        SPHM_FIELD_ACTIVATION == 3 && SPHM_FIELD_FIBRE_STRETCH == 4 && SPHM_FIELD_COUNT == 5

#define GROUP(title, help)
#define REAL(name, unit, value, minimum, maximum, help)
#define INTEGER(name, unit, value, minimum, maximum, help)                                                   \
    _Static_assert((value) >= (minimum) && (value) <= (maximum), #name ": default out of range");
#define BOOLEAN(name, value, help) _Static_assert((value) == 0 || (value) == 1, #name ": default not 0 or 1");
#define CHOICE(name, value, choices, help)                                                                   \
    _Static_assert(CHOICES_##name(choices), #name ": parameters.h and parameter_list.inc disagree");
#define TEXT(name, value, help) _Static_assert(sizeof(value) <= SPHM_TEXT_SIZE, #name ": default too long");
#define VECTOR(name, unit, x, y, z, minimum, maximum, help)
#include "sph_muscle/parameter_list.inc"
#undef GROUP
#undef REAL
#undef INTEGER
#undef BOOLEAN
#undef CHOICE
#undef TEXT
#undef VECTOR

/* The table
 * ------------------------------------------------------------------------------------------------*/

#define ROW(name, unit, help, choices, kind, minimum, maximum, text)                                         \
    {#name, unit, help, NULL, choices, kind, minimum, maximum, text, offsetof(sphm_parameters, name)},
#define GROUP(title, help) {NULL, NULL, help, title, NULL, SPHM_KIND_TEXT, 0, 0, NULL, 0},
#define REAL(name, unit, value, minimum, maximum, help)                                                      \
    ROW(name, unit, help, NULL, SPHM_KIND_REAL, minimum, maximum, #value)
#define INTEGER(name, unit, value, minimum, maximum, help)                                                   \
    ROW(name, unit, help, NULL, SPHM_KIND_INTEGER, minimum, maximum, #value)
#define BOOLEAN(name, value, help)                                                                           \
    ROW(name, "", help, NULL, SPHM_KIND_BOOLEAN, 0, 1, (value) ? "true" : "false")
#define CHOICE(name, value, choices, help) ROW(name, "", help, choices, SPHM_KIND_CHOICE, value, 0, NULL)
#define TEXT(name, value, help) ROW(name, "", help, NULL, SPHM_KIND_TEXT, 0, 0, value)
#define VECTOR(name, unit, x, y, z, minimum, maximum, help)                                                  \
    ROW(name, unit, help, NULL, SPHM_KIND_VECTOR, minimum, maximum,                                          \
        (x) >= SPHM_AUTO ? "auto" : "[" #x ", " #y ", " #z "]")

/* The list with its group headings as rows without a name. */
static const sphm_parameter_info listed[] = {
#include "sph_muscle/parameter_list.inc"
};
#undef GROUP
#undef REAL
#undef INTEGER
#undef BOOLEAN
#undef CHOICE
#undef TEXT
#undef VECTOR

enum { LISTED = sizeof listed / sizeof listed[0], CHOICE_SIZE = 48 };
static sphm_parameter_info table[LISTED];
static char default_choices[LISTED][CHOICE_SIZE];
static size_t table_rows;

static void choice_name(const char *choices, int index, char *name, size_t size);

/* Two things the preprocessor cannot do: carry a group's title down its rows, and cut the default out of a
 * choice string. Done when the library is loaded, before a second thread can be there; filling the table at
 * the first call would need a lock. */
__attribute__((constructor)) static void fill_table(void) {
    const char *group = "";
    for (size_t i = 0; i < LISTED; i++) {
        if (!listed[i].name) {
            group = listed[i].group;
            continue;
        }
        sphm_parameter_info *row = &table[table_rows];
        *row = listed[i];
        row->group = group;
        if (row->kind == SPHM_KIND_CHOICE) {
            choice_name(row->choices, (int)row->minimum, default_choices[table_rows], CHOICE_SIZE);
            row->default_text = default_choices[table_rows];
            row->minimum = 0;
            for (const char *c = row->choices; *c; c++)
                row->maximum += *c == '|';
        }
        table_rows++;
    }
}

size_t sphm_parameter_count(void) {
    return table_rows;
}

const sphm_parameter_info *sphm_parameter_row(size_t row) {
    return row < table_rows ? &table[row] : NULL;
}

const sphm_parameter_info *sphm_parameter_find(const char *name) {
    for (size_t i = 0; name && i < table_rows; i++)
        if (strcmp(table[i].name, name) == 0)
            return &table[i];
    return NULL;
}

sphm_parameters sphm_parameters_default(void) {
    sphm_parameters parameters;
    memset(&parameters, 0, sizeof parameters); /* padding too, so that equal settings are equal bytes */
    parameters.marker = MARKER;
#define GROUP(title, help)
#define REAL(name, unit, value, minimum, maximum, help) parameters.name = value;
#define INTEGER(name, unit, value, minimum, maximum, help) parameters.name = value;
#define BOOLEAN(name, value, help) parameters.name = value;
#define CHOICE(name, value, choices, help) parameters.name = value;
#define TEXT(name, value, help) memcpy(parameters.name, value, sizeof(value));
#define VECTOR(name, unit, x, y, z, minimum, maximum, help)                                                  \
    parameters.name[0] = x, parameters.name[1] = y, parameters.name[2] = z;
#include "sph_muscle/parameter_list.inc"
#undef GROUP
#undef REAL
#undef INTEGER
#undef BOOLEAN
#undef CHOICE
#undef TEXT
#undef VECTOR
    return parameters;
}

/* Choices
 * --------------------------------------------------------------------------------------------------*/

/* The index-th of "first|second|...", or "?" beyond them. */
static void choice_name(const char *choices, int index, char *name, size_t size) {
    for (; index > 0 && choices; index--) {
        choices = strchr(choices, '|');
        choices = choices ? choices + 1 : NULL;
    }
    if (index < 0 || !choices)
        choices = "?";
    snprintf(name, size, "%.*s", (int)strcspn(choices, "|"), choices);
}

/* The index of `name` among the choices, or -1. */
static int choice_index(const char *choices, const char *name) {
    size_t length = strlen(name);
    for (int index = 0;; index++) {
        size_t here = strcspn(choices, "|");
        if (here == length && strncmp(choices, name, length) == 0)
            return index;
        if (choices[here] == '\0')
            return -1;
        choices += here + 1;
    }
}

/* "a|b|c" as "a, b, c". */
static void choice_list(const char *choices, char *text, size_t size) {
    size_t used = 0;
    for (; *choices && used + 3 < size; choices++) {
        text[used++] = *choices == '|' ? ',' : *choices;
        if (*choices == '|')
            text[used++] = ' ';
    }
    text[used] = '\0';
}

/* The nearest name
 * -----------------------------------------------------------------------------------------*/

enum { NAME_SIZE = 64 };

static size_t smallest(size_t a, size_t b, size_t c) {
    size_t least = a < b ? a : b;
    return least < c ? least : c;
}

/* Edits (insert, delete, replace, swap two neighbours) that lead from a to b: the optimal string alignment
 * distance, three rows of the usual table. */
static size_t edit_distance(const char *a, const char *b) {
    size_t rows[3][NAME_SIZE + 1], length_a = strlen(a), length_b = strlen(b);
    if (length_a > NAME_SIZE || length_b > NAME_SIZE)
        return SIZE_MAX;
    size_t *before = rows[0], *last = rows[1], *now = rows[2];
    for (size_t j = 0; j <= length_b; j++)
        before[j] = last[j] = j;
    for (size_t i = 1; i <= length_a; i++) {
        now[0] = i;
        for (size_t j = 1; j <= length_b; j++) {
            now[j] = smallest(last[j] + 1, now[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1]));
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] && before[j - 2] + 1 < now[j])
                now[j] = before[j - 2] + 1;
        }
        size_t *rotated = before;
        before = last, last = now, now = rotated;
    }
    return last[length_b];
}

/* The parameter whose name is most like `name`: one that contains it, or one few edits away; else NULL. */
static const char *nearest_name(const char *name) {
    const char *nearest = NULL;
    size_t length = strlen(name), least = length / 3 + 1;
    for (size_t i = 0; i < table_rows; i++) {
        size_t distance = edit_distance(name, table[i].name);
        if (distance <= least) {
            least = distance ? distance - 1 : 0; /* of equally near ones the first in the table */
            nearest = table[i].name;
        }
    }
    for (size_t i = 0; !nearest && length >= 4 && i < table_rows; i++)
        if (strstr(table[i].name, name))
            nearest = table[i].name;
    return nearest;
}

static sphm_status refuse_name(const char *name, sphm_context *context) {
    const char *nearest = nearest_name(name);
    if (nearest)
        return sphm_fail(context, SPHM_REFUSED_PARAMETER, "unknown parameter '%.60s'; did you mean '%s'?",
                         name, nearest);
    return sphm_fail(
        context, SPHM_REFUSED_PARAMETER,
        "unknown parameter '%.60s', and none has a similar name; the first of %zu are %s, %s, %s", name,
        table_rows, table[0].name, table[1].name, table[2].name);
}

/* Setting
 * --------------------------------------------------------------------------------------------------*/

/* Between a number and its unit, and "" where there is none. */
#define SPACED(unit) ((unit)[0] ? " " : ""), (unit)

static sphm_status refuse_value(const sphm_parameter_info *row, const char *value, sphm_context *context) {
    char least[SPHM_NUMBER_SIZE], most[SPHM_NUMBER_SIZE], choices[256];
    sphm_number_print(row->minimum, least);
    sphm_number_print(row->maximum, most);
    switch (row->kind) {
    case SPHM_KIND_REAL:
    case SPHM_KIND_INTEGER:
        return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                         "parameter '%s' is '%.60s'; it must be a %snumber from %s to %s%s%s", row->name,
                         value, row->kind == SPHM_KIND_INTEGER ? "whole " : "", least, most,
                         SPACED(row->unit));
    case SPHM_KIND_BOOLEAN:
        return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                         "parameter '%s' is '%.60s'; it must be true or false", row->name, value);
    case SPHM_KIND_CHOICE:
        choice_list(row->choices, choices, sizeof choices);
        return sphm_fail(context, SPHM_REFUSED_PARAMETER, "parameter '%s' is '%.60s'; it must be one of %s",
                         row->name, value, choices);
    case SPHM_KIND_TEXT:
        return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                         "parameter '%s' is '%.60s'...; it may have at most %d bytes", row->name, value,
                         SPHM_TEXT_SIZE - 1);
    case SPHM_KIND_VECTOR:
        return sphm_fail(context, SPHM_REFUSED_PARAMETER,
                         "parameter '%s' is '%.60s'; it must be %s[x, y, z] with numbers from %s to %s%s%s",
                         row->name, value, strcmp(row->default_text, "auto") == 0 ? "auto or " : "", least,
                         most, SPACED(row->unit));
    }
    return SPHM_REFUSED_PARAMETER;
}

static int in_range(const sphm_parameter_info *row, double value) {
    return value >= row->minimum && value <= row->maximum; /* false for NaN */
}

static int equal_but_for_case(const char *a, const char *b) {
    while (*a && tolower((unsigned char)*a) == tolower((unsigned char)*b))
        a++, b++;
    return *a == *b;
}

/* The spellings YAML 1.1 and ROS use. Returns 0 for any other text. */
static int parse_boolean(const char *text, int *value) {
    static const char *const names[2][4] = {{"false", "no", "off", "0"}, {"true", "yes", "on", "1"}};
    for (int truth = 0; truth < 2; truth++)
        for (int i = 0; i < 4; i++)
            if (equal_but_for_case(text, names[truth][i])) {
                *value = truth;
                return 1;
            }
    return 0;
}

/* "[x, y, z]", or "auto" for a vector that is so by default. Half automatic vectors are not a thing. */
static int parse_vector(const sphm_parameter_info *row, const char *text, double value[3]) {
    if (strcmp(text, "auto") == 0 && strcmp(row->default_text, "auto") == 0) {
        value[0] = value[1] = value[2] = SPHM_AUTO;
        return 1;
    }
    char copy[160], *ends[3];
    size_t length = strlen(text);
    if (length < 7 || length >= sizeof copy || text[0] != '[' || text[length - 1] != ']')
        return 0;
    memcpy(copy, text + 1, length - 2);
    copy[length - 2] = '\0';
    ends[0] = copy;
    for (int i = 1; i < 3; i++) {
        ends[i] = strchr(ends[i - 1], ',');
        if (!ends[i])
            return 0;
        *ends[i]++ = '\0';
    }
    double parsed[3];
    for (int i = 0; i < 3; i++)
        if (!sphm_number_parse(ends[i], &parsed[i]) || !in_range(row, parsed[i]))
            return 0;
    memcpy(value, parsed, sizeof parsed);
    return 1;
}

/* Writes the value at `target` if `text` is a valid one. */
static int parse_value(const sphm_parameter_info *row, const char *text, void *target) {
    double number;
    switch (row->kind) {
    case SPHM_KIND_REAL:
        if (!sphm_number_parse(text, &number) || !in_range(row, number))
            return 0;
        *(double *)target = number;
        return 1;
    case SPHM_KIND_INTEGER: /* "1e5" and "2231.0" are whole numbers too */
        if (!sphm_number_parse(text, &number) || !in_range(row, number) || number != floor(number))
            return 0;
        *(int64_t *)target = (int64_t)number;
        return 1;
    case SPHM_KIND_BOOLEAN:
        return parse_boolean(text, target);
    case SPHM_KIND_CHOICE:
        if (choice_index(row->choices, text) < 0)
            return 0;
        *(int *)target = choice_index(row->choices, text);
        return 1;
    case SPHM_KIND_TEXT:
        if (strlen(text) >= SPHM_TEXT_SIZE)
            return 0;
        memset(target, 0, SPHM_TEXT_SIZE);
        strcpy(target, text);
        return 1;
    case SPHM_KIND_VECTOR:
        return parse_vector(row, text, target);
    }
    return 0;
}

static sphm_status refuse_unmarked(const sphm_parameters *parameters, sphm_context *context) {
    if (parameters && parameters->marker == MARKER)
        return SPHM_OK;
    return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "parameters were not made by sphm_parameters_default()");
}

sphm_status sphm_parameters_set(sphm_parameters *parameters, const char *name, const char *value,
                                sphm_context *context) {
    sphm_status status = refuse_unmarked(parameters, context);
    if (status != SPHM_OK)
        return status;
    if (!name || !value)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "name or value of a parameter is NULL");
    const sphm_parameter_info *row = sphm_parameter_find(name);
    if (!row)
        return refuse_name(name, context);
    if (!parse_value(row, value, (char *)parameters + row->offset))
        return refuse_value(row, value, context);
    return SPHM_OK;
}

/* Getting
 * --------------------------------------------------------------------------------------------------*/

static void print_vector(const double value[3], char *text, size_t size) {
    char components[3][SPHM_NUMBER_SIZE];
    if (value[0] >= SPHM_AUTO && value[1] >= SPHM_AUTO && value[2] >= SPHM_AUTO) {
        snprintf(text, size, "auto");
        return;
    }
    for (int i = 0; i < 3; i++)
        sphm_number_print(value[i], components[i]);
    snprintf(text, size, "[%s, %s, %s]", components[0], components[1], components[2]);
}

static void print_value(const sphm_parameter_info *row, const void *value, char text[SPHM_TEXT_SIZE]) {
    switch (row->kind) {
    case SPHM_KIND_REAL:
        sphm_number_print(*(const double *)value, text);
        break;
    case SPHM_KIND_INTEGER:
        snprintf(text, SPHM_TEXT_SIZE, "%" PRId64, *(const int64_t *)value);
        break;
    case SPHM_KIND_BOOLEAN:
        strcpy(text, *(const int *)value ? "true" : "false");
        break;
    case SPHM_KIND_CHOICE:
        choice_name(row->choices, *(const int *)value, text, SPHM_TEXT_SIZE);
        break;
    case SPHM_KIND_TEXT:
        snprintf(text, SPHM_TEXT_SIZE, "%.*s", SPHM_TEXT_SIZE - 1, (const char *)value);
        break;
    case SPHM_KIND_VECTOR:
        print_vector(value, text, SPHM_TEXT_SIZE);
        break;
    }
}

sphm_status sphm_parameters_get(const sphm_parameters *parameters, const char *name, char *text, size_t size,
                                sphm_context *context) {
    sphm_status status = refuse_unmarked(parameters, context);
    if (status != SPHM_OK)
        return status;
    const sphm_parameter_info *row = name ? sphm_parameter_find(name) : NULL;
    if (!row)
        return refuse_name(name ? name : "", context);
    char value[SPHM_TEXT_SIZE];
    print_value(row, (const char *)parameters + row->offset, value);
    if (!text || strlen(value) >= size)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "parameter '%s' takes %zu bytes; there are %zu",
                         name, strlen(value) + 1, size);
    strcpy(text, value);
    return SPHM_OK;
}
