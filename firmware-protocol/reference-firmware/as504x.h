/* AS5047P and AS5048A, 14-bit magnetic rotation sensors on SPI (by their data sheets). Words have 16 bits; the answer to a
 * request comes with the next word. AS5048A can be chained: data out of one into the next, one select line for all. */
#ifndef AS504X_H
#define AS504X_H

#include "hardware.h"
#include "spi.h"

#define AS504X_COUNTS 16384u
#define AS504X_CHAIN 3u
enum { AS504X_ERRORS = 0x0001, AS5047P_DIAGNOSIS = 0x3FFC, AS5048A_DIAGNOSIS = 0x3FFD, AS504X_ANGLE = 0x3FFF };

static inline uint8_t as504x_is_odd(uint16_t word)
{
    word ^= word >> 8;
    word ^= word >> 4;
    return (0x6996u >> (word & 15)) & 1;
}

/* One word for each sensor of the chain, out and in. The first word received is from the last sensor. */
static inline void as504x_exchange(uint8_t line, uint16_t out, uint16_t *in, uint8_t count)
{
    spi_select(line, 1);
    for (uint8_t i = count; i-- > 0;) {
        uint16_t high = spi_exchange((uint8_t)(out >> 8));
        in[i] = (uint16_t)(high << 8 | spi_exchange((uint8_t)out));
    }
    spi_select(line, 0);
}

/* Reads a register of every sensor of the chain. A word that is damaged or has its error flag set becomes 0xFFFF. */
static inline void as504x_read(uint8_t line, uint16_t address, uint16_t *words, uint8_t count)
{
    enum { READ = 0x4000, PARITY = 0x8000, ERROR = 0x4000, DATA = 0x3FFF };
    uint16_t command = READ | address;
    uint8_t failed = 0;
    if (as504x_is_odd(command))
        command |= PARITY;
    as504x_exchange(line, command, words, count);
    as504x_exchange(line, 0, words, count);
    for (uint8_t i = 0; i < count; i++) {
        uint8_t bad = as504x_is_odd(words[i]) || (words[i] & ERROR) != 0;
        words[i] = bad ? 0xFFFF : words[i] & DATA;
        failed |= bad;
    }
    /* The flag stays until the error register is read. */
    if (failed && address != AS504X_ERRORS) {
        uint16_t errors[AS504X_CHAIN];
        as504x_read(line, AS504X_ERRORS, errors, count);
    }
}

/* What the diagnostics say about the magnet. Both chips use the same bits; only which field bit means weak differs. */
static inline uint8_t as504x_magnet(uint16_t diagnosis)
{
    enum { READY = 0x100, OVERFLOWN = 0x200, FIELD = 0xC00 };
    if (diagnosis == 0xFFFF || (diagnosis & READY) == 0 || (diagnosis & OVERFLOWN) != 0)
        return NO_DATA;
    return (diagnosis & FIELD) != 0 ? MAGNET_WEAK : READING_OK;
}

#endif
