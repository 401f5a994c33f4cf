/* text.h: numbers to and from text, fast, with the same results as the C library. */
#ifndef APP_TEXT_H
#define APP_TEXT_H

#include <stdbool.h>
#include <stddef.h>

enum { TEXT_NUMBER_SIZE = 32 }; /* enough for one formatted number */

/* Writes `value` as printf's %.9g does, without a terminating zero; returns the end. */
char *text_format_g9(char *out, double value);
/* Writes an unsigned whole number; returns the end. */
char *text_format_unsigned(char *out, unsigned long long value);
/* Reads all of [begin, end), blanks around it allowed, as strtod does (decimal notation, inf and nan
 * included); false if it is anything but one number. *end must be readable and no part of a number. */
bool text_parse_number(const char *begin, const char *end, double *value);

#endif
