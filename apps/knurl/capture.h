/* capture.h: inside of `knurl capture`: a model as textures with depth (Baboud and Decoret 2006).
 *
 * A view looks along -z of its own frame, x to the right and y up in the picture. Its rays are the lines
 *
 *     S(X, Y, z) = z D(X, Y)                 [frusta: the lines meet in the frame's origin, the apex]
 *     S(X, Y, z) = (X hx, Y hy, z)           [parallel]
 *
 * with picture coordinates X, Y in [-1, 1] and directions D whose z is 1. So z is a length along the axis for
 * all of them, rays run towards smaller z, and with h = z - base the captured surface is knurl's own
 * S = P + h D over the rectangle P = S(X, Y, base). Reverse perspective has its apex behind the model and z >
 * 0; ordinary perspective has the apex, the eye, in front and z < 0. */
#ifndef APP_CAPTURE_H
#define APP_CAPTURE_H

#include "common.h"

typedef enum capture_frustum {
    CAPTURE_PARALLEL = 0,
    CAPTURE_REVERSE,    /* rays converge behind the model: its sides are seen, too */
    CAPTURE_PERSPECTIVE /* rays leave an eye in front of the model */
} capture_frustum;

typedef struct capture_options {
    const char *model, *folder;
    int views; /* 1 or 6 */
    capture_frustum frustum;
    double from[3];           /* views 1: from the model towards the viewer, any length */
    double fov;               /* whole angle across the wider side, radians */
    double center[3];         /* where the axis passes, the cube's apex; NaN: the middle of the bounds */
    double near_cut, far_cut; /* depths below the front face, metres */
    double clip[6];           /* world box, lower and upper corner */
    bool clipped;
    int32_t size, color_size; /* texels along the longer side; color_size 0: as size */
    int32_t samples;          /* colour rays per texel and axis */
    int32_t cell;             /* texels per side of a piece of the base */
    bool float_depth;         /* .exr in place of 16-bit .png */
    general_options general;
    method_options method;
    displacement_options displacement;
} capture_options;

/* Parses the command line of `knurl capture`; ends the program when it is wrong. */
void capture_options_parse(int argc, char **argv, capture_options *options);

/* ---- capture_view.c ---- */

typedef struct capture_view {
    const char *name; /* part of file names, "" for the only view */
    capture_frustum frustum;
    double right[3], up[3], out[3]; /* the frame's axes in the world, unit, right-handed */
    double origin[3];               /* of the frame, in the world */
    double scale[2];                /* parallel: hx, hy; else tangents of the half angles */
    double front, back;             /* the range of z that rays run through, front > back */
    double base;                    /* z of the base rectangle */
    int32_t width, height;          /* texels of the height map */
    int32_t color_width, color_height;
} capture_view;

enum { CAPTURE_MOST_VIEWS = 6 };

/* The world box that is captured: the scene's bounds, cut by --clip. False if nothing is left. */
bool capture_box(const capture_options *options, const knurl_scene *scene, double box[6]);
/* Fits the views to the box; returns their number, or 0 with a message. */
int capture_views_fit(const capture_options *options, const double box[6], capture_view *views,
                      char message[200]);

/* Picture coordinates X, Y of texel coordinates (0 is the first texel's centre, y points down): the centres
 * of the border texels lie on X, Y = -1 and 1, so that views of a cube share their samples along its edges.
 */
void capture_picture(const capture_view *view, double x, double y, double picture[2]);
/* Direction D of picture coordinates, in the frame. */
void capture_direction(const capture_view *view, const double picture[2], double direction[3]);
/* The point at z on the ray of picture coordinates, in the frame. */
void capture_point(const capture_view *view, const double picture[2], double z, double point[3]);
/* The ray through texel coordinates: t = front - z; its range cut by the box if there is one. False: misses
 * it. */
bool capture_ray(const capture_view *view, double x, double y, const double *box, knurl_ray *ray);

/* ---- capture_texture.c ---- */

typedef struct capture_textures capture_textures;

int capture_textures_load(command_session *session, const knurl_description *description,
                          capture_textures **textures);
void capture_textures_release(capture_textures *textures);
/* Unlit base colour of a hit, linear, and alpha: factors times texture. */
void capture_base_color(const capture_textures *textures, const knurl_hit *hit, double color[4]);
/* Factors times texture, in [0, 1]. */
void capture_surface(const capture_textures *textures, const knurl_hit *hit, double *roughness,
                     double *metallic);
/* Whether rays pass: alpha under the cutoff (MASK), or under one half (BLEND). */
bool capture_is_hole(const capture_textures *textures, const knurl_hit *hit);
double capture_srgb_encode(double linear);

/* ---- capture_trace.c ---- */

typedef struct capture_maps {
    float *heights;    /* width * height, h; of texels without a hit that of the nearest one with a hit */
    uint8_t *seen;     /* width * height: 1 where the ray hit */
    uint8_t *colors;   /* 4 * color_width * color_height: sRGB, alpha = coverage */
    uint8_t *surfaces; /* 3 * color_width * color_height: 0, roughness, metalness */
    uint64_t hits;     /* texels of the height map that hit */
    double low, high;  /* range of heights over the hits */
    double roughness[2], metallic[2]; /* ranges over the colour samples that hit */
} capture_maps;

typedef struct capture_job {
    command_session *session;
    const capture_options *options;
    const knurl_description *description;
    const knurl_scene *scene;
    const capture_textures *textures;
    const double *box;          /* NULL: not clipped */
    double rays_done, rays_all; /* for progress */
} capture_job;

int capture_view_trace(capture_job *job, const capture_view *view, capture_maps *maps);
void capture_maps_release(capture_maps *maps);

/* ---- capture_fill.c ---- */

/* For each texel the number of the nearest one with `seen` set, itself if it is; UINT32_MAX if there is none.
 * Returns NULL when out of memory. The caller frees the array. */
uint32_t *capture_nearest(const uint8_t *seen, int32_t width, int32_t height);

/* ---- capture_gltf.c, capture_write.c ---- */

typedef struct capture_result {
    capture_view views[CAPTURE_MOST_VIEWS];
    capture_maps maps[CAPTURE_MOST_VIEWS];
    int count;
    double offset, factor;            /* h = offset + factor * map, of all views */
    double roughness[2], metallic[2]; /* ranges over all views */
    uint64_t triangles;               /* of the bases, filled by the writer */
} capture_result;

/* Writes capture.gltf, capture.bin and the maps; all of them or none. */
int capture_write(command_session *session, const capture_options *options, const loaded_scene *loaded,
                  capture_result *result);

/* The glTF document and its buffer, for capture_write(); both NULL when out of memory. */
typedef struct capture_document {
    char *text;
    unsigned char *bytes;
    size_t size;
} capture_document;
bool capture_document_make(const capture_options *options, const loaded_scene *loaded, capture_result *result,
                           capture_document *document);
/* Whether roughness and metalness need maps: they are not the same everywhere. */
bool capture_has_surfaces(const capture_result *result);
/* File name of a view's map: "height", "color" or "surface", with the view's name. */
void capture_file_name(const capture_options *options, const capture_view *view, const char *what,
                       char name[64]);

/* Base rectangle of one view, cut into cells; those where the picture is empty are left out. */
typedef struct capture_base {
    float *positions, *directions, *texcoords; /* 3, 3, 2 per vertex */
    uint32_t *triangles;                       /* 3 per triangle */
    uint32_t vertex_count, triangle_count;
} capture_base;
bool capture_base_make(const capture_view *view, const capture_maps *maps, int32_t cell, capture_base *base);
void capture_base_release(capture_base *base);

#endif
