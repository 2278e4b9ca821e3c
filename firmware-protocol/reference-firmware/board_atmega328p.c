/* Arduino Nano or Uno: an ATmega328P at 16 MHz with a USB serial bridge on its UART. Pins as printed on the board:
 *
 *   A4 SDA, A5 SCL   the bus, with 2.2 kOhm pull-ups to 5 V
 *   D2               RESET of the multiplexers
 *   D0, D1           the serial bridge */
#include "bus.h"
#include "hardware.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#define SDA 0x10u
#define SCL 0x20u
#define RESET_PIN 0x04u /* D2 is PD2 */
/* Interrupts see everything written to memory before this, and the other way round. */
#define BARRIER() __asm__ volatile("" ::: "memory")
#define TICK_MICROS 4u
#define TICKS_PER_MILLI (1000u / TICK_MICROS)
/* A byte that takes longer than any chip on the bus may stretch the clock. */
#define STUCK_TICKS (1000u / TICK_MICROS)

/* --- Clock: timer 1 at 250 kHz, and how often it has overflowed --- */

static volatile uint32_t overflows;

ISR(TIMER1_OVF_vect)
{
    overflows++;
}

/* Ends a sleep every millisecond, and at the time being waited for. */
ISR(TIMER1_COMPA_vect)
{
    OCR1A += TICKS_PER_MILLI;
}

EMPTY_INTERRUPT(TIMER1_COMPB_vect)

/* Interrupts are off. */
static uint64_t ticks_now(void)
{
    uint16_t low = TCNT1;
    uint32_t high = overflows;
    /* It may have overflowed since interrupts were turned off. */
    if ((TIFR1 & _BV(TOV1)) != 0 && low < 0x8000u)
        high++;
    return (uint64_t)high << 16 | low;
}

uint64_t hardware_micros(void)
{
    uint8_t flags = SREG;
    cli();
    uint64_t ticks = ticks_now();
    SREG = flags;
    return ticks * TICK_MICROS;
}

static uint16_t timer(void)
{
    uint8_t flags = SREG;
    cli();
    uint16_t ticks = TCNT1;
    SREG = flags;
    return ticks;
}

/* Sleeps until the next interrupt, unless something has arrived since the last check. Interrupts are off before, on after:
 * the processor executes one more instruction between enabling interrupts and taking one. */
static void sleep_unless(uint8_t awake)
{
    if (!awake) {
        sleep_enable();
        sei();
        sleep_cpu();
        sleep_disable();
    }
    sei();
}

/* --- Serial port --- */

#define RECEIVED_SIZE 64u
static volatile uint8_t received[RECEIVED_SIZE], received_end;
static uint8_t received_begin;
static volatile uint16_t delimiter_timer; /* when the last zero byte came */
static const uint8_t *volatile send_next;
static volatile uint16_t send_left;

ISR(USART_RX_vect)
{
    uint8_t status = UCSR0A, byte = UDR0, next = (uint8_t)((received_end + 1) % RECEIVED_SIZE);
    /* The checksum reveals anything lost or damaged. */
    (void)status;
    if (byte == 0)
        delimiter_timer = TCNT1;
    if (next == received_begin)
        return;
    received[received_end] = byte;
    received_end = next;
}

ISR(USART_UDRE_vect)
{
    UDR0 = *send_next++;
    if (--send_left == 0)
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
}

int hardware_receive(void)
{
    if (received_begin == received_end)
        return -1;
    uint8_t byte = received[received_begin];
    received_begin = (uint8_t)((received_begin + 1) % RECEIVED_SIZE);
    return byte;
}

/* Bytes wait for a few milliseconds at most, which sixteen timer bits can measure. */
uint64_t hardware_received_micros(void)
{
    uint8_t flags = SREG;
    cli();
    uint64_t ticks = ticks_now();
    uint16_t age = (uint16_t)((uint16_t)ticks - delimiter_timer);
    SREG = flags;
    return (ticks - age) * TICK_MICROS;
}

void hardware_flush(void)
{
    while ((UCSR0B & _BV(UDRIE0)) != 0) {
    }
}

void hardware_send(const uint8_t *bytes, size_t length)
{
    hardware_flush();
    if (length == 0)
        return;
    send_next = bytes;
    send_left = (uint16_t)length;
    BARRIER();
    UCSR0B |= _BV(UDRIE0);
}

void hardware_wait(uint64_t until)
{
    /* The slow part is done while bytes can still arrive. */
    uint64_t now = hardware_micros();
    uint16_t then = timer();
    if (until < now + 2 * TICK_MICROS)
        return;
    then += until < now + 1000 ? (uint16_t)(until - now) / TICK_MICROS : TICKS_PER_MILLI;
    cli();
    OCR1B = then;
    sleep_unless((int16_t)(then - TCNT1) <= 1 || received_begin != received_end);
}

void hardware_start(void)
{
    TCCR1A = 0;
    TCCR1B = _BV(CS11) | _BV(CS10); /* 16 MHz / 64 */
    TIMSK1 = _BV(TOIE1) | _BV(OCIE1A) | _BV(OCIE1B);
    set_sleep_mode(SLEEP_MODE_IDLE);
    UBRR0 = (uint16_t)(F_CPU / 8 / LINE_BAUD - 1);
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
    bus_start(0);
    sei();
}

/* --- Sensor bus --- */

