/* The device's side of the conversation, version 1.0. Nothing in here knows the board: see hardware.h. */
#include "hardware.h"

#include "../c/frame.c"
#include "../c/unframe.c"

#define MAX_PARTS 46 /* records in one message; a puppet of more parts sends several */
#define MAX_SENSORS 138
#define RECORD 22
#define MAX_RATE_MILLIHERTZ 1000000u
/* A sample this late is left out, but counted, so that the host sees the gap. */
#define LATEST_MICROS 20000u

enum {
    HELLO_REQUEST = 0x01, TOPOLOGY_REQUEST, SET_RATE, START, STOP, PING, BLINK,
    HELLO = 0x81, TOPOLOGY, TOPOLOGY_CHANGED, SAMPLE, RATE_SET, ACKNOWLEDGE, PONG, REFUSE,
};
enum { UNKNOWN_REQUEST = 1, MALFORMED = 2, NO_SUCH_PART = 4 };

static const uint8_t board_number[11] = {'r', 'e', 'f', 'e', 'r', 'e', 'n', 'c', 'e', 0, 1};

static uint8_t wire[1041];
static uint8_t payload[1024];

static uint16_t epoch;
static size_t plugged[MAX_PARTS], plugged_count;
static int streaming;
static uint32_t rate_millihertz = 120000, sequence;
static uint64_t stream_began, ticks; /* samples are due at began + ticks * 10^9 / rate */
static size_t blinking = MAX_PARTS;
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

static size_t put_number(size_t at, uint8_t last)
{
    for (size_t i = 0; i < sizeof board_number; i++)
        payload[at + i] = board_number[i];
    payload[at + sizeof board_number] = last;
    return at + 12;
}

static void say(uint8_t type, size_t length)
{
    hardware_send(wire, armature_frame(wire, type, payload, length));
}

static void say_hello(void)
{
    static const char name[] = "Reference firmware";
    size_t at = put(0, 1, 1);
    at = put(at, 0, 1);
    at = put(at, 3, 4); /* blink, hot plug */
    at = put(at, 0x000001, 3);
    at = put_number(at, 0);
    at = put(at, MAX_RATE_MILLIHERTZ, 4);
    at = put(at, sizeof name - 1, 1);
    for (size_t i = 0; i < sizeof name - 1; i++)
        payload[at++] = (uint8_t)name[i];
    say(HELLO, at);
}

/* Finds out what is plugged in; a part hangs on its parent. Returns whether that changed. */
static int look_at_parts(uint64_t now)
{
    size_t found[MAX_PARTS], count = 0;
    int present[MAX_PARTS], changed = 0;
    for (size_t part = 0; part < hardware_part_count && part < MAX_PARTS; part++) {
        uint16_t parent = hardware_parts[part].parent;
        present[part] = (parent == 0xFFFF || present[parent]) && hardware_is_present(part, now);
        if (present[part])
            found[count++] = part;
    }
    changed = count != plugged_count;
    for (size_t i = 0; i < count; i++) {
        changed |= plugged[i] != found[i];
        plugged[i] = found[i];
    }
    plugged_count = count;
    return changed;
}

static uint16_t place_of(uint16_t part)
{
    for (uint16_t i = 0; i < plugged_count; i++)
        if (plugged[i] == part)
            return i;
    return 0xFFFF;
}

static void say_topology(void)
{
    size_t at = put(0, epoch, 2);
    at = put(at, plugged_count, 2);
    at = put(at, 0, 2);
    at = put(at, plugged_count, 1);
    at = put(at, RECORD, 1);
    for (size_t i = 0; i < plugged_count; i++) {
        const struct part *part = &hardware_parts[plugged[i]];
        at = put(at, part->kind, 1);
        at = put(at, part->sensor_count, 1);
        at = put(at, part->outlet, 1);
        at = put(at, part->outlet_count, 1);
        at = put(at, part->parent == 0xFFFF ? 0xFFFF : place_of(part->parent), 2);
        at = put_number(at, part->number);
        at = put(at, part->counts_per_turn, 4);
    }
    say(TOPOLOGY, at);
}

