/* knurl/render.h: path tracing of a described scene. */
#ifndef KNURL_RENDER_H
#define KNURL_RENDER_H

#include <knurl/description.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum knurl_integrator {
    KNURL_INTEGRATOR_PATH = 0, /* next-event estimation with multiple importance sampling */
    KNURL_INTEGRATOR_AO,       /* ambient occlusion, white */
    KNURL_INTEGRATOR_PRIMARY   /* shading normal towards the camera, no secondary rays */
} knurl_integrator;

/* Arbitrary output variables. The beauty image is always made. */
enum {
    KNURL_AOV_DEPTH = 1u << 0,            /* 1 channel: distance along the ray, metres; inf for none */
    KNURL_AOV_POSITION = 1u << 1,         /* 3: world space */
    KNURL_AOV_GEOMETRIC_NORMAL = 1u << 2, /* 3: unit, towards the camera */
    KNURL_AOV_SHADING_NORMAL = 1u << 3,   /* 3: unit, towards the camera */
    KNURL_AOV_ALBEDO = 1u << 4,           /* 3: linear */
    KNURL_AOV_UV = 1u << 5,               /* 2: map coordinates */
    KNURL_AOV_OBJECT = 1u << 6,           /* 1: object number, -1 for none */
    KNURL_AOV_TRIANGLE = 1u << 7,         /* 1: base triangle, -1 for none */
    KNURL_AOV_STEPS = 1u << 8,            /* 1: traversal steps of the primary ray, averaged */
    KNURL_AOV_COUNT = 9
};
/* Lower-case name of AOV bit i ("depth", "geometric_normal", ...) and its channels. */
KNURL_API const char *knurl_aov_name(int32_t index);
KNURL_API int32_t knurl_aov_channels(int32_t index);

typedef enum knurl_lod_mode {
    KNURL_LOD_FINEST = 0, /* level 0 always */
    KNURL_LOD_AUTO,       /* per ray, from ray cones */
    KNURL_LOD_FIXED       /* knurl_render_def.lod */
} knurl_lod_mode;

typedef struct knurl_render_def {
    uint32_t cookie;
    int32_t width, height; /* pixels, 1 to 65536, default 960 x 540 */
    int32_t samples;       /* per pixel, default 64 */
    uint32_t seed;         /* default 0; same seed, same bits, at any thread count */
    knurl_integrator integrator;
    int32_t max_depth;              /* scattering events, default 8 */
    int32_t camera;                 /* index; -1: the first, or one that frames the scene */
    const knurl_image *environment; /* latitude-longitude, linear RGB, y up; NULL: the scene's own,
                                       else a soft studio sky when the scene has no light at all */
    double environment_intensity;   /* default 1 */
    double environment_rotation;    /* radians about y */
    bool environment_hidden;        /* camera rays see `background` in its place */
    double background[3];
    double clamp; /* largest radiance of an indirect sample, 0: none (default) */
    int32_t crop_x, crop_y, crop_width, crop_height; /* pixels; crop_width 0: everything */
    uint32_t aovs;                                   /* KNURL_AOV_* bits */
    knurl_lod_mode lod_mode;
    double lod;
    double ao_distance;          /* metres; 0: a tenth of the scene's diagonal */
    knurl_progress_fn *progress; /* may be NULL */
    void *progress_user;
} knurl_render_def;

KNURL_API knurl_render_def knurl_render_def_default(void);

typedef struct knurl_render_stats {
    double seconds;                                      /* wall-clock time of tracing and shading */
    uint64_t primary_rays, diffuse_rays, occlusion_rays; /* camera, scattered, shadow rays */
    /* Rays per second over all threads: the time is what threads spent inside the scene's
     * intersect and occluded calls, sampled on every 64th call. */
    double primary_per_second, diffuse_per_second, occlusion_per_second;
    double steps_mean;    /* traversal steps per primary ray */
    int32_t samples_done; /* fully finished samples per pixel (fewer if interrupted) */
} knurl_render_stats;

typedef struct knurl_render_result {
    knurl_image *beauty;                /* F32, 4 channels: linear RGB and coverage */
    knurl_image *aovs[KNURL_AOV_COUNT]; /* NULL where not asked for */
    knurl_render_stats stats;
} knurl_render_result;

/* `scene` must come from knurl_scene_build on the same description. KNURL_INTERRUPTED still fills
 * the result with what was finished. Release the images with knurl_render_result_release. */
KNURL_API knurl_status knurl_render(const knurl_description *description, const knurl_scene *scene,
                                    const knurl_render_def *def, knurl_render_result *result,
                                    knurl_error *error);
KNURL_API void knurl_render_result_release(knurl_render_result *result);

/* The camera that knurl_render takes for `camera` (its index; -1: the first, or one that frames the scene),
 * as width * height rays: rows from the top, one ray through each pixel's and the lens's centre, with unit
 * directions, level of detail 0 and no cone. Width and height are in [1, 65536]. */
KNURL_API knurl_status knurl_camera_rays(const knurl_description *description, const knurl_scene *scene,
                                         int32_t camera, int32_t width, int32_t height, knurl_ray *rays,
                                         knurl_error *error);

/* Display image: exposure in stops, filmic tone curve, sRGB encoding, 8 bits, RGBA to RGB. */
KNURL_API knurl_status knurl_tonemap(knurl_context *context, const knurl_image *linear, double exposure,
                                     knurl_image **display, knurl_error *error);

#ifdef __cplusplus
}
#endif
#endif
