/* render/albedo.h: how much light one bounce off GGX reflects, tabulated.
 *
 * With Schlick's Fresnel, the reflected part is f0 (E - B) + B, where E is the albedo for F = 1 and B
 * that for F = (1 - cos)^5. */
#ifndef KNURL_SRC_RENDER_ALBEDO_H
#define KNURL_SRC_RENDER_ALBEDO_H

#include "base/base.h"

enum { ALBEDO_COSINES = 32, ALBEDO_ROUGHNESSES = 32 };

typedef struct albedo {
    double e, b;
} albedo;

typedef struct albedo_table {
    float e[ALBEDO_ROUGHNESSES][ALBEDO_COSINES];
    float b[ALBEDO_ROUGHNESSES][ALBEDO_COSINES];
    float e_mean[ALBEDO_ROUGHNESSES], b_mean[ALBEDO_ROUGHNESSES]; /* cosine-weighted over directions */
} albedo_table;

/* Fills the table on the context's threads, about 10 ms of one core. */
void albedo_build(knurl_context *context, albedo_table *table);
albedo albedo_lookup(const albedo_table *table, double cosine, double alpha);
albedo albedo_mean(const albedo_table *table, double alpha);

#endif
