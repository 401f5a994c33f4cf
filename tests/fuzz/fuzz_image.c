/* Decodes arbitrary bytes as an image, within limits that keep a run short. */
#include <knurl/image.h>

#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    knurl_context_def def = knurl_context_def_default();
    def.threads = 1;
    def.memory_limit = UINT64_C(256) << 20;
    def.max_image_pixels = UINT64_C(1) << 22;
    knurl_context *context = NULL;
    if (knurl_context_create(&def, &context, NULL) != KNURL_OK) return 0;
    knurl_image *image = NULL;
    knurl_error error;
    if (knurl_image_decode(context, data, size, "input", &image, &error) == KNURL_OK) {
        const unsigned char *samples = knurl_image_samples(image);
        size_t bytes = (size_t)knurl_image_width(image) * (size_t)knurl_image_height(image) *
                       (size_t)knurl_image_channels(image) * (size_t)knurl_image_format(image);
        unsigned sum = 0;
        for (size_t i = 0; i < bytes; i++) sum += samples[i];
        volatile unsigned used = sum;
        (void)used;
    } else if (image) {
        abort(); /* a failed call gives no image */
    }
    knurl_image_release(image);
    if (knurl_context_bytes(context) != 0) abort(); /* something was left behind */
    knurl_context_release(context);
    return 0;
}
