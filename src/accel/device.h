/* accel/device.h: the Embree device. Private to this folder, the only one that sees Embree. */
#ifndef KNURL_SRC_ACCEL_DEVICE_H
#define KNURL_SRC_ACCEL_DEVICE_H

#include "accel/bvh.h"

#include <knurl/embree.h>

#include <pthread.h>

struct accel_device {
    knurl_context *context;
    atomic_size_t references;
    RTCDevice device;
    size_t lanes; /* of its widest packets: 16, 8, 4, or 0 if it has none */
    atomic_llong bytes;
    pthread_mutex_t lock; /* guards the two below: Embree reports from its build threads */
    enum RTCError failure;
    char message[256];
};

struct accel_bvh {
    accel_device *device;
    RTCScene scene;          /* NULL if there is nothing in it, or one box only */
    accel_bounds_fn *bounds; /* NULL: Embree's own geometry (native.c) */
    const void *user;
    accel_box box;
    bool empty;        /* the box is */
    vec3 centre, half; /* of the bounds; half is padded */
    double scale;      /* Embree sees (x - centre) * scale: see bvh.c */
};

/* Half of the box about bvh->centre, padded for clipping rays. */
void accel_bvh_set_half(accel_bvh *bvh);
/* The segment as Embree sees it: tnear 0, tfar not set; *rate is Embree's t per t. False if it cannot be
 * traced. */
bool accel_bvh_start_ray(const accel_bvh *bvh, const accel_segment *segment, struct RTCRay *ray,
                         double *rate);
/* tfar for a tmax, rounded up. */
float accel_bvh_tfar(double tmax, double t0, double rate);

accel_device *accel_device_retain(accel_device *device);
/* The first error since the last call as a status, with "building WHAT" in its message. */
knurl_status accel_device_check(accel_device *device, const char *what, knurl_error *error);

#endif
