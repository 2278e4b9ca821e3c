/* AS5600 magnetic rotation sensor on I2C (data sheet v1-06). Its address is fixed, so each sits behind a channel of a
 * multiplexer. */
#ifndef AS5600_H
#define AS5600_H

#include "hardware.h"

#define AS5600_ADDRESS 0x36u
#define AS5600_COUNTS 4096u
/* STATUS, RAW ANGLE high and RAW ANGLE low are adjacent: one read gets all three, and the high and low byte match because
 * the chip latches the low byte when the high one is read. */
#define AS5600_STATUS 0x0Bu
#define AS5600_BURST 3u
#define AS5600_AGC 0x1Au
/* The gain goes up to 255 at 5 V and 128 at 3.3 V; this close to the limit the magnet is too far away. */
#ifndef AS5600_GAIN_LIMIT
#define AS5600_GAIN_LIMIT 240u
#endif

/* Interprets the three bytes. */
static inline uint8_t as5600_reading(const uint8_t *burst, uint16_t *count)
{
    enum { TOO_STRONG = 0x08, TOO_WEAK = 0x10, DETECTED = 0x20, UNUSED = 0xC7 };
    *count = (uint16_t)((burst[1] & 0x0Fu) << 8 | burst[2]);
    /* Bits that are always 0: a stuck line reads as ones. */
    if ((burst[0] & UNUSED) != 0 || (burst[1] & 0xF0u) != 0 || (burst[0] & DETECTED) == 0)
        return NO_DATA;
    return (burst[0] & (TOO_STRONG | TOO_WEAK)) != 0 ? MAGNET_WEAK : READING_OK;
}

#endif
