/* All that the firmware asks of a board. To bring it to another one, write these functions anew. */
#ifndef HARDWARE_H
#define HARDWARE_H

#include <stddef.h>
#include <stdint.h>

/* A part of the puppet, as the protocol describes it (the table in firmware-protocol/src/messages.rs). */
struct part {
    uint8_t kind, sensor_count, outlet, outlet_count;
    uint16_t parent; /* 0xFFFF for the root */
    uint8_t number;  /* last byte of its 12-byte number; the others are the board's */
    uint32_t counts_per_turn;
};

/* All parts that can be plugged in, parents before children, and how many there are. */
extern const struct part hardware_parts[];
extern const size_t hardware_part_count;

/* Starts clock and serial port. */
void hardware_start(void);

/* Microseconds since power-up; never goes back. */
uint64_t hardware_micros(void);

/* A byte from the host, or -1. Does not wait. */
int hardware_receive(void);

/* Sends bytes to the host; waits while the port is full. */
void hardware_send(const uint8_t *bytes, size_t length);

/* Whether a part is plugged in now. */
int hardware_is_present(size_t part, uint64_t now_micros);

/* Reads one sensor of a part: the raw count. Returns the protocol's state: 0 ok, 1 no data, 2 weak magnet, 3 outlier. */
uint8_t hardware_read(size_t part, uint8_t sensor, uint64_t now_micros, uint16_t *count);

/* Lights up a part, or ends that. */
void hardware_light(size_t part, int on);

#endif
