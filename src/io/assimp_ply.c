/* The structure of PLY files, without their values. */
#include "io/assimp_ply.h"

#include <string.h>

#include "io/scene_text.h"

enum { MAX_ELEMENTS = 64, MAX_PROPERTIES = 1024 };

typedef struct ply_property {
    size_t size;       /* bytes of the value or of a list's items */
    size_t count_size; /* bytes of a list's length, 0: no list */
} ply_property;

typedef struct ply_element {
    text_span name;
    uint64_t count;
    size_t first, end; /* properties */
    bool lists;
} ply_element;

typedef struct ply_walk {
    const char *path;
    knurl_error *error;
    const unsigned char *bytes;
    size_t at, size;
    enum { PLY_NONE, PLY_ASCII, PLY_LITTLE, PLY_BIG } format;
    ply_element elements[MAX_ELEMENTS];
    size_t element_count;
    ply_property properties[MAX_PROPERTIES];
    size_t property_count;
    uint32_t line;
} ply_walk;

/* Case counts: assimp does not see End_header and would look for the end for ever. */
static bool word_is(text_span word, const char *name)
{
    size_t length = strlen(name);
    return (size_t)(word.end - word.begin) == length && memcmp(word.begin, name, length) == 0;
}

static size_t type_size(text_span word)
{
    static const struct {
        const char *name;
        size_t size;
    } types[] = {{"char", 1},  {"uchar", 1},   {"int8", 1},   {"uint8", 1},  {"short", 2}, {"ushort", 2},
                 {"int16", 2}, {"uint16", 2},  {"int", 4},    {"uint", 4},   {"int32", 4}, {"uint32", 4},
                 {"float", 4}, {"float32", 4}, {"double", 8}, {"float64", 8}};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if (word_is(word, types[i].name)) return types[i].size;
    return 0;
}

static bool next_header_line(ply_walk *w, text_span *line)
{
    size_t begin = w->at;
    while (w->at < w->size && w->bytes[w->at] != '\n') w->at++;
    if (w->at == w->size) return false;
    *line = (text_span){(const char *)w->bytes + begin, (const char *)w->bytes + w->at};
    w->at++;
    w->line++;
    return true;
}

static knurl_status bad_header(ply_walk *w, text_span found, const char *expected)
{
    return knurl_fail(w->error, KNURL_ERROR_INPUT, "%s:%u: found \"%.*s\", expected %s", w->path, w->line,
                      text_shown(found), found.begin ? found.begin : "", expected);
}

static knurl_status read_element(ply_walk *w, text_span rest)
{
    text_span count = {0};
    if (w->element_count == MAX_ELEMENTS)
        return knurl_fail(w->error, KNURL_ERROR_LIMIT, "%s:%u: more than %d elements", w->path, w->line,
                          MAX_ELEMENTS);
    ply_element *e = &w->elements[w->element_count];
    *e = (ply_element){.first = w->property_count, .end = w->property_count};
    int64_t number;
    if (!text_next_word(&rest, &e->name) || !text_next_word(&rest, &count) || !text_integer(count, &number) ||
        number < 0)
        return bad_header(w, count, "element, a name and a count up to 2147483647");
    e->count = (uint64_t)number;
    w->element_count++;
    return KNURL_OK;
}

static knurl_status read_property(ply_walk *w, text_span rest)
{
    text_span word = {0}, item;
    if (w->element_count == 0 || w->property_count == MAX_PROPERTIES || !text_next_word(&rest, &word))
        return bad_header(w, rest, "a property of an element, at most 1024 in all");
    ply_element *e = &w->elements[w->element_count - 1];
    ply_property *p = &w->properties[w->property_count];
    *p = (ply_property){.size = type_size(word)};
    if (word_is(word, "list")) {
        bool whole = text_next_word(&rest, &word) && (p->count_size = type_size(word)) != 0 &&
                     word.begin[0] != 'f' && word.begin[0] != 'd';
        if (!whole || !text_next_word(&rest, &item))
            return bad_header(w, word, "an integer type for the list's length and a type for its items");
        p->size = type_size(item);
        e->lists = true;
    }
    if (p->size == 0) return bad_header(w, word, "a type such as float or uchar");
    e->end = ++w->property_count;
    return KNURL_OK;
}

