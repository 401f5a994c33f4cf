/* MTL, and with a first byte that is odd OBJ, from memory. No other file is opened. */
#include <stdlib.h>
#include <string.h>

#include "data/description.h"
#include "io/mtl.h"
#include "io/scene.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size == 0) return 0;
    knurl_context_def def = knurl_context_def_default();
    def.threads = 1;
    def.memory_limit = UINT64_C(1) << 30;
    knurl_context *context;
    if (knurl_context_create(&def, &context, NULL) != KNURL_OK) return 0;
    unsigned char *bytes = knurl_alloc(context, size);
    knurl_description *d = description_new(context, "fuzz.obj");
    if (bytes && d) {
        memcpy(bytes, data + 1, size - 1);
        bytes[size - 1] = 0;
        knurl_error error;
        knurl_status status = data[0] % 2 ? obj_read(d, bytes, size - 1, false, &error)
                                          : mtl_read(d, bytes, size - 1, "fuzz.mtl", &error);
        if (status == KNURL_OK) (void)description_finish(d, &error);
    }
    knurl_description_release(d);
    knurl_free(context, bytes);
    /* A leak is a failure, too. */
    if (knurl_context_bytes(context) != 0) abort();
    knurl_context_release(context);
    return 0;
}
