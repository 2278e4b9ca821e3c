/* The device's side of the conversation, version 1.0. Independent of the board: see hardware.h. */
#include "hardware.h"

#include "../c/frame.c"
#include "../c/unframe.c"

/* A board with little memory sets less; the topology is then sent in several messages. */
#ifndef PAYLOAD
#define PAYLOAD 1024
#endif
#define RECORD 22
#define RECORDS_AT_ONCE ((PAYLOAD - 8) / RECORD)

enum {
    HELLO_REQUEST = 0x01, TOPOLOGY_REQUEST, SET_RATE, START, STOP, PING, BLINK, LABEL,
    HELLO = 0x81, TOPOLOGY, TOPOLOGY_CHANGED, SAMPLE, RATE_SET, ACKNOWLEDGE, PONG, REFUSE,
};
enum { UNKNOWN_REQUEST = 1, MALFORMED = 2, NO_SUCH_PART = 4, SENSOR_BUS_FAILED = 5 };
enum { NO_BLINK = 0xFF };

static uint8_t wire[PAYLOAD + PAYLOAD / 254 + 13];
static uint8_t payload[PAYLOAD];

static uint16_t epoch;
static uint8_t streaming;
static uint32_t rate_millihertz = 120000, sequence;
static uint64_t stream_began, ticks; /* samples are due at began + ticks * 10^9 / rate */
static uint64_t due, next_due;       /* the next of them, and the one after it */
static uint8_t blinking = NO_BLINK, blinking_number[12];
static uint64_t blink_until;

static size_t put(size_t at, uint64_t value, size_t bytes)
{
    for (size_t i = 0; i < bytes; i++, value >>= 8)
        payload[at + i] = (uint8_t)value;
    return at + bytes;
}

static uint64_t get(const uint8_t *bytes, size_t count)
{
    uint64_t value = 0;
    while (count-- > 0)
        value = value << 8 | bytes[count];
    return value;
}

static size_t put_bytes(size_t at, const void *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++)
        payload[at + i] = ((const uint8_t *)bytes)[i];
    return at + count;
}

static int same_number(const uint8_t *one, const uint8_t *other)
{
    for (uint8_t i = 0; i < 12; i++)
        if (one[i] != other[i])
            return 0;
    return 1;
}

static void say(uint8_t type, size_t length)
{
    hardware_flush();
    hardware_send(wire, armature_frame(wire, type, payload, length));
}

static void say_hello(void)
{
    size_t at = put(0, 1, 1), name_length = 0;
    at = put(at, 0, 1);
    at = put(at, hardware_features, 4);
    at = put(at, 0x000001, 3);
    at = put_bytes(at, hardware_number(), 12);
    at = put(at, hardware_max_rate(), 4);
    while (hardware_name[name_length] != 0)
        name_length++;
    at = put(at, name_length, 1);
    say(HELLO, put_bytes(at, hardware_name, name_length));
}

static void say_topology(void)
{
    size_t first = 0;
    do {
        size_t records = hardware_part_count - first;
        if (records > RECORDS_AT_ONCE)
            records = RECORDS_AT_ONCE;
        size_t at = put(0, epoch, 2);
        at = put(at, hardware_part_count, 2);
        at = put(at, first, 2);
        at = put(at, records, 1);
        at = put(at, RECORD, 1);
        for (size_t i = first; i < first + records; i++) {
            const struct part *part = &hardware_parts[i];
            at = put(at, part->kind, 1);
            at = put(at, part->sensor_count, 1);
            at = put(at, part->outlet, 1);
            at = put(at, part->outlet_count, 1);
            at = put(at, part->parent == NO_PARENT ? 0xFFFF : part->parent, 2);
            at = put_bytes(at, part->number, 12);
            at = put(at, part->counts_per_turn, 4);
        }
        say(TOPOLOGY, at);
        first += records;
    } while (first < hardware_part_count);
}

static size_t sample_sensors;

void puppet_put_reading(size_t sensor, uint16_t count, uint8_t state)
{
    uint8_t *states = payload + 16 + 2 * sample_sensors + sensor / 4, shift = 2 * (sensor % 4);
    payload[16 + 2 * sensor] = (uint8_t)count;
    payload[17 + 2 * sensor] = (uint8_t)(count >> 8);
    *states = (uint8_t)((*states & ~(3u << shift)) | (unsigned)state << shift);
}

static void say_sample(uint64_t now)
{
    sample_sensors = 0;
    for (size_t i = 0; i < hardware_part_count; i++)
        sample_sensors += hardware_parts[i].sensor_count;
    size_t length = 16 + 2 * sample_sensors + (sample_sensors + 3) / 4;
    for (size_t at = 16; at < length; at++)
        payload[at] = at < 16 + 2 * sample_sensors ? 0 : 0x55; /* no data, four times */
    if (sample_sensors % 4 != 0)
        payload[length - 1] &= (uint8_t)((1u << 2 * (sample_sensors % 4)) - 1);
    put(0, hardware_sample(now), 8);
    put(8, sequence, 4);
    put(12, epoch, 2);
    put(14, sample_sensors, 2);
    say(SAMPLE, length);
}

static void acknowledge(uint8_t request)
{
    say(ACKNOWLEDGE, put(0, request, 1));
}

static void refuse(uint8_t request, uint8_t reason)
{
    put(0, request, 1);
    say(REFUSE, put(1, reason, 1));
}

/* 64-bit division is slow on small processors: once per sample, not at every use. */
static void set_ticks(uint64_t count)
{
    ticks = count;
    due = stream_began + ticks * 1000000000u / rate_millihertz;
    next_due = stream_began + (ticks + 1) * 1000000000u / rate_millihertz;
}

