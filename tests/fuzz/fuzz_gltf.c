/* glTF and GLB from memory: containers, JSON, accessors, materials, nodes. No other file is opened. */
#include <stdlib.h>
#include <string.h>

#include "data/description.h"
#include "io/scene.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    knurl_context_def def = knurl_context_def_default();
    def.threads = 1;
    def.memory_limit = UINT64_C(1) << 30;
    knurl_context *context;
    if (knurl_context_create(&def, &context, NULL) != KNURL_OK) return 0;
    unsigned char *bytes = knurl_alloc(context, size + 1);
    knurl_description *d = description_new(context, "fuzz.gltf");
    if (bytes && d) {
        memcpy(bytes, data, size);
        bytes[size] = 0;
        knurl_error error;
        if (gltf_read(d, bytes, size, false, &error) == KNURL_OK) (void)description_finish(d, &error);
    }
    knurl_description_release(d);
    knurl_free(context, bytes);
    /* A leak is a failure, too. */
    if (knurl_context_bytes(context) != 0) abort();
    knurl_context_release(context);
    return 0;
}
