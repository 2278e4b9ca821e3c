/* One joint with a potentiometer on analogue input 0: the first evening. */
#include "hardware.h"
#include "table.h"

const struct table_part table[] = {
    {4, 0, 0, 1, NO_PARENT, NO_CHIP, {0}},
    {1, 1, 0, 1, 0, POTENTIOMETER, {0}},
};
const uint8_t table_length = sizeof table / sizeof *table;
