/* embree_sample.c: a displaced sphere in an ordinary Embree scene.
 *
 *     embree_sample [picture.png]
 *
 * The floor is an Embree triangle mesh, as in any Embree program. The sphere is a knurl surface: 384
 * triangles and a 512 x 256 map, traced as if every texel had been tessellated. The lines that
 * concern knurl are marked with (k). */
#include <knurl/embree.h> /* (k) includes rtcore.h, and knurl/surface.h */

#include <stdio.h>
#include <stdlib.h>

enum { WIDTH = 640, HEIGHT = 480, ROWS = 12, COLUMNS = 16, MAP_WIDTH = 512, MAP_HEIGHT = 256 };
static const double PI = 3.14159265358979323846;

/* (k) Any image will do as a height map; this one is made of waves. */
static knurl_heightmap *make_map(knurl_context *context)
{
    static float samples[MAP_WIDTH * MAP_HEIGHT];
    for (int y = 0; y < MAP_HEIGHT; y++)
        for (int x = 0; x < MAP_WIDTH; x++) {
            double u = 2 * PI * x / MAP_WIDTH, v = PI * (y + 0.5) / MAP_HEIGHT, w = sin(v);
            double bumps = w * w * (cos(16 * u) * cos(16 * v) + 0.3 * cos(48 * u + 30 * v));
            samples[y * MAP_WIDTH + x] = (float)(0.5 + 0.4 * bumps);
        }
    knurl_image *image = NULL;
    knurl_heightmap *map = NULL;
    if (knurl_image_create(context, MAP_WIDTH, MAP_HEIGHT, 1, KNURL_PIXEL_F32, samples, &image, NULL) ==
        KNURL_OK) {
        knurl_heightmap_def def = knurl_heightmap_def_default();
        def.image = image;
        (void)knurl_heightmap_create(context, &def, &map, NULL); /* copies what it needs */
        knurl_image_release(image);
    }
    return map;
}

/* (k) The base mesh: a coarse sphere, its normals equal to its positions. */
static knurl_surface *make_sphere(knurl_context *context, knurl_heightmap *map, knurl_error *error)
{
    static float positions[(ROWS + 1) * (COLUMNS + 1) * 3], texcoords[(ROWS + 1) * (COLUMNS + 1) * 2];
    static uint32_t triangles[ROWS * COLUMNS * 6];
    for (uint32_t r = 0, i = 0; r <= ROWS; r++)
        for (uint32_t c = 0; c <= COLUMNS; c++, i++) {
            double theta = PI * r / ROWS,
                   phi = 2 * PI * (c % COLUMNS) / COLUMNS; /* the seam closes exactly */
            positions[3 * i] = (float)(sin(theta) * cos(phi));
            positions[3 * i + 1] = (float)cos(theta);
            positions[3 * i + 2] = (float)(sin(theta) * sin(phi));
            texcoords[2 * i] = (float)c / COLUMNS;
            texcoords[2 * i + 1] = (float)r / ROWS;
        }
    uint32_t *t = triangles;
    for (uint32_t r = 0; r < ROWS; r++)
        for (uint32_t c = 0; c < COLUMNS; c++) {
            uint32_t a = r * (COLUMNS + 1) + c, b = a + COLUMNS + 1;
            *t++ = a, *t++ = a + 1, *t++ = b;
            *t++ = a + 1, *t++ = b + 1, *t++ = b;
        }
    knurl_surface_def def = knurl_surface_def_default();
    def.mesh.positions = def.mesh.normals = positions;
    def.mesh.texcoords = texcoords;
    def.mesh.vertex_count = (ROWS + 1) * (COLUMNS + 1);
    def.mesh.triangles = triangles;
    def.mesh.triangle_count = ROWS * COLUMNS * 2;
    def.displacement.map = map;
    def.displacement.factor = 0.2; /* h = -0.1 + 0.2 * map */
    def.displacement.offset = -0.1;
    def.displacement.wrap_v = KNURL_WRAP_CLAMP;
    knurl_surface *surface = NULL;
    (void)knurl_surface_create(context, &def, &surface, error);
    return surface;
}

/* Nothing of knurl here. */
static void add_floor(RTCDevice device, RTCScene scene)
{
    static const float corners[12] = {-9, -1.1f, -9, 9, -1.1f, -9, 9, -1.1f, 9, -9, -1.1f, 9};
    static const unsigned int indices[6] = {0, 2, 1, 0, 3, 2};
    RTCGeometry floor = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    memcpy(rtcSetNewGeometryBuffer(floor, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 4), corners,
           sizeof corners);
    memcpy(rtcSetNewGeometryBuffer(floor, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 2), indices,
           sizeof indices);
    rtcCommitGeometry(floor);
    rtcAttachGeometry(scene, floor);
    rtcReleaseGeometry(floor);
}

