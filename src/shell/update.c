/* Shells after an edit of the map, and what all of them come to. */
#include "shell/heights.h"

void shell_totals_make(const shell_space *space, shell_totals *totals)
{
    vec3 lower = v3(INFINITY, INFINITY, INFINITY), upper = v3_neg(lower);
    *totals = (shell_totals){.height_min = INFINITY, .height_max = -INFINITY};
    height_lod lod;
    height_lod_make(space, 0.0, &lod);
    for (uint32_t t = 0; t < space->mesh.triangle_count; t++) {
        const shell *stored = &space->shells[t];
        totals->folded += (stored->flags & SHELL_FOLDED) != 0;
        totals->flat_uv += (stored->flags & SHELL_FLAT_UV) != 0;
        totals->degenerate += (stored->flags & SHELL_EMPTY) != 0;
        double lo[3], hi[3];
        if (!shell_box(space, t, lo, hi)) continue;
        triangle_frame f;
        triangle_frame_load(space, t, &lod, &f);
        totals->texels += 0.5 * fabs(f.xe * f.yf - f.xf * f.ye);
        lower = v3_min(lower, v3_load(lo));
        upper = v3_max(upper, v3_load(hi));
        totals->height_min = min_d(totals->height_min, (double)stored->height_min);
        totals->height_max = max_d(totals->height_max, (double)stored->height_max);
    }
    v3_store(totals->lower, lower);
    v3_store(totals->upper, upper);
}

/* What a thread found. */
typedef struct found {
    double lower[3], upper[3], height_min, height_max; /* of shells as they are now */
    bool other_flags;                                  /* of any shell */
    bool recount; /* a shell that reached to the totals' ends does not any more */
} found;

typedef struct update_job {
    const shell_space *space;
    const shell_edit *edit;
    const shell_totals *totals;
    uint8_t *changed;
    found *found;
} update_job;

static void widen(found *f, const shell *stored, const double lower[3], const double upper[3])
{
    for (int k = 0; k < 3; k++) {
        f->lower[k] = min_d(f->lower[k], lower[k]);
        f->upper[k] = max_d(f->upper[k], upper[k]);
    }
    f->height_min = min_d(f->height_min, (double)stored->height_min);
    f->height_max = max_d(f->height_max, (double)stored->height_max);
}

/* Whether the totals may be what they are because of this shell, and it is smaller now. */
static bool gives_way(const shell_totals *totals, const shell *before, const shell *after,
                      const double old_box[2][3], const double new_box[2][3])
{
    for (int k = 0; k < 3; k++)
        if ((old_box[0][k] <= totals->lower[k] && new_box[0][k] > old_box[0][k]) ||
            (old_box[1][k] >= totals->upper[k] && new_box[1][k] < old_box[1][k]))
            return true;
    return ((double)before->height_min <= totals->height_min && after->height_min > before->height_min) ||
           ((double)before->height_max >= totals->height_max && after->height_max < before->height_max);
}

static void update_shell(const update_job *job, const height_lod *lod, uint32_t triangle,
                         const shell *heights, found *f)
{
    const shell_space *space = job->space;
    shell *stored = &space->shells[triangle];
    const shell before = *stored;
    double old_box[2][3], new_box[2][3];
    bool some = shell_box(space, triangle, old_box[0], old_box[1]);
    *stored = *heights;
    shell_shape(space, lod, triangle);
    job->changed[triangle] = 1;
    if (stored->flags != before.flags) {
        f->other_flags = true;
    } else if (some) {
        (void)shell_box(space, triangle, new_box[0], new_box[1]);
        f->recount = f->recount || gives_way(job->totals, &before, stored, old_box, new_box);
        widen(f, stored, new_box[0], new_box[1]);
    }
}

static void update_range(void *user, size_t begin, size_t end, int32_t thread)
{
    const update_job *job = user;
    height_lod lod;
    height_lod_make(job->space, 0.0, &lod);
    for (size_t t = begin; t < end; t++) {
        shell heights = job->space->shells[t];
        if (shell_heights_update(job->space, (uint32_t)t, job->edit, &heights))
            update_shell(job, &lod, (uint32_t)t, &heights, &job->found[thread]);
    }
}

static void merge(const found *f, shell_totals *totals)
{
    for (int k = 0; k < 3; k++) {
        totals->lower[k] = min_d(totals->lower[k], f->lower[k]);
        totals->upper[k] = max_d(totals->upper[k], f->upper[k]);
    }
    totals->height_min = min_d(totals->height_min, f->height_min);
    totals->height_max = max_d(totals->height_max, f->height_max);
}

knurl_status shell_space_update(shell_space *space, const shell_edit *edit, shell_totals *totals,
                                uint8_t *changed, bool *other_flags, knurl_error *error)
{
    knurl_context *context = space->context;
    size_t threads = (size_t)knurl_context_threads(context);
    update_job job = {space, edit, totals, changed, NULL};
    job.found = knurl_alloc_array(context, threads, sizeof *job.found);
    if (!job.found) return knurl_fail_memory(error, threads * sizeof *job.found, "updating shells");
    for (size_t i = 0; i < threads; i++)
        job.found[i] = (found){.lower = {INFINITY, INFINITY, INFINITY},
                               .upper = {-INFINITY, -INFINITY, -INFINITY},
                               .height_min = INFINITY,
                               .height_max = -INFINITY};
    knurl_parallel_for(context, space->mesh.triangle_count, 256, update_range, &job);
    bool recount = false;
    *other_flags = false;
    for (size_t i = 0; i < threads; i++) {
        *other_flags = *other_flags || job.found[i].other_flags;
        recount = recount || job.found[i].recount;
    }
    recount = recount || *other_flags;
    for (size_t i = 0; i < threads && !recount; i++) merge(&job.found[i], totals);
    knurl_free(context, job.found);
    if (recount) shell_totals_make(space, totals);
    return KNURL_OK;
}
