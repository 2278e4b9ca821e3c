/* The RP2040 registers that the firmware uses, by chapter of the data sheet. */
#ifndef RP2040_H
#define RP2040_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
/* Every peripheral's registers have three aliases; writes to these two set or clear the bits that are one (2.1.2). */
#define SET(address) REGISTER((address) + 0x2000u)
#define CLEAR(address) REGISTER((address) + 0x3000u)

/* 2.14 resets */
#define RESETS 0x4000C000u
#define RESETS_DONE 0x4000C008u
enum {
    RESET_I2C0 = 1 << 3, RESET_I2C1 = 1 << 4, RESET_IO = 1 << 5, RESET_PADS = 1 << 8, RESET_PLL_SYS = 1 << 12,
    RESET_PLL_USB = 1 << 13, RESET_SPI0 = 1 << 16, RESET_TIMER = 1 << 21, RESET_UART0 = 1 << 22, RESET_USB = 1 << 24,
};

/* 2.15 clocks, 2.16 crystal, 2.18 PLL */
#define CLOCK_REF_CONTROL 0x40008030u
#define CLOCK_REF_SELECTED 0x40008038u
#define CLOCK_SYS_CONTROL 0x4000803Cu
#define CLOCK_SYS_SELECTED 0x40008044u
#define CLOCK_PERI_CONTROL 0x40008048u
#define CLOCK_USB_CONTROL 0x40008054u
#define CRYSTAL_CONTROL 0x40024000u
#define CRYSTAL_STATUS 0x40024004u
#define CRYSTAL_STARTUP 0x4002400Cu
#define PLL_SYS 0x40028000u
#define PLL_USB 0x4002C000u
#define PLL_STATUS 0x0u
#define PLL_POWER 0x4u
#define PLL_FEEDBACK 0x8u
#define PLL_DIVIDERS 0xCu

/* 2.19 pins */
#define PIN_CONTROL(pin) (0x40014004u + 8u * (pin))
#define PAD(pin) (0x4001C004u + 4u * (pin))
#define PIN_INPUT 0xD0000004u
#define PIN_LOW 0xD0000018u
#define PIN_OUTPUT_ON 0xD0000024u
#define PIN_OUTPUT_OFF 0xD0000028u
enum { PIN_SPI = 1, PIN_UART = 2, PIN_I2C = 3, PIN_BY_HAND = 5 };
enum { PAD_PULL_UP = 1 << 3, PAD_SCHMITT = 1 << 1, PAD_4_MILLIAMPERES = 1 << 4, PAD_INPUT = 1 << 6 };

/* 4.2 UART */
#define UART0 0x40034000u
#define UART_DATA (UART0 + 0x00u)
#define UART_FLAGS (UART0 + 0x18u)
#define UART_DIVISOR (UART0 + 0x24u)
#define UART_FRACTION (UART0 + 0x28u)
#define UART_FORMAT (UART0 + 0x2Cu)
#define UART_CONTROL (UART0 + 0x30u)
#define UART_INTERRUPTS (UART0 + 0x38u)
enum { UART_RECEIVE_EMPTY = 1 << 4, UART_TRANSMIT_FULL = 1 << 5, UART_BUSY = 1 << 3 };

/* 4.3 I2C */
#define I2C(bus) (0x40044000u + 0x4000u * (bus))
enum {
    I2C_CONTROL = 0x00, I2C_TARGET = 0x04, I2C_DATA = 0x10, I2C_HIGH = 0x1C, I2C_LOW = 0x20, I2C_MASK = 0x30,
    I2C_RAW = 0x34, I2C_CLEAR = 0x40, I2C_ENABLE = 0x6C, I2C_RECEIVED = 0x78, I2C_HOLD = 0x7C, I2C_ABORT_SOURCE = 0x80,
    I2C_ENABLED = 0x9C, I2C_SPIKES = 0xA0,
};

/* 4.6 timer, 4.7 watchdog (whose tick generator drives the timer) */
#define TIMER_HIGH 0x40054024u
#define TIMER_LOW 0x40054028u
#define TIMER_ALARM0 0x40054010u
#define TIMER_INTERRUPT 0x40054034u
#define TIMER_ENABLE 0x40054038u
#define WATCHDOG_TICK 0x4005802Cu

/* Cortex-M0+ */
#define INTERRUPT_ENABLE 0xE000E100u
enum { IRQ_TIMER0 = 0, IRQ_USB = 5, IRQ_UART0 = 20, IRQ_I2C0 = 23, IRQ_I2C1 = 24, IRQS = 26 };

static inline void interrupts_off(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
}

static inline void interrupts_on(void)
{
    __asm__ volatile("cpsie i" ::: "memory");
}

/* Wakes up for any interrupt, even while interrupts are off. */
static inline void wait_for_interrupt(void)
{
    __asm__ volatile("dsb\n\twfi" ::: "memory");
}

#endif
