/* From a description to a scene: each map once, each mesh an object, each instance an instance. */
#include "scene/scene.h"

#include <knurl/description.h>

knurl_build_def knurl_build_def_default(void)
{
    return (knurl_build_def){
        .cookie = KNURL_COOKIE,
        .surface = knurl_surface_def_default(),
        .heightmap = knurl_heightmap_def_default(),
    };
}

typedef struct builder {
    const knurl_description *description;
    const knurl_build_def *def;
    knurl_heightmap **maps; /* one per image, NULL until used */
    knurl_scene *scene;
} builder;

static const char *name_or(const char *name)
{
    return name ? name : "unnamed";
}

static bool is_displaced(const knurl_description_material *material)
{
    return material->displacement.image >= 0 || material->displacement_offset != 0.0;
}

/* The height map of an image, made at its first use. */
static knurl_status get_map(builder *b, int32_t image, knurl_heightmap **map, knurl_error *error)
{
    const knurl_description *d = b->description;
    *map = NULL;
    if (image < 0) return KNURL_OK;
    if ((uint32_t)image >= d->image_count)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "displacement image is %d, expected under %u", image,
                          d->image_count);
    if (!b->maps[image]) {
        knurl_image *pixels = NULL;
        double start = knurl_seconds();
        knurl_status status = knurl_description_load_image(d, image, &pixels, error);
        if (b->def->image_seconds) *b->def->image_seconds += knurl_seconds() - start;
        if (status != KNURL_OK) return status;
        knurl_heightmap_def def = b->def->heightmap;
        def.image = pixels;
        status = knurl_heightmap_create(d->context, &def, &b->maps[image], error);
        knurl_image_release(pixels);
        if (status != KNURL_OK)
            return knurl_fail_prefix(error, status, "displacement map \"%s\"",
                                     name_or(d->images[image].name));
    }
    *map = b->maps[image];
    return KNURL_OK;
}

static knurl_displacement displacement_of(const knurl_description_material *material, knurl_heightmap *map)
{
    const knurl_texture_ref *texture = &material->displacement;
    knurl_displacement displacement = knurl_displacement_default();
    displacement.map = map;
    displacement.factor = material->displacement_factor;
    displacement.offset = material->displacement_offset;
    displacement.wrap_u = texture->wrap_u;
    displacement.wrap_v = texture->wrap_v;
    for (int i = 0; i < 2; i++) {
        displacement.uv_offset[i] = texture->uv_offset[i];
        displacement.uv_scale[i] = texture->uv_scale[i];
    }
    displacement.uv_rotation = texture->uv_rotation;
    displacement.unnormalised = material->displacement_unnormalised;
    return displacement;
}

static knurl_status add_displaced(builder *b, const knurl_mesh_view *view,
                                  const knurl_description_material *material, knurl_error *error)
{
    knurl_heightmap *map;
    knurl_status status = get_map(b, material->displacement.image, &map, error);
    if (status != KNURL_OK) return status;
    knurl_surface_def def = b->def->surface;
    def.mesh = *view;
    def.displacement = displacement_of(material, map);
    knurl_surface *surface = NULL;
    status = knurl_surface_create(b->description->context, &def, &surface, error);
    if (status != KNURL_OK) return status;
    status = knurl_scene_add_surface(b->scene, surface, NULL, error);
    knurl_surface_release(surface);
    return status;
}

static knurl_status add_mesh(builder *b, uint32_t number, knurl_error *error)
{
    const knurl_description *d = b->description;
    const knurl_description_mesh *mesh = &d->meshes[number];
    if (mesh->material < 0 || (uint32_t)mesh->material >= d->material_count)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "mesh %u: material is %d, expected 0 to %u", number,
                          mesh->material, d->material_count);
    const knurl_description_material *material = &d->materials[mesh->material];
    knurl_mesh_view view = {
        .positions = mesh->positions,
        .normals = mesh->normals,
        .texcoords = mesh->texcoords,
        .directions = mesh->directions,
        .vertex_count = mesh->vertex_count,
        .triangles = mesh->triangles,
        .triangle_count = mesh->triangle_count,
    };
    /* A mesh without triangles has no surface, but keeps its number. */
    knurl_status status = is_displaced(material) && mesh->triangle_count > 0
                              ? add_displaced(b, &view, material, error)
                              : knurl_scene_add_mesh(b->scene, &view, NULL, error);
    if (status != KNURL_OK)
        return knurl_fail_prefix(error, status, "mesh %u (\"%s\"), material \"%s\"", number,
                                 name_or(mesh->name), name_or(material->name));
    return KNURL_OK;
}

