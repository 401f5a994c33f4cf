/* values.c: option values. */
#include "values.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int64_t value_integer(struct argp_state *state, const char *option, const char *text, int64_t lowest,
                      int64_t highest)
{
    char *end = NULL;
    errno = 0;
    long long value = strtoll(text, &end, 10);
    if (end == text || *end || errno || value < lowest || value > highest)
        argp_error(state, "%s: found '%s', expected a whole number from %lld to %lld", option, text,
                   (long long)lowest, (long long)highest);
    return value;
}

static void describe_range(char *text, size_t size, double lowest, double highest)
{
    if (isinf(lowest) && isinf(highest))
        snprintf(text, size, "a number");
    else if (isinf(highest))
        snprintf(text, size, "a number not below %g", lowest);
    else
        snprintf(text, size, "a number from %g to %g", lowest, highest);
}

double value_real(struct argp_state *state, const char *option, const char *text, double lowest,
                  double highest)
{
    char *end = NULL;
    double value = strtod(text, &end);
    if (end == text || *end || !isfinite(value) || value < lowest || value > highest) {
        char range[64];
        describe_range(range, sizeof range, lowest, highest);
        argp_error(state, "%s: found '%s', expected %s", option, text, range);
    }
    return value;
}

void value_reals(struct argp_state *state, const char *option, const char *text, char separator, int count,
                 double *values, const char *expected)
{
    const char *place = text;
    bool good = true;
    for (int i = 0; i < count && good; i++) {
        char *end = NULL;
        values[i] = strtod(place, &end);
        good = end != place && isfinite(values[i]) && *end == (i + 1 < count ? separator : 0);
        place = end + 1;
    }
    if (!good) argp_error(state, "%s: found '%s', expected %s", option, text, expected);
}

uint64_t value_size(struct argp_state *state, const char *option, const char *text)
{
    char *end = NULL;
    double value = strtod(text, &end);
    bool good = end != text && isfinite(value) && value >= 0;
    static const char suffixes[] = "KMGT";
    const char *suffix = good && *end ? strchr(suffixes, *end & ~0x20) : NULL;
    if (suffix) {
        value *= pow(1024, (double)(suffix - suffixes + 1));
        end++;
        if (*end == 'i') end++;
    }
    if (*end == 'B') end++;
    if (!good || *end || value < 1 || value > 1e18)
        argp_error(state, "%s: found '%s', expected bytes such as 500M or 2G", option, text);
    return (uint64_t)value;
}

int value_choice(struct argp_state *state, const char *option, const char *text, const char *const *names)
{
    char list[512] = "";
    size_t used = 0;
    for (int i = 0; names[i]; i++) {
        if (strcmp(text, names[i]) == 0) return i;
        int more = snprintf(list + used, sizeof list - used, "%s%s", i ? ", " : "", names[i]);
        if (more > 0 && used + (size_t)more < sizeof list) used += (size_t)more;
    }
    argp_error(state, "%s: found '%s', expected one of %s", option, text, list);
    return 0;
}

/* Levenshtein distance, good for words under 64 letters. */
static int edit_distance(const char *a, const char *b)
{
    int row[64];
    int length = (int)strlen(b);
    if (length > 63 || strlen(a) > 63) return 64;
    for (int j = 0; j <= length; j++) row[j] = j;
    for (int i = 1; a[i - 1]; i++) {
        int diagonal = row[0];
        row[0] = i;
        for (int j = 1; j <= length; j++) {
            int replaced = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            int best = row[j] + 1 < row[j - 1] + 1 ? row[j] + 1 : row[j - 1] + 1;
            row[j] = replaced < best ? replaced : best;
        }
    }
    return row[length];
}

const char *nearest_name(const char *text, const char *const *names)
{
    const char *best = NULL;
    int best_distance = 3; /* two slips of the finger, not a different word */
    size_t length = strlen(text);
    for (int i = 0; names[i]; i++) {
        int distance = edit_distance(text, names[i]);
        if (length >= 2 && strncmp(text, names[i], length) == 0) distance = 0;
        if (distance < best_distance && (size_t)distance < strlen(names[i])) {
            best = names[i];
            best_distance = distance;
        }
    }
    return best;
}
