/* Accessors: typed arrays in buffers. Bytes are put together one by one, so alignment and the
 * machine's byte order do not matter. */
#include <string.h>

#include "io/gltf.h"

enum { BYTE = 5120, UNSIGNED_BYTE, SHORT, UNSIGNED_SHORT, UNSIGNED_INT = 5125, FLOAT = 5126 };
/* Elements that an accessor without a buffer view (all zeros) may claim. */
enum { MAX_ZEROS = 1 << 24 };

static size_t component_size(uint32_t type)
{
    switch (type) {
    case BYTE:
    case UNSIGNED_BYTE:
        return 1;
    case SHORT:
    case UNSIGNED_SHORT:
        return 2;
    case UNSIGNED_INT:
    case FLOAT:
        return 4;
    default:
        return 0;
    }
}

static uint32_t component_count(const char *type)
{
    static const struct {
        const char *name;
        uint32_t count;
    } types[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4},
                 {"MAT2", 4},   {"MAT3", 9}, {"MAT4", 16}};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if (strcmp(type, types[i].name) == 0) return types[i].count;
    return 0;
}

static uint32_t read_u32(const unsigned char *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static uint32_t read_integer(const unsigned char *p, uint32_t type)
{
    if (type == UNSIGNED_BYTE) return p[0];
    if (type == UNSIGNED_SHORT) return (uint32_t)p[0] | (uint32_t)p[1] << 8;
    return read_u32(p);
}

static float read_float(const unsigned char *p, uint32_t type, bool normalized)
{
    float value;
    uint32_t bits;
    switch (type) {
    case BYTE:
        value = (float)(int8_t)p[0];
        break;
    case UNSIGNED_BYTE:
        return normalized ? (float)p[0] / 255.0f : (float)p[0];
    case SHORT:
        value = (float)(int16_t)(uint16_t)read_integer(p, UNSIGNED_SHORT);
        break;
    case UNSIGNED_SHORT:
        value = (float)read_integer(p, UNSIGNED_SHORT);
        return normalized ? value / 65535.0f : value;
    case UNSIGNED_INT:
        return (float)read_u32(p);
    default:
        bits = read_u32(p);
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    if (!normalized) return value;
    value /= type == BYTE ? 127.0f : 32767.0f;
    return value < -1.0f ? -1.0f : value;
}

/* `count` elements of `element` bytes, `natural` or the view's stride apart. */
static bool view_elements(gltf_reader *g, const gltf_at *at, size_t count, size_t element,
                          const unsigned char **bytes, size_t *stride)
{
    gltf_report *r = &g->report;
    gltf_at views = gltf_array(r, &g->root, "bufferViews");
    int64_t index = gltf_index(r, at, "bufferView", gltf_count(&views), true);
    uint64_t offset = gltf_integer(r, at, "byteOffset", 0, UINT32_MAX);
    if (r->status != KNURL_OK || index < 0) return false;
    gltf_at view = gltf_element_object(r, &views, (size_t)index);
    size_t size, asked;
    if (!gltf_buffer_view(g, &view, bytes, &size, &asked)) return false;
    *stride = asked ? asked : element;
    if (*stride < element) {
        gltf_at place = gltf_member(&view, "byteStride");
        gltf_fail(r, &place, KNURL_ERROR_INPUT, "found %zu, expected at least %zu", asked, element);
        return false;
    }
    /* count and offset are below 2^32 and stride below 2^8: no overflow in 64 bits. */
    uint64_t needed = count ? offset + (uint64_t)(count - 1) * *stride + element : 0;
    if (needed > size) {
        gltf_fail(r, at, KNURL_ERROR_INPUT, "%zu elements take %llu bytes of buffer view %lld, which has %zu",
                  count, (unsigned long long)needed, (long long)index, size);
        return false;
    }
    *bytes += count ? offset : 0;
    return true;
}

static bool open_sparse(gltf_reader *g, const gltf_at *at, gltf_accessor *a)
{
    gltf_report *r = &g->report;
    gltf_at sparse = gltf_object(r, at, "sparse");
    if (!sparse.value) return r->status == KNURL_OK;
    gltf_at indices = gltf_object(r, &sparse, "indices"), values = gltf_object(r, &sparse, "values");
    a->sparse_count = (size_t)gltf_integer(r, &sparse, "count", 0, a->count);
    a->sparse_index_type = (uint32_t)gltf_integer(r, &indices, "componentType", 0, UNSIGNED_INT);
    uint32_t type = a->sparse_index_type;
    if (r->status == KNURL_OK && type != UNSIGNED_BYTE && type != UNSIGNED_SHORT && type != UNSIGNED_INT)
        gltf_fail(r, &indices, KNURL_ERROR_INPUT, "componentType is %u, expected 5121, 5123 or 5125", type);
    if (r->status != KNURL_OK) return false;
    size_t step, element = component_size(type);
    if (!view_elements(g, &indices, a->sparse_count, element, &a->sparse_indices, &step)) return false;
    if (step != element) {
        gltf_fail(r, &indices, KNURL_ERROR_INPUT, "its buffer view has byteStride %zu, expected none", step);
        return false;
    }
    element = component_size(a->type) * a->components;
    if (!view_elements(g, &values, a->sparse_count, element, &a->sparse_values, &step)) return false;
    if (step != element) {
        gltf_fail(r, &values, KNURL_ERROR_INPUT, "its buffer view has byteStride %zu, expected none", step);
        return false;
    }
    for (size_t i = 0; i < a->sparse_count; i++) {
        uint32_t index = read_integer(a->sparse_indices + i * component_size(type), type);
        if (index < a->count) continue;
        gltf_fail(r, &indices, KNURL_ERROR_INPUT, "element %zu is %u, expected less than %zu", i, index,
                  a->count);
        return false;
    }
    return true;
}

bool gltf_open_accessor(gltf_reader *g, const gltf_at *at, gltf_accessor *a)
{
    *a = (gltf_accessor){0};
    gltf_report *r = &g->report;
    const char *type = gltf_string(r, at, "type", "");
    uint64_t component = gltf_integer(r, at, "componentType", 0, UINT32_MAX);
    a->count = (size_t)gltf_integer(r, at, "count", 0, UINT32_MAX);
    a->normalized = gltf_bool(r, at, "normalized", false);
    a->type = (uint32_t)component;
    a->components = component_count(type);
    if (r->status == KNURL_OK && a->components == 0)
        gltf_fail(r, at, KNURL_ERROR_INPUT, "type is \"%.20s\", expected SCALAR, VEC2, VEC3 or VEC4", type);
    if (r->status == KNURL_OK && component_size(a->type) == 0)
        gltf_fail(r, at, KNURL_ERROR_INPUT, "componentType is %u, expected 5120 to 5123, 5125 or 5126",
                  a->type);
    if (r->status == KNURL_OK && a->count == 0)
        gltf_fail(r, at, KNURL_ERROR_INPUT, "count is 0 or missing, expected at least 1");
    if (r->status != KNURL_OK) return false;
    if (gltf_member(at, "bufferView").value) {
        if (!view_elements(g, at, a->count, component_size(a->type) * a->components, &a->bytes, &a->stride))
            return false;
    } else if (a->count > MAX_ZEROS) {
        gltf_fail(r, at, KNURL_ERROR_LIMIT, "count is %zu without a bufferView, expected at most %d",
                  a->count, MAX_ZEROS);
        return false;
    }
    return open_sparse(g, at, a);
}

void gltf_accessor_floats(const gltf_accessor *a, float *out)
{
    size_t size = component_size(a->type), n = a->components;
    if (!a->bytes) memset(out, 0, a->count * n * sizeof *out);
    for (size_t i = 0; a->bytes && i < a->count; i++)
        for (size_t c = 0; c < n; c++)
            out[i * n + c] = read_float(a->bytes + i * a->stride + c * size, a->type, a->normalized);
    size_t index_size = component_size(a->sparse_index_type);
    for (size_t i = 0; i < a->sparse_count; i++) {
        size_t target = read_integer(a->sparse_indices + i * index_size, a->sparse_index_type);
        for (size_t c = 0; c < n; c++)
            out[target * n + c] = read_float(a->sparse_values + (i * n + c) * size, a->type, a->normalized);
    }
}

void gltf_accessor_indices(const gltf_accessor *a, uint32_t *out)
{
    size_t index_size = component_size(a->sparse_index_type), size = component_size(a->type);
    for (size_t i = 0; i < a->count; i++)
        out[i] = a->bytes ? read_integer(a->bytes + i * a->stride, a->type) : 0;
    for (size_t i = 0; i < a->sparse_count; i++)
        out[read_integer(a->sparse_indices + i * index_size, a->sparse_index_type)] =
            read_integer(a->sparse_values + i * size, a->type);
}
