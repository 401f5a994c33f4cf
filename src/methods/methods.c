/* The list of methods. A new one adds a line here. */
#include "methods/method.h"

#include <string.h>

static const method *const methods[] = {
    &method_rmip,
};

enum { METHOD_COUNT = sizeof methods / sizeof methods[0] };

const method *method_find(const char *name)
{
    for (int32_t i = 0; i < METHOD_COUNT; i++)
        if (strcmp(methods[i]->name, name) == 0) return methods[i];
    return NULL;
}

int32_t knurl_method_count(void)
{
    return METHOD_COUNT;
}

const char *knurl_method_name(int32_t index)
{
    return index >= 0 && index < METHOD_COUNT ? methods[index]->name : NULL;
}

const char *knurl_method_summary(int32_t index)
{
    return index >= 0 && index < METHOD_COUNT ? methods[index]->summary : NULL;
}
