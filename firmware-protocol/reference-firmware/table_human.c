/* A human of 19 three-axis joints, 57 sensors: AS5048A in chains of three. */
#include "hardware.h"
#include "table.h"

#define JOINT(outlet, parent, line) {3, 3, outlet, 1, parent, AS5048A, {line}}

const struct table_part table[] = {
    {4, 0, 0, 4, NO_PARENT, NO_CHIP, {0}}, /* chest */
    JOINT(0, 0, 0), JOINT(0, 1, 1), JOINT(0, 2, 2), JOINT(0, 3, 3), /* left arm */
    JOINT(1, 0, 4), JOINT(0, 5, 5),                                 /* neck and head */
    JOINT(2, 0, 6), JOINT(0, 7, 7), JOINT(0, 8, 8), JOINT(0, 9, 9), /* right arm */
    JOINT(3, 0, 10),                                                /* spine */
    {4, 0, 0, 2, 11, NO_CHIP, {0}},                                 /* pelvis */
    JOINT(0, 12, 11), JOINT(0, 13, 12), JOINT(0, 14, 13), JOINT(0, 15, 14),
    JOINT(1, 12, 15), JOINT(0, 17, 16), JOINT(0, 18, 17), JOINT(0, 19, 18),
};
const uint8_t table_length = sizeof table / sizeof *table;
