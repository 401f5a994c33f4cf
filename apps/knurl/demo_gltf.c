/* Building a glTF 2.0 document in memory. Writing it is in demo_file.c. */
#include "demo_gltf.h"

#include "demo_noise.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void demo_scene_fail(demo_scene *scene, knurl_status status, const char *format, ...)
{
    if (scene->status != KNURL_OK) return;
    scene->status = status;
    if (!scene->error) return;
    va_list args;
    va_start(args, format);
    scene->error->status = status;
    (void)vsnprintf(scene->error->message, sizeof scene->error->message, format, args);
    va_end(args);
}

void demo_scene_path(demo_scene *scene, const char *file, char *path, size_t size)
{
    int length = snprintf(path, size, "%s/%s", scene->folder, file);
    if (length < 0 || (size_t)length >= size)
        demo_scene_fail(scene, KNURL_ERROR_OUTPUT, "path is too long: %s", file);
}

/* jansson returns NULL when out of memory and passes NULL through its setters as -1. */
static void check(demo_scene *scene, bool good)
{
    if (!good) demo_scene_fail(scene, KNURL_ERROR_MEMORY, "out of memory for the glTF document");
}

static void put(demo_scene *scene, json_t *object, const char *key, json_t *value)
{
    check(scene, json_object_set_new(object, key, value) == 0);
}

static json_t *numbers(demo_scene *scene, const double *values, int count)
{
    json_t *array = json_array();
    for (int i = 0; i < count; i++) check(scene, json_array_append_new(array, json_real(values[i])) == 0);
    return array;
}

/* The array under `key` of an object, made when missing. */
static json_t *list(demo_scene *scene, json_t *object, const char *key)
{
    json_t *array = json_object_get(object, key);
    if (array) return array;
    array = json_array();
    put(scene, object, key, array);
    return json_object_get(object, key);
}

static json_t *child(demo_scene *scene, json_t *object, const char *key)
{
    json_t *value = json_object_get(object, key);
    if (value) return value;
    put(scene, object, key, json_object());
    return json_object_get(object, key);
}

/* Appends and returns the index. */
static int append(demo_scene *scene, const char *key, json_t *value)
{
    json_t *array = list(scene, scene->root, key);
    check(scene, json_array_append_new(array, value) == 0);
    return (int)json_array_size(array) - 1;
}

static void use_extension(demo_scene *scene, const char *name)
{
    json_t *used = list(scene, scene->root, "extensionsUsed");
    size_t i;
    json_t *entry;
    json_array_foreach(used, i, entry) if (!strcmp(json_string_value(entry), name)) return;
    check(scene, json_array_append_new(used, json_string(name)) == 0);
}

void demo_scene_begin(demo_scene *scene)
{
    scene->root = json_object();
    put(scene, scene->root, "asset",
        json_pack("{s:s, s:s}", "version", "2.0", "generator", "knurl " KNURL_VERSION_STRING));
    put(scene, scene->root, "scene", json_integer(0));
    scene->scene_root = json_object();
    put(scene, scene->scene_root, "name", json_string(scene->name));
    put(scene, scene->scene_root, "nodes", json_array());
    append(scene, "scenes", json_incref(scene->scene_root));
}

static int add_sampler(demo_scene *scene, demo_wrap wrap)
{
    json_t *samplers = list(scene, scene->root, "samplers"), *entry;
    size_t i;
    json_array_foreach(samplers, i, entry)
    {
        if (json_integer_value(json_object_get(entry, "wrapS")) == (json_int_t)wrap) return (int)i;
    }
    return append(scene, "samplers",
                  json_pack("{s:i, s:i, s:i, s:i}", "magFilter", 9729, "minFilter", 9987, "wrapS", (int)wrap,
                            "wrapT", (int)wrap));
}

