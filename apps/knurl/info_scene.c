/* info_scene.c: what `knurl info` says about scenes. */
#include "info.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *const wrap_names[] = {"repeat", "mirror", "clamp"};

/* ---- parts as JSON ---- */

static json_t *describe_displacement(const knurl_description *description, const knurl_description_mesh *mesh)
{
    const knurl_description_material *material = &description->materials[mesh->material];
    const knurl_texture_ref *use = &material->displacement;
    const knurl_description_image *image = use->image >= 0 ? &description->images[use->image] : NULL;
    return json_pack("{s:o, s:o, s:o, s:s, s:s, s:o, s:o, s:o, s:b}", "image",
                     image ? json_text(image->path ? image->path : image->name) : json_null(), "factor",
                     json_number(material->displacement_factor), "offset",
                     json_number(material->displacement_offset), "wrap_u", wrap_names[use->wrap_u], "wrap_v",
                     wrap_names[use->wrap_v], "uv_offset", json_numbers(use->uv_offset, 2), "uv_scale",
                     json_numbers(use->uv_scale, 2), "uv_rotation", json_number(use->uv_rotation),
                     "unnormalised", (int)material->displacement_unnormalised);
}

static json_t *describe_object(const loaded_scene *loaded, uint32_t object)
{
    const knurl_description_mesh *mesh = &loaded->description->meshes[object];
    const knurl_surface *surface = knurl_scene_surface(loaded->scene, object);
    json_t *root = json_pack("{s:o, s:b, s:o}", "name", json_text(mesh->name), "displaced", surface != NULL,
                             "triangles", json_count(mesh->triangle_count));
    if (!surface || !root) return root;
    knurl_surface_info info;
    knurl_surface_get_info(surface, &info);
    json_t *bytes = json_pack("{s:o, s:o, s:o}", "mesh", json_count(info.mesh_bytes), "shells",
                              json_count(info.shell_bytes), "map", json_count(info.map_bytes));
    json_t *more = json_pack(
        "{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "texels",
        json_number(info.texels), "folded", json_count(info.folded), "flat_uv", json_count(info.flat_uv),
        "degenerate", json_count(info.degenerate), "replaced_normals", json_count(info.replaced_normals),
        "seam_edges", json_count(info.seam_edges), "height_min", json_number(info.height_min), "height_max",
        json_number(info.height_max), "lower", json_numbers(info.lower, 3), "upper",
        json_numbers(info.upper, 3), "displacement", describe_displacement(loaded->description, mesh),
        "bytes", bytes, "tessellated_bytes", json_count(info.tessellated_bytes));
    json_object_update(root, more);
    json_decref(more);
    return root;
}

static json_t *describe_texture(command_session *session, const knurl_description *description,
                                uint32_t index)
{
    const knurl_description_image *source = &description->images[index];
    json_t *root = json_pack("{s:o, s:o}", "name", json_text(source->name), "path", json_text(source->path));
    knurl_error error = {0};
    knurl_image *image = NULL;
    if (knurl_description_load_image(description, (int32_t)index, &image, &error) != KNURL_OK) {
        session_note(session, "knurl: warning: %s", error.message);
        json_object_set_new(root, "error", json_text(error.message));
        return root;
    }
    json_object_set_new(root, "width", json_integer(knurl_image_width(image)));
    json_object_set_new(root, "height", json_integer(knurl_image_height(image)));
    json_object_set_new(root, "channels", json_integer(knurl_image_channels(image)));
    json_object_set_new(root, "bits", json_integer(8 * (int)knurl_image_format(image)));
    knurl_image_release(image);
    return root;
}

static json_t *describe_camera(const knurl_description_camera *camera)
{
    return json_pack("{s:o, s:s, s:o, s:o}", "name", json_text(camera->name), "kind",
                     camera->orthographic ? "orthographic" : "perspective",
                     camera->orthographic ? "half_height" : "yfov_degrees",
                     json_number(camera->orthographic ? camera->ymag : camera->yfov * 57.29577951308232),
                     "lens_radius", json_number(camera->lens_radius));
}

static json_t *describe_light(const knurl_description_light *light)
{
    static const char *const kinds[] = {"point", "spot", "directional"};
    return json_pack("{s:o, s:s, s:o, s:o}", "name", json_text(light->name), "kind", kinds[light->kind],
                     "intensity", json_number(light->intensity), "color", json_numbers(light->color, 3));
}

