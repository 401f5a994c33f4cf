/* bake_blocks.c: vertices and triangles of a part, a block at a time. */
#include "bake.h"

#include <errno.h>
#include <math.h>
#include <string.h>

static double determinant(const double *m)
{
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
           m[2] * (m[4] * m[9] - m[5] * m[8]);
}

bool bake_is_seen(const bake_job *job, uint32_t instance)
{
    const knurl_description_instance *i = &job->description->instances[instance];
    double det = determinant(i->transform);
    return job->parts[i->mesh].triangles > 0 && isfinite(det) && det != 0.0;
}

bool bake_mirrors(const double transform[12])
{
    return determinant(transform) < 0.0;
}

int bake_write(bake_job *job, const void *bytes, size_t size)
{
    if (fwrite(bytes, 1, size, job->out) == size) return CODE_DONE;
    return session_fail_with(job->session, CODE_FILE, "write failed: %s", strerror(errno));
}

/* A plain mesh without normals is flat: each corner is a vertex of its own. */
static bool is_flat(const bake_part *part)
{
    return !part->tessellation && !part->mesh->normals;
}

static void load_face_normal(const knurl_description_mesh *mesh, uint64_t triangle, float normal[3])
{
    double p[3][3], n[3], length = 0.0;
    for (int k = 0; k < 3; k++)
        for (int c = 0; c < 3; c++)
            p[k][c] =
                (double)mesh->positions[3 * (size_t)mesh->triangles[3 * triangle + (size_t)k] + (size_t)c];
    for (int c = 0; c < 3; c++) {
        int d = (c + 1) % 3, e = (c + 2) % 3;
        n[c] = (p[1][d] - p[0][d]) * (p[2][e] - p[0][e]) - (p[1][e] - p[0][e]) * (p[2][d] - p[0][d]);
        length += n[c] * n[c];
    }
    length = sqrt(length);
    for (int c = 0; c < 3; c++) normal[c] = length > 0.0 ? (float)(n[c] / length) : c == 1 ? 1.0f : 0.0f;
}

static void load_plain(bake_job *job, const bake_part *part, uint64_t begin, size_t count)
{
    const knurl_description_mesh *mesh = part->mesh;
    bake_block *block = job->block;
    bool flat = is_flat(part);
    for (size_t i = 0; i < count; i++) {
        size_t v = flat ? mesh->triangles[begin + i] : (size_t)begin + i;
        for (size_t k = 0; k < 3; k++) job->points[3 * i + k] = (double)mesh->positions[3 * v + k];
        if (flat)
            load_face_normal(mesh, (begin + i) / 3, block->normals + 3 * i);
        else
            memcpy(block->normals + 3 * i, mesh->normals + 3 * v, 3 * sizeof *mesh->normals);
        for (size_t k = 0; k < 2; k++)
            block->texcoords[2 * i + k] = mesh->texcoords ? mesh->texcoords[2 * v + k] : 0.0f;
    }
}

/* Normals go with the cofactors of the transform, which is its inverse transpose but for a factor. */
static void place_block(const bake_job *job, const double *m)
{
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    bake_block *block = job->block;
    if (!m) m = identity;
    double cofactor[9], sign = determinant(m) < 0.0 ? -1.0 : 1.0;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
            cofactor[3 * r + c] = sign * (m[4 * r1 + c1] * m[4 * r2 + c2] - m[4 * r1 + c2] * m[4 * r2 + c1]);
        }
    for (size_t i = 0; i < block->count; i++) {
        const double *p = job->points + 3 * i;
        float *n = block->normals + 3 * i;
        double turned[3], length = 0.0;
        for (size_t r = 0; r < 3; r++) {
            block->positions[3 * i + r] =
                (float)(m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3]);
            turned[r] = cofactor[3 * r] * (double)n[0] + cofactor[3 * r + 1] * (double)n[1] +
                        cofactor[3 * r + 2] * (double)n[2];
            length += turned[r] * turned[r];
        }
        if (m != identity && length > 0.0)
            for (size_t r = 0; r < 3; r++) n[r] = (float)(turned[r] / sqrt(length));
    }
}

/* Counts what was done; asks whether to go on. */
static int report(bake_job *job, uint64_t more)
{
    job->done += more;
    double fraction = job->all ? (double)job->done / (double)job->all : 1.0;
    if (progress_update(&job->session->progress, "bake", fraction)) return CODE_DONE;
    return session_fail_with(job->session, CODE_INTERRUPTED, "interrupted; nothing was written");
}

int bake_vertices(bake_job *job, const bake_part *part, const double *transform, bake_vertices_fn *write,
                  void *user)
{
    int code = CODE_DONE;
    for (uint64_t begin = 0; begin < part->vertices && code == CODE_DONE; begin += BAKE_BLOCK) {
        uint64_t left = part->vertices - begin;
        size_t count = left < BAKE_BLOCK ? (size_t)left : BAKE_BLOCK;
        job->block->count = count;
        if (part->tessellation)
            knurl_tessellation_get_vertices(part->tessellation, begin, count, job->points,
                                            job->block->normals, job->block->texcoords);
        else
            load_plain(job, part, begin, count);
        place_block(job, transform);
        code = write(job, user, job->block);
        if (code == CODE_DONE) code = report(job, count);
    }
    return code;
}

int bake_triangles(bake_job *job, const bake_part *part, bake_triangles_fn *write, void *user)
{
    int code = CODE_DONE;
    bool flat = is_flat(part);
    for (uint64_t begin = 0; begin < part->triangles && code == CODE_DONE; begin += BAKE_BLOCK) {
        uint64_t left = part->triangles - begin;
        size_t count = left < BAKE_BLOCK ? (size_t)left : BAKE_BLOCK;
        if (part->tessellation)
            knurl_tessellation_get_triangles(part->tessellation, begin, count, job->indices);
        for (size_t i = 0; i < 3 * count && !part->tessellation; i++)
            job->indices[i] = flat ? (uint32_t)(3 * begin + i) : part->mesh->triangles[3 * begin + i];
        code = write(job, user, job->indices, count);
        if (code == CODE_DONE) code = report(job, count);
    }
    return code;
}
