/* Numbers as text, the same in every locale: files written under one locale are read under any other. */
#ifndef SPHM_CORE_NUMBER_H
#define SPHM_CORE_NUMBER_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Long enough for every text sphm_number_print() writes. */
#define SPHM_NUMBER_SIZE 32

/* Reads a decimal number that fills `text` but for blanks around it. Returns 1, or 0 and leaves *value alone.
 * "nan", "inf" and numbers beyond a double are refused too: no setting of ours may be one. */
int sphm_number_parse(const char *text, double *value);
/* Writes a decimal of few digits that reads back to the same double; non-finite values as nan, inf, -inf. */
void sphm_number_print(double value, char text[SPHM_NUMBER_SIZE]);
/* The same with at most `digits` (1 ... 17) significant digits. */
void sphm_number_print_digits(double value, int digits, char text[SPHM_NUMBER_SIZE]);

#ifdef __cplusplus
}
#endif
#endif
