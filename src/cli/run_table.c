/* Prints the parameter table for the documentation; what the binary prints is what it does. */
#include "cli/run_table.h"

#include "core/number.h"
#include "sph_muscle/parameters.h"

#include <string.h>

/* '|' would end a cell of a Markdown table. */
static void print_cell(FILE *file, const char *text) {
    for (; *text; text++) {
        if (*text == '|')
            fputc('\\', file);
        fputc(*text, file);
    }
}

static void print_range(FILE *file, const sphm_parameter_info *row) {
    char least[SPHM_NUMBER_SIZE], most[SPHM_NUMBER_SIZE];
    sphm_number_print(row->minimum, least);
    sphm_number_print(row->maximum, most);
    switch (row->kind) {
    case SPHM_KIND_REAL:
    case SPHM_KIND_INTEGER:
        fprintf(file, "%s ... %s", least, most);
        break;
    case SPHM_KIND_VECTOR:
        fprintf(file, "%s ... %s each%s", least, most,
                strcmp(row->default_text, "auto") == 0 ? ", or `auto`" : "");
        break;
    case SPHM_KIND_BOOLEAN:
        fputs("`true`, `false`", file);
        break;
    case SPHM_KIND_CHOICE:
        for (const char *c = row->choices; *c; c += strcspn(c, "|"), c += *c == '|')
            fprintf(file, "%s`%.*s`", c == row->choices ? "" : ", ", (int)strcspn(c, "|"), c);
        break;
    case SPHM_KIND_TEXT:
        fputs("text", file);
        break;
    }
}

void sphm_cli_print_table(FILE *file) {
    const char *group = "";
    for (size_t i = 0; i < sphm_parameter_count(); i++) {
        const sphm_parameter_info *row = sphm_parameter_row(i);
        if (strcmp(row->group, group) != 0)
            fprintf(file, "%s**%s**\n\n| name | unit | default | valid | meaning |\n|---|---|---|---|---|\n",
                    i ? "\n" : "", row->group);
        group = row->group;
        fprintf(file, "| `%s` | %s | ", row->name, row->unit);
        if (row->default_text[0])
            fprintf(file, "`%s`", row->default_text);
        fputs(" | ", file);
        print_range(file, row);
        fputs(" | ", file);
        print_cell(file, row->help);
        fputs(" |\n", file);
    }
}
