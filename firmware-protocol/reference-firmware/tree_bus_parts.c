/* Part of tree_bus.c: parts that are added and removed. */

static uint8_t end_of_subtree(uint8_t part)
{
    uint8_t end = part + 1;
    while (end < hardware_part_count && hardware_parts[end].parent != NO_PARENT && hardware_parts[end].parent >= part)
        end++;
    return end;
}

static void count_sensors(void)
{
    sensor_count = 0;
    for (uint8_t i = 0; i < hardware_part_count; i++)
        sensor_count += hardware_parts[i].sensor_count;
    for (uint8_t i = 0; i < sizeof weak; i++)
        weak[i] = 0;
    gain_turn = 0;
}

static void remove_subtree(uint8_t part)
{
    uint8_t end = end_of_subtree(part), gone = end - part;
    for (uint8_t i = end; i < hardware_part_count; i++) {
        hardware_parts[i - gone] = hardware_parts[i];
        nodes[i - gone] = nodes[i];
        if (hardware_parts[i - gone].parent != NO_PARENT && hardware_parts[i - gone].parent >= end)
            hardware_parts[i - gone].parent -= gone;
    }
    hardware_part_count -= gone;
    forget_ways();
    count_sensors();
}

/* Where a new part belongs: after its siblings on lower outlets, so that the order is that of a walk through the tree and
 * the path from one part to the next is short. */
static uint8_t place_for(uint8_t parent, uint8_t outlet)
{
    if (parent == NO_PARENT)
        return 0;
    uint8_t place = parent + 1, end = end_of_subtree(parent);
    while (place < end && hardware_parts[place].outlet < outlet)
        place = end_of_subtree(place);
    return place;
}

static void insert(const struct part *part, const struct node *node)
{
    uint8_t place = place_for(part->parent, part->outlet);
    for (uint8_t i = hardware_part_count; i > place; i--) {
        hardware_parts[i] = hardware_parts[i - 1];
        nodes[i] = nodes[i - 1];
        if (hardware_parts[i].parent != NO_PARENT && hardware_parts[i].parent >= place)
            hardware_parts[i].parent++;
    }
    hardware_parts[place] = *part;
    nodes[place] = *node;
    found_end = found_end > place ? found_end + 1 : place + 1;
    hardware_part_count++;
    forget_ways();
    count_sensors();
}

static void take_label(struct part *part, const uint8_t *label)
{
    part->kind = label[2];
    part->sensor_count = label[3];
    part->outlet_count = label[4];
    part->counts_per_turn = label[3] > 0 ? (uint32_t)(label[5] | label[6] << 8) + 1 : 0;
}

/* A part without a label, fresh from soldering: kind 0, with the sensors that answer. */
static int count_answering_sensors(uint8_t bus, uint8_t address, struct part *part)
{
    static uint8_t burst[AS5600_BURST];
    static const uint8_t from = AS5600_STATUS;
    for (uint8_t channel = 0; channel < FIRST_OUTLET_CHANNEL; channel++) {
        uint8_t mask = (uint8_t)(1u << channel);
        if (!transfer(bus, NO_PART, 0, address, &mask, 1, 0, 0))
            return 0;
        if (!transfer(bus, NO_PART, 0, AS5600_ADDRESS, &from, 1, burst, sizeof burst))
            break;
        part->sensor_count++;
    }
    part->outlet_count = part->sensor_count > 0 ? 1 : 5;
    part->counts_per_turn = part->sensor_count > 0 ? AS5600_COUNTS : 0;
    return 1;
}

static int label_is_whole(const uint8_t *label)
{
    return label[0] == LABEL_MARK && label[1] == LABEL_VERSION && label[3] <= 3 && label[4] <= 5 &&
           crc8(label, LABEL_LENGTH - 1) == label[7];
}

/* Finds out what answers at this level at the end of the open path: fills in part and node. */
static int identify(uint8_t bus, struct part *part, struct node *node)
{
    static const uint8_t prefix[4] = NUMBER_PREFIX;
    uint8_t label[LABEL_LENGTH], address = multiplexer_address(node->level);
    static const uint8_t memory_open = 1;
    if (!transfer(bus, NO_PART, 0, address, &memory_open, 1, 0, 0))
        return 0;
    for (uint8_t b = 0; b < BUSES; b++)
        node->open[b] = UNKNOWN_MASK;
    if (!read_memory(bus, NO_PART, 0, MEMORY_NUMBER, part->number + 4) ||
        !read_memory(bus, NO_PART, 0, MEMORY_LABEL, label))
        return 0;
    for (uint8_t i = 0; i < sizeof prefix; i++)
        part->number[i] = prefix[i];
    if (label_is_whole(label))
        take_label(part, label);
    else if (!count_answering_sensors(bus, address, part))
        return 0;
    return 1;
}

/* Two parts with one number, as from a copied memory: the second one gets a number of its own, which says so in the byte
 * before the EUI-64. The rest of the puppet carries on; a host accepts no tree in which a number occurs twice. */
static void make_unique(struct part *part)
{
    for (uint8_t i = 0; i < hardware_part_count; i++) {
        uint8_t same = 1;
        for (uint8_t at = 0; at < 12; at++)
            same = same && part->number[at] == hardware_parts[i].number[at];
        if (same) {
            part->number[3]++;
            i = 0xFF; /* from the beginning */
        }
    }
}

