/* knurl/description.h: what a scene file says, as plain data that can be printed and changed.
 *
 * Conventions: right-handed, y up, metres; texture v = 0 at the image's first row; colours linear
 * unless the field says otherwise; angles in radians; transforms 3 rows of 4, row-major, to world. */
#ifndef KNURL_DESCRIPTION_H
#define KNURL_DESCRIPTION_H

#include <knurl/heightmap.h>
#include <knurl/scene.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A use of an image. image is -1 for none. */
typedef struct knurl_texture_ref {
    int32_t image; /* index into knurl_description.images, -1: none */
    knurl_wrap wrap_u, wrap_v;
    double uv_offset[2], uv_scale[2], uv_rotation; /* as knurl_displacement */
    bool nearest;                                  /* magnification filter */
} knurl_texture_ref;

/* Encoded image: a file or a piece of the scene file. */
typedef struct knurl_description_image {
    char *name;           /* for messages */
    char *path;           /* NULL if embedded */
    unsigned char *bytes; /* NULL if in a file */
    size_t size;
} knurl_description_image;

typedef enum knurl_alpha_mode {
    KNURL_ALPHA_OPAQUE = 0,
    KNURL_ALPHA_MASK, /* cut out where alpha < cutoff */
    KNURL_ALPHA_BLEND /* pass through with probability 1 - alpha */
} knurl_alpha_mode;

/* glTF 2.0 metallic-roughness; OBJ/MTL is converted to it. */
typedef struct knurl_description_material {
    char *name;
    double base_color[4]; /* times the texture (sRGB-encoded colour, linear alpha) */
    knurl_texture_ref base_color_texture;
    double metallic, roughness; /* times the texture's blue and green */
    knurl_texture_ref metallic_roughness_texture;
    double emissive[3]; /* radiance, strength multiplied in, times the texture */
    knurl_texture_ref emissive_texture;
    double transmission;         /* 0..1, KHR_materials_transmission */
    double ior;                  /* default 1.5 */
    double attenuation_color[3]; /* KHR_materials_volume, default 1 */
    double attenuation_distance; /* default infinity */
    knurl_alpha_mode alpha_mode;
    double alpha_cutoff; /* default 0.5 */
    bool double_sided;
    /* Displacement: image -1 and offset 0 for none. */
    knurl_texture_ref displacement;                  /* linear data, red channel */
    double displacement_factor, displacement_offset; /* h = offset + factor * map */
    bool displacement_unnormalised;
} knurl_description_material;

/* One primitive: triangles with one material. */
typedef struct knurl_description_mesh {
    char *name;
    float *positions;  /* 3 per vertex */
    float *normals;    /* 3 per vertex, or NULL: a displaced mesh gets smooth ones, a plain one is flat */
    float *texcoords;  /* 2 per vertex, or NULL */
    float *directions; /* 3 per vertex, or NULL: knurl_mesh_view.directions of a displaced mesh */
    uint32_t vertex_count;
    uint32_t *triangles; /* 3 per triangle */
    uint32_t triangle_count;
    int32_t material; /* index, always valid: the loader adds a default material */
} knurl_description_mesh;

typedef struct knurl_description_instance {
    char *name;
    int32_t mesh;
    double transform[12];
} knurl_description_instance;

typedef struct knurl_description_camera {
    char *name;
    double transform[12]; /* looks along -z, y up */
    bool orthographic;
    double yfov;                        /* radians, perspective */
    double ymag;                        /* half height, orthographic */
    double lens_radius, focus_distance; /* 0: pinhole. From node/camera extras "lens_radius",
                                           "focus_distance" (our own, in metres) */
} knurl_description_camera;

typedef enum knurl_light_kind {
    KNURL_LIGHT_POINT = 0,
    KNURL_LIGHT_SPOT,
    KNURL_LIGHT_DIRECTIONAL
} knurl_light_kind;

/* KHR_lights_punctual: candela for point and spot, lux for directional. */
typedef struct knurl_description_light {
    char *name;
    knurl_light_kind kind;
    double transform[12]; /* shines along -z */
    double color[3];      /* linear, times intensity */
    double intensity;
    double range;                  /* infinity for none */
    double inner_cone, outer_cone; /* radians from the axis */
} knurl_description_light;

/* All arrays are owned by the description and were allocated by its context. Counts may be 0. */
typedef struct knurl_description {
    knurl_context *context;
    char *path;
    knurl_description_mesh *meshes;
    uint32_t mesh_count;
    knurl_description_image *images;
    uint32_t image_count;
    knurl_description_material *materials;
    uint32_t material_count;
    knurl_description_instance *instances;
    uint32_t instance_count;
    knurl_description_camera *cameras;
    uint32_t camera_count;
    knurl_description_light *lights;
    uint32_t light_count;
    char **warnings;
    uint32_t warning_count;
    /* Environment named by the scene itself: scene extras {"environment": {"image": "sky.hdr",
     * "intensity": 1, "rotation": 0}} in glTF; image -1 for none. */
    knurl_texture_ref environment;
    double environment_intensity, environment_rotation; /* radians about y */
} knurl_description;

/* Reads .gltf, .glb, .obj (with its .mtl), and whatever geometry assimp reads besides (.ply, .stl,
 * ...). Relative names are looked up beside the scene file. */
KNURL_API knurl_status knurl_description_load(knurl_context *context, const char *path,
                                              knurl_description **description, knurl_error *error);
KNURL_API void knurl_description_release(knurl_description *description);

/* Adds an image file (not read yet), returns its index; or -1 when out of memory. */
KNURL_API int32_t knurl_description_add_image(knurl_description *description, const char *path);
/* Reads image `index` from its file or bytes. */
KNURL_API knurl_status knurl_description_load_image(const knurl_description *description, int32_t index,
                                                    knurl_image **image, knurl_error *error);

/* What the command line may add or override, for every material. Fill with the default function;
 * NULL and NaN fields leave the scene's own values. */
typedef struct knurl_displacement_override {
    uint32_t cookie;
    const char *map;        /* image file, or NULL */
    double factor, offset;  /* NaN: keep */
    double tile_u, tile_v;  /* NaN: keep; else replaces the uv scale */
    int32_t wrap_u, wrap_v; /* -1: keep, else knurl_wrap */
    const char *color_map;  /* base colour image for every material, or NULL */
    bool remove;            /* drop all displacement first */
    int32_t unnormalised;   /* -1: keep */
} knurl_displacement_override;

KNURL_API knurl_displacement_override knurl_displacement_override_default(void);
KNURL_API knurl_status knurl_description_override(knurl_description *description,
                                                  const knurl_displacement_override *override,
                                                  knurl_error *error);

/* How a description becomes a scene. Fill with knurl_build_def_default(). */
typedef struct knurl_build_def {
    uint32_t cookie;
    knurl_surface_def surface;     /* method and its parameters; mesh and displacement are ignored */
    knurl_heightmap_def heightmap; /* bounds' parameters; image is ignored */
    knurl_progress_fn *progress;   /* may be NULL */
    void *progress_user;
    double *image_seconds; /* may be NULL; else receives the part of the time that went into reading images */
} knurl_build_def;

KNURL_API knurl_build_def knurl_build_def_default(void);

/* Object i of the scene is mesh i of the description, instance i is instance i. Loads each
 * displacement map once. The scene does not keep the description. */
KNURL_API knurl_status knurl_scene_build(const knurl_description *description, const knurl_build_def *def,
                                         knurl_scene **scene, knurl_error *error);

#ifdef __cplusplus
}
#endif
#endif
