/* capture_view.c: frames and frusta of the views, and their rays. */
#include "capture.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Depths this close to a frustum's apex, as a fraction of the front face's, are left out: all rays meet
 * there. */
static const double LEAST_DEPTH = 0x1p-10;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    double result[3];
    for (int i = 0; i < 3; i++) result[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
    memcpy(out, result, sizeof result);
}

static void normalize(double v[3])
{
    double length = sqrt(dot(v, v));
    for (int i = 0; i < 3; i++) v[i] /= length;
}

/* Axes of exactly 0 and 1 stay so: views of a cube then agree bit for bit on their shared edges. Seen from
 * above, -z points up in the picture, seen from below, z. */
static void make_axes(const double from[3], capture_view *view)
{
    memcpy(view->out, from, sizeof view->out);
    normalize(view->out);
    double up[3] = {0, 1, 0};
    if (fabs(view->out[1]) > 1 - 1e-9) {
        up[1] = 0;
        up[2] = view->out[1] > 0 ? -1 : 1;
    }
    cross(up, view->out, view->right);
    normalize(view->right);
    cross(view->out, view->right, view->up);
    for (int i = 0; i < 3; i++) { /* no -0 in files */
        view->right[i] += 0.0;
        view->up[i] += 0.0;
        view->out[i] += 0.0;
    }
}

bool capture_box(const capture_options *options, const knurl_scene *scene, double box[6])
{
    knurl_scene_bounds(scene, box, box + 3);
    for (int i = 0; i < 3 && options->clipped; i++) {
        box[i] = fmax(box[i], options->clip[i]);
        box[i + 3] = fmin(box[i + 3], options->clip[i + 3]);
    }
    for (int i = 0; i < 6; i++)
        if (!isfinite(box[i])) return false;
    return box[0] <= box[3] && box[1] <= box[4] && box[2] <= box[5];
}

static int32_t texels(int32_t longest, double side, double longer)
{
    double n = ceil(longest * side / longer - 1e-6);
    return n < 2 ? 2 : (int32_t)n;
}

/* The map's sides in proportion to the view's. */
static void choose_texels(const capture_options *options, capture_view *view)
{
    double longer = fmax(view->scale[0], view->scale[1]);
    int32_t color = options->color_size ? options->color_size : options->size;
    view->width = texels(options->size, view->scale[0], longer);
    view->height = texels(options->size, view->scale[1], longer);
    view->color_width = texels(color, view->scale[0], longer);
    view->color_height = texels(color, view->scale[1], longer);
}

/* Corners of the box in the frame at `center`. */
static void frame_corners(const capture_view *view, const double box[6], const double center[3],
                          double corners[8][3])
{
    for (int c = 0; c < 8; c++) {
        double p[3];
        for (int i = 0; i < 3; i++) p[i] = box[c >> i & 1 ? i + 3 : i] - center[i];
        corners[c][0] = dot(p, view->right);
        corners[c][1] = dot(p, view->up);
        corners[c][2] = dot(p, view->out);
    }
}

/* Distance of the apex from the box's centre, along -out (reverse) or out: each corner is within the angle.
 */
static double apex_distance(double corners[8][3], double sign, double tangent)
{
    double distance = 0;
    for (int c = 0; c < 8; c++)
        for (int i = 0; i < 2; i++)
            distance = fmax(distance, fabs(corners[c][i]) / tangent - sign * corners[c][2]);
    return distance;
}

/* Range of z and half sizes that hold all corners; the apex of a frustum is `apex` away. */
static void fit_corners(capture_view *view, double corners[8][3], double apex)
{
    view->front = -INFINITY;
    view->back = INFINITY;
    view->scale[0] = view->scale[1] = 0;
    for (int c = 0; c < 8; c++) {
        double z = corners[c][2] + apex;
        view->front = fmax(view->front, z);
        view->back = fmin(view->back, z);
        double width = view->frustum == CAPTURE_PARALLEL ? 1 : fabs(z);
        for (int i = 0; i < 2; i++) view->scale[i] = fmax(view->scale[i], fabs(corners[c][i]) / width);
    }
}

static void fit_single(const capture_options *options, const double box[6], const double center[3],
                       double size, capture_view *view)
{
    view->name = "";
    view->frustum = options->frustum;
    make_axes(options->from, view);
    double corners[8][3], apex = 0;
    frame_corners(view, box, center, corners);
    if (view->frustum != CAPTURE_PARALLEL) {
        double sign = view->frustum == CAPTURE_REVERSE ? 1 : -1;
        apex = apex_distance(corners, sign, tan(0.5 * options->fov));
        double deepest = 0;
        for (int c = 0; c < 8; c++) deepest = fmax(deepest, -sign * corners[c][2]);
        /* A box that is thin across the axis still needs room between it and the apex. */
        apex = sign * fmax(apex, deepest + 1e-3 * size);
    }
    fit_corners(view, corners, apex);
    for (int i = 0; i < 3; i++) view->origin[i] = center[i] - apex * view->out[i];
    /* One texel more on each side, so that the model's outline is inside the picture. Flat models keep a
     * little width. */
    double longer = fmax(view->scale[0], view->scale[1]);
    for (int i = 0; i < 2; i++)
        view->scale[i] = fmax(view->scale[i], 1e-3 * longer) + 2 * longer / (options->size - 1);
    double room = 1e-6 * size; /* for the rounding of bounds and rays */
    view->front += view->frustum == CAPTURE_PERSPECTIVE ? fmin(room, -0.5 * view->front) : room;
    view->back -= view->frustum == CAPTURE_REVERSE ? fmin(room, 0.5 * view->back) : room;
}

