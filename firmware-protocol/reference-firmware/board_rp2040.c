/* Raspberry Pi Pico: an RP2040 at 125 MHz. Pins by the chip's numbering:
 *
 *   GP0 TX, GP1 RX     the serial line; the USB socket is also a serial port (usb_rp2040.c)
 *   GP4 SDA, GP5 SCL   the first bus, with 1.5 kOhm pull-ups to 3.3 V
 *   GP6 SDA, GP7 SCL   the second bus
 *   GP8, GP9           RESET of the multiplexers on the first and second bus
 *
 * A host may use either line; answers and samples go to the line used last. */
#include "bus.h"
#include "hardware.h"
#include "rp2040.h"
#include "usb_rp2040.h"

#define CLOCK_HERTZ 125000000u
#define UART_TX 0u
#define UART_RX 1u
#define SDA(bus) (4u + 2u * (bus))
#define SCL(bus) (5u + 2u * (bus))
#define RESET_PIN(bus) (8u + (bus))
#define BIT(pin) (1u << (pin))

/* --- Clocks --- */

static void start_pll(uint32_t pll, uint32_t feedback, uint32_t first, uint32_t second)
{
    enum { LOCKED = 1u << 31, OFF = 1 << 0, DIVIDERS_OFF = 1 << 3, OSCILLATOR_OFF = 1 << 5 };
    REGISTER(pll + PLL_STATUS) = 1; /* the crystal, undivided */
    REGISTER(pll + PLL_FEEDBACK) = feedback;
    CLEAR(pll + PLL_POWER) = OFF | OSCILLATOR_OFF;
    while ((REGISTER(pll + PLL_STATUS) & LOCKED) == 0) {
    }
    REGISTER(pll + PLL_DIVIDERS) = first << 16 | second << 12;
    CLEAR(pll + PLL_POWER) = DIVIDERS_OFF;
}

static void leave_reset(uint32_t which)
{
    CLEAR(RESETS) = which;
    while ((REGISTER(RESETS_DONE) & which) != which) {
    }
}

static void start_clocks(void)
{
    REGISTER(CRYSTAL_STARTUP) = 47; /* 1 ms */
    REGISTER(CRYSTAL_CONTROL) = 0xFABu << 12 | 0xAA0u;
    while ((REGISTER(CRYSTAL_STATUS) & 1u << 31) == 0) {
    }
    leave_reset(RESET_PLL_SYS | RESET_PLL_USB);
    start_pll(PLL_SYS, 125, 6, 2); /* 12 MHz * 125 / 12 = 125 MHz */
    start_pll(PLL_USB, 100, 5, 5); /* 12 MHz * 100 / 25 = 48 MHz */
    REGISTER(CLOCK_REF_CONTROL) = 2;
    while ((REGISTER(CLOCK_REF_SELECTED) & 1u << 2) == 0) {
    }
    REGISTER(CLOCK_SYS_CONTROL) = 1;
    while ((REGISTER(CLOCK_SYS_SELECTED) & 1u << 1) == 0) {
    }
    REGISTER(CLOCK_PERI_CONTROL) = 1u << 11;
    REGISTER(CLOCK_USB_CONTROL) = 1u << 11;
    REGISTER(WATCHDOG_TICK) = 1u << 9 | 12;
    leave_reset(RESET_TIMER | RESET_IO | RESET_PADS | RESET_UART0 | RESET_I2C0 | RESET_I2C1 | RESET_USB);
}

uint64_t hardware_micros(void)
{
    uint32_t high, low;
    do {
        high = REGISTER(TIMER_HIGH);
        low = REGISTER(TIMER_LOW);
    } while (high != REGISTER(TIMER_HIGH));
    return (uint64_t)high << 32 | low;
}

static void timer_interrupt(void)
{
    REGISTER(TIMER_INTERRUPT) = 1;
}

/* Sets the alarm that ends a sleep. Interrupts are off. Returns whether that time is still in the future. */
static int wake_in(uint32_t micros)
{
    uint32_t then = REGISTER(TIMER_LOW) + micros;
    REGISTER(TIMER_ALARM0) = then;
    return micros > 1 && (int32_t)(then - REGISTER(TIMER_LOW)) > 0;
}

/* --- Serial line and USB --- */

