/* Method specifications: "NAME" or "NAME:PARAMETER=VALUE:...". */
#include "methods/method.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NAME_MAX_LENGTH = 64 };

/* Number of `length` characters at `text` among names separated by '|', or -1. */
static int find_choice(const char *choices, const char *text, size_t length)
{
    for (int i = 0;; i++) {
        size_t n = strcspn(choices, "|");
        if (n == length && memcmp(choices, text, n) == 0) return i;
        if (!choices[n]) return -1;
        choices += n + 1;
    }
}

static knurl_status parse_value(const knurl_method_parameter *p, const char *text, size_t length,
                                double *value, knurl_error *error)
{
    if (p->choices) {
        int choice = find_choice(p->choices, text, length);
        if (choice < 0)
            return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                              "method parameter %s: found '%.*s', expected one of %s", p->name, (int)length,
                              text, p->choices);
        *value = (double)choice;
        return KNURL_OK;
    }
    char copy[NAME_MAX_LENGTH], *end = copy;
    if (length > 0 && length < sizeof copy) {
        memcpy(copy, text, length);
        copy[length] = '\0';
        *value = strtod(copy, &end);
    }
    if (end == copy || *end || !(*value >= p->least && *value <= p->most) ||
        (p->whole && *value != floor(*value)))
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "method parameter %s: found '%.*s', expected a %s from %.10g to %.10g", p->name,
                          length < 100 ? (int)length : 100, text, p->whole ? "whole number" : "number",
                          p->least, p->most);
    return KNURL_OK;
}

/* One "name=value" of `length` characters. */
static knurl_status parse_assignment(const method *m, const char *text, size_t length, double *values,
                                     uint32_t *given, knurl_error *error)
{
    const char *equals = memchr(text, '=', length);
    size_t name = equals ? (size_t)(equals - text) : length;
    for (int i = 0; equals && m->parameters[i].name; i++) {
        if (strlen(m->parameters[i].name) != name || memcmp(m->parameters[i].name, text, name) != 0) continue;
        if (*given >> i & 1u)
            return knurl_fail(error, KNURL_ERROR_ARGUMENT, "method parameter %s: given twice",
                              m->parameters[i].name);
        *given |= 1u << i;
        return parse_value(&m->parameters[i], equals + 1, length - name - 1, &values[i], error);
    }
    char list[256] = "none";
    size_t used = 0;
    for (int i = 0; m->parameters[i].name; i++) {
        size_t n = strlen(m->parameters[i].name);
        if (used + n + 3 > sizeof list) break;
        if (i) used += (size_t)snprintf(list + used, sizeof list - used, ", ");
        used += (size_t)snprintf(list + used, sizeof list - used, "%s", m->parameters[i].name);
    }
    return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                      "method %s: found '%.*s', expected PARAMETER=VALUE with one of: %s", m->name,
                      length < 100 ? (int)length : 100, text, list);
}

knurl_status method_parse(const char *specification, const method **found,
                          double values[METHOD_MAX_PARAMETERS], knurl_error *error)
{
    size_t length = strcspn(specification, ":");
    const method *m = method_find(specification, length);
    if (!m)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "method '%.*s' is not known",
                          length < 100 ? (int)length : 100, specification);
    for (int i = 0; m->parameters[i].name; i++) values[i] = m->parameters[i].preset;
    const char *at = specification + length;
    uint32_t given = 0; /* a bit per parameter */
    while (*at == ':') {
        at++;
        length = strcspn(at, ":");
        knurl_status status = parse_assignment(m, at, length, values, &given, error);
        if (status != KNURL_OK) return status;
        at += length;
    }
    *found = m;
    return KNURL_OK;
}
