/* An open-addressing hash table: files with very many materials must not take quadratic time. */
#include "io/obj_names.h"

#include <string.h>

static uint64_t hash_text(text_span text)
{
    uint64_t h = 0xcbf29ce484222325u;
    for (const char *p = text.begin; p < text.end; p++) h = (h ^ (unsigned char)*p) * 0x100000001b3u;
    return h ^ (h >> 29);
}

static bool equal(text_span a, text_span b)
{
    size_t length = (size_t)(a.end - a.begin);
    return length == (size_t)(b.end - b.begin) && memcmp(a.begin, b.begin, length) == 0;
}

static bool grow(obj_names *n)
{
    if (n->count > UINT32_MAX / 8) return false;
    uint32_t slots = n->slots ? 2 * n->slots : 16;
    obj_name *names = knurl_realloc(n->context, n->names, sizeof *names * (slots / 2));
    if (!names) return false;
    n->names = names;
    uint32_t *table = knurl_alloc_array(n->context, slots, sizeof *table);
    if (!table) return false;
    memset(table, 0xff, slots * sizeof *table);
    for (uint32_t i = 0; i < n->count; i++) {
        uint32_t slot = (uint32_t)hash_text(n->names[i].text) & (slots - 1);
        while (table[slot] != UINT32_MAX) slot = (slot + 1) & (slots - 1);
        table[slot] = i;
    }
    knurl_free(n->context, n->table);
    n->table = table;
    n->slots = slots;
    return true;
}

uint32_t obj_names_find(obj_names *n, text_span text)
{
    if (2 * n->count >= n->slots && !grow(n)) return UINT32_MAX;
    uint32_t slot = (uint32_t)hash_text(text) & (n->slots - 1);
    while (n->table[slot] != UINT32_MAX) {
        if (equal(n->names[n->table[slot]].text, text)) return n->table[slot];
        slot = (slot + 1) & (n->slots - 1);
    }
    n->names[n->count] = (obj_name){text, -1, UINT32_MAX};
    n->table[slot] = n->count;
    return n->count++;
}

void obj_names_free(obj_names *n)
{
    knurl_free(n->context, n->names);
    knurl_free(n->context, n->table);
    *n = (obj_names){0};
}
