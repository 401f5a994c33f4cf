/* hit_writer.c: hits as CSV or as a NumPy array. */
#include "parallel.h"
#include "rays.h"
#include "text.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    CHUNK = 4096,                               /* hits formatted by one thread at a time */
    LINE_SIZE = HIT_COLUMNS * TEXT_NUMBER_SIZE, /* most bytes of a line */
    NPY_HEADER_SIZE = 128,
    ROW_SIZE = HIT_COLUMNS * (int)sizeof(double)
};

struct hit_writer {
    command_session *session;
    output_file output;
    bool npy, any_hit;
    uint64_t total, written;
    char *buffer; /* LINE_SIZE bytes for each ray of a block */
    const knurl_hit *hits;
    size_t count;
    size_t chunk_bytes[RAY_BLOCK / CHUNK];
};

static const char csv_header[] = "hit,t,px,py,pz,ngx,ngy,ngz,nsx,nsy,nsz,u,v,height,object,triangle\n";

/* ---- CSV ---- */

static char *format_hit(char *out, const knurl_hit *hit)
{
    if (hit->triangle == KNURL_NO_HIT) {
        static const char miss[] = "0,,,,,,,,,,,,,,,\n";
        memcpy(out, miss, sizeof miss - 1);
        return out + sizeof miss - 1;
    }
    const double values[] = {hit->t,     hit->position[0], hit->position[1], hit->position[2], hit->ng[0],
                             hit->ng[1], hit->ng[2],       hit->ns[0],       hit->ns[1],       hit->ns[2],
                             hit->uv[0], hit->uv[1],       hit->height};
    *out++ = '1';
    for (size_t i = 0; i < sizeof values / sizeof values[0]; i++) {
        *out++ = ',';
        out = text_format_g9(out, values[i]);
    }
    *out++ = ',';
    out = text_format_unsigned(out, hit->object);
    *out++ = ',';
    out = text_format_unsigned(out, hit->triangle);
    *out++ = '\n';
    return out;
}

/* ---- NumPy ---- */

static char *put_double(char *out, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 8; i++) *out++ = (char)(bits >> (8 * i) & 0xff);
    return out;
}

static char *pack_hit(char *out, const knurl_hit *hit)
{
    bool found = hit->triangle != KNURL_NO_HIT;
    out = put_double(out, found ? 1 : 0);
    if (!found) {
        for (int i = 1; i < HIT_COLUMNS; i++) out = put_double(out, (double)NAN);
        return out;
    }
    out = put_double(out, hit->t);
    for (int i = 0; i < 3; i++) out = put_double(out, hit->position[i]);
    for (int i = 0; i < 3; i++) out = put_double(out, hit->ng[i]);
    for (int i = 0; i < 3; i++) out = put_double(out, hit->ns[i]);
    out = put_double(out, hit->uv[0]);
    out = put_double(out, hit->uv[1]);
    out = put_double(out, hit->height);
    out = put_double(out, (double)hit->object);
    return put_double(out, (double)hit->triangle);
}

/* Always NPY_HEADER_SIZE bytes, so that it can be written again when the count is known. */
static bool write_npy_header(hit_writer *writer, uint64_t count)
{
    char text[NPY_HEADER_SIZE + 1];
    memset(text, ' ', sizeof text);
    memcpy(text, "\x93NUMPY\x01\x00\x76\x00", 10); /* 0x76 = 128 - 10 bytes of dictionary */
    unsigned long long rows = count;
    int length =
        writer->any_hit
            ? snprintf(text + 10, NPY_HEADER_SIZE - 10,
                       "{'descr': '|u1', 'fortran_order': False, 'shape': (%llu,), }", rows)
            : snprintf(text + 10, NPY_HEADER_SIZE - 10,
                       "{'descr': '<f8', 'fortran_order': False, 'shape': (%llu, %d), }", rows, HIT_COLUMNS);
    text[10 + length] = ' ';
    text[NPY_HEADER_SIZE - 1] = '\n';
    return fwrite(text, 1, NPY_HEADER_SIZE, writer->output.file) == NPY_HEADER_SIZE;
}

/* ---- writer ---- */

int hit_writer_open(command_session *session, const char *path, bool npy, bool any_hit, uint64_t total,
                    hit_writer **result)
{
    *result = NULL;
    hit_writer *writer = calloc(1, sizeof *writer);
    if (writer) writer->buffer = malloc((size_t)RAY_BLOCK * LINE_SIZE);
    if (!writer || !writer->buffer) {
        free(writer);
        return session_fail_with(session, CODE_LIMIT, "out of memory for the hits");
    }
    writer->session = session;
    writer->npy = npy;
    writer->any_hit = any_hit;
    writer->total = total;
    int code = output_open(session, &writer->output, path);
    if (code == CODE_DONE && npy && total == RAY_COUNT_UNKNOWN && !writer->output.temporary[0])
        code = session_fail_with(session, CODE_FILE,
                                 "%s: a NumPy array made from CSV rays needs a regular file as its output",
                                 path);
    if (code == CODE_DONE) {
        if (npy)
            write_npy_header(writer, total == RAY_COUNT_UNKNOWN ? 0 : total);
        else
            fputs(any_hit ? "hit\n" : csv_header, writer->output.file);
        *result = writer;
    } else {
        hit_writer_close(writer);
    }
    return code;
}

/* The first failed write ends the run; the reason is reported by output_commit. */
static int check_write(hit_writer *writer)
{
    return ferror(writer->output.file) ? output_commit(writer->session, &writer->output) : CODE_DONE;
}

static void format_chunk(void *user, size_t chunk)
{
    hit_writer *writer = user;
    size_t end = (chunk + 1) * CHUNK < writer->count ? (chunk + 1) * CHUNK : writer->count;
    char *start = writer->buffer + chunk * CHUNK * LINE_SIZE, *out = start;
    for (size_t i = chunk * CHUNK; i < end; i++)
        out = writer->npy ? pack_hit(out, &writer->hits[i]) : format_hit(out, &writer->hits[i]);
    writer->chunk_bytes[chunk] = (size_t)(out - start);
}

int hit_writer_write(hit_writer *writer, const knurl_hit *hits, size_t count)
{
    writer->hits = hits;
    writer->count = count;
    size_t chunks = (count + CHUNK - 1) / CHUNK;
    parallel_chunks(knurl_context_threads(writer->session->context), chunks, format_chunk, writer);
    for (size_t chunk = 0; chunk < chunks; chunk++)
        fwrite(writer->buffer + chunk * CHUNK * LINE_SIZE, 1, writer->chunk_bytes[chunk],
               writer->output.file);
    writer->written += count;
    return check_write(writer);
}

int hit_writer_write_any(hit_writer *writer, const uint8_t *occluded, size_t count)
{
    char *out = writer->buffer;
    for (size_t i = 0; i < count; i++) {
        *out++ = writer->npy ? (char)(occluded[i] != 0) : occluded[i] ? '1' : '0';
        if (!writer->npy) *out++ = '\n';
    }
    fwrite(writer->buffer, 1, (size_t)(out - writer->buffer), writer->output.file);
    writer->written += count;
    return check_write(writer);
}

int hit_writer_commit(hit_writer *writer)
{
    if (writer->npy && writer->written != writer->total && writer->output.temporary[0] &&
        fseek(writer->output.file, 0, SEEK_SET) == 0)
        write_npy_header(writer, writer->written);
    return output_commit(writer->session, &writer->output);
}

void hit_writer_close(hit_writer *writer)
{
    if (!writer) return;
    output_discard(&writer->output);
    free(writer->buffer);
    free(writer);
}
