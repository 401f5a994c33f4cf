/* io/obj_names.h: material names of an OBJ file, numbered. */
#ifndef KNURL_SRC_IO_OBJ_NAMES_H
#define KNURL_SRC_IO_OBJ_NAMES_H

#include "io/scene_text.h"

typedef struct obj_name {
    text_span text;   /* belongs to the file or the description */
    int32_t material; /* index, -1 while no library defined it */
    uint32_t mesh;    /* the mesh made for it last, UINT32_MAX: none */
} obj_name;

typedef struct obj_names {
    knurl_context *context;
    obj_name *names;
    uint32_t count;
    uint32_t *table; /* hash table of numbers */
    uint32_t slots;  /* a power of two, at least twice the count */
} obj_names;

/* The number of `text`, added if it is new; UINT32_MAX when out of memory. */
uint32_t obj_names_find(obj_names *names, text_span text);
void obj_names_free(obj_names *names);

#endif