#define RECEIVED_SIZE 512u
static volatile uint8_t received[RECEIVED_SIZE];
static volatile uint32_t received_begin, received_end;
static volatile uint32_t delimiter_micros;
static volatile uint8_t host_is_on_usb;
static const uint8_t *send_next;
static size_t send_left;
static uint32_t send_progress;

static size_t receive_room(void)
{
    return RECEIVED_SIZE - 1 - (received_end - received_begin) % RECEIVED_SIZE;
}

/* Called from an interrupt: what does not fit is lost, and the checksum reveals it. */
static void take_byte(uint8_t byte, uint8_t from_usb)
{
    if (byte == 0)
        delimiter_micros = REGISTER(TIMER_LOW);
    if (receive_room() == 0)
        return;
    host_is_on_usb = from_usb;
    received[received_end] = byte;
    received_end = (received_end + 1) % RECEIVED_SIZE;
}

static void uart_interrupt(void)
{
    while ((REGISTER(UART_FLAGS) & UART_RECEIVE_EMPTY) == 0)
        take_byte((uint8_t)REGISTER(UART_DATA), 0);
}

int usb_may_receive(size_t length)
{
    return receive_room() >= length;
}

void usb_received(uint8_t byte)
{
    take_byte(byte, 1);
}

int hardware_receive(void)
{
    if (received_begin == received_end)
        return -1;
    uint8_t byte = received[received_begin];
    received_begin = (received_begin + 1) % RECEIVED_SIZE;
    usb_receive_on();
    return byte;
}

uint64_t hardware_received_micros(void)
{
    uint64_t now = hardware_micros();
    return now - ((uint32_t)now - delimiter_micros);
}

/* Passes on as much as the line takes now. */
static void send_on(void)
{
    size_t before = send_left;
    if (host_is_on_usb) {
        size_t taken = send_left > 0 ? usb_send(send_next, send_left) : 0;
        send_next += taken;
        send_left -= taken;
    } else {
        while (send_left > 0 && (REGISTER(UART_FLAGS) & UART_TRANSMIT_FULL) == 0) {
            REGISTER(UART_DATA) = *send_next++;
            send_left--;
        }
    }
    if (send_left != before)
        send_progress = REGISTER(TIMER_LOW);
    /* The host has the port open but does not read: drop what is waiting, or everything else would stall. */
    else if (send_left > 0 && REGISTER(TIMER_LOW) - send_progress > 100000u)
        send_left = 0;
}

void hardware_flush(void)
{
    while (send_left > 0)
        send_on();
}

void hardware_send(const uint8_t *bytes, size_t length)
{
    hardware_flush();
    send_next = bytes;
    send_left = length;
    send_progress = REGISTER(TIMER_LOW);
    send_on();
}

void hardware_wait(uint64_t until)
{
    uint64_t now = hardware_micros();
    if (until <= now)
        return;
    send_on();
    uint32_t most = send_left > 0 ? 50 : 1000;
    interrupts_off();
    if (wake_in(until - now < most ? (uint32_t)(until - now) : most) && received_begin == received_end)
        wait_for_interrupt();
    interrupts_on();
}

static void start_uart(void)
{
    /* The divisor has six fractional bits. */
    uint32_t divisor = (CLOCK_HERTZ * 4u + LINE_BAUD / 2) / LINE_BAUD;
    REGISTER(PIN_CONTROL(UART_TX)) = PIN_UART;
    REGISTER(PIN_CONTROL(UART_RX)) = PIN_UART;
    REGISTER(PAD(UART_RX)) = PAD_INPUT | PAD_SCHMITT | PAD_PULL_UP;
    REGISTER(UART_DIVISOR) = divisor >> 6;
    REGISTER(UART_FRACTION) = divisor & 63;
    REGISTER(UART_FORMAT) = 0x70; /* 8 bits, FIFOs on */
    REGISTER(UART_CONTROL) = 0x301;
    REGISTER(UART_INTERRUPTS) = 0x50; /* bytes have arrived, or a pause after too few for that */
}

void hardware_start(void)
{
    start_clocks();
    start_uart();
    for (uint8_t bus = 0; bus < BUSES; bus++)
        bus_start(bus);
    usb_start();
    REGISTER(TIMER_ENABLE) = 1;
    REGISTER(INTERRUPT_ENABLE) = BIT(IRQ_TIMER0) | BIT(IRQ_USB) | BIT(IRQ_UART0) | BIT(IRQ_I2C0) | BIT(IRQ_I2C1);
}

