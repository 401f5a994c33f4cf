/* Typed access to a glTF document. */
#include "io/gltf_json.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

char *gltf_pointer(const gltf_at *at, char *text, size_t size)
{
    /* From the leaf backwards: the deepest places count when it does not fit. */
    size_t begin = size - 1;
    text[begin] = 0;
    for (; at && at->parent; at = at->parent) {
        char part[96];
        int length = at->key ? snprintf(part, sizeof part, "/%s", at->key)
                             : snprintf(part, sizeof part, "/%zu", at->index);
        size_t used = length < 0 ? 0 : (size_t)length < sizeof part ? (size_t)length : sizeof part - 1;
        if (used > begin) break;
        begin -= used;
        memcpy(text + begin, part, used);
    }
    memmove(text, text + begin, size - begin);
    return text;
}

void gltf_fail(gltf_report *r, const gltf_at *at, knurl_status status, const char *format, ...)
{
    if (r->status != KNURL_OK) return;
    char pointer[256], message[640];
    va_list args;
    va_start(args, format);
    (void)vsnprintf(message, sizeof message, format, args);
    va_end(args);
    r->status = knurl_fail(r->error, status, "%.100s: %s: %s", r->file,
                           gltf_pointer(at, pointer, sizeof pointer), message);
}

static const char *type_name(const json_t *value)
{
    if (!value) return "nothing";
    switch (json_typeof(value)) {
    case JSON_OBJECT:
        return "an object";
    case JSON_ARRAY:
        return "an array";
    case JSON_STRING:
        return "a string";
    case JSON_INTEGER:
    case JSON_REAL:
        return "a number";
    case JSON_TRUE:
        return "true";
    case JSON_FALSE:
        return "false";
    case JSON_NULL:
        return "null";
    }
    return "something else";
}

gltf_at gltf_member(const gltf_at *at, const char *key)
{
    const json_t *value = at->value ? json_object_get(at->value, key) : NULL;
    return (gltf_at){value, at, key, 0};
}

gltf_at gltf_element(const gltf_at *array, size_t index)
{
    const json_t *value = array->value ? json_array_get(array->value, index) : NULL;
    return (gltf_at){value, array, NULL, index};
}

static void expect(gltf_report *r, gltf_at *at, bool good, const char *expected)
{
    if (r->status == KNURL_OK && at->value && !good)
        gltf_fail(r, at, KNURL_ERROR_INPUT, "found %s, expected %s", type_name(at->value), expected);
    if (!good || r->status != KNURL_OK) at->value = NULL;
}

gltf_at gltf_object(gltf_report *r, const gltf_at *at, const char *key)
{
    gltf_at found = gltf_member(at, key);
    expect(r, &found, json_is_object(found.value), "an object");
    return found;
}

gltf_at gltf_array(gltf_report *r, const gltf_at *at, const char *key)
{
    gltf_at found = gltf_member(at, key);
    expect(r, &found, json_is_array(found.value), "an array");
    return found;
}

gltf_at gltf_element_object(gltf_report *r, const gltf_at *array, size_t index)
{
    gltf_at found = gltf_element(array, index);
    expect(r, &found, json_is_object(found.value), "an object");
    return found;
}

size_t gltf_count(const gltf_at *array)
{
    return array->value ? json_array_size(array->value) : 0;
}

void gltf_extension_open(gltf_report *r, const gltf_at *at, const char *name, gltf_extension *extension)
{
    extension->extensions = gltf_object(r, at, "extensions");
    extension->at = gltf_object(r, &extension->extensions, name);
}

static double number_value(gltf_report *r, gltf_at *at, double fallback)
{
    expect(r, at, json_is_number(at->value), "a number");
    return at->value ? json_number_value(at->value) : fallback;
}

double gltf_number(gltf_report *r, const gltf_at *at, const char *key, double fallback, double low,
                   double high)
{
    gltf_at found = gltf_member(at, key);
    double value = number_value(r, &found, fallback);
    if (found.value && !(value >= low && value <= high)) {
        if (isinf(high))
            gltf_fail(r, &found, KNURL_ERROR_INPUT, "found %g, expected at least %g", value, low);
        else
            gltf_fail(r, &found, KNURL_ERROR_INPUT, "found %g, expected %g to %g", value, low, high);
        return fallback;
    }
    return value;
}

bool gltf_bool(gltf_report *r, const gltf_at *at, const char *key, bool fallback)
{
    gltf_at found = gltf_member(at, key);
    expect(r, &found, json_is_boolean(found.value), "true or false");
    return found.value ? json_is_true(found.value) : fallback;
}

const char *gltf_string(gltf_report *r, const gltf_at *at, const char *key, const char *fallback)
{
    gltf_at found = gltf_member(at, key);
    expect(r, &found, json_is_string(found.value), "a string");
    return found.value ? json_string_value(found.value) : fallback;
}

bool gltf_numbers(gltf_report *r, const gltf_at *at, const char *key, size_t count, double *values)
{
    gltf_at array = gltf_array(r, at, key);
    if (!array.value) return false;
    if (gltf_count(&array) != count) {
        gltf_fail(r, &array, KNURL_ERROR_INPUT, "found %zu elements, expected %zu", gltf_count(&array),
                  count);
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        gltf_at element = gltf_element(&array, i);
        double value = number_value(r, &element, 0.0);
        if (r->status != KNURL_OK) return false;
        values[i] = value;
    }
    return true;
}

/* Integers may be written as 3 or 3.0; *good says whether it is one of [0, 2^53]. */
static uint64_t integer_value(const json_t *value, bool *good)
{
    double number = json_number_value(value);
    *good = json_is_number(value) && number >= 0.0 && number <= 9007199254740992.0 && floor(number) == number;
    return *good ? (uint64_t)number : 0;
}

uint64_t gltf_integer(gltf_report *r, const gltf_at *at, const char *key, uint64_t fallback, uint64_t high)
{
    gltf_at found = gltf_member(at, key);
    (void)number_value(r, &found, 0.0);
    if (!found.value) return fallback;
    bool good;
    uint64_t value = integer_value(found.value, &good);
    if (good && value <= high) return value;
    gltf_fail(r, &found, KNURL_ERROR_INPUT, "found %.17g, expected a whole number from 0 to %llu",
              json_number_value(found.value), (unsigned long long)high);
    return fallback;
}

int64_t gltf_index_value(gltf_report *r, const gltf_at *at, size_t count)
{
    gltf_at found = *at;
    (void)number_value(r, &found, 0.0);
    if (!found.value) return -1;
    bool good;
    uint64_t value = integer_value(found.value, &good);
    if (good && value < count) return (int64_t)value;
    if (count == 0)
        gltf_fail(r, at, KNURL_ERROR_INPUT, "found %.17g, expected nothing: there are no such elements",
                  json_number_value(found.value));
    else
        gltf_fail(r, at, KNURL_ERROR_INPUT, "found %.17g, expected 0 to %zu", json_number_value(found.value),
                  count - 1);
    return -1;
}

int64_t gltf_index(gltf_report *r, const gltf_at *at, const char *key, size_t count, bool required)
{
    gltf_at found = gltf_member(at, key);
    if (!found.value && required) gltf_fail(r, &found, KNURL_ERROR_INPUT, "not there, expected an index");
    return gltf_index_value(r, &found, count);
}
