/* Part of tree_bus.c: which multiplexers must be set on the path to a part, transfers over that path, and what is done
 * when something holds the bus. */

/* The bus on which a part's outlets hang. */
static uint8_t outlet_bus(uint8_t part, uint8_t outlet)
{
    return BUSES > 1 && part == 0 && outlet >= SECOND_BUS_OUTLET ? 1 : nodes[part].bus;
}

/* The part to which the path on each bus is open, except for its own multiplexer. */
static uint8_t way_open[BUSES];

static void forget_ways(void)
{
    for (uint8_t bus = 0; bus < BUSES; bus++)
        way_open[bus] = NO_PART;
}

static void forget_masks(uint8_t bus)
{
    way_open[bus] = NO_PART;
    for (uint8_t i = 0; i < hardware_part_count; i++)
        nodes[i].open[bus] = UNKNOWN_MASK;
}

/* The next multiplexer to set on the path to a channel of a part: from the root outwards, the first that has another
 * channel open. Returns NO_PART if the path is open. */
static uint8_t next_on_way(uint8_t bus, uint8_t part, uint8_t mask, uint8_t *wanted)
{
    uint8_t first = NO_PART, goal = part;
    for (;;) {
        if (nodes[part].open[bus] != mask) {
            first = part;
            *wanted = mask;
        }
        if (hardware_parts[part].parent == NO_PARENT || way_open[bus] == part)
            break;
        mask = (uint8_t)(1u << (FIRST_OUTLET_CHANNEL + hardware_parts[part].outlet));
        part = hardware_parts[part].parent;
    }
    if (first == NO_PART || first == goal)
        way_open[bus] = goal;
    return first;
}

static void begin_to_open(uint8_t bus, uint8_t part, uint8_t mask)
{
    static uint8_t masks[BUSES];
    masks[bus] = mask;
    if (way_open[bus] != part)
        way_open[bus] = NO_PART;
    nodes[part].open[bus] = UNKNOWN_MASK;
    bus_begin(bus, multiplexer_address(nodes[part].level), &masks[bus], 1, 0, 0);
}

/* A part, or the path to it, has failed: from now on it and everything that hangs on it have no data. */
static void fail(uint8_t part)
{
    if (nodes[part].failing)
        return;
    nodes[part].failing = 1;
    nodes[part].failing_since = (uint16_t)(hardware_micros() / 1000);
}

/* A line is held low: by what was opened last, or by something left open beyond it. If nine clocks do not help, all
 * multiplexers are closed. Only a channel that does it twice in a row stays closed for a while. */
static void unstick(uint8_t bus, uint8_t part, uint8_t mask)
{
    bus_clear(bus);
    forget_masks(bus);
    if (!bus_is_free(bus)) {
        bus_reset_multiplexers(bus);
        for (uint8_t i = 0; i < hardware_part_count; i++)
            nodes[i].open[bus] = 0;
    }
    if (part == NO_PART)
        return;
    nodes[part].blocked |= nodes[part].stuck & mask;
    nodes[part].stuck |= mask;
}

static void has_opened(uint8_t bus, uint8_t part, uint8_t mask)
{
    nodes[part].open[bus] = mask;
    nodes[part].stuck &= (uint8_t)~mask;
}

/* --- Blocking transfers --- */

static enum bus_outcome wait_for(uint8_t bus)
{
    enum bus_outcome outcome;
    while ((outcome = bus_poll(bus)) == BUS_BUSY)
        bus_wait();
    return outcome;
}

/* Opens the path to a channel of a part. */
static int reach(uint8_t bus, uint8_t part, uint8_t mask)
{
    uint8_t next, wanted = 0;
    while ((next = next_on_way(bus, part, mask, &wanted)) != NO_PART) {
        if ((nodes[next].blocked & wanted) != 0)
            return 0;
        begin_to_open(bus, next, wanted);
        enum bus_outcome outcome = wait_for(bus);
        if (outcome == BUS_DONE && bus_is_free(bus)) {
            has_opened(bus, next, wanted);
            continue;
        }
        if (outcome == BUS_NACK) {
            forget_masks(bus);
            fail(next);
            return 0;
        }
        unstick(bus, next, wanted);
    }
    return 1;
}

/* A transfer with a chip at the end of an open path. */
static int transfer(uint8_t bus, uint8_t part, uint8_t mask, uint8_t address, const uint8_t *out, uint8_t out_length,
                    uint8_t *in, uint8_t in_length)
{
    bus_begin(bus, address, out, out_length, in, in_length);
    enum bus_outcome outcome = wait_for(bus);
    if (outcome == BUS_STUCK)
        unstick(bus, part, mask);
    return outcome == BUS_DONE;
}

static int read_memory(uint8_t bus, uint8_t part, uint8_t mask, uint8_t from, uint8_t *bytes)
{
    return transfer(bus, part, mask, MEMORY_ADDRESS, &from, 1, bytes, 8);
}

static uint8_t crc8(const uint8_t *bytes, uint8_t length)
{
    uint8_t crc = 0;
    while (length-- > 0) {
        crc ^= *bytes++;
        for (uint8_t bit = 0; bit < 8; bit++)
            crc = (uint8_t)(crc & 0x80 ? crc << 1 ^ 0x07 : crc << 1);
    }
    return crc;
}