/* --- Sensor buses --- */

enum { STOPPED = 1 << 9, ABORTED = 1 << 6 };
/* Longer than sixteen bytes take at 400 kHz, including all clock stretching. */
#define STUCK_MICROS 1500u

static struct transfer {
    uint8_t *in;
    uint8_t in_length;
    uint8_t running;
    uint8_t outcome;
    uint32_t began, abort_source;
} transfers[BUSES];

/* The interrupts only end a sleep: bus_poll finds out what happened. */
static void i2c0_interrupt(void)
{
    REGISTER(I2C(0) + I2C_MASK) = 0;
}

static void i2c1_interrupt(void)
{
    REGISTER(I2C(1) + I2C_MASK) = 0;
}

/* 400 kHz are 312 clocks: 125 high (7 of them to filter spikes, 7 to notice the rise), 187 low; 1 MHz are 125: 41 and 84. */
static void set_speed(uint32_t i2c, uint32_t hertz)
{
    REGISTER(i2c + I2C_HIGH) = (hertz > 400000u ? 41 : 125) - 7 - 7;
    REGISTER(i2c + I2C_LOW) = (hertz > 400000u ? 84 : 187) - 1;
}

static void start_controller(uint8_t bus)
{
    uint32_t i2c = I2C(bus);
    REGISTER(i2c + I2C_ENABLE) = 0;
    REGISTER(i2c + I2C_MASK) = 0;
    REGISTER(i2c + I2C_CONTROL) = 1 | 2 << 1 | 1 << 5 | 1 << 6 | 1 << 8; /* master, fast, repeated starts */
    REGISTER(i2c + I2C_SPIKES) = 7;
    REGISTER(i2c + I2C_HOLD) = 38; /* 300 ns */
    set_speed(i2c, 400000u);
}

void bus_start(uint8_t bus)
{
    const uint8_t lines[2] = {SDA(bus), SCL(bus)};
    for (uint8_t i = 0; i < 2; i++) {
        REGISTER(PAD(lines[i])) = PAD_INPUT | PAD_SCHMITT | PAD_PULL_UP | PAD_4_MILLIAMPERES;
        REGISTER(PIN_CONTROL(lines[i])) = PIN_I2C;
        REGISTER(PIN_LOW) = BIT(lines[i]);
    }
    REGISTER(PAD(RESET_PIN(bus))) = PAD_INPUT | PAD_PULL_UP | PAD_4_MILLIAMPERES;
    REGISTER(PIN_CONTROL(RESET_PIN(bus))) = PIN_BY_HAND;
    REGISTER(PIN_LOW) = BIT(RESET_PIN(bus));
    start_controller(bus);
}

int bus_is_free(uint8_t bus)
{
    uint32_t both = BIT(SDA(bus)) | BIT(SCL(bus));
    return (REGISTER(PIN_INPUT) & both) == both;
}

void bus_begin(uint8_t bus, uint8_t address, const uint8_t *out, uint8_t out_length, uint8_t *in, uint8_t in_length)
{
    enum { READ = 1 << 8, STOP = 1 << 9, RESTART = 1 << 10 };
    uint32_t i2c = I2C(bus);
    struct transfer *transfer = &transfers[bus];
    transfer->in = in;
    transfer->in_length = in_length;
    transfer->outcome = BUS_STUCK;
    transfer->running = bus_is_free(bus) != 0;
    transfer->began = REGISTER(TIMER_LOW);
    transfer->abort_source = 0;
    if (!transfer->running)
        return;
    REGISTER(i2c + I2C_ENABLE) = 0;
    if (BUS_HERTZ > 400000u)
        set_speed(i2c, BUS_IS_SLOW(address) ? 400000u : BUS_HERTZ);
    REGISTER(i2c + I2C_TARGET) = address;
    REGISTER(i2c + I2C_ENABLE) = 1;
    (void)REGISTER(i2c + I2C_CLEAR);
    for (uint8_t i = 0; i < out_length; i++)
        REGISTER(i2c + I2C_DATA) = out[i] | (in_length == 0 && i + 1 == out_length ? STOP : 0u);
    for (uint8_t i = 0; i < in_length; i++)
        REGISTER(i2c + I2C_DATA) =
            READ | (out_length > 0 && i == 0 ? RESTART : 0u) | (i + 1 == in_length ? STOP : 0u);
    REGISTER(i2c + I2C_MASK) = STOPPED;
}

