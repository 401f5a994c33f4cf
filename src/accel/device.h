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
    atomic_llong bytes;
    pthread_mutex_t lock; /* guards the two below: Embree reports from its build threads */
    enum RTCError failure;
    char message[256];
};

accel_device *accel_device_retain(accel_device *device);
/* The first error since the last call as a status, with "building WHAT" in its message. */
knurl_status accel_device_check(accel_device *device, const char *what, knurl_error *error);

#endif
