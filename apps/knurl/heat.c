/* heat.c: heat colours. */
#include "heat.h"

void heat_color(double x, uint8_t color[3])
{
    static const double stops[6][3] = {{0, 0, 0},         {0.15, 0.05, 0.45}, {0.65, 0.1, 0.5},
                                       {0.98, 0.45, 0.1}, {1, 0.9, 0.2},      {1, 1, 1}};
    double place = (x < 0 ? 0 : x > 1 ? 1 : x) * 5;
    int below = place < 5 ? (int)place : 4;
    double part = place - below;
    for (int i = 0; i < 3; i++)
        color[i] = (uint8_t)(255 * (stops[below][i] * (1 - part) + stops[below + 1][i] * part) + 0.5);
}
