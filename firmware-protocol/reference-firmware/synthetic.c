/* Parts and sensors that do not exist: a puppet with four arms, swinging by a table. In a real puppet these functions read
 * the sensor bus. */
#include "hardware.h"

#define COUNTS 16384u
#define TABLE_STEPS 64u
/* One swing takes 64 * 16 ms. */
#define STEP_MICROS 16000u
/* Starting at two seconds, the last arm is unplugged for half a second in every two. */
#define PULL_PERIOD 2000000u
#define PULL_FROM 1500000u
#define PULLED_PART 6u

#define NUMBER(last) {'r', 'e', 'f', 'e', 'r', 'e', 'n', 'c', 'e', 0, 1, last}

#define ALL_PARTS 8
static const struct part all_parts[ALL_PARTS] = {
    {4, 0, 0, 4, NO_PARENT, NUMBER(1), 0}, /* a splitter */
    {3, 3, 0, 1, 0, NUMBER(2), COUNTS},    /* twist-bend-twist */
    {1, 1, 0, 1, 1, NUMBER(3), COUNTS},    /* bend */
    {3, 3, 1, 1, 0, NUMBER(4), COUNTS},
    {2, 1, 0, 1, 3, NUMBER(5), COUNTS},    /* twist */
    {3, 3, 2, 1, 0, NUMBER(6), COUNTS},
    {3, 3, 3, 1, 0, NUMBER(7), COUNTS},    /* the two that come and go */
    {1, 1, 0, 1, 6, NUMBER(8), COUNTS},
};

const char hardware_name[] = "Reference firmware";
const uint32_t hardware_features = FEATURE_BLINK | FEATURE_HOT_PLUG;
struct part hardware_parts[ALL_PARTS];
uint8_t hardware_part_count;

const uint8_t *hardware_number(void)
{
    static const uint8_t number[12] = NUMBER(0);
    return number;
}

uint32_t hardware_max_rate(void)
{
    return 1000000;
}

/* A quarter of a sine, 1024 high. */
static const int16_t quarter[17] = {0,   100, 200, 297, 392, 483, 569,  650,  724,
                                    792, 851, 903, 946, 980, 1004, 1019, 1024};

static int32_t sine(uint32_t step)
{
    uint32_t within = step % (TABLE_STEPS / 4), turn = step / (TABLE_STEPS / 4) % 4;
    int32_t height = quarter[turn % 2 == 0 ? within : TABLE_STEPS / 4 - within];
    return turn < 2 ? height : -height;
}

int hardware_watch(uint64_t now_micros)
{
    int plugged = now_micros < PULL_PERIOD || now_micros % PULL_PERIOD < PULL_FROM;
    uint8_t count = plugged ? ALL_PARTS : PULLED_PART;
    if (count == hardware_part_count)
        return 0;
    for (uint8_t part = 0; part < count; part++)
        hardware_parts[part] = all_parts[part];
    hardware_part_count = count;
    return 1;
}

uint64_t hardware_sample(uint64_t due_micros)
{
    size_t sensor_of_all = 0;
    for (uint8_t part = 0; part < hardware_part_count; part++)
        for (uint8_t sensor = 0; sensor < hardware_parts[part].sensor_count; sensor++) {
            uint32_t step = (uint32_t)(due_micros / STEP_MICROS), in_step = (uint32_t)(due_micros % STEP_MICROS);
            step += (uint32_t)(part * 7 + sensor * 16);
            int32_t from = sine(step), to = sine(step + 1);
            int32_t height = from + (to - from) * (int32_t)in_step / (int32_t)STEP_MICROS;
            uint16_t count = (uint16_t)((int32_t)(part * 1000) + height) & (COUNTS - 1);
            puppet_put_reading(sensor_of_all++, count, READING_OK);
        }
    return due_micros;
}

int hardware_light(uint8_t part, int on)
{
    (void)part;
    (void)on;
    return 1;
}

int hardware_label(uint8_t part, uint8_t kind, uint8_t sensor_count, uint8_t outlet_count, uint32_t counts_per_turn)
{
    (void)part, (void)kind, (void)sensor_count, (void)outlet_count, (void)counts_per_turn;
    return 0;
}
