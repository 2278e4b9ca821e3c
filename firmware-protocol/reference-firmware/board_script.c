/* A board that is none, for tests on the machine that compiles this: the host's bytes come from standard input, each
 * line "MICROSECONDS HEX", what the firmware sends goes to standard output as it is, and the clock goes on by 100
 * microseconds whenever somebody looks at it. The program ends with the last line's time, which may hold no bytes. */
#include "hardware.h"

#include <stdio.h>
#include <stdlib.h>

static uint64_t now, due;
static uint8_t line[256];
static size_t length, at;
static int script_is_over;

static void next_line(void)
{
    char text[600];
    unsigned long long micros;
    int used, pair;
    unsigned value;
    length = at = 0;
    if (!fgets(text, sizeof text, stdin) || sscanf(text, "%llu%n", &micros, &used) != 1) {
        script_is_over = 1;
        return;
    }
    due = micros;
    while (length < sizeof line && sscanf(text + used, "%2x%n", &value, &pair) == 1) {
        line[length++] = (uint8_t)value;
        used += pair;
    }
}

void hardware_start(void)
{
    next_line();
}

uint64_t hardware_micros(void)
{
    now += 100;
    if (script_is_over || (now >= due && length == 0)) {
        fflush(stdout);
        exit(0);
    }
    return now;
}

int hardware_receive(void)
{
    if (script_is_over || now < due)
        return -1;
    if (at == length) {
        next_line();
        return -1;
    }
    return line[at++];
}

void hardware_send(const uint8_t *bytes, size_t count)
{
    fwrite(bytes, 1, count, stdout);
}
