/* demo_gltf.h: writes a scene as glTF 2.0 with its files beside it. */
#ifndef KNURL_APPS_DEMO_GLTF_H
#define KNURL_APPS_DEMO_GLTF_H

#include "demo_mesh.h"

#include <knurl/image.h>

#include <jansson.h>

typedef enum demo_wrap {
    DEMO_REPEAT = 10497, /* glTF's sampler values */
    DEMO_MIRROR = 33648,
    DEMO_CLAMP = 33071
} demo_wrap;

/* The first failure is kept in `error`; after it every call does nothing, so that scenes are
 * written straight down and checked once, by demo_scene_finish. */
typedef struct demo_scene {
    knurl_context *context;
    knurl_status status;
    knurl_error *error;
    const char *name;  /* of the scene, and the stem of its files */
    char folder[3000]; /* files go here */
    int32_t map_size;  /* asked for by --size, 0: each map's own */
    int32_t map_limit; /* asked for by --map-size, 0: none */
    uint32_t seed;
    bool glb;

    json_t *root, *scene_root;
    unsigned char *bytes; /* contents of the buffer */
    size_t byte_count, byte_capacity;

    uint64_t triangles;     /* of all meshes, each once */
    uint64_t displaced;     /* of them with a displaced material */
    uint64_t texels;        /* of all height maps */
    uint32_t displacing[2]; /* bit i: material i is displaced; 64 materials */
} demo_scene;

typedef struct demo_material {
    const char *name;
    double color[4];
    double metallic, roughness;
    const char *color_map, *surface_map; /* file names; surface: green roughness, blue metallic */
    const char *height_map;
    double factor, offset; /* metres */
    double tile[2];        /* whole numbers, for all maps */
    demo_wrap wrap;
    double emissive[3]; /* radiance: the strength extension is written when over 1 */
    double transmission, ior;
    double thickness, attenuation_distance, attenuation_color[3]; /* thickness 0: no volume */
    bool mask, double_sided;
} demo_material;

typedef struct demo_camera {
    double eye[3], target[3];
    double yfov;                        /* degrees */
    double lens_radius, focus_distance; /* metres, 0: pinhole */
} demo_camera;

typedef struct demo_place {
    double position[3];
    double axis[3], angle; /* turned about this first; any length, degrees */
    double heading;        /* then about y, degrees, counter-clockwise from above */
} demo_place;

void demo_scene_begin(demo_scene *scene);
/* Writes the files and releases everything. */
knurl_status demo_scene_finish(demo_scene *scene);

/* Sets the scene's error unless it has one. */
void demo_scene_fail(demo_scene *scene, knurl_status status, const char *format, ...) KNURL_PRINTF(3, 4);
/* Path of a file of this scene. */
void demo_scene_path(demo_scene *scene, const char *file, char *path, size_t size);

demo_material demo_material_default(const char *name);
int demo_add_material(demo_scene *scene, const demo_material *material);
/* Releases the mesh. */
int demo_add_mesh(demo_scene *scene, const char *name, demo_mesh *mesh, int material);
void demo_add_node(demo_scene *scene, const char *name, int mesh, const demo_place *place);
void demo_add_camera(demo_scene *scene, const demo_camera *camera);
/* A directional light of `lux` that shines along `direction`. */
void demo_add_sun(demo_scene *scene, const double direction[3], const double color[3], double lux);
/* `rotation` in radians about y. */
void demo_add_environment(demo_scene *scene, const char *file, double intensity, double rotation);

/* Writes all of a file or nothing under its name. */
knurl_status demo_write_file(const char *path, const void *bytes, size_t size, knurl_error *error);

#endif
