/* json_file.c: JSON results. */
#include "json_file.h"
#include "output.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

json_t *json_count(uint64_t value)
{
    return json_integer(value > INT64_MAX ? INT64_MAX : (json_int_t)value);
}

json_t *json_number(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

json_t *json_numbers(const double *values, int count)
{
    json_t *array = json_array();
    for (int i = 0; i < count; i++) json_array_append_new(array, json_number(values[i]));
    return array;
}

json_t *json_text(const char *text)
{
    if (!text) return json_null();
    json_t *string = json_string(text);
    if (string) return string;
    char *copy = strdup(text);
    if (!copy) return NULL;
    for (char *place = copy; *place; place++)
        if ((unsigned char)*place >= 0x80) *place = '?';
    string = json_string(copy);
    free(copy);
    return string;
}

int json_save(command_session *session, json_t *root, const char *path)
{
    char *text = root ? json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(15)) : NULL;
    json_decref(root);
    if (!text) return session_fail_with(session, CODE_LIMIT, "out of memory for the JSON results");
    output_file output;
    int code = output_open(session, &output, path);
    if (code == CODE_DONE) {
        fputs(text, output.file);
        fputc('\n', output.file);
        code = output_commit(session, &output);
    }
    free(text);
    return code;
}
