/* Buffers, buffer views and uris of glTF files. */
#include <string.h>

#include "io/gltf.h"
#include "io/scene_text.h"

void gltf_fail_memory(gltf_reader *g, const gltf_at *at, size_t bytes)
{
    gltf_fail(&g->report, at, KNURL_ERROR_MEMORY, "out of memory: %.1f MiB", (double)bytes / 1048576.0);
}

bool gltf_take(gltf_reader *g, const gltf_at *at, uint64_t bytes)
{
    if (g->report.status != KNURL_OK) return false;
    if (bytes > g->budget) {
        gltf_fail(&g->report, at, KNURL_ERROR_LIMIT,
                  "needs %llu bytes, expected at most %llu: the scene would be far larger than its file",
                  (unsigned long long)bytes, (unsigned long long)g->budget);
        return false;
    }
    g->budget -= bytes;
    return true;
}

bool gltf_is_data_uri(const char *uri)
{
    return strncmp(uri, "data:", 5) == 0;
}

static int base64_value(char c)
{
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    if (c == '+' || c == '-') return 62;
    if (c == '/' || c == '_') return 63;
    return -1;
}

static void decode_base64(gltf_reader *g, const gltf_at *at, const char *text, unsigned char **bytes,
                          size_t *size)
{
    size_t length = strlen(text);
    while (length && text[length - 1] == '=') length--;
    unsigned char *out = knurl_alloc(g->context, length / 4 * 3 + 4);
    if (!out) {
        gltf_fail_memory(g, at, length);
        return;
    }
    size_t made = 0;
    uint32_t bits = 0;
    for (size_t i = 0; i < length; i++) {
        int value = base64_value(text[i]);
        if (value < 0) {
            gltf_fail(&g->report, at, KNURL_ERROR_INPUT, "character %zu of the base64 data is code %d", i,
                      (unsigned char)text[i]);
            knurl_free(g->context, out);
            return;
        }
        bits = bits << 6 | (uint32_t)value;
        if (i % 4 == 0) continue;
        out[made++] = (unsigned char)(bits >> (i % 4 == 1 ? 4 : i % 4 == 2 ? 2 : 0));
    }
    *bytes = out;
    *size = made;
}

