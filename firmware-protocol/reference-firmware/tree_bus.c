/* The modular bus: parts plugged into any tree while the power is on. tree_bus.h describes how a part is wired. */
#include "tree_bus.h"

#include "as5600.h"
#include "bus.h"
#include "hardware.h"

#ifndef MAX_PARTS
#define MAX_PARTS 46
#endif
#ifndef MAX_SENSORS
#define MAX_SENSORS 138
#endif
#ifndef PRODUCT_NAME
#define PRODUCT_NAME "Armature puppet"
#endif
/* The root's outlets from this one on are on the second bus, if there is one. */
#define SECOND_BUS_OUTLET 3u

/* Each empty outlet is checked this often; a part that does not answer for this long is gone. */
#ifndef LOOK_MICROS
#define LOOK_MICROS 60000u
#endif
#define GONE_MICROS 60000u
/* A failed part is asked again this often, and a channel that holds the bus low this often. */
#define AGAIN_MICROS 10000u
#define BLOCKED_MICROS 500000u
/* After power-up the whole tree is found before anything is sent; a tree that takes longer keeps growing. */
#define FIRST_LOOK_MICROS 200000u
#define TOGETHER_MICROS 5000u
/* One sensor's gain is read once per this many samples: magnets move away slowly, if ever. */
#ifndef GAIN_SAMPLES
#define GAIN_SAMPLES 4u
#endif
#define NO_PART 0xFFu
#define UNKNOWN_MASK 0xFFu /* never opened: the firmware opens one channel at a time */
#define WRITE_MICROS 6000u /* a memory's longest write cycle is 5 ms */

const char hardware_name[] = PRODUCT_NAME;
const uint32_t hardware_features = FEATURE_BLINK | FEATURE_HOT_PLUG | FEATURE_LABEL;
struct part hardware_parts[MAX_PARTS];
uint8_t hardware_part_count;

/* What the bus needs to know about each part besides its record. */
static struct node {
    uint8_t level, bus;
    uint8_t open[BUSES];   /* its multiplexer's last setting; only the root has one on each bus */
    uint8_t stuck;         /* channels that held the bus low when last opened */
    uint8_t blocked;       /* those of them that stay closed for a while */
    uint8_t failing;       /* does not answer; its subtree is omitted from the samples */
    uint16_t failing_since; /* milliseconds */
} nodes[MAX_PARTS];
static uint8_t sensor_count;
static uint8_t weak[(MAX_SENSORS + 7) / 8]; /* a bit for each sensor: its gain is near its limit */
static uint8_t gain_turn;                   /* the sensor whose gain is read next, */
static uint8_t gain_pause;                  /* after this many samples */
static uint64_t unblock_at, again_at, look_at;
static uint8_t looked_once;            /* at every outlet of the tree */
static uint8_t sampled;                /* since all of them were last checked */
static uint8_t found_end;              /* the index after the parts found just now */
static uint8_t look_part, look_outlet; /* the outlet checked last */

static uint8_t multiplexer_address(uint8_t level)
{
    static const uint8_t lines[LEVELS] = {1, 2, 4, 3, 6, 7, 5};
    return (uint8_t)(MULTIPLEXER_ADDRESS | lines[level]);
}

#include "tree_bus_ways.c"

#include "tree_bus_parts.c"

#include "tree_bus_sample.c"

const uint8_t *hardware_number(void)
{
    static const uint8_t none[12];
    return hardware_part_count > 0 ? hardware_parts[0].number : none;
}

uint32_t hardware_max_rate(void)
{
    /* For each bus: 77 clocks per sensor (multiplexer 20, burst 57), 20 for the path to each further part, and what the
     * processor adds. Then the time that checking an empty outlet may take, and the line: the frame is 24 bytes plus 9 for
     * every four sensors. The slowest of these decides. */
    uint32_t slowest = 1000;
    for (uint8_t bus = 0; bus < BUSES; bus++) {
        uint32_t micros = BUS_LOOK_MICROS;
        for (uint8_t i = 0; i < hardware_part_count; i++)
            if (nodes[i].bus == bus)
                micros += BUS_PART_MICROS + BUS_SENSOR_MICROS * (uint32_t)hardware_parts[i].sensor_count;
        if (micros > slowest)
            slowest = micros;
    }
    uint32_t line = (uint32_t)((24u + sensor_count * 9u / 4u + 1u) * 10u * 1000u / (LINE_BAUD / 1000u));
    if (line > slowest)
        slowest = line;
    return 1000000000u / slowest;
}

/* --- Light and label --- */

int hardware_light(uint8_t part, int on)
{
    static const uint8_t direction[2] = {LIGHT_DIRECTION, 0xFE};
    const uint8_t output[2] = {LIGHT_OUTPUT, on ? 0xFE : 0xFF};
    uint8_t bus = nodes[part].bus;
    return reach(bus, part, 1) && transfer(bus, part, 1, LIGHT_ADDRESS, output, 2, 0, 0) &&
           transfer(bus, part, 1, LIGHT_ADDRESS, direction, 2, 0, 0);
}

int hardware_label(uint8_t part, uint8_t kind, uint8_t sensors, uint8_t outlets, uint32_t counts_per_turn)
{
    uint8_t page[1 + LABEL_LENGTH] = {MEMORY_LABEL, LABEL_MARK, LABEL_VERSION, kind, sensors, outlets};
    uint8_t read[LABEL_LENGTH], bus = nodes[part].bus;
    uint64_t began;
    if (sensor_count - hardware_parts[part].sensor_count + sensors > MAX_SENSORS)
        return 0;
    page[6] = (uint8_t)(counts_per_turn - 1);
    page[7] = (uint8_t)((counts_per_turn - 1) >> 8);
    page[8] = crc8(page + 1, LABEL_LENGTH - 1);
    if (!reach(bus, part, 1) || !transfer(bus, part, 1, MEMORY_ADDRESS, page, sizeof page, 0, 0))
        return 0;
    /* It does not answer while writing. */
    began = hardware_micros();
    while (!read_memory(bus, part, 1, MEMORY_LABEL, read))
        if (hardware_micros() - began > WRITE_MICROS)
            return 0;
    for (uint8_t i = 0; i < LABEL_LENGTH; i++)
        if (read[i] != page[1 + i])
            return 0;
    take_label(&hardware_parts[part], read);
    /* Parts on outlets that it no longer has are gone, with everything that hangs on them. */
    for (uint8_t i = part + 1; i < end_of_subtree(part); i++)
        if (hardware_parts[i].parent == part && hardware_parts[i].outlet >= outlets)
            remove_subtree(i--);
    count_sensors();
    return 1;
}
