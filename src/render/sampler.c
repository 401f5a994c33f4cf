/* Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020. Direction numbers: Joe and Kuo,
 * new-joe-kuo-6.21201 (2008), dimensions 1 to 4. The hash is Laine and Karras' permutation with the
 * constants of Vegdahl (2021), which avalanche better than the original ones. */
#include "render/sampler.h"

/* Four dimensions side by side, so that one pass over the index's bits serves all. */
static const uint32_t sobol_directions[32][4] = {
    {0x80000000, 0x80000000, 0x80000000, 0x80000000}, {0x40000000, 0xc0000000, 0xc0000000, 0xc0000000},
    {0x20000000, 0xa0000000, 0x60000000, 0x20000000}, {0x10000000, 0xf0000000, 0x90000000, 0x50000000},
    {0x08000000, 0x88000000, 0xe8000000, 0xf8000000}, {0x04000000, 0xcc000000, 0x5c000000, 0x74000000},
    {0x02000000, 0xaa000000, 0x8e000000, 0xa2000000}, {0x01000000, 0xff000000, 0xc5000000, 0x93000000},
    {0x00800000, 0x80800000, 0x68800000, 0xd8800000}, {0x00400000, 0xc0c00000, 0x9cc00000, 0x25400000},
    {0x00200000, 0xa0a00000, 0xee600000, 0x59e00000}, {0x00100000, 0xf0f00000, 0x55900000, 0xe6d00000},
    {0x00080000, 0x88880000, 0x80680000, 0x78080000}, {0x00040000, 0xcccc0000, 0xc09c0000, 0xb40c0000},
    {0x00020000, 0xaaaa0000, 0x60ee0000, 0x82020000}, {0x00010000, 0xffff0000, 0x90550000, 0xc3050000},
    {0x00008000, 0x80008000, 0xe8808000, 0x208f8000}, {0x00004000, 0xc000c000, 0x5cc0c000, 0x51474000},
    {0x00002000, 0xa000a000, 0x8e606000, 0xfbea2000}, {0x00001000, 0xf000f000, 0xc5909000, 0x75d93000},
    {0x00000800, 0x88008800, 0x6868e800, 0xa0858800}, {0x00000400, 0xcc00cc00, 0x9c9c5c00, 0x914e5400},
    {0x00000200, 0xaa00aa00, 0xeeee8e00, 0xdbe79e00}, {0x00000100, 0xff00ff00, 0x5555c500, 0x25db6d00},
    {0x00000080, 0x80808080, 0x8000e880, 0x58800080}, {0x00000040, 0xc0c0c0c0, 0xc0005cc0, 0xe54000c0},
    {0x00000020, 0xa0a0a0a0, 0x60008e60, 0x79e00020}, {0x00000010, 0xf0f0f0f0, 0x9000c590, 0xb6d00050},
    {0x00000008, 0x88888888, 0xe8006868, 0x800800f8}, {0x00000004, 0xcccccccc, 0x5c009c9c, 0xc00c0074},
    {0x00000002, 0xaaaaaaaa, 0x8e00eeee, 0x200200a2}, {0x00000001, 0xffffffff, 0xc5005555, 0x50050093},
};

void sampler_sobol(uint32_t index, uint32_t x[4])
{
    x[0] = x[1] = x[2] = x[3] = 0;
    for (uint32_t bit = 0; bit < 32; bit++) {
        uint32_t mask = 0u - (index >> bit & 1u);
        for (int d = 0; d < 4; d++) x[d] ^= sobol_directions[bit][d] & mask;
    }
}

static uint32_t reverse_bits(uint32_t x)
{
    x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
    return __builtin_bswap32(x);
}

/* Each bit is flipped depending on lower bits only: in reversed order, an Owen scramble. */
static uint32_t laine_karras(uint32_t x, uint32_t seed)
{
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

static uint32_t owen_scramble(uint32_t x, uint32_t seed)
{
    return reverse_bits(laine_karras(reverse_bits(x), seed));
}

/* Full-avalanche integer hash ("lowbias32", Wellons 2018). */
static uint32_t hash32(uint32_t x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

static uint32_t combine(uint32_t a, uint32_t b)
{
    return hash32(a ^ (hash32(b + 0x9e3779b9u) + 0x9e3779b9u + (a << 6) + (a >> 2)));
}

sampler sampler_make(uint32_t seed, uint32_t x, uint32_t y, uint32_t index)
{
    return (sampler){combine(combine(hash32(seed), x), y), index};
}

sample4 sampler_get(const sampler *s, uint32_t group)
{
    uint32_t seed = combine(s->seed, group);
    uint32_t index = owen_scramble(s->index, seed);
    uint32_t x[4];
    sampler_sobol(index, x);
    sample4 point;
    for (uint32_t d = 0; d < 4; d++) point.u[d] = (double)owen_scramble(x[d], combine(seed, d + 1)) * 0x1p-32;
    return point;
}

double sampler_hash(const sampler *s, uint32_t a, uint32_t b)
{
    return (double)combine(combine(combine(s->seed, s->index ^ 0x5bd1e995u), a), b) * 0x1p-32;
}
