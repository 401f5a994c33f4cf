/* An open-addressing hash table over rows of words. */
#include "io/scene_weld.h"

#include <string.h>

static uint64_t hash_row(const uint32_t *row, size_t words)
{
    uint64_t h = 0x9e3779b97f4a7c15u;
    for (size_t i = 0; i < words; i++) {
        h = (h ^ row[i]) * 0xff51afd7ed558ccdu;
        h ^= h >> 32;
    }
    return h;
}

knurl_status scene_weld(knurl_context *context, const uint32_t *rows, size_t count, size_t words,
                        uint32_t *index, uint32_t *first, uint32_t *distinct, knurl_error *error)
{
    *distinct = 0;
    if (count > UINT32_MAX / 4)
        return knurl_fail(error, KNURL_ERROR_LIMIT, "%zu triangle corners in one mesh, expected at most %u",
                          count, UINT32_MAX / 4);
    size_t slots = 16;
    while (slots < 2 * count) slots *= 2;
    uint32_t *table = knurl_alloc_array(context, slots, sizeof *table);
    if (!table) return knurl_fail_memory(error, slots * sizeof *table, "joining equal vertices");
    memset(table, 0xff, slots * sizeof *table);
    uint32_t made = 0;
    for (size_t i = 0; i < count; i++) {
        const uint32_t *row = rows + i * words;
        size_t slot = (size_t)hash_row(row, words) & (slots - 1);
        while (table[slot] != UINT32_MAX &&
               memcmp(rows + (size_t)first[table[slot]] * words, row, words * sizeof *row) != 0)
            slot = (slot + 1) & (slots - 1);
        if (table[slot] == UINT32_MAX) {
            first[made] = (uint32_t)i;
            table[slot] = made++;
        }
        index[i] = table[slot];
    }
    knurl_free(context, table);
    *distinct = made;
    return KNURL_OK;
}
