/* heat.h: heat colours. */
#ifndef APP_HEAT_H
#define APP_HEAT_H

#include <stdint.h>

/* Black, blue, magenta, orange, yellow, white for x from 0 to 1; beyond, the ends. */
void heat_color(double x, uint8_t color[3]);

#endif