/* Transfers run byte by byte in the interrupt. */
static struct {
    uint8_t address, out_length, in_length, at;
    volatile uint8_t outcome, doing;
    const uint8_t *out;
    uint8_t *in;
    volatile uint16_t progress; /* timer 1 when the bus last did something */
} bus_now;
enum { IDLE, RUNNING, STOPPING };

void bus_start(uint8_t bus)
{
    (void)bus;
    DDRC &= (uint8_t)~(SDA | SCL);
    PORTC &= (uint8_t)~(SDA | SCL);
    DDRD &= (uint8_t)~RESET_PIN;
    PORTD |= RESET_PIN;
    TWSR = 0;
    TWBR = (uint8_t)((F_CPU / 400000 - 16) / 2);
    TWCR = _BV(TWEN);
}

int bus_is_free(uint8_t bus)
{
    (void)bus;
    return (PINC & (SDA | SCL)) == (SDA | SCL);
}

void bus_begin(uint8_t bus, uint8_t address, const uint8_t *out, uint8_t out_length, uint8_t *in, uint8_t in_length)
{
    bus_now.doing = IDLE;
    bus_now.outcome = BUS_STUCK;
    if (!bus_is_free(bus))
        return;
    bus_now.address = (uint8_t)(address << 1);
    bus_now.out = out;
    bus_now.out_length = out_length;
    bus_now.in = in;
    bus_now.in_length = in_length;
    bus_now.at = 0;
    bus_now.doing = RUNNING;
    bus_now.progress = timer();
    BARRIER();
    TWCR = _BV(TWINT) | _BV(TWSTA) | _BV(TWEN) | _BV(TWIE);
}

static void stop_with(uint8_t outcome)
{
    bus_now.outcome = outcome;
    bus_now.doing = STOPPING;
    TWCR = _BV(TWINT) | _BV(TWSTO) | _BV(TWEN);
}

ISR(TWI_vect)
{
    bus_now.progress = TCNT1;
    uint8_t again = _BV(TWINT) | _BV(TWEN) | _BV(TWIE);
    switch (TWSR & 0xF8) {
    case 0x08: /* start */
        TWDR = bus_now.address | (bus_now.out_length == 0);
        break;
    case 0x10: /* repeated start */
        TWDR = bus_now.address | 1;
        break;
    case 0x18: /* address or byte acknowledged */
    case 0x28:
        if (bus_now.at < bus_now.out_length) {
            TWDR = bus_now.out[bus_now.at++];
        } else if (bus_now.in_length > 0) {
            again |= _BV(TWSTA);
        } else {
            stop_with(BUS_DONE);
            return;
        }
        break;
    case 0x40: /* address acknowledged, bytes will follow */
        bus_now.at = 0;
        if (bus_now.in_length > 1)
            again |= _BV(TWEA);
        break;
    case 0x50: /* a byte has arrived, and more are wanted */
        bus_now.in[bus_now.at++] = TWDR;
        if (bus_now.at + 1 < bus_now.in_length)
            again |= _BV(TWEA);
        break;
    case 0x58: /* the last byte has arrived */
        bus_now.in[bus_now.at] = TWDR;
        stop_with(BUS_DONE);
        return;
    case 0x20: /* not acknowledged */
    case 0x30:
    case 0x48:
        stop_with(BUS_NACK);
        return;
    default: /* something else pulled a line */
        bus_now.outcome = BUS_STUCK;
        bus_now.doing = IDLE;
        TWCR = 0;
        return;
    }
    TWCR = again;
}

enum bus_outcome bus_poll(uint8_t bus)
{
    (void)bus;
    if (bus_now.doing == STOPPING && (TWCR & _BV(TWSTO)) == 0)
        bus_now.doing = IDLE;
    if (bus_now.doing == IDLE) {
        BARRIER();
        return bus_now.outcome;
    }
    cli();
    if ((uint16_t)(TCNT1 - bus_now.progress) > STUCK_TICKS) {
        TWCR = 0;
        bus_now.outcome = BUS_STUCK;
        bus_now.doing = IDLE;
    }
    sei();
    return BUS_BUSY;
}

void bus_wait(void)
{
    cli();
    sleep_unless(bus_now.doing != RUNNING);
}

/* Waits for 4 to 8 microseconds, half a slow clock of the bus. */
static void half_clock(void)
{
    for (uint16_t began = timer(); (uint16_t)(timer() - began) < 2;) {
    }
}

/* The lines are open drain: low by the pin, high by the pull-up. */
static void set_line(uint8_t line, int high)
{
    if (high)
        DDRC &= (uint8_t)~line;
    else
        DDRC |= line;
    half_clock();
}

void bus_clear(uint8_t bus)
{
    (void)bus;
    TWCR = 0;
    set_line(SDA, 1);
    for (uint8_t clock = 0; clock < 9; clock++) {
        set_line(SCL, 0);
        set_line(SCL, 1);
    }
    set_line(SCL, 0);
    set_line(SDA, 0);
    set_line(SCL, 1);
    set_line(SDA, 1);
    TWCR = _BV(TWEN);
}

void bus_reset_multiplexers(uint8_t bus)
{
    (void)bus;
    PORTD &= (uint8_t)~RESET_PIN;
    DDRD |= RESET_PIN;
    half_clock();
    DDRD &= (uint8_t)~RESET_PIN;
    PORTD |= RESET_PIN;
    half_clock();
}
