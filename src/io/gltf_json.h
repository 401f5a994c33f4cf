/* io/gltf_json.h: typed access to JSON with messages that name the place by its JSON pointer. */
#ifndef KNURL_SRC_IO_GLTF_JSON_H
#define KNURL_SRC_IO_GLTF_JSON_H

#include <jansson.h>

#include "base/base.h"

/* Who is told about the first mistake. After it every function below returns its fallback at once, so
 * callers check `status` where a wrong value would lead them astray. */
typedef struct gltf_report {
    knurl_status status;
    knurl_error *error;
    const char *file;
} gltf_report;

/* A place in the document. `parent` must outlive it; `value` is NULL if there is nothing. */
typedef struct gltf_at {
    const json_t *value;
    const struct gltf_at *parent;
    const char *key; /* NULL: element `index` of an array */
    size_t index;
} gltf_at;

/* Records KNURL_ERROR_INPUT (or `status`) as "file: /pointer: message". */
void gltf_fail(gltf_report *r, const gltf_at *at, knurl_status status, const char *format, ...)
    KNURL_PRINTF(4, 5);
/* The pointer of `at`, cut at `size`; returns text. */
char *gltf_pointer(const gltf_at *at, char *text, size_t size);

/* Members. A member of another type than asked for is an error; an absent one has value NULL. */
gltf_at gltf_member(const gltf_at *at, const char *key);
gltf_at gltf_object(gltf_report *r, const gltf_at *at, const char *key);
gltf_at gltf_array(gltf_report *r, const gltf_at *at, const char *key);
gltf_at gltf_element(const gltf_at *array, size_t index);
/* An element that must be an object. */
gltf_at gltf_element_object(gltf_report *r, const gltf_at *array, size_t index);
size_t gltf_count(const gltf_at *array); /* 0 if absent */
/* extensions.<name>, absent if either is. */
typedef struct gltf_extension {
    gltf_at extensions, at;
} gltf_extension;
void gltf_extension_open(gltf_report *r, const gltf_at *at, const char *name, gltf_extension *extension);

/* Values of members, `fallback` if absent. A range that is left is an error. */
double gltf_number(gltf_report *r, const gltf_at *at, const char *key, double fallback, double low,
                   double high);
bool gltf_bool(gltf_report *r, const gltf_at *at, const char *key, bool fallback);
const char *gltf_string(gltf_report *r, const gltf_at *at, const char *key, const char *fallback);
/* Exactly `count` numbers; the values are left alone if absent. Returns whether there were any. */
bool gltf_numbers(gltf_report *r, const gltf_at *at, const char *key, size_t count, double *values);
/* A whole number in [0, high]. */
uint64_t gltf_integer(gltf_report *r, const gltf_at *at, const char *key, uint64_t fallback, uint64_t high);
/* An index of an array of `count` elements; -1 if absent and not required. */
int64_t gltf_index(gltf_report *r, const gltf_at *at, const char *key, size_t count, bool required);
/* The same for the value at `at` itself. */
int64_t gltf_index_value(gltf_report *r, const gltf_at *at, size_t count);

#endif
