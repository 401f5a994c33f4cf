/* bake_obj.c: Wavefront OBJ, every instance an object of its own in world space. */
#include "bake.h"
#include "text.h"

#include <ctype.h>
#include <string.h>

typedef struct obj_writer {
    uint64_t first; /* number of the instance's first vertex, from 1 */
    bool mirrored;
} obj_writer;

static char *add_line(char *at, const char *key, const float *values, int count)
{
    size_t length = strlen(key);
    memcpy(at, key, length);
    at += length;
    for (int i = 0; i < count; i++) {
        *at++ = ' ';
        at = text_format_g9(at, (double)values[i]);
    }
    *at++ = '\n';
    return at;
}

static int write_vertices(bake_job *job, void *user, const bake_block *block)
{
    (void)user;
    char *at = job->rows;
    for (size_t i = 0; i < block->count; i++) {
        const float st[2] = {block->texcoords[2 * i], 1.0f - block->texcoords[2 * i + 1]};
        at = add_line(at, "v", block->positions + 3 * i, 3);
        at = add_line(at, "vt", st, 2);
        at = add_line(at, "vn", block->normals + 3 * i, 3);
    }
    return bake_write(job, job->rows, (size_t)(at - job->rows));
}

static int write_triangles(bake_job *job, void *user, const uint32_t *indices, size_t count)
{
    const obj_writer *w = user;
    char *at = job->rows;
    for (size_t i = 0; i < count; i++) {
        *at++ = 'f';
        for (size_t k = 0; k < 3; k++) {
            unsigned long long number = w->first + indices[3 * i + (w->mirrored ? 2 - k : k)];
            for (int part = 0; part < 3; part++) {
                *at++ = part ? '/' : ' ';
                at = text_format_unsigned(at, number);
            }
        }
        *at++ = '\n';
    }
    return bake_write(job, job->rows, (size_t)(at - job->rows));
}

/* A name as one word; numbered where there is none. */
static void write_name(FILE *out, const char *key, const char *name, unsigned number)
{
    fprintf(out, "%s ", key);
    if (!name || !*name) fprintf(out, "instance%u", number);
    for (; name && *name; name++) fputc(isspace((unsigned char)*name) ? '_' : *name, out);
    fputc('\n', out);
}

int bake_obj(bake_job *job)
{
    /* 8 numbers and some, or 9 whole ones. */
    _Static_assert(8 * TEXT_NUMBER_SIZE + 32 <= BAKE_ROW && 9 * 24 + 8 <= BAKE_ROW, "rows are too short");
    const knurl_description *d = job->description;
    obj_writer w = {.first = 1};
    int code = CODE_DONE;
    fprintf(job->out, "# baked by knurl %s\n", KNURL_VERSION_STRING);
    for (uint32_t i = 0; i < d->instance_count && code == CODE_DONE; i++) {
        if (!bake_is_seen(job, i)) continue;
        const bake_part *part = &job->parts[d->instances[i].mesh];
        write_name(job->out, "o", d->instances[i].name, i);
        write_name(job->out, "usemtl", d->materials[part->mesh->material].name,
                   (unsigned)part->mesh->material);
        w.mirrored = bake_mirrors(d->instances[i].transform);
        code = bake_vertices(job, part, d->instances[i].transform, write_vertices, &w);
        if (code == CODE_DONE) code = bake_triangles(job, part, write_triangles, &w);
        w.first += part->vertices;
    }
    return code;
}