static enum bus_outcome end_with(struct transfer *transfer, enum bus_outcome outcome)
{
    transfer->running = 0;
    transfer->outcome = (uint8_t)outcome;
    return outcome;
}

enum bus_outcome bus_poll(uint8_t bus)
{
    enum { NOT_ACKNOWLEDGED = 0x1F };
    uint32_t i2c = I2C(bus);
    struct transfer *transfer = &transfers[bus];
    if (send_left > 0)
        send_on();
    if (!transfer->running)
        return transfer->outcome;
    uint32_t raw = REGISTER(i2c + I2C_RAW);
    if ((raw & ABORTED) != 0)
        transfer->abort_source |= REGISTER(i2c + I2C_ABORT_SOURCE);
    if ((raw & ABORTED) != 0 && (transfer->abort_source & NOT_ACKNOWLEDGED) == 0)
        return end_with(transfer, BUS_STUCK);
    if ((raw & STOPPED) != 0) {
        if ((raw & ABORTED) != 0 || REGISTER(i2c + I2C_RECEIVED) != transfer->in_length)
            return end_with(transfer, BUS_NACK);
        for (uint8_t i = 0; i < transfer->in_length; i++)
            transfer->in[i] = (uint8_t)REGISTER(i2c + I2C_DATA);
        return end_with(transfer, BUS_DONE);
    }
    if (REGISTER(TIMER_LOW) - transfer->began > STUCK_MICROS)
        return end_with(transfer, BUS_STUCK);
    return BUS_BUSY;
}

void bus_wait(void)
{
    interrupts_off();
    uint32_t ready = 0;
    for (uint8_t bus = 0; bus < BUSES; bus++)
        ready |= transfers[bus].running ? REGISTER(I2C(bus) + I2C_RAW) & STOPPED : 0;
    if (wake_in(send_left > 0 ? 50 : 500) && !ready)
        wait_for_interrupt();
    interrupts_on();
}

static void half_clock(void)
{
    for (uint32_t began = REGISTER(TIMER_LOW); REGISTER(TIMER_LOW) - began < 3;) {
    }
}

/* The lines are open drain: low by the pin, high by the pull-up. */
static void set_line(uint32_t pin, int high)
{
    REGISTER(high ? PIN_OUTPUT_OFF : PIN_OUTPUT_ON) = BIT(pin);
    half_clock();
}

void bus_clear(uint8_t bus)
{
    /* A controller stuck in a byte releases the lines when it is reset. */
    SET(RESETS) = bus == 0 ? RESET_I2C0 : RESET_I2C1;
    REGISTER(PIN_OUTPUT_OFF) = BIT(SDA(bus)) | BIT(SCL(bus));
    REGISTER(PIN_CONTROL(SDA(bus))) = PIN_BY_HAND;
    REGISTER(PIN_CONTROL(SCL(bus))) = PIN_BY_HAND;
    half_clock();
    for (uint8_t clock = 0; clock < 9; clock++) {
        set_line(SCL(bus), 0);
        set_line(SCL(bus), 1);
    }
    set_line(SCL(bus), 0);
    set_line(SDA(bus), 0);
    set_line(SCL(bus), 1);
    set_line(SDA(bus), 1);
    leave_reset(bus == 0 ? RESET_I2C0 : RESET_I2C1);
    REGISTER(PIN_CONTROL(SDA(bus))) = PIN_I2C;
    REGISTER(PIN_CONTROL(SCL(bus))) = PIN_I2C;
    start_controller(bus);
}

void bus_reset_multiplexers(uint8_t bus)
{
    set_line(RESET_PIN(bus), 0);
    set_line(RESET_PIN(bus), 1);
}

/* --- Reset and interrupts --- */

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
__attribute__((section(".vectors"), used)) static handler *const vectors[16 + IRQS] = {
    [0] = (handler *)&stack_top,
    [1] = reset,
    [2 ... 15] = stop_here,
    [16 + IRQ_TIMER0] = timer_interrupt,
    [16 + IRQ_USB] = usb_interrupt,
    [16 + IRQ_UART0] = uart_interrupt,
    [16 + IRQ_I2C0] = i2c0_interrupt,
    [16 + IRQ_I2C1] = i2c1_interrupt,
};
