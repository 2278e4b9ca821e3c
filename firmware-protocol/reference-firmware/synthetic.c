/* Parts and sensors that are not there: a puppet of four arms that swings by a table. In a real puppet these functions
 * read the sensor bus. */
#include "hardware.h"

#define COUNTS 16384u
#define TABLE_STEPS 64u
/* One swing takes 64 * 16 ms. */
#define STEP_MICROS 16000u
/* The last arm is pulled out for half a second in every two, from the second second on. */
#define PULL_PERIOD 2000000u
#define PULL_FROM 1500000u
#define PULLED_PART 6u

const struct part hardware_parts[] = {
    {4, 0, 0, 4, 0xFFFF, 1, 0},    /* a splitter */
    {3, 3, 0, 1, 0, 2, COUNTS},    /* twist-bend-twist */
    {1, 1, 0, 1, 1, 3, COUNTS},    /* bend */
    {3, 3, 1, 1, 0, 4, COUNTS},
    {2, 1, 0, 1, 3, 5, COUNTS},    /* twist */
    {3, 3, 2, 1, 0, 6, COUNTS},
    {3, 3, 3, 1, 0, 7, COUNTS},
    {1, 1, 0, 1, 6, 8, COUNTS},
};
const size_t hardware_part_count = sizeof hardware_parts / sizeof *hardware_parts;

/* A quarter of a sine, 1024 high. */
static const int16_t quarter[17] = {0,   100, 200, 297, 392, 483, 569,  650,  724,
                                    792, 851, 903, 946, 980, 1004, 1019, 1024};

static int32_t sine(uint32_t step)
{
    uint32_t within = step % (TABLE_STEPS / 4), turn = step / (TABLE_STEPS / 4) % 4;
    int32_t height = quarter[turn % 2 == 0 ? within : TABLE_STEPS / 4 - within];
    return turn < 2 ? height : -height;
}

int hardware_is_present(size_t part, uint64_t now_micros)
{
    return part != PULLED_PART || now_micros < PULL_PERIOD || now_micros % PULL_PERIOD < PULL_FROM;
}

uint8_t hardware_read(size_t part, uint8_t sensor, uint64_t now_micros, uint16_t *count)
{
    uint32_t step = (uint32_t)(now_micros / STEP_MICROS), in_step = (uint32_t)(now_micros % STEP_MICROS);
    step += (uint32_t)(part * 7 + sensor * 16);
    int32_t from = sine(step), to = sine(step + 1);
    int32_t height = from + (to - from) * (int32_t)in_step / (int32_t)STEP_MICROS;
    *count = (uint16_t)((int32_t)(part * 1000) + height) & (COUNTS - 1);
    return 0;
}

void hardware_light(size_t part, int on)
{
    (void)part;
    (void)on;
}
