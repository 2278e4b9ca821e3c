/* Part of tree_bus.c: reads every sensor, on all buses at once. */

/* How far the reading of one bus has got. */
static struct cursor {
    uint8_t part, turn;     /* the part, and how many of its sensors are done */
    uint8_t backwards;      /* its last sensor comes first: its channel is still open from the previous sample */
    uint8_t first;          /* index of the part's first sensor in the sample */
    enum { IDLE, OPENING, READING, READING_GAIN } doing;
    uint8_t opening;        /* whose multiplexer is set, and to what */
    uint8_t mask;
    uint8_t burst[AS5600_BURST];
} cursors[BUSES];

/* Skips the rest of a part's subtree, in which the cursor is. */
static void skip_subtree(struct cursor *cursor, uint8_t part)
{
    uint8_t end = end_of_subtree(part);
    for (; cursor->part < end; cursor->part++)
        cursor->first += hardware_parts[cursor->part].sensor_count;
    cursor->turn = 0;
}

static uint8_t sensor_of(const struct cursor *cursor)
{
    return cursor->backwards ? hardware_parts[cursor->part].sensor_count - 1 - cursor->turn : cursor->turn;
}

/* Moves on to the next sensor of this bus that can be read. Returns whether there is one. */
static int seek(uint8_t bus, struct cursor *cursor)
{
    while (cursor->part < hardware_part_count) {
        const struct part *part = &hardware_parts[cursor->part];
        if (nodes[cursor->part].failing || (part->parent != NO_PARENT && nodes[cursor->part].bus != bus)) {
            skip_subtree(cursor, cursor->part);
        } else if (nodes[cursor->part].bus == bus && cursor->turn < part->sensor_count) {
            if (cursor->turn == 0)
                cursor->backwards = nodes[cursor->part].open[bus] == 1u << (part->sensor_count - 1);
            if ((nodes[cursor->part].blocked & 1u << sensor_of(cursor)) == 0)
                return 1;
            cursor->turn++;
        } else {
            cursor->first += part->sensor_count;
            cursor->part++;
            cursor->turn = 0;
        }
    }
    return 0;
}

static void begin_next(uint8_t bus, struct cursor *cursor)
{
    static const uint8_t status = AS5600_STATUS;
    cursor->doing = IDLE;
    if (!seek(bus, cursor))
        return;
    cursor->opening = next_on_way(bus, cursor->part, (uint8_t)(1u << sensor_of(cursor)), &cursor->mask);
    if (cursor->opening != NO_PART) {
        if ((nodes[cursor->opening].blocked & cursor->mask) != 0) {
            skip_subtree(cursor, cursor->part);
            begin_next(bus, cursor);
            return;
        }
        cursor->doing = OPENING;
        begin_to_open(bus, cursor->opening, cursor->mask);
    } else {
        cursor->doing = READING;
        bus_begin(bus, AS5600_ADDRESS, &status, 1, cursor->burst, AS5600_BURST);
    }
}

static void take_reading(struct cursor *cursor)
{
    uint8_t sensor = cursor->first + sensor_of(cursor);
    uint16_t count;
    uint8_t state = as5600_reading(cursor->burst, &count);
    if (state == READING_OK && (weak[sensor / 8] & 1u << sensor % 8) != 0)
        state = MAGNET_WEAK;
    puppet_put_reading(sensor, count, state);
}

static void take_gain(const struct cursor *cursor)
{
    uint8_t bit = (uint8_t)(1u << gain_turn % 8);
    if (cursor->burst[0] >= AS5600_GAIN_LIMIT)
        weak[gain_turn / 8] |= bit;
    else
        weak[gain_turn / 8] &= (uint8_t)~bit;
}

/* A transfer on this bus has ended: takes the result and starts the next one. */
static void go_on(uint8_t bus, struct cursor *cursor, enum bus_outcome outcome)
{
    static const uint8_t gain = AS5600_AGC;
    if (outcome == BUS_DONE && cursor->doing == OPENING) {
        if (bus_is_free(bus))
            has_opened(bus, cursor->opening, cursor->mask);
        else
            unstick(bus, cursor->opening, cursor->mask);
    } else if (outcome == BUS_DONE && cursor->doing == READING) {
        take_reading(cursor);
        if (gain_pause == 0 && cursor->first + sensor_of(cursor) == gain_turn) {
            cursor->doing = READING_GAIN;
            bus_begin(bus, AS5600_ADDRESS, &gain, 1, cursor->burst, 1);
            return;
        }
        cursor->turn++;
    } else if (cursor->doing == READING_GAIN) {
        if (outcome == BUS_DONE)
            take_gain(cursor);
        cursor->turn++;
    } else if (outcome == BUS_NACK && cursor->doing == OPENING) {
        /* The multiplexers on the path may have lost power and with it their channels: all are set again. */
        forget_masks(bus);
        fail(cursor->opening);
        skip_subtree(cursor, cursor->opening);
    } else if (outcome == BUS_NACK) {
        nodes[cursor->part].open[bus] = UNKNOWN_MASK;
        cursor->turn++;
    } else {
        unstick(bus, cursor->doing == OPENING ? cursor->opening : cursor->part,
                cursor->doing == OPENING ? cursor->mask : (uint8_t)(1u << sensor_of(cursor)));
        if (cursor->doing != OPENING)
            cursor->turn++;
    }
    begin_next(bus, cursor);
}

uint64_t hardware_sample(uint64_t due)
{
    uint64_t began = hardware_micros();
    uint8_t busy = 0;
    (void)due;
    sampled = 1;
    for (uint8_t bus = 0; bus < BUSES; bus++) {
        cursors[bus].part = cursors[bus].turn = cursors[bus].first = 0;
        begin_next(bus, &cursors[bus]);
        busy += cursors[bus].doing != IDLE;
    }
    while (busy > 0) {
        uint8_t moved = 0;
        for (uint8_t bus = 0; bus < BUSES; bus++) {
            enum bus_outcome outcome;
            if (cursors[bus].doing == IDLE || (outcome = bus_poll(bus)) == BUS_BUSY)
                continue;
            go_on(bus, &cursors[bus], outcome);
            busy -= cursors[bus].doing == IDLE;
            moved = 1;
        }
        if (!moved)
            bus_wait();
    }
    if (gain_pause-- == 0) {
        gain_pause = GAIN_SAMPLES - 1;
        gain_turn = gain_turn + 1 < sensor_count ? gain_turn + 1 : 0;
    }
    return began;
}
