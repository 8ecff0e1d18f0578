/* Decimal text to double and back, whatever the locale.
 *
 * strtod() and printf() follow the locale's decimal point, and a host process (a ROS node with a Qt plugin,
 * say) may well have set one. uselocale() switches only the calling thread; writing a correctly rounding
 * parser of our own would be the alternative, and a bad one. */
#define _POSIX_C_SOURCE 200809L
#include "core/number.h"

#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Sets the thread's locale to "C" and returns the one to go back to. Where there is no memory for the locale
 * object the present one stays: right in most programs, and better than failing. */
static locale_t enter_c_locale(locale_t *c) {
    *c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    return *c ? uselocale(*c) : (locale_t)0;
}

static void leave_c_locale(locale_t c, locale_t before) {
    if (!c)
        return;
    uselocale(before);
    freelocale(c);
}

int sphm_number_parse(const char *text, double *value) {
    static const char blanks[] = " \t\r\n";
    text += strspn(text, blanks);
    size_t length = strspn(text, "0123456789+-.eE"); /* leaves out nan, inf and hexadecimal */
    if (length == 0 || text[length + strspn(text + length, blanks)] != '\0')
        return 0;
    locale_t c, before = enter_c_locale(&c);
    char *end;
    double number = strtod(text, &end);
    leave_c_locale(c, before);
    if (end != text + length || !isfinite(number))
        return 0;
    *value = number;
    return 1;
}

static int print_nonfinite(double value, char text[SPHM_NUMBER_SIZE]) {
    if (isfinite(value))
        return 0;
    strcpy(text, isnan(value) ? "nan" : value > 0 ? "inf" : "-inf");
    return 1;
}

void sphm_number_print(double value, char text[SPHM_NUMBER_SIZE]) {
    if (print_nonfinite(value, text))
        return;
    locale_t c, before = enter_c_locale(&c);
    for (int digits = 15; digits <= 17; digits++) { /* %g leaves out zeros at the end */
        snprintf(text, SPHM_NUMBER_SIZE, "%.*g", digits, value);
        if (strtod(text, NULL) == value)
            break;
    }
    leave_c_locale(c, before);
}

void sphm_number_print_digits(double value, int digits, char text[SPHM_NUMBER_SIZE]) {
    if (print_nonfinite(value, text))
        return;
    locale_t c, before = enter_c_locale(&c);
    snprintf(text, SPHM_NUMBER_SIZE, "%.*g", digits, value);
    leave_c_locale(c, before);
}
