/* support/traced.h: a scene of tests made into knurl objects through the public headers. */
#ifndef KNURL_TESTS_TRACED_H
#define KNURL_TESTS_TRACED_H

#include "oracle.h"

#include <knurl/knurl.h>

typedef struct traced {
    knurl_context *context;
    knurl_surface *surface;
    knurl_scene *scene;
    float lod;
} traced;

/* On failure writes the library's message to standard output and returns false. */
bool traced_make(const oracle_def *def, const char *method, int threads, traced *out);
void traced_free(traced *t);
knurl_ray traced_ray(const traced *t, const oracle_ray *ray);

#endif
