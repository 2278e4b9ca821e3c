/* A potentiometer of 270 degrees between ground and supply, its wiper on an analogue input with 1 MOhm to ground. For a first
 * evening: it wears out, and does not turn all the way round. */
#ifndef POTENTIOMETER_H
#define POTENTIOMETER_H

#include "hardware.h"
#include "spi.h"

/* 1024 counts over 270 degrees. */
#define POTENTIOMETER_COUNTS 1365u

static inline uint8_t potentiometer_read(uint8_t input, uint16_t *count)
{
    enum { LEAST = 4, MOST = 1019 };
    *count = analogue_read(input);
    /* The ends of the track: an open wiper or a loose wire. */
    return *count < LEAST || *count > MOST ? NO_DATA : READING_OK;
}

#endif