static knurl_status add_instance(builder *b, uint32_t number, knurl_error *error)
{
    const knurl_description_instance *instance = &b->description->instances[number];
    if (instance->mesh < 0 || (uint32_t)instance->mesh >= b->description->mesh_count)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT, "instance %u: mesh is %d, expected under %u", number,
                          instance->mesh, b->description->mesh_count);
    scene_instance place;
    if (scene_instance_place(&place, instance->transform))
        return knurl_scene_add_instance(b->scene, (uint32_t)instance->mesh, instance->transform, UINT32_MAX,
                                        NULL, error);
    /* Scenes hide things by scaling them to nothing. */
    knurl_log(b->description->context, KNURL_LOG_WARNING,
              "instance %u (\"%s\"): its transform is singular or not finite, so it is left out", number,
              name_or(instance->name));
    return scene_add_hidden_instance(b->scene, (uint32_t)instance->mesh, error);
}

static knurl_status report(const builder *b, const char *stage, double fraction, knurl_error *error)
{
    if (!b->def->progress || b->def->progress(b->def->progress_user, stage, fraction)) return KNURL_OK;
    return knurl_fail(error, KNURL_INTERRUPTED, "stopped while building the scene");
}

static knurl_status build_all(builder *b, knurl_error *error)
{
    const knurl_description *d = b->description;
    knurl_status status = KNURL_OK;
    for (uint32_t i = 0; i < d->mesh_count && status == KNURL_OK; i++) {
        status = report(b, "surfaces", (double)i / (double)d->mesh_count, error);
        if (status == KNURL_OK) status = add_mesh(b, i, error);
    }
    for (uint32_t i = 0; i < d->instance_count && status == KNURL_OK; i++) status = add_instance(b, i, error);
    if (status == KNURL_OK) status = report(b, "hierarchy", 0.0, error);
    if (status == KNURL_OK) status = knurl_scene_commit(b->scene, error);
    if (status == KNURL_OK) status = report(b, "hierarchy", 1.0, error);
    return status;
}

knurl_status knurl_scene_build(const knurl_description *description, const knurl_build_def *def,
                               knurl_scene **out, knurl_error *error)
{
    if (!out) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "scene is NULL");
    *out = NULL;
    if (!description) return knurl_fail(error, KNURL_ERROR_ARGUMENT, "description is NULL");
    if (!def || def->cookie != KNURL_COOKIE || def->surface.cookie != KNURL_COOKIE ||
        def->heightmap.cookie != KNURL_COOKIE)
        return knurl_fail(error, KNURL_ERROR_ARGUMENT,
                          "build definition was not made by knurl_build_def_default()");
    if (def->image_seconds) *def->image_seconds = 0.0;
    knurl_context *context = description->context;
    builder b = {.description = description, .def = def};
    size_t bytes = (size_t)description->image_count * sizeof(knurl_heightmap *);
    b.maps = knurl_alloc_zero(context, bytes);
    if (!b.maps) return knurl_fail_memory(error, bytes, "the list of maps");
    knurl_status status = knurl_scene_create(context, &b.scene, error);
    if (status == KNURL_OK) status = build_all(&b, error);
    /* The surfaces hold the maps they use. */
    for (uint32_t i = 0; i < description->image_count; i++)
        if (b.maps[i]) knurl_heightmap_release(b.maps[i]);
    knurl_free(context, b.maps);
    if (status != KNURL_OK) {
        knurl_scene_release(b.scene);
        return status;
    }
    *out = b.scene;
    return KNURL_OK;
}
