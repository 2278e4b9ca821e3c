/* A fixed puppet, described by a table (table.h): sensors on SPI, which are fast, or potentiometers. */
#include "as504x.h"
#include "hardware.h"
#include "mt6701.h"
#include "potentiometer.h"
#include "table.h"

#ifndef MAX_PARTS
#define MAX_PARTS 24
#endif
#ifndef PRODUCT_NAME
#define PRODUCT_NAME "Armature puppet"
#endif
/* The board's number, different for each board; part numbers are derived from it. */
#ifndef BOARD_NUMBER
#define BOARD_NUMBER 1
#endif
/* A count this close to the end of the turn may be followed by one at its beginning. */
#define NEAR_ZERO 1024u

const char hardware_name[] = PRODUCT_NAME;
const uint32_t hardware_features = 0;
struct part hardware_parts[MAX_PARTS];
uint8_t hardware_part_count;

static uint8_t magnets[MAX_PARTS][3]; /* the last diagnosis */
static uint8_t was_near_zero[MAX_PARTS];  /* a bit for each sensor of a part */
static uint8_t diagnosed;             /* the part to diagnose with the next sample */

static uint32_t counts_of(uint8_t chip)
{
    return chip == POTENTIOMETER ? POTENTIOMETER_COUNTS : chip == MT6701 ? MT6701_COUNTS : chip ? AS504X_COUNTS : 0;
}

/* FIX, four bytes of the board's number, and the part's index in the table. */
static void make_number(uint8_t *number, uint8_t part)
{
    static const uint8_t prefix[3] = {'F', 'I', 'X'};
    for (uint8_t i = 0; i < 3; i++)
        number[i] = prefix[i];
    for (uint8_t i = 0; i < 4; i++)
        number[4 + i] = (uint8_t)((uint32_t)(BOARD_NUMBER) >> 8 * i);
    number[11] = part;
}

int hardware_watch(uint64_t now)
{
    (void)now;
    if (hardware_part_count > 0)
        return 0;
    spi_start();
    for (uint8_t i = 0; i < table_length && i < MAX_PARTS; i++) {
        struct part *part = &hardware_parts[i];
        part->kind = table[i].kind;
        part->sensor_count = table[i].sensor_count;
        part->outlet = table[i].outlet;
        part->outlet_count = table[i].outlet_count;
        part->parent = table[i].parent;
        part->counts_per_turn = counts_of(table[i].chip);
        make_number(part->number, i);
        hardware_part_count++;
    }
    return 1;
}

const uint8_t *hardware_number(void)
{
    return hardware_parts[0].number;
}

uint32_t hardware_max_rate(void)
{
    uint32_t sensors = 0, chains = 0;
    for (uint8_t i = 0; i < hardware_part_count; i++) {
        sensors += table[i].sensor_count;
        chains += table[i].chip == AS5048A ? 1u : table[i].sensor_count;
    }
    uint32_t reading = TABLE_SAMPLE_MICROS + TABLE_LINE_MICROS * chains + TABLE_SENSOR_MICROS * sensors;
    uint32_t line = (24u + sensors * 9u / 4u + 1u) * 10u * 1000u / (LINE_BAUD / 1000u);
    uint32_t slowest = reading > line ? reading : line;
    return slowest < 1000u ? 1000000u : 1000000000u / slowest;
}

/* The sensors of one part that are AS504x: `count` of them on one line. */
static void read_as504x(uint8_t part, uint8_t first, size_t sensor, uint8_t count)
{
    uint16_t words[AS504X_CHAIN], diagnoses[AS504X_CHAIN];
    uint8_t line = table[part].lines[first], wanted = part == diagnosed, i;
    as504x_read(line, AS504X_ANGLE, words, count);
    /* A line held low reads as zeros, which is a valid angle; the diagnosis is never all zeros. */
    for (i = 0; i < count; i++)
        wanted |= words[i] == 0;
    if (wanted) {
        as504x_read(line, table[part].chip == AS5047P ? AS5047P_DIAGNOSIS : AS5048A_DIAGNOSIS, diagnoses, count);
        for (i = 0; i < count; i++)
            magnets[part][first + i] = as504x_magnet(diagnoses[i]);
    }
    for (i = 0; i < count; i++)
        puppet_put_reading(sensor + first + i, words[i], words[i] == 0xFFFF ? NO_DATA : magnets[part][first + i]);
}

/* A line held low reads as angle zero with a correct checksum: only believed if the sensor was near zero before. */
static uint8_t read_mt6701(uint8_t part, uint8_t i, uint16_t *count)
{
    uint8_t state = mt6701_read(table[part].lines[i], count), bit = (uint8_t)(1u << i);
    if (state != NO_DATA && *count == 0 && (was_near_zero[part] & bit) == 0)
        return NO_DATA;
    if (state != NO_DATA && (*count < NEAR_ZERO || *count >= MT6701_COUNTS - NEAR_ZERO))
        was_near_zero[part] |= bit;
    else if (state != NO_DATA)
        was_near_zero[part] &= (uint8_t)~bit;
    return state;
}

static void read_part(uint8_t part, size_t sensor)
{
    uint8_t count = table[part].sensor_count;
    if (table[part].chip == AS5048A) {
        read_as504x(part, 0, sensor, count);
        return;
    }
    for (uint8_t i = 0; i < count; i++) {
        uint16_t value = 0;
        uint8_t state;
        switch (table[part].chip) {
        case AS5047P:
            read_as504x(part, i, sensor, 1);
            continue;
        case MT6701:
            state = read_mt6701(part, i, &value);
            break;
        default:
            state = potentiometer_read(table[part].lines[i], &value);
            break;
        }
        puppet_put_reading(sensor + i, state == NO_DATA ? 0 : value, state);
    }
}

uint64_t hardware_sample(uint64_t due)
{
    uint64_t began = hardware_micros();
    size_t sensor = 0;
    (void)due;
    for (uint8_t part = 0; part < hardware_part_count; part++) {
        read_part(part, sensor);
        sensor += table[part].sensor_count;
    }
    diagnosed = diagnosed + 1 < hardware_part_count ? diagnosed + 1 : 0;
    return began;
}

int hardware_light(uint8_t part, int on)
{
    (void)part, (void)on;
    return 0;
}

int hardware_label(uint8_t part, uint8_t kind, uint8_t sensors, uint8_t outlets, uint32_t counts_per_turn)
{
    (void)part, (void)kind, (void)sensors, (void)outlets, (void)counts_per_turn;
    return 0;
}
