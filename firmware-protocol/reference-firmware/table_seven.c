/* An upper body of seven three-axis joints, 21 sensors: a neck, and arms of three joints. AS5048A in chains of three. */
#include "hardware.h"
#include "table.h"

const struct table_part table[] = {
    {4, 0, 0, 3, NO_PARENT, NO_CHIP, {0}},
    {3, 3, 0, 1, 0, AS5048A, {0}},
    {3, 3, 0, 1, 1, AS5048A, {1}},
    {3, 3, 0, 1, 2, AS5048A, {2}},
    {3, 3, 1, 1, 0, AS5048A, {3}},
    {3, 3, 2, 1, 0, AS5048A, {4}},
    {3, 3, 0, 1, 5, AS5048A, {5}},
    {3, 3, 0, 1, 6, AS5048A, {6}},
};
const uint8_t table_length = sizeof table / sizeof *table;