static void say_sample(uint64_t now)
{
    uint8_t states[MAX_SENSORS];
    size_t sensors = 0, at = 16;
    for (size_t i = 0; i < plugged_count; i++)
        for (uint8_t sensor = 0; sensor < hardware_parts[plugged[i]].sensor_count; sensor++) {
            uint16_t count = 0;
            states[sensors++] = hardware_read(plugged[i], sensor, now, &count);
            at = put(at, count, 2);
        }
    for (size_t sensor = 0; sensor < sensors; sensor += 4) {
        uint8_t bits = 0;
        for (size_t i = sensor; i < sensors && i < sensor + 4; i++)
            bits |= (uint8_t)(states[i] << (2 * (i - sensor)));
        at = put(at, bits, 1);
    }
    put(0, now, 8);
    put(8, sequence, 4);
    put(12, epoch, 2);
    put(14, sensors, 2);
    say(SAMPLE, at);
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

static void set_rate(uint32_t wanted, uint64_t now)
{
    rate_millihertz = wanted < 1 ? 1 : wanted > MAX_RATE_MILLIHERTZ ? MAX_RATE_MILLIHERTZ : wanted;
    stream_began = now;
    ticks = 1;
    say(RATE_SET, put(0, rate_millihertz, 4));
}

static void blink(const uint8_t *number, uint64_t duration_micros, uint64_t now)
{
    for (size_t i = 0; i < plugged_count; i++) {
        int same = number[11] == hardware_parts[plugged[i]].number;
        for (size_t at = 0; at < sizeof board_number; at++)
            same = same && number[at] == board_number[at];
        if (!same)
            continue;
        if (blinking < MAX_PARTS)
            hardware_light(blinking, 0);
        blinking = duration_micros > 0 ? plugged[i] : MAX_PARTS;
        blink_until = now + duration_micros;
        hardware_light(plugged[i], duration_micros > 0);
        acknowledge(BLINK);
        return;
    }
    refuse(BLINK, NO_SUCH_PART);
}

/* Answers one request: its type and payload. */
static void answer(const uint8_t *plain, size_t length, uint64_t now)
{
    static const uint8_t least[] = {0, 6, 0, 4, 0, 0, 8, 14};
    uint8_t type = plain[0];
    const uint8_t *fields = plain + 1;
    if (type >= 0x80)
        return; /* what only devices say is an echo */
    if (type < HELLO_REQUEST || type > BLINK) {
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
            ticks = 0;
        }
        break;
    case STOP:
        streaming = 0;
        acknowledge(STOP);
        break;
    case PING:
        put(0, get(fields, 8), 8);
        put(8, now, 8);
        say(PONG, put(16, hardware_micros(), 8));
        break;
    case BLINK:
        blink(fields, get(fields + 12, 2) * 1000, now);
        break;
    }
}

/* Takes what the host has sent. Requests are short; what is longer is dropped unseen. */
static void listen(void)
{
    static uint8_t piece[64], plain[64];
    static size_t length;
    static int overlong;
    int byte;
    while ((byte = hardware_receive()) >= 0) {
        if (byte != 0) {
            if (length < sizeof piece)
                piece[length++] = (uint8_t)byte;
            else
                overlong = 1;
            continue;
        }
        int plain_length = overlong ? 0 : armature_unframe(piece, length, plain);
        length = 0;
        overlong = 0;
        if (plain_length > 0)
            answer(plain, (size_t)plain_length, hardware_micros());
    }
}

static void stream(uint64_t now)
{
    while (streaming) {
        uint64_t due = stream_began + ticks * 1000000000u / rate_millihertz;
        if (due > now)
            return;
        if (now - due < LATEST_MICROS)
            say_sample(due);
        sequence++;
        ticks++;
    }
}

int main(void)
{
    static const uint8_t delimiter = 0;
    hardware_start();
    look_at_parts(hardware_micros());
    hardware_send(&delimiter, 1);
    say_hello();
    for (;;) {
        uint64_t now = hardware_micros();
        if (look_at_parts(now)) {
            epoch++;
            say(TOPOLOGY_CHANGED, put(0, epoch, 2));
        }
        if (blinking < MAX_PARTS && now >= blink_until) {
            hardware_light(blinking, 0);
            blinking = MAX_PARTS;
        }
        listen();
        stream(now);
    }
}