/* One pixel: a camera ray, a lamp, a shadow ray. Hits on both geometries are used alike. */
static void shade(RTCScene scene, unsigned int sphere, int x, int y, unsigned char rgb[3])
{
    struct RTCRayHit q;
    memset(&q, 0, sizeof q);
    q.ray.org_y = 0.7f, q.ray.org_z = 4.2f;
    q.ray.dir_x = ((float)x + 0.5f - WIDTH / 2) / HEIGHT;
    q.ray.dir_y = (HEIGHT / 2 - (float)y - 0.5f) / HEIGHT - 0.2f;
    q.ray.dir_z = -1.2f;
    q.ray.tfar = INFINITY;
    q.ray.mask = 0xFFFFFFFFu;
    q.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    knurl_embree_intersect1(scene, NULL, &q); /* rtcIntersect1 of either Embree */
    rgb[0] = 70, rgb[1] = 90, rgb[2] = 120;
    if (q.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;

    const float n = sqrtf(q.hit.Ng_x * q.hit.Ng_x + q.hit.Ng_y * q.hit.Ng_y + q.hit.Ng_z * q.hit.Ng_z);
    const float light[3] = {0.5f, 0.7f, 0.5f};
    struct RTCRay shadow;
    memset(&shadow, 0, sizeof shadow);
    shadow.org_x = q.ray.org_x + q.ray.tfar * q.ray.dir_x + 1e-4f * q.hit.Ng_x / n;
    shadow.org_y = q.ray.org_y + q.ray.tfar * q.ray.dir_y + 1e-4f * q.hit.Ng_y / n;
    shadow.org_z = q.ray.org_z + q.ray.tfar * q.ray.dir_z + 1e-4f * q.hit.Ng_z / n;
    shadow.dir_x = light[0], shadow.dir_y = light[1], shadow.dir_z = light[2];
    shadow.tfar = INFINITY;
    shadow.mask = 0xFFFFFFFFu;
    knurl_embree_occluded1(scene, NULL, &shadow);
    float cosine = (q.hit.Ng_x * light[0] + q.hit.Ng_y * light[1] + q.hit.Ng_z * light[2]) / n;
    float bright = 0.12f + (cosine > 0.0f && shadow.tfar > 0.0f ? 0.85f * cosine : 0.0f);
    const float color[2][3] = {{0.6f, 0.6f, 0.58f}, {0.9f, 0.55f, 0.3f}};
    for (int k = 0; k < 3; k++)
        rgb[k] = (unsigned char)(255.0f * sqrtf(bright * color[q.hit.geomID == sphere][k]));
}

int main(int argc, char **argv)
{
    const char *path = argc > 1 ? argv[1] : "embree_sample.png";
    knurl_error error = {0};
    knurl_context_def def = knurl_context_def_default();
    knurl_context *context = NULL;
    knurl_context_create(&def, &context, &error);                            /* (k) */
    knurl_heightmap *map = context ? make_map(context) : NULL;               /* (k) */
    knurl_surface *surface = map ? make_sphere(context, map, &error) : NULL; /* (k) */
    if (!surface) {
        fprintf(stderr, "embree_sample: %s\n", error.message);
        return EXIT_FAILURE;
    }
    RTCDevice device = rtcNewDevice(NULL);
    RTCScene scene = rtcNewScene(device);
    unsigned int sphere = knurl_embree_attach(device, scene, surface); /* (k) all there is to it */
    add_floor(device, scene);
    rtcCommitScene(scene);

    static unsigned char pixels[WIDTH * HEIGHT * 3];
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) shade(scene, sphere, x, y, pixels + 3 * (y * WIDTH + x));
    knurl_image *picture = NULL;
    knurl_status status =
        knurl_image_create(context, WIDTH, HEIGHT, 3, KNURL_PIXEL_U8, pixels, &picture, &error);
    if (status == KNURL_OK) status = knurl_image_save(context, picture, path, &error);
    if (status != KNURL_OK) fprintf(stderr, "embree_sample: %s\n", error.message);

    rtcReleaseScene(scene); /* before the surface, which it does not hold */
    rtcReleaseDevice(device);
    knurl_image_release(picture);
    knurl_surface_release(surface);
    knurl_heightmap_release(map);
    knurl_context_release(context);
    return status == KNURL_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}