static int add_texture(demo_scene *scene, const char *file, demo_wrap wrap)
{
    int sampler = add_sampler(scene, wrap), image = -1;
    json_t *entry;
    size_t i;
    json_array_foreach(list(scene, scene->root, "images"), i, entry)
    {
        if (!strcmp(json_string_value(json_object_get(entry, "uri")), file)) image = (int)i;
    }
    if (image < 0) image = append(scene, "images", json_pack("{s:s}", "uri", file));
    return append(scene, "textures", json_pack("{s:i, s:i}", "sampler", sampler, "source", image));
}

static json_t *texture_info(demo_scene *scene, const char *file, const demo_material *material)
{
    json_t *info = json_pack("{s:i}", "index", add_texture(scene, file, material->wrap));
    if (material->tile[0] != 1 || material->tile[1] != 1) {
        use_extension(scene, "KHR_texture_transform");
        json_t *transform = child(scene, child(scene, info, "extensions"), "KHR_texture_transform");
        put(scene, transform, "scale", numbers(scene, material->tile, 2));
    }
    return info;
}

demo_material demo_material_default(const char *name)
{
    return (demo_material){.name = name,
                           .color = {1, 1, 1, 1},
                           .roughness = 1,
                           .tile = {1, 1},
                           .wrap = DEMO_REPEAT,
                           .ior = 1.5,
                           .attenuation_color = {1, 1, 1}};
}

static json_t *extension(demo_scene *scene, json_t *material, const char *name)
{
    use_extension(scene, name);
    return child(scene, child(scene, material, "extensions"), name);
}

static void add_glass(demo_scene *scene, json_t *json, const demo_material *material)
{
    put(scene, extension(scene, json, "KHR_materials_transmission"), "transmissionFactor",
        json_real(material->transmission));
    put(scene, extension(scene, json, "KHR_materials_ior"), "ior", json_real(material->ior));
    if (!(material->thickness > 0)) return;
    json_t *volume = extension(scene, json, "KHR_materials_volume");
    put(scene, volume, "thicknessFactor", json_real(material->thickness));
    if (material->attenuation_distance > 0) {
        put(scene, volume, "attenuationDistance", json_real(material->attenuation_distance));
        put(scene, volume, "attenuationColor", numbers(scene, material->attenuation_color, 3));
    }
}

static void add_emission(demo_scene *scene, json_t *json, const double emissive[3])
{
    double strength = 1, factor[3];
    for (int k = 0; k < 3; k++) strength = fmax(strength, emissive[k]);
    for (int k = 0; k < 3; k++) factor[k] = emissive[k] / strength;
    put(scene, json, "emissiveFactor", numbers(scene, factor, 3));
    if (strength > 1)
        put(scene, extension(scene, json, "KHR_materials_emissive_strength"), "emissiveStrength",
            json_real(strength));
}

int demo_add_material(demo_scene *scene, const demo_material *material)
{
    if (scene->status != KNURL_OK) return 0;
    json_t *json = json_object(), *pbr = json_object();
    put(scene, json, "name", json_string(material->name));
    put(scene, json, "pbrMetallicRoughness", pbr);
    put(scene, pbr, "baseColorFactor", numbers(scene, material->color, 4));
    put(scene, pbr, "metallicFactor", json_real(material->metallic));
    put(scene, pbr, "roughnessFactor", json_real(material->roughness));
    if (material->color_map)
        put(scene, pbr, "baseColorTexture", texture_info(scene, material->color_map, material));
    if (material->surface_map)
        put(scene, pbr, "metallicRoughnessTexture", texture_info(scene, material->surface_map, material));
    if (material->emissive[0] + material->emissive[1] + material->emissive[2] > 0)
        add_emission(scene, json, material->emissive);
    if (material->mask) {
        put(scene, json, "alphaMode", json_string("MASK"));
        put(scene, json, "alphaCutoff", json_real(0.5));
    }
    if (material->double_sided) put(scene, json, "doubleSided", json_true());
    if (material->transmission > 0) add_glass(scene, json, material);
    if (material->height_map) {
        json_t *displacement = extension(scene, json, "KHR_materials_displacement");
        put(scene, displacement, "displacementGeometryTexture",
            texture_info(scene, material->height_map, material));
        put(scene, displacement, "displacementGeometryFactor", json_real(material->factor));
        put(scene, displacement, "displacementGeometryOffset", json_real(material->offset));
    }
    int index = append(scene, "materials", json);
    if (material->height_map && index < 64) scene->displacing[index / 32] |= 1u << (index % 32);
    return index;
}