static void fit_cube(const double center[3], double half, capture_view *views)
{
    static const char *const names[6] = {"px", "nx", "py", "ny", "pz", "nz"};
    for (int k = 0; k < 6; k++) {
        capture_view *view = &views[k];
        double from[3] = {0};
        from[k / 2] = k % 2 ? -1 : 1;
        view->name = names[k];
        view->frustum = CAPTURE_REVERSE;
        make_axes(from, view);
        memcpy(view->origin, center, sizeof view->origin);
        view->scale[0] = view->scale[1] = 1;
        view->front = half;
        view->back = LEAST_DEPTH * half;
    }
}

/* Applies --near and --far, which count from the front face; false if nothing is left. */
static bool cut_depths(const capture_options *options, capture_view *view)
{
    double front = view->front;
    view->front = front - options->near_cut;
    view->back = fmax(view->back, front - options->far_cut);
    return view->front > view->back;
}

int capture_views_fit(const capture_options *options, const double box[6], capture_view *views,
                      char message[200])
{
    memset(views, 0, CAPTURE_MOST_VIEWS * sizeof *views);
    double center[3], half = 0, size = 0;
    for (int i = 0; i < 3; i++) {
        center[i] = isnan(options->center[i]) ? 0.5 * (box[i] + box[i + 3]) : options->center[i];
        half = fmax(half, fmax(fabs(box[i] - center[i]), fabs(box[i + 3] - center[i])));
        size = fmax(size, box[i + 3] - box[i]);
    }
    if (!(size > 0)) {
        (void)snprintf(message, 200, "the model has no size");
        return 0;
    }
    if (options->views == 6)
        fit_cube(center, half * (1 + 1e-6), views);
    else
        fit_single(options, box, center, size, views);
    for (int k = 0; k < options->views; k++) {
        double front = views[k].front, depth = front - views[k].back;
        if (!cut_depths(options, &views[k])) {
            (void)snprintf(message, 200, "--near and --far: found %g and %g, expected depths from 0 to %g",
                           options->near_cut, options->far_cut, depth);
            return 0;
        }
        /* Heights over the back of a single view, as one paints a relief; below the faces of a cube, whose
         * rays meet at its back. */
        views[k].base = options->views == 6 ? front : views[k].back;
        choose_texels(options, &views[k]);
    }
    return options->views;
}

void capture_picture(const capture_view *view, double x, double y, double picture[2])
{
    double last_x = view->width - 1, last_y = view->height - 1;
    picture[0] = (2 * x - last_x) / last_x;
    picture[1] = (last_y - 2 * y) / last_y;
}

void capture_direction(const capture_view *view, const double picture[2], double direction[3])
{
    double sign = view->frustum == CAPTURE_PARALLEL ? 0 : view->frustum == CAPTURE_REVERSE ? 1 : -1;
    for (int i = 0; i < 2; i++) direction[i] = sign * picture[i] * view->scale[i];
    direction[2] = 1;
}

void capture_point(const capture_view *view, const double picture[2], double z, double point[3])
{
    capture_direction(view, picture, point);
    bool parallel = view->frustum == CAPTURE_PARALLEL;
    for (int i = 0; i < 2; i++) point[i] = parallel ? picture[i] * view->scale[i] : point[i] * z;
    point[2] = z;
}

/* Cuts [tmin, tmax] by the slabs of a box. */
static bool clip_ray(const double box[6], knurl_ray *ray)
{
    for (int i = 0; i < 3; i++) {
        double o = ray->origin[i], d = ray->direction[i];
        if (d == 0) {
            if (o < box[i] || o > box[i + 3]) return false;
            continue;
        }
        double a = (box[i] - o) / d, b = (box[i + 3] - o) / d;
        ray->tmin = fmax(ray->tmin, fmin(a, b));
        ray->tmax = fmin(ray->tmax, fmax(a, b));
    }
    return ray->tmin <= ray->tmax;
}

bool capture_ray(const capture_view *view, double x, double y, const double *box, knurl_ray *ray)
{
    double picture[2], start[3], along[3], origin[3], direction[3];
    capture_picture(view, x, y, picture);
    capture_point(view, picture, view->front, start);
    capture_direction(view, picture, along);
    for (int i = 0; i < 3; i++) {
        origin[i] =
            view->origin[i] + start[0] * view->right[i] + start[1] * view->up[i] + start[2] * view->out[i];
        direction[i] = -(along[0] * view->right[i] + along[1] * view->up[i] + along[2] * view->out[i]);
    }
    *ray = knurl_ray_make(origin, direction);
    ray->tmax = view->front - view->back;
    return !box || clip_ray(box, ray);
}
