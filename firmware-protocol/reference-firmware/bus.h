/* The I2C buses of a board: what tree_bus.c needs from them. Transfers run while the processor does other things, so a
 * board with two buses reads both at once. */
#ifndef BUS_H
#define BUS_H

#include <stdint.h>

/* Number of buses on the board, set by a compiler option. */
#ifndef BUSES
#define BUSES 1
#endif

enum bus_outcome {
    BUS_BUSY,  /* still running */
    BUS_DONE,  /* all bytes were transferred and acknowledged */
    BUS_NACK,  /* nothing answered, or a chip stopped answering */
    BUS_STUCK, /* a line is held low, or a byte took longer than any allowed clock stretching */
};

/* 400 kHz, or 1 MHz where the multiplexers are rated for it; memory and light are always addressed at 400 kHz. */
#ifndef BUS_HERTZ
#define BUS_HERTZ 400000u
#endif
#define BUS_IS_SLOW(address) ((address) == 0x50u || (address) == 0x41u)

/* Sets the bus up. */
void bus_start(uint8_t bus);

/* Starts a transfer: writes `out_length` bytes to the 7-bit address, then, after a repeated start, reads `in_length`
 * bytes. One of the lengths may be 0. Both buffers must stay in place until bus_poll no longer returns busy. */
void bus_begin(uint8_t bus, uint8_t address, const uint8_t *out, uint8_t out_length, uint8_t *in, uint8_t in_length);

/* Checks the transfer that was started last. */
enum bus_outcome bus_poll(uint8_t bus);

/* All transfers are running: may sleep until one may have progressed, or until any other interrupt. */
void bus_wait(void);

/* Whether both lines are high between transfers. */
int bus_is_free(uint8_t bus);

/* Nine clocks and a stop by hand, which free a chip that was interrupted in the middle of a byte. */
void bus_clear(uint8_t bus);

/* Pulls the line that resets every multiplexer in the tree, which closes all channels. */
void bus_reset_multiplexers(uint8_t bus);

#endif