/* Appends to the buffer and returns the view's index. `target`: 34962 vertices, 34963 indices. */
static int add_view(demo_scene *scene, const void *data, size_t size, int target)
{
    size_t offset = (scene->byte_count + 3) & ~(size_t)3, needed = offset + size;
    if (needed > scene->byte_capacity) {
        size_t capacity = 2 * needed;
        unsigned char *grown = realloc(scene->bytes, capacity);
        check(scene, grown != NULL);
        if (!grown) return 0;
        scene->bytes = grown;
        scene->byte_capacity = capacity;
    }
    memset(scene->bytes + scene->byte_count, 0, offset - scene->byte_count);
    memcpy(scene->bytes + offset, data, size);
    scene->byte_count = needed;
    return append(scene, "bufferViews",
                  json_pack("{s:i, s:I, s:I, s:i}", "buffer", 0, "byteOffset", (json_int_t)offset,
                            "byteLength", (json_int_t)size, "target", target));
}

static int add_floats(demo_scene *scene, const float *values, uint32_t count, int width)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < count; i++) {
        for (int k = 0; k < width; k++) {
            double x = (double)values[(uint32_t)width * i + (uint32_t)k];
            low[k] = fmin(low[k], x);
            high[k] = fmax(high[k], x);
        }
    }
    int view = add_view(scene, values, (size_t)count * (size_t)width * sizeof(float), 34962);
    json_t *accessor = json_pack("{s:i, s:i, s:I, s:s}", "bufferView", view, "componentType", 5126, "count",
                                 (json_int_t)count, "type", width == 2 ? "VEC2" : "VEC3");
    put(scene, accessor, "min", numbers(scene, low, width));
    put(scene, accessor, "max", numbers(scene, high, width));
    return append(scene, "accessors", accessor);
}

static int add_indices(demo_scene *scene, const demo_mesh *mesh)
{
    int view = add_view(scene, mesh->triangles, (size_t)mesh->triangle_count * 3 * sizeof(uint32_t), 34963);
    return append(scene, "accessors",
                  json_pack("{s:i, s:i, s:I, s:s}", "bufferView", view, "componentType", 5125, "count",
                            (json_int_t)mesh->triangle_count * 3, "type", "SCALAR"));
}

int demo_add_mesh(demo_scene *scene, const char *name, demo_mesh *mesh, int material)
{
    int index = 0;
    check(scene, !mesh->out_of_memory);
    if (scene->status == KNURL_OK) {
        int position = add_floats(scene, mesh->positions, mesh->vertex_count, 3);
        int normal = add_floats(scene, mesh->normals, mesh->vertex_count, 3);
        int texcoord = add_floats(scene, mesh->texcoords, mesh->vertex_count, 2);
        int indices = add_indices(scene, mesh);
        index = append(scene, "meshes",
                       json_pack("{s:s, s:[{s:{s:i, s:i, s:i}, s:i, s:i}]}", "name", name, "primitives",
                                 "attributes", "POSITION", position, "NORMAL", normal, "TEXCOORD_0", texcoord,
                                 "indices", indices, "material", material));
        scene->triangles += mesh->triangle_count;
        if (material < 64 && (scene->displacing[material / 32] >> (material % 32) & 1))
            scene->displaced += mesh->triangle_count;
    }
    demo_mesh_release(mesh);
    return index;
}

static json_t *add_root_node(demo_scene *scene, const char *name)
{
    json_t *node = json_object();
    put(scene, node, "name", json_string(name));
    int index = append(scene, "nodes", node);
    check(scene, json_array_append_new(list(scene, scene->scene_root, "nodes"), json_integer(index)) == 0);
    return node;
}

