/* A fixed puppet: its parts, and which sensor is on which line. One table_*.c for each puppet. */
#ifndef TABLE_H
#define TABLE_H

#include <stdint.h>

enum chip {
    NO_CHIP,
    AS5047P,       /* each on its own select line */
    AS5048A,       /* those of a part form a chain on one select line; the first one's input is at the controller */
    MT6701,        /* each on its own select line */
    POTENTIOMETER, /* on an analogue input */
};

struct table_part {
    uint8_t kind, sensor_count, outlet, outlet_count, parent; /* as in struct part */
    uint8_t chip;
    uint8_t lines[3]; /* select line or input of each sensor; a chain only uses the first */
};

/* Parents before children. */
extern const struct table_part table[];
extern const uint8_t table_length;

#endif
