/* bake_ply.c: binary PLY, all instances in world space: first their vertices, then their triangles. */
#include "bake.h"

#include <string.h>

enum { VERTEX_BYTES = 32, FACE_BYTES = 13 };

typedef struct ply_writer {
    uint32_t first; /* vertex of the instance */
    bool mirrored;
} ply_writer;

/* Values as they lie in memory: little-endian, like every machine that Embree runs on. */
static int write_vertices(bake_job *job, void *user, const bake_block *block)
{
    (void)user;
    float *rows = (float *)(void *)job->rows;
    for (size_t i = 0; i < block->count; i++) {
        float *row = rows + 8 * i;
        memcpy(row, block->positions + 3 * i, 3 * sizeof *row);
        memcpy(row + 3, block->normals + 3 * i, 3 * sizeof *row);
        row[6] = block->texcoords[2 * i];
        row[7] = 1.0f - block->texcoords[2 * i + 1]; /* PLY's t points up */
    }
    return bake_write(job, rows, block->count * VERTEX_BYTES);
}

static int write_triangles(bake_job *job, void *user, const uint32_t *indices, size_t count)
{
    const ply_writer *w = user;
    unsigned char *rows = (unsigned char *)job->rows;
    for (size_t i = 0; i < count; i++) {
        unsigned char *row = rows + FACE_BYTES * i;
        uint32_t corners[3];
        for (size_t k = 0; k < 3; k++) corners[k] = w->first + indices[3 * i + (w->mirrored ? 2 - k : k)];
        row[0] = 3;
        memcpy(row + 1, corners, sizeof corners);
    }
    return bake_write(job, rows, count * FACE_BYTES);
}

static void write_header(FILE *out, uint64_t vertices, uint64_t triangles)
{
    fprintf(out,
            "ply\nformat binary_little_endian 1.0\ncomment baked by knurl %s\nelement vertex %llu\n"
            "property float x\nproperty float y\nproperty float z\n"
            "property float nx\nproperty float ny\nproperty float nz\n"
            "property float s\nproperty float t\nelement face %llu\n"
            "property list uchar int vertex_indices\nend_header\n",
            KNURL_VERSION_STRING, (unsigned long long)vertices, (unsigned long long)triangles);
}

int bake_ply(bake_job *job)
{
    const knurl_description *d = job->description;
    uint64_t vertices = 0, triangles = 0;
    for (uint32_t i = 0; i < d->instance_count; i++) {
        if (!bake_is_seen(job, i)) continue;
        vertices += job->parts[d->instances[i].mesh].vertices;
        triangles += job->parts[d->instances[i].mesh].triangles;
    }
    if (vertices > INT32_MAX || triangles > INT32_MAX)
        return session_fail_with(
            job->session, CODE_LIMIT,
            "a PLY file holds 2,147,483,647 vertices and triangles at most, found %llu and "
            "%llu; lower --rate",
            (unsigned long long)vertices, (unsigned long long)triangles);
    write_header(job->out, vertices, triangles);
    int code = CODE_DONE;
    for (uint32_t i = 0; i < d->instance_count && code == CODE_DONE; i++)
        if (bake_is_seen(job, i))
            code = bake_vertices(job, &job->parts[d->instances[i].mesh], d->instances[i].transform,
                                 write_vertices, NULL);
    ply_writer w = {0};
    for (uint32_t i = 0; i < d->instance_count && code == CODE_DONE; i++) {
        if (!bake_is_seen(job, i)) continue;
        const bake_part *part = &job->parts[d->instances[i].mesh];
        w.mirrored = bake_mirrors(d->instances[i].transform);
        code = bake_triangles(job, part, write_triangles, &w);
        w.first += (uint32_t)part->vertices;
    }
    return code;
}