static void describe_lists(command_session *session, const loaded_scene *loaded, json_t *root)
{
    const knurl_description *description = loaded->description;
    json_t *objects = json_array(), *textures = json_array(), *cameras = json_array(), *lights = json_array(),
           *warnings = json_array();
    for (uint32_t i = 0; i < description->mesh_count; i++)
        json_array_append_new(objects, describe_object(loaded, i));
    for (uint32_t i = 0; i < description->image_count && !signals_stop_requested(); i++)
        json_array_append_new(textures, describe_texture(session, description, i));
    for (uint32_t i = 0; i < description->camera_count; i++)
        json_array_append_new(cameras, describe_camera(&description->cameras[i]));
    for (uint32_t i = 0; i < description->light_count; i++)
        json_array_append_new(lights, describe_light(&description->lights[i]));
    for (uint32_t i = 0; i < description->warning_count; i++)
        json_array_append_new(warnings, json_text(description->warnings[i]));
    json_object_set_new(root, "objects", objects);
    json_object_set_new(root, "textures", textures);
    json_object_set_new(root, "cameras", cameras);
    json_object_set_new(root, "lights", lights);
    json_object_set_new(root, "warnings", warnings);
}

static json_t *describe_bytes(const knurl_scene *scene)
{
    knurl_scene_memory memory = knurl_scene_get_memory(scene);
    return json_pack("{s:o, s:o, s:o, s:o, s:o}", "mesh", json_count(memory.mesh), "shells",
                     json_count(memory.shells), "maps", json_count(memory.maps), "bvh",
                     json_count(memory.bvh), "total",
                     json_count(memory.mesh + memory.shells + memory.maps + memory.bvh));
}

/* Sums over the displaced objects: what one tessellated mesh for each would take. */
static double sum_over_objects(const json_t *root, const char *key)
{
    const json_t *objects = json_object_get(root, "objects");
    double sum = 0;
    for (size_t i = 0; i < json_array_size(objects); i++) sum += info_number(json_array_get(objects, i), key);
    return sum;
}

int info_gather_scene(command_session *session, const info_options *options, json_t **root)
{
    loaded_scene loaded;
    int code = scene_load(session, options->path, &options->displacement, &options->method, &loaded);
    if (code != CODE_DONE) return code;
    const char *method = options->method.method ? options->method.method : knurl_surface_def_default().method;
    double lower[3], upper[3];
    knurl_scene_bounds(loaded.scene, lower, upper);
    *root = json_pack("{s:s, s:s, s:o, s:s, s:o, s:o, s:o, s:o}", "knurl", KNURL_VERSION_STRING, "kind",
                      "scene", "path", json_text(options->path), "method", method, "lower",
                      json_numbers(lower, 3), "upper", json_numbers(upper, 3), "instances",
                      json_count(knurl_scene_instance_count(loaded.scene)), "materials",
                      json_count(loaded.description->material_count));
    if (*root) {
        describe_lists(session, &loaded, *root);
        json_object_set_new(*root, "bytes", describe_bytes(loaded.scene));
        json_object_set_new(*root, "tessellated_bytes",
                            json_count((uint64_t)sum_over_objects(*root, "tessellated_bytes")));
        if (options->timing)
            json_object_set_new(*root, "timing",
                                json_pack("{s:o, s:o}", "load_ms", json_number(loaded.load_seconds * 1e3),
                                          "build_ms", json_number(loaded.build_seconds * 1e3)));
    } else {
        code = session_fail_with(session, CODE_LIMIT, "out of memory for the results");
    }
    scene_release(&loaded);
    if (code == CODE_DONE && signals_stop_requested()) {
        json_decref(*root);
        *root = NULL;
        code = session_fail_with(session, CODE_INTERRUPTED, "interrupted");
    }
    return code;
}

/* ---- text ---- */

static void print_displaced(const json_t *object)
{
    const json_t *displacement = json_object_get(object, "displacement");
    const json_t *scale = json_object_get(displacement, "uv_scale");
    char text[32];
    printf("    height = %g + %g * %s, %g to %g; tiled %g x %g, %s/%s\n", info_number(displacement, "offset"),
           info_number(displacement, "factor"),
           *info_text(displacement, "image") ? info_text(displacement, "image") : "(no map)",
           info_number(object, "height_min"), info_number(object, "height_max"),
           json_number_value(json_array_get(scale, 0)), json_number_value(json_array_get(scale, 1)),
           info_text(displacement, "wrap_u"), info_text(displacement, "wrap_v"));
    printf(
        "    %s texels; triangles folded %.0f, flat in texture space %.0f, degenerate %.0f; seam edges %.0f",
        info_count_text(text, info_number(object, "texels")), info_number(object, "folded"),
        info_number(object, "flat_uv"), info_number(object, "degenerate"), info_number(object, "seam_edges"));
    if (info_number(object, "replaced_normals") > 0)
        printf("; normals replaced %.0f", info_number(object, "replaced_normals"));
    const json_t *bytes = json_object_get(object, "bytes");
    char mesh[32], shells[32], map[32], tessellated[32];
    printf("\n    mesh %s, shells %s, map %s; tessellated %s\n",
           format_bytes(mesh, info_number(bytes, "mesh")), format_bytes(shells, info_number(bytes, "shells")),
           format_bytes(map, info_number(bytes, "map")),
           format_bytes(tessellated, info_number(object, "tessellated_bytes")));
}

