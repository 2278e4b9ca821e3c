/* MT6701, a 14-bit magnetic rotation sensor, on its serial port SSI (by its data sheet): 24 bits, of which 14 are the angle,
 * 4 the state of the magnet and 6 a checksum over both. */
#ifndef MT6701_H
#define MT6701_H

#include "hardware.h"
#include "spi.h"

#define MT6701_COUNTS 16384u

/* CRC-6 with polynomial x^6 + x + 1, start 0, over 18 bits, highest first. */
static inline uint8_t mt6701_crc(uint32_t bits)
{
    uint8_t crc = 0;
    for (uint32_t bit = 1ul << 17; bit != 0; bit >>= 1) {
        uint8_t carry = (uint8_t)((crc >> 5 & 1) ^ ((bits & bit) != 0));
        crc = (uint8_t)((crc << 1 & 0x3F) ^ (carry ? 0x03 : 0));
    }
    return crc;
}

static inline uint8_t mt6701_read(uint8_t line, uint16_t *count)
{
    enum { TOO_STRONG = 1, TOO_WEAK = 2, LOST = 8 };
    uint32_t bits = 0;
    spi_select(line, 1);
    for (uint8_t i = 0; i < 3; i++)
        bits = bits << 8 | spi_exchange(0);
    spi_select(line, 0);
    uint8_t state = bits >> 6 & 15;
    *count = (uint16_t)(bits >> 10);
    if (mt6701_crc(bits >> 6) != (bits & 0x3F) || (state & LOST) != 0)
        return NO_DATA;
    return (state & (TOO_STRONG | TOO_WEAK)) != 0 ? MAGNET_WEAK : READING_OK;
}

#endif
