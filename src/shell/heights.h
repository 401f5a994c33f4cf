/* shell/heights.h: the range of heights of a shell over every level of detail, and after an edit of the map.
 *
 * Averages of a coarse level reach beyond a triangle and may leave the range of level 0 over it, so a shell
 * holds the range over all levels. It also says which levels that range comes from: an edit of other levels
 * can only widen it, and then nothing but those must be looked at. */
#ifndef KNURL_SRC_SHELL_HEIGHTS_H
#define KNURL_SRC_SHELL_HEIGHTS_H

#include "shell/shell.h"

/* Whether samples first .. last of a wrapped axis include any of [from, to) of the map. */
bool height_axis_reads(int64_t first, int64_t last, int32_t size, knurl_wrap wrap, int32_t from, int32_t to);

/* Whether a range table's answer for those samples depends on any of [from, to): it looks at up to `reach`
 * more on each side, inside the map, and its last cell holds sample 0 whatever the wrap mode. */
bool height_table_reads(int64_t first, int64_t last, int64_t reach, int32_t size, knurl_wrap wrap,
                        int32_t from, int32_t to);

/* What an edit of the map did to each level of detail. */
typedef struct shell_edit {
    bool all;                               /* anything may have changed; the rest does not matter */
    height_rect samples[HEIGHT_MAX_LEVELS]; /* that changed */
    float low[HEIGHT_MAX_LEVELS], high[HEIGHT_MAX_LEVELS]; /* heights that bound their new values */
} shell_edit;

/* From the samples of level 0 that changed. The map is up to date. */
void shell_edit_make(const shell_space *space, height_rect samples, bool all, shell_edit *edit);

/* Fills height_min, height_max, low_level and high_level. */
void shell_heights(const shell_space *space, uint32_t triangle, shell *stored);
/* The same for a shell that was right before the edit; false if it still is. */
bool shell_heights_update(const shell_space *space, uint32_t triangle, const shell_edit *edit, shell *stored);

/* Fills all but the heights, from the heights. */
void shell_shape(const shell_space *space, const height_lod *lod, uint32_t triangle);

/* What the shells that are not empty come to. */
typedef struct shell_totals {
    uint64_t folded, flat_uv, degenerate;
    double lower[3], upper[3];     /* of their boxes; lower > upper if there are none */
    double height_min, height_max; /* infinite the wrong way round if there are none */
    double texels;
} shell_totals;
void shell_totals_make(const shell_space *space, shell_totals *totals);

/* Brings shells and totals up to date. changed[i], one per triangle and 0 before, becomes 1 where a shell is
 * another now; *other_flags says whether flags of any did. Nothing has happened if it fails. */
knurl_status shell_space_update(shell_space *space, const shell_edit *edit, shell_totals *totals,
                                uint8_t *changed, bool *other_flags, knurl_error *error);

#endif
