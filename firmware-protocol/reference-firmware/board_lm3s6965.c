/* A Cortex-M3 board (TI LM3S6965 evaluation kit), as emulated by QEMU: UART0 and the system timer. */
#include "hardware.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define UART_DATA REGISTER(0x4000C000)
#define UART_FLAGS REGISTER(0x4000C018)
#define UART_DIVISOR REGISTER(0x4000C024)
#define UART_FRACTION REGISTER(0x4000C028)
#define UART_FORMAT REGISTER(0x4000C02C)
#define UART_CONTROL REGISTER(0x4000C030)
#define UART_CLOCK REGISTER(0x400FE104)
#define PORT_CLOCK REGISTER(0x400FE108)
#define PORT_A_FUNCTION REGISTER(0x40004420)
#define PORT_A_DIGITAL REGISTER(0x4000451C)
#define TIMER_CONTROL REGISTER(0xE000E010)
#define TIMER_RELOAD REGISTER(0xE000E014)
#define TIMER_VALUE REGISTER(0xE000E018)
#define INTERRUPT_STATE REGISTER(0xE000ED04)

/* 12.5 MHz after reset: two ticks per 160 ns. */
#define CYCLES_PER_MILLI 12500u
#define RECEIVE_EMPTY 0x10u
#define TRANSMIT_FULL 0x20u
#define TIMER_PENDING 0x04000000u

static volatile uint32_t millis, millis_high;

static void count_milli(void)
{
    if (++millis == 0)
        millis_high++;
}

void hardware_start(void)
{
    UART_CLOCK |= 1;
    PORT_CLOCK |= 1;
    PORT_A_FUNCTION |= 3;
    PORT_A_DIGITAL |= 3;
    UART_CONTROL = 0;
    /* 12.5 MHz / (16 * 0.78125) is 1 Mbaud; the emulator ignores the speed. */
    UART_DIVISOR = 0;
    UART_FRACTION = 50;
    UART_FORMAT = 0x70; /* 8 bits, no parity, FIFOs on */
    UART_CONTROL = 0x301;
    TIMER_RELOAD = CYCLES_PER_MILLI - 1;
    TIMER_VALUE = 0;
    TIMER_CONTROL = 7; /* processor clock, interrupt, on */
}

uint64_t hardware_micros(void)
{
    static uint64_t latest;
    uint32_t low, high, value;
    /* The timer may pass zero between two readings. */
    do {
        high = millis_high;
        low = millis;
        value = TIMER_VALUE;
    } while (low != millis || (INTERRUPT_STATE & TIMER_PENDING) != 0);
    uint64_t now = (((uint64_t)high << 32) | low) * 1000u + (CYCLES_PER_MILLI - 1 - value) * 2 / 25;
    if (now > latest)
        latest = now;
    return latest;
}

void hardware_wait(uint64_t until_micros)
{
    (void)until_micros;
}

int hardware_receive(void)
{
    return (UART_FLAGS & RECEIVE_EMPTY) != 0 ? -1 : (int)(UART_DATA & 0xFF);
}

uint64_t hardware_received_micros(void)
{
    return hardware_micros();
}

void hardware_send(const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        while ((UART_FLAGS & TRANSMIT_FULL) != 0) {
        }
        UART_DATA = bytes[i];
    }
}

void hardware_flush(void)
{
}

extern uint32_t data_load, data_begin, data_end, bss_begin, bss_end, stack_top;
int main(void);

void reset(void)
{
    uint32_t *from = &data_load;
    for (uint32_t *to = &data_begin; to < &data_end;)
        *to++ = *from++;
    for (uint32_t *to = &bss_begin; to < &bss_end;)
        *to++ = 0;
    main();
    for (;;) {
    }
}

static void stop_here(void)
{
    for (;;) {
    }
}

typedef void handler(void);
__attribute__((section(".vectors"), used)) static handler *const vectors[16] = {
    (handler *)&stack_top, reset,     stop_here, stop_here, stop_here, stop_here, stop_here, stop_here,
    stop_here,             stop_here, stop_here, stop_here, stop_here, stop_here, stop_here, count_milli,
};