static void place_rotation(const demo_place *place, double quaternion[4])
{
    const double *axis = place->axis;
    double length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    double half = place->angle * DEMO_PI / 360, s = length > 0 ? sin(half) / length : 0,
           c = length > 0 ? cos(half) : 1;
    double turn = place->heading * DEMO_PI / 360, sy = sin(turn), cy = cos(turn);
    /* The product of (0, sy, 0, cy) and (axis * s, c). */
    quaternion[0] = cy * axis[0] * s + sy * axis[2] * s;
    quaternion[1] = cy * axis[1] * s + sy * c;
    quaternion[2] = cy * axis[2] * s - sy * axis[0] * s;
    quaternion[3] = cy * c - sy * axis[1] * s;
}

void demo_add_node(demo_scene *scene, const char *name, int mesh, const demo_place *place)
{
    if (scene->status != KNURL_OK) return;
    json_t *node = add_root_node(scene, name);
    put(scene, node, "mesh", json_integer(mesh));
    if (!place) return;
    put(scene, node, "translation", numbers(scene, place->position, 3));
    double rotation[4];
    place_rotation(place, rotation);
    put(scene, node, "rotation", numbers(scene, rotation, 4));
}

/* Unit quaternion that turns -z to `direction` and keeps x level: first up or down, then around y. */
static void look_rotation(const double direction[3], double quaternion[4])
{
    double level = hypot(direction[0], direction[2]);
    double yaw = level > 0 ? atan2(-direction[0], -direction[2]) : 0, pitch = atan2(direction[1], level);
    double cy = cos(0.5 * yaw), sy = sin(0.5 * yaw), cp = cos(0.5 * pitch), sp = sin(0.5 * pitch);
    quaternion[0] = cy * sp;
    quaternion[1] = sy * cp;
    quaternion[2] = -sy * sp;
    quaternion[3] = cy * cp;
}

void demo_add_camera(demo_scene *scene, const demo_camera *camera)
{
    if (scene->status != KNURL_OK) return;
    double direction[3], rotation[4];
    for (int k = 0; k < 3; k++) direction[k] = camera->target[k] - camera->eye[k];
    look_rotation(direction, rotation);
    json_t *json = json_pack("{s:s, s:{s:f, s:f, s:f}}", "type", "perspective", "perspective", "aspectRatio",
                             16.0 / 9.0, "yfov", camera->yfov * DEMO_PI / 180, "znear", 0.01);
    if (camera->lens_radius > 0)
        put(scene, json, "extras",
            json_pack("{s:f, s:f}", "lens_radius", camera->lens_radius, "focus_distance",
                      camera->focus_distance));
    int index = append(scene, "cameras", json);
    json_t *node = add_root_node(scene, "camera");
    put(scene, node, "camera", json_integer(index));
    put(scene, node, "translation", numbers(scene, camera->eye, 3));
    put(scene, node, "rotation", numbers(scene, rotation, 4));
}

void demo_add_sun(demo_scene *scene, const double direction[3], const double color[3], double lux)
{
    if (scene->status != KNURL_OK) return;
    use_extension(scene, "KHR_lights_punctual");
    json_t *extensions = child(scene, scene->root, "extensions");
    json_t *lights = list(scene, child(scene, extensions, "KHR_lights_punctual"), "lights");
    json_t *light = json_pack("{s:s, s:s, s:f}", "type", "directional", "name", "sun", "intensity", lux);
    put(scene, light, "color", numbers(scene, color, 3));
    check(scene, json_array_append_new(lights, light) == 0);
    double rotation[4];
    look_rotation(direction, rotation);
    json_t *node = add_root_node(scene, "sun");
    put(scene, node, "rotation", numbers(scene, rotation, 4));
    put(scene, node, "extensions",
        json_pack("{s:{s:i}}", "KHR_lights_punctual", "light", (int)json_array_size(lights) - 1));
}

void demo_add_environment(demo_scene *scene, const char *file, double intensity, double rotation)
{
    if (scene->status != KNURL_OK) return;
    put(scene, scene->scene_root, "extras",
        json_pack("{s:{s:s, s:f, s:f}}", "environment", "image", file, "intensity", intensity, "rotation",
                  rotation));
}
