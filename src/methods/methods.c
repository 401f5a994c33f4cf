/* The list of methods. A new one adds a line here. */
#include "methods/method.h"

#include <string.h>

static const method *const methods[] = {
    &method_fast,         &method_rmip,       &method_tfdm,   &method_pdm,           &method_secant,
    &method_tessellation, &method_texel_walk, &method_binary, &method_robust_binary, &method_empty_skip,
};

enum { METHOD_COUNT = sizeof methods / sizeof methods[0] };

static const method *at(int32_t index)
{
    return index >= 0 && index < METHOD_COUNT ? methods[index] : NULL;
}

const method *method_find(const char *name, size_t length)
{
    for (int32_t i = 0; i < METHOD_COUNT; i++)
        if (strlen(methods[i]->name) == length && memcmp(methods[i]->name, name, length) == 0)
            return methods[i];
    return NULL;
}

int32_t knurl_method_count(void)
{
    return METHOD_COUNT;
}

const char *knurl_method_name(int32_t index)
{
    return at(index) ? at(index)->name : NULL;
}

const char *knurl_method_summary(int32_t index)
{
    return at(index) ? at(index)->summary : NULL;
}

uint32_t knurl_method_flags(int32_t index)
{
    return at(index) ? at(index)->flags : 0;
}

const knurl_method_parameter *knurl_method_get_parameter(int32_t index, int32_t parameter)
{
    if (!at(index) || parameter < 0) return NULL;
    for (int32_t i = 0; at(index)->parameters[i].name; i++)
        if (i == parameter) return &at(index)->parameters[i];
    return NULL;
}

knurl_status knurl_method_check(const char *specification, int32_t *index, knurl_error *error)
{
    const method *found = NULL;
    double values[METHOD_MAX_PARAMETERS];
    if (!specification) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "method is NULL");
    knurl_status status = method_parse(specification, &found, values, error);
    for (int32_t i = 0; status == KNURL_OK && index && i < METHOD_COUNT; i++)
        if (methods[i] == found) *index = i;
    return status;
}
