/* One joint with each chip, for trying them out on a bench. */
#include "hardware.h"
#include "table.h"

const struct table_part table[] = {
    {4, 0, 0, 4, NO_PARENT, NO_CHIP, {0}},
    {3, 3, 0, 1, 0, AS5047P, {0, 1, 2}},
    {1, 1, 1, 1, 0, MT6701, {3}},
    {2, 1, 2, 1, 0, AS5048A, {4}},
    {1, 1, 3, 1, 0, POTENTIOMETER, {0}},
};
const uint8_t table_length = sizeof table / sizeof *table;