static void set_rate(uint32_t wanted, uint64_t now)
{
    uint32_t most = hardware_max_rate();
    rate_millihertz = wanted < 1 ? 1 : wanted > most ? most : wanted;
    stream_began = now;
    set_ticks(1);
    say(RATE_SET, put(0, rate_millihertz, 4));
}

/* The index of the part with this number, or NO_PARENT. */
static uint8_t find(const uint8_t *number)
{
    for (uint8_t i = 0; i < hardware_part_count; i++)
        if (same_number(number, hardware_parts[i].number))
            return i;
    return NO_PARENT;
}

/* Ends a blink; by now the part may have been moved or removed. */
static void stop_blinking(void)
{
    uint8_t part = blinking == NO_BLINK ? NO_PARENT : find(blinking_number);
    blinking = NO_BLINK;
    if (part != NO_PARENT)
        hardware_light(part, 0);
}

static void blink(const uint8_t *number, uint32_t duration_micros, uint64_t now)
{
    uint8_t part = find(number);
    if (part == NO_PARENT) {
        refuse(BLINK, NO_SUCH_PART);
        return;
    }
    stop_blinking();
    if (!hardware_light(part, duration_micros > 0)) {
        refuse(BLINK, SENSOR_BUS_FAILED);
        return;
    }
    if (duration_micros > 0) {
        blinking = part;
        for (uint8_t i = 0; i < 12; i++)
            blinking_number[i] = number[i];
        blink_until = now + duration_micros;
    }
    acknowledge(BLINK);
}

static void change_epoch(void)
{
    epoch++;
    say(TOPOLOGY_CHANGED, put(0, epoch, 2));
}

/* Writes a part's label. */
static void label(const uint8_t *fields)
{
    uint8_t part = find(fields), kind = fields[12], sensors = fields[13], outlets = fields[14];
    uint32_t counts = (uint32_t)get(fields + 15, 4);
    if (kind == 0 || kind == 0xFF || sensors > 3 || outlets > 5 || (sensors > 0 && (counts < 2 || counts > 65536))) {
        refuse(LABEL, MALFORMED);
    } else if (part == NO_PARENT) {
        refuse(LABEL, NO_SUCH_PART);
    } else if (!hardware_label(part, kind, sensors, outlets, sensors > 0 ? counts : 0)) {
        refuse(LABEL, SENSOR_BUS_FAILED);
    } else {
        acknowledge(LABEL);
        change_epoch();
    }
}

/* Answers one request: its type and payload. */
static void answer(const uint8_t *plain, size_t length, uint64_t now)
{
    static const uint8_t least[] = {0, 6, 0, 4, 0, 0, 8, 14, 19};
    uint8_t type = plain[0];
    const uint8_t *fields = plain + 1;
    if (type >= 0x80)
        return; /* messages that only devices send are an echo */
    if (type < HELLO_REQUEST || type > (hardware_features & FEATURE_LABEL ? LABEL : BLINK)) {
        refuse(type, UNKNOWN_REQUEST);
        return;
    }
    if (length - 1 < least[type]) {
        refuse(type, MALFORMED);
        return;
    }
    switch (type) {
    case HELLO_REQUEST:
        streaming = 0;
        say_hello();
        break;
    case TOPOLOGY_REQUEST:
        say_topology();
        break;
    case SET_RATE:
        set_rate((uint32_t)get(fields, 4), now);
        break;
    case START:
        acknowledge(START);
        if (!streaming) {
            streaming = 1;
            sequence = 0;
            stream_began = now;
            set_ticks(0);
        }
        break;
    case STOP:
        streaming = 0;
        acknowledge(STOP);
        break;
    case PING:
        put(0, get(fields, 8), 8);
        put(8, now, 8);
        hardware_flush();
        say(PONG, put(16, hardware_micros(), 8));
        break;
    case BLINK:
        blink(fields, (uint32_t)get(fields + 12, 2) * 1000, now);
        break;
    case LABEL:
        label(fields);
        break;
    }
}

/* Handles what the host has sent. Requests are short; anything longer is dropped unread. */
static void listen(void)
{
    static uint8_t piece[64];
    static uint8_t length, overlong;
    int byte;
    while ((byte = hardware_receive()) >= 0) {
        if (byte != 0) {
            if (length < sizeof piece)
                piece[length++] = (uint8_t)byte;
            else
                overlong = 1;
            continue;
        }
        /* In place: the output never overtakes the input. */
        int plain_length = overlong ? 0 : armature_unframe(piece, length, piece);
        length = 0;
        overlong = 0;
        if (plain_length > 0)
            answer(piece, (size_t)plain_length, hardware_received_micros());
    }
}

static void stream(uint64_t now)
{
    while (streaming && due <= now) {
        /* A sample so late that the next one is already due is skipped, but counted: the host sees the gap. */
        if (now < next_due)
            say_sample(due);
        sequence++;
        set_ticks(ticks + 1);
    }
}

int main(void)
{
    static const uint8_t delimiter = 0;
    hardware_start();
    hardware_watch(hardware_micros());
    hardware_send(&delimiter, 1);
    say_hello();
    for (;;) {
        uint64_t now = hardware_micros();
        if (hardware_watch(now))
            change_epoch();
        if (blinking != NO_BLINK && now >= blink_until)
            stop_blinking();
        listen();
        stream(now);
        hardware_wait(streaming ? due : now + 1000);
    }
}
