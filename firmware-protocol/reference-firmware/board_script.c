/* Not a real board, but one for tests on the computer that compiles this: the host's bytes come from standard input, in
 * lines "MICROSECONDS HEX", what the firmware sends goes to standard output unchanged, and the clock advances by 100
 * microseconds whenever it is read. The program ends at the last line's time; that line may have no bytes. */
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

void hardware_wait(uint64_t until_micros)
{
    (void)until_micros;
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

uint64_t hardware_received_micros(void)
{
    return hardware_micros();
}

void hardware_send(const uint8_t *bytes, size_t count)
{
    fwrite(bytes, 1, count, stdout);
}

void hardware_flush(void)
{
}