static knurl_status read_header(ply_walk *w)
{
    text_span line, word;
    if (!next_header_line(w, &line) || !text_next_word(&line, &word) || !word_is(word, "ply"))
        return knurl_fail(w->error, KNURL_ERROR_INPUT, "%s:1: expected a line that says ply", w->path);
    while (next_header_line(w, &line)) {
        if (!text_next_word(&line, &word)) continue;
        knurl_status status = KNURL_OK;
        if (word_is(word, "end_header")) {
            if (w->format != PLY_NONE) return KNURL_OK;
            return bad_header(w, word, "a format line before it");
        }
        if (word_is(word, "format")) {
            (void)text_next_word(&line, &word);
            w->format = word_is(word, "ascii")                  ? PLY_ASCII
                        : word_is(word, "binary_little_endian") ? PLY_LITTLE
                        : word_is(word, "binary_big_endian")    ? PLY_BIG
                                                                : PLY_NONE;
            if (w->format == PLY_NONE) status = bad_header(w, word, "ascii or binary_..._endian");
        } else if (word_is(word, "element")) {
            status = read_element(w, line);
        } else if (word_is(word, "property")) {
            status = read_property(w, line);
        } else if (!word_is(word, "comment") && !word_is(word, "obj_info")) {
            status = bad_header(w, word, "element, property, comment or end_header");
        }
        if (status != KNURL_OK) return status;
    }
    return knurl_fail(w->error, KNURL_ERROR_INPUT, "%s: %u lines without end_header", w->path, w->line);
}

static knurl_status too_short(ply_walk *w, const ply_element *e, uint64_t item)
{
    return knurl_fail(w->error, KNURL_ERROR_INPUT,
                      "%s: element %.*s, item %llu of %llu: the file ends after %zu bytes", w->path,
                      text_shown(e->name), e->name.begin, (unsigned long long)item,
                      (unsigned long long)e->count, w->size);
}

static bool next_token(ply_walk *w, text_span *word)
{
    text_span rest = {(const char *)w->bytes + w->at, (const char *)w->bytes + w->size};
    const char *p = rest.begin;
    while (p < rest.end && (*p == ' ' || *p == '\t' || *p == '\r' || *p == '\n')) p++;
    word->begin = p;
    while (p < rest.end && !(*p == ' ' || *p == '\t' || *p == '\r' || *p == '\n')) p++;
    word->end = p;
    w->at = (size_t)(p - (const char *)w->bytes);
    return word->begin < word->end;
}

/* A list's length; false if the file ends or it is no count. */
static bool read_length(ply_walk *w, size_t size, uint64_t *length)
{
    if (w->format == PLY_ASCII) {
        text_span word;
        int64_t number;
        if (!next_token(w, &word) || !text_integer(word, &number) || number < 0) return false;
        *length = (uint64_t)number;
        return true;
    }
    if (size > w->size - w->at) return false;
    *length = 0;
    for (size_t i = 0; i < size; i++) {
        size_t shift = w->format == PLY_LITTLE ? i : size - 1 - i;
        *length |= (uint64_t)w->bytes[w->at + i] << 8 * shift;
    }
    w->at += size;
    return true;
}

/* Skips `count` values of `size` bytes. */
static bool skip(ply_walk *w, uint64_t count, size_t size)
{
    if (w->format != PLY_ASCII) {
        if (count > (w->size - w->at) / size) return false;
        w->at += (size_t)count * size;
        return true;
    }
    if (count > w->size - w->at) return false;
    text_span word;
    for (uint64_t i = 0; i < count; i++)
        if (!next_token(w, &word)) return false;
    return true;
}

static knurl_status walk_element(ply_walk *w, const ply_element *e)
{
    /* An element without properties takes no room and could claim any count. */
    if (e->first == e->end && e->count > 0)
        return knurl_fail(w->error, KNURL_ERROR_INPUT, "%s: element %.*s has no properties", w->path,
                          text_shown(e->name), e->name.begin);
    for (uint64_t item = 0; item < e->count; item++)
        for (size_t i = e->first; i < e->end; i++) {
            const ply_property *p = &w->properties[i];
            uint64_t length = 1;
            if (p->count_size && !read_length(w, p->count_size, &length)) return too_short(w, e, item);
            if (!skip(w, length, p->size)) return too_short(w, e, item);
        }
    return KNURL_OK;
}

knurl_status assimp_check_ply(const char *path, const unsigned char *bytes, size_t size, knurl_error *error)
{
    ply_walk w = {.path = path, .error = error, .bytes = bytes, .size = size};
    knurl_status status = read_header(&w);
    for (size_t i = 0; i < w.element_count && status == KNURL_OK; i++)
        status = walk_element(&w, &w.elements[i]);
    return status;
}
