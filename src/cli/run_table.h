/* The table of all parameters as Markdown. */
#ifndef SPHM_CLI_RUN_TABLE_H
#define SPHM_CLI_RUN_TABLE_H

#include <stdio.h>

void sphm_cli_print_table(FILE *file);

#endif
