/* The Embree device: threads, memory count and errors. */
#include "accel/device.h"

#include <stdio.h>

static void on_error(void *user, enum RTCError code, const char *text)
{
    accel_device *device = user;
    pthread_mutex_lock(&device->lock);
    if (device->failure == RTC_ERROR_NONE) {
        device->failure = code;
        (void)snprintf(device->message, sizeof device->message, "%s", text ? text : "no message");
    }
    pthread_mutex_unlock(&device->lock);
}

/* Embree asks before it allocates (post false) and tells after it freed (post true, negative). */
static bool on_memory(void *user, ssize_t bytes, bool post)
{
    accel_device *device = user;
    long long now = atomic_fetch_add_explicit(&device->bytes, bytes, memory_order_relaxed) + bytes;
    uint64_t limit = knurl_context_get_def(device->context)->memory_limit;
    if (post || bytes <= 0 || limit == 0 || now <= 0) return true;
    /* Refusing makes Embree report that it is out of memory. */
    return (uint64_t)now + knurl_context_bytes(device->context) <= limit;
}

knurl_status accel_device_create(knurl_context *context, accel_device **out, knurl_error *error)
{
    *out = NULL;
    accel_device *device = knurl_alloc_zero(context, sizeof *device);
    if (!device) return knurl_fail_memory(error, sizeof *device, "the Embree device");
    if (pthread_mutex_init(&device->lock, NULL) != 0) {
        knurl_free(context, device);
        return knurl_fail_memory(error, sizeof device->lock, "the Embree device's lock");
    }
    device->context = knurl_context_retain(context);
    atomic_init(&device->references, 1);
    atomic_init(&device->bytes, 0);
    char config[64];
    (void)snprintf(config, sizeof config, "threads=%d", knurl_context_threads(context));
    device->device = rtcNewDevice(config);
    if (!device->device) {
        enum RTCError code = rtcGetDeviceError(NULL);
        accel_device_release(device);
        return knurl_fail(error,
                          code == RTC_ERROR_OUT_OF_MEMORY ? KNURL_ERROR_MEMORY : KNURL_ERROR_UNSUPPORTED,
                          "Embree cannot start: error %d, expected a CPU with SSE2 at least", (int)code);
    }
    device->lanes = rtcGetDeviceProperty(device->device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)  ? 16
                    : rtcGetDeviceProperty(device->device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? 8
                    : rtcGetDeviceProperty(device->device, RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED) ? 4
                                                                                                      : 0;
    rtcSetDeviceErrorFunction(device->device, on_error, device);
    rtcSetDeviceMemoryMonitorFunction(device->device, on_memory, device);
    *out = device;
    return KNURL_OK;
}

accel_device *accel_device_retain(accel_device *device)
{
    atomic_fetch_add_explicit(&device->references, 1, memory_order_relaxed);
    return device;
}

void accel_device_release(accel_device *device)
{
    if (!device || atomic_fetch_sub_explicit(&device->references, 1, memory_order_acq_rel) != 1) return;
    if (device->device) rtcReleaseDevice(device->device);
    pthread_mutex_destroy(&device->lock);
    knurl_context *context = device->context;
    knurl_free(context, device);
    knurl_context_release(context);
}

uint64_t accel_device_bytes(const accel_device *device)
{
    long long bytes = atomic_load_explicit(&((accel_device *)device)->bytes, memory_order_relaxed);
    return bytes > 0 ? (uint64_t)bytes : 0;
}

knurl_status accel_device_check(accel_device *device, const char *what, knurl_error *error)
{
    pthread_mutex_lock(&device->lock);
    enum RTCError failure = device->failure;
    device->failure = RTC_ERROR_NONE;
    char message[sizeof device->message];
    (void)snprintf(message, sizeof message, "%s", device->message);
    pthread_mutex_unlock(&device->lock);
    switch (failure) {
    case RTC_ERROR_NONE:
        return KNURL_OK;
    case RTC_ERROR_OUT_OF_MEMORY:
    case RTC_ERROR_CANCELLED: /* what a refusing memory monitor comes to */
        return knurl_fail(error, KNURL_ERROR_MEMORY, "building %s: Embree is out of memory (%s)", what,
                          message);
    default:
        return knurl_fail(error, KNURL_ERROR_UNSUPPORTED, "building %s: Embree error %d (%s)", what,
                          (int)failure, message);
    }
}
