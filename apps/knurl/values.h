/* values.h: reads option values; a bad one ends the program with the option, what was found and what was
 * expected (exit status 2). */
#ifndef APP_VALUES_H
#define APP_VALUES_H

#include <argp.h>
#include <stdint.h>

int64_t value_integer(struct argp_state *state, const char *option, const char *text, int64_t lowest,
                      int64_t highest);
/* Finite and in [lowest, highest]. */
double value_real(struct argp_state *state, const char *option, const char *text, double lowest,
                  double highest);
/* Exactly `count` finite numbers with `separator` between them; `expected` describes them. */
void value_reals(struct argp_state *state, const char *option, const char *text, char separator, int count,
                 double *values, const char *expected);
/* Bytes: a number with an optional K, M, G or T (powers of 1024) and an optional B or iB after it. */
uint64_t value_size(struct argp_state *state, const char *option, const char *text);
/* Index of `text` in `names`, which a NULL ends. */
int value_choice(struct argp_state *state, const char *option, const char *text, const char *const *names);

/* The name among `names` (ended by NULL) that `text` most likely meant, or NULL when none is near. */
const char *nearest_name(const char *text, const char *const *names);

#endif