static int hex_value(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

char *gltf_uri_path(gltf_reader *g, const gltf_at *at, const char *uri)
{
    size_t scheme = strspn(uri, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ");
    if (scheme > 1 && strncmp(uri + scheme, "://", 3) == 0) {
        gltf_fail(&g->report, at, KNURL_ERROR_UNSUPPORTED, "\"%.100s\": expected a file beside the scene",
                  uri);
        return NULL;
    }
    char *name = knurl_strdup(g->context, uri);
    if (!name) {
        gltf_fail_memory(g, at, strlen(uri));
        return NULL;
    }
    char *to = name;
    for (const char *from = name; *from; from++) {
        int high = *from == '%' ? hex_value(from[1]) : -1;
        int low = high >= 0 ? hex_value(from[2]) : -1;
        if (low < 0 || (high == 0 && low == 0)) {
            *to++ = *from;
            continue;
        }
        *to++ = (char)(high * 16 + low);
        from += 2;
    }
    char *path = text_path_beside(g->context, g->report.file, name, (size_t)(to - name));
    knurl_free(g->context, name);
    if (!path) gltf_fail_memory(g, at, strlen(uri));
    return path;
}

void gltf_read_uri(gltf_reader *g, const gltf_at *at, const char *uri, unsigned char **bytes, size_t *size)
{
    *bytes = NULL;
    *size = 0;
    if (gltf_is_data_uri(uri)) {
        const char *comma = strchr(uri, ',');
        if (!comma || comma - uri < 7 || strncmp(comma - 7, ";base64", 7) != 0)
            gltf_fail(&g->report, at, KNURL_ERROR_UNSUPPORTED,
                      "data uri \"%.40s\", expected data:...;base64,...", uri);
        else
            decode_base64(g, at, comma + 1, bytes, size);
        return;
    }
    char *path = gltf_uri_path(g, at, uri);
    if (!path) return;
    knurl_error error = {0};
    knurl_status status = KNURL_ERROR_INPUT;
    if (g->files) status = knurl_file_read(g->context, path, bytes, size, &error);
    if (status != KNURL_OK)
        gltf_fail(&g->report, at, status, "%s", g->files ? error.message : "other files are not opened");
    knurl_free(g->context, path);
}

static void read_buffer(gltf_reader *g, const gltf_at *at, size_t index)
{
    gltf_buffer *buffer = &g->buffers[index];
    gltf_report *r = &g->report;
    uint64_t length = gltf_integer(r, at, "byteLength", UINT64_MAX, UINT64_MAX);
    if (r->status == KNURL_OK && length == UINT64_MAX)
        gltf_fail(r, at, KNURL_ERROR_INPUT, "byteLength is missing");
    const char *uri = gltf_string(r, at, "uri", NULL);
    if (r->status != KNURL_OK) return;
    size_t have = 0;
    if (uri) {
        gltf_at place = gltf_member(at, "uri");
        gltf_read_uri(g, &place, uri, &buffer->owned, &have);
        buffer->bytes = buffer->owned;
    } else if (index == 0 && g->binary) {
        buffer->bytes = g->binary;
        have = g->binary_size;
    } else {
        gltf_fail(r, at, KNURL_ERROR_INPUT, "uri is missing%s",
                  index == 0 ? " and the file has no BIN chunk" : "");
    }
    if (r->status == KNURL_OK && have < length)
        gltf_fail(r, at, KNURL_ERROR_INPUT, "%zu bytes are there, expected byteLength %llu", have,
                  (unsigned long long)length);
    buffer->size = length < have ? (size_t)length : have;
}

void gltf_read_buffers(gltf_reader *g)
{
    gltf_at buffers = gltf_array(&g->report, &g->root, "buffers");
    size_t count = gltf_count(&buffers);
    g->buffers = knurl_alloc_zero(g->context, count * sizeof *g->buffers);
    if (!g->buffers) {
        gltf_fail_memory(g, &buffers, count * sizeof *g->buffers);
        return;
    }
    g->buffer_count = count;
    for (size_t i = 0; i < count && g->report.status == KNURL_OK; i++) {
        gltf_at at = gltf_element_object(&g->report, &buffers, i);
        if (at.value) read_buffer(g, &at, i);
        g->budget += 64 * (uint64_t)g->buffers[i].size;
    }
}

void gltf_free_buffers(gltf_reader *g)
{
    for (size_t i = 0; i < g->buffer_count; i++) knurl_free(g->context, g->buffers[i].owned);
    knurl_free(g->context, g->buffers);
}

bool gltf_buffer_view(gltf_reader *g, const gltf_at *view, const unsigned char **bytes, size_t *size,
                      size_t *stride)
{
    gltf_report *r = &g->report;
    int64_t buffer = gltf_index(r, view, "buffer", g->buffer_count, true);
    if (r->status != KNURL_OK || buffer < 0) return false;
    size_t have = g->buffers[buffer].size;
    uint64_t offset = gltf_integer(r, view, "byteOffset", 0, have);
    uint64_t length = gltf_integer(r, view, "byteLength", 0, have);
    *stride = (size_t)gltf_integer(r, view, "byteStride", 0, 252);
    if (r->status != KNURL_OK) return false;
    if (length > have - offset) {
        gltf_fail(r, view, KNURL_ERROR_INPUT, "byteOffset %llu + byteLength %llu, expected at most %zu",
                  (unsigned long long)offset, (unsigned long long)length, have);
        return false;
    }
    *bytes = g->buffers[buffer].bytes ? g->buffers[buffer].bytes + offset : NULL;
    *size = (size_t)length;
    return true;
}