static void print_objects(const json_t *root)
{
    const json_t *objects = json_object_get(root, "objects");
    for (size_t i = 0; i < json_array_size(objects); i++) {
        const json_t *object = json_array_get(objects, i);
        char count[32];
        printf("object %zu%s%s%s: %s triangles%s\n", i, *info_text(object, "name") ? " '" : "",
               info_text(object, "name"), *info_text(object, "name") ? "'" : "",
               info_count_text(count, info_number(object, "triangles")),
               json_is_true(json_object_get(object, "displaced")) ? ", displaced" : "");
        if (json_is_true(json_object_get(object, "displaced"))) print_displaced(object);
    }
}

static void print_memory(const json_t *root)
{
    static const char *const keys[] = {"mesh", "shells", "maps", "bvh", "total"};
    static const char *const meanings[] = {"vertices and indices", "what the method keeps",
                                           "height maps with levels and bounds", "Embree", "all of it"};
    const json_t *bytes = json_object_get(root, "bytes");
    char text[32], whole[32];
    puts("memory");
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        printf("  %-7s %12s  %s\n", keys[i], format_bytes(text, info_number(bytes, keys[i])), meanings[i]);
    double tessellated = info_number(root, "tessellated_bytes"), total = info_number(bytes, "total");
    if (tessellated > 0)
        printf("  the displaced objects tessellated at one vertex per texel: %s, %.4g times as much\n",
               format_bytes(whole, tessellated), tessellated / total);
}

static void print_rest(const json_t *root)
{
    const json_t *list = json_object_get(root, "textures");
    for (size_t i = 0; i < json_array_size(list); i++) {
        const json_t *item = json_array_get(list, i);
        printf("texture %zu '%s': ", i,
               *info_text(item, "path") ? info_text(item, "path") : info_text(item, "name"));
        if (*info_text(item, "error"))
            puts("cannot be read");
        else
            printf("%.0f x %.0f, %.0f x %.0f bits\n", info_number(item, "width"), info_number(item, "height"),
                   info_number(item, "channels"), info_number(item, "bits"));
    }
    list = json_object_get(root, "cameras");
    for (size_t i = 0; i < json_array_size(list); i++)
        printf("camera %zu '%s': %s\n", i, info_text(json_array_get(list, i), "name"),
               info_text(json_array_get(list, i), "kind"));
    list = json_object_get(root, "lights");
    for (size_t i = 0; i < json_array_size(list); i++)
        printf("light %zu '%s': %s, intensity %g\n", i, info_text(json_array_get(list, i), "name"),
               info_text(json_array_get(list, i), "kind"), info_number(json_array_get(list, i), "intensity"));
    list = json_object_get(root, "warnings");
    if (json_array_size(list))
        printf("%zu warning%s, printed above\n", json_array_size(list), json_array_size(list) > 1 ? "s" : "");
    const json_t *timing = json_object_get(root, "timing");
    if (timing)
        printf("timing: loading %.1f ms, building %.1f ms\n", info_number(timing, "load_ms"),
               info_number(timing, "build_ms"));
}

static double number_at(const json_t *array, size_t index)
{
    return json_number_value(json_array_get(array, index));
}

void info_print_scene(const json_t *root)
{
    const json_t *lower = json_object_get(root, "lower"), *upper = json_object_get(root, "upper");
    printf("%s: %zu objects, %.0f instances, %.0f materials, method %s\n", info_text(root, "path"),
           json_array_size(json_object_get(root, "objects")), info_number(root, "instances"),
           info_number(root, "materials"), info_text(root, "method"));
    printf("bounds (%g, %g, %g) to (%g, %g, %g)\n", number_at(lower, 0), number_at(lower, 1),
           number_at(lower, 2), number_at(upper, 0), number_at(upper, 1), number_at(upper, 2));
    print_objects(root);
    print_memory(root);
    print_rest(root);
}
