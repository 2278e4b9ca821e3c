/* Everything the firmware needs from a board and from the parts plugged into it. To port it to another board, rewrite these
 * functions; the existing boards and trees are in this folder and listed in the guide. */
#ifndef HARDWARE_H
#define HARDWARE_H

#include <stddef.h>
#include <stdint.h>

#define NO_PARENT 0xFFu

enum { FEATURE_BLINK = 1, FEATURE_HOT_PLUG = 2, FEATURE_LABEL = 4 };
/* The protocol's states of a sensor. */
enum { READING_OK = 0, NO_DATA = 1, MAGNET_WEAK = 2, OUTLIER = 3 };

/* A part of the puppet, as the protocol describes it (the table in firmware-protocol/src/messages/mod.rs). */
struct part {
    uint8_t kind, sensor_count, outlet, outlet_count;
    uint8_t parent; /* its parent's index among the parts; NO_PARENT for the root */
    uint8_t number[12];
    uint32_t counts_per_turn;
};

/* --- The board: board_*.c --- */

/* Starts clock and serial port. */
void hardware_start(void);

/* Microseconds since power-up; never goes backwards. */
uint64_t hardware_micros(void);

/* Nothing needs doing before this time unless the host sends something: sleeps until then, for a millisecond at most, or
 * not at all. */
void hardware_wait(uint64_t until_micros);

/* A byte from the host, or -1. Does not wait. */
int hardware_receive(void);

/* When the zero byte arrived that hardware_receive returned last; boards that do not know return the current time. */
uint64_t hardware_received_micros(void);

/* Starts sending bytes to the host. They must stay in place until hardware_flush returns. */
void hardware_send(const uint8_t *bytes, size_t length);

/* Waits until everything has been passed to the line. */
void hardware_flush(void);

/* --- The parts: tree_*.c, synthetic.c --- */

/* The product name, and the features of this tree (FEATURE_*). */
extern const char hardware_name[];
extern const uint32_t hardware_features;

/* The parts plugged in now, parents before children. Both change only in hardware_watch and hardware_label. */
extern struct part hardware_parts[];
extern uint8_t hardware_part_count;

/* The number of the part that contains the microcontroller, 12 bytes. */
const uint8_t *hardware_number(void);

/* The highest sampling rate that the present parts and the line allow, in samples per 1,000 seconds. */
uint32_t hardware_max_rate(void);

/* Looks for parts that were added or removed, for a few milliseconds at most; the first time, at power-up, for as long as
 * it takes to find the whole tree. Returns whether the tree changed. */
int hardware_watch(uint64_t now_micros);

/* Reads every sensor and reports each with puppet_put_reading; sensors not reported have no data. The sample was due at
 * this time; returns when reading started. */
uint64_t hardware_sample(uint64_t due_micros);

/* Sensors are numbered part by part, within each from the inlet outwards. */
void puppet_put_reading(size_t sensor, uint16_t count, uint8_t state);

/* Turns a part's light on or off. Returns whether the part has a light that answers. */
int hardware_light(uint8_t part, int on);

/* Writes a part's label into its memory. Returns whether it reads back correctly. */
int hardware_label(uint8_t part, uint8_t kind, uint8_t sensor_count, uint8_t outlet_count, uint32_t counts_per_turn);

#endif