/* Checks one outlet. Returns whether a part was found there. */
static int look_at_outlet(uint8_t parent, uint8_t outlet)
{
    struct part part = {0};
    struct node node = {0};
    part.parent = parent;
    part.outlet = outlet;
    if (parent != NO_PARENT) {
        node.level = nodes[parent].level + 1;
        node.bus = outlet_bus(parent, outlet);
        if (node.level >= LEVELS || !reach(node.bus, parent, (uint8_t)(1u << (FIRST_OUTLET_CHANNEL + outlet))))
            return 0;
    }
    if (!identify(node.bus, &part, &node) || hardware_part_count == MAX_PARTS ||
        sensor_count + part.sensor_count > MAX_SENSORS)
        return 0;
    make_unique(&part);
    insert(&part, &node);
    return 1;
}

static int outlet_is_taken(uint8_t parent, uint8_t outlet)
{
    for (uint8_t i = parent + 1; i < hardware_part_count; i++)
        if (hardware_parts[i].parent == parent && hardware_parts[i].outlet == outlet)
            return 1;
    return 0;
}

/* Moves on to the next empty outlet. Returns whether there is one before the end of the tree. */
static int next_empty_outlet(void)
{
    for (; look_part < hardware_part_count; look_part++, look_outlet = 0)
        for (; look_outlet < hardware_parts[look_part].outlet_count; look_outlet++)
            if (!nodes[look_part].failing && !outlet_is_taken(look_part, look_outlet))
                return 1;
    return 0;
}

/* Asks a failed part who it is. If it is the same, it is back; another one, or none for some time, means it is gone. */
static int ask_again(uint8_t part, uint16_t now_millis)
{
    uint8_t number[8], bus = nodes[part].bus, same = 1;
    uint8_t parent = hardware_parts[part].parent;
    if (parent != NO_PARENT && nodes[parent].failing)
        return 0; /* its parent is asked first, and takes it along */
    uint16_t failing_since = nodes[part].failing_since;
    nodes[part].failing = 0;
    if (reach(bus, part, 1) && read_memory(bus, part, 1, MEMORY_NUMBER, number)) {
        for (uint8_t i = 0; i < 8; i++)
            same = same && number[i] == hardware_parts[part].number[4 + i];
        if (same)
            return 0;
    }
    nodes[part].failing = 1;
    nodes[part].failing_since = failing_since;
    if ((uint16_t)(now_millis - failing_since) < GONE_MICROS / 1000)
        return 0;
    remove_subtree(part);
    return 1;
}

/* Parts on an outlet that holds the bus low count as unplugged: they cannot be reached. */
static int drop_blocked(void)
{
    for (uint8_t i = 1; i < hardware_part_count; i++) {
        uint8_t mask = (uint8_t)(1u << (FIRST_OUTLET_CHANNEL + hardware_parts[i].outlet));
        if ((nodes[hardware_parts[i].parent].blocked & mask) != 0) {
            remove_subtree(i);
            return 1;
        }
    }
    return 0;
}

/* Sampling asks every sensor. This asks the rest: parts without sensors, and all parts while nothing samples. */
static void ask_silent_parts(void)
{
    for (uint8_t i = 0; i < hardware_part_count; i++)
        if (!nodes[i].failing && (!sampled || hardware_parts[i].sensor_count == 0)) {
            nodes[i].open[nodes[i].bus] = UNKNOWN_MASK;
            reach(nodes[i].bus, i, 1);
        }
    sampled = 0;
}

static int watch(uint64_t now)
{
    int changed = 0;
    if (hardware_part_count == 0) {
        if (now >= look_at) {
            look_at = now + AGAIN_MICROS;
            changed = look_at_outlet(NO_PARENT, 0);
        }
        return changed;
    }
    if (now >= unblock_at) {
        unblock_at = now + BLOCKED_MICROS;
        for (uint8_t i = 0; i < hardware_part_count; i++)
            nodes[i].blocked = 0;
    }
    if (now >= again_at) {
        again_at = now + AGAIN_MICROS;
        while (drop_blocked())
            changed = 1;
        for (uint8_t i = 0; i < hardware_part_count; i++)
            if (nodes[i].failing && ask_again(i, (uint16_t)(now / 1000))) {
                changed = 1;
                break;
            }
    }
    if (now < look_at)
        return changed;
    if (!next_empty_outlet()) {
        look_part = look_outlet = found_end = 0;
        look_at = now + LOOK_MICROS;
        looked_once = 1;
        ask_silent_parts();
        return changed;
    }
    if (look_at_outlet(look_part, look_outlet)) {
        look_at = now; /* what hangs on it is found immediately */
        return 1;
    }
    look_outlet++;
    return changed;
}

int hardware_watch(uint64_t now)
{
    /* Parts plugged in together are reported together, as long as that makes no sample late. */
    uint32_t limit = looked_once ? TOGETHER_MICROS : FIRST_LOOK_MICROS;
    int changed = 0;
    found_end = 0;
    do
        changed |= watch(hardware_micros());
    while ((!looked_once || look_part < found_end) && hardware_micros() - now < limit);
    looked_once = 1;
    return changed;
}
