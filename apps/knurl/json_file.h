/* json_file.h: JSON results. */
#ifndef APP_JSON_FILE_H
#define APP_JSON_FILE_H

#include "common.h"

#include <jansson.h>

/* Integers up to 2^63 - 1 exactly. */
json_t *json_count(uint64_t value);
/* Numbers; null where JSON has none (infinity, NaN). */
json_t *json_number(double value);
json_t *json_numbers(const double *values, int count);
/* Text of any bytes: what is not UTF-8 becomes '?'. NULL gives null. */
json_t *json_text(const char *text);

/* Writes `root` (takes its reference) to a file, "-" for standard output. Reports failures, returns an
 * exit code. A NULL root is out of memory. */
int json_save(command_session *session, json_t *root, const char *path);

#endif
