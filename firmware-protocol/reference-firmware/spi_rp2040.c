/* SPI and analogue inputs of a Raspberry Pi Pico: GP19 data out, GP16 data in, GP18 clock; analogue inputs are GP26 to GP28,
 * if not used as select lines. */
#include "spi.h"

#include "hardware.h"
#include "rp2040.h"

#define SPI0 0x4003C000u
#define SPI_FORMAT (SPI0 + 0x00u)
#define SPI_CONTROL (SPI0 + 0x04u)
#define SPI_DATA (SPI0 + 0x08u)
#define SPI_STATUS (SPI0 + 0x0Cu)
#define SPI_PRESCALER (SPI0 + 0x10u)
#define ADC_CONTROL 0x4004C000u
#define ADC_RESULT 0x4004C004u
#define PIN_HIGH 0xD0000014u
enum { RESET_ADC = 1 << 0, DATA_OUT = 19, DATA_IN = 16, CLOCK = 18 };

/* Select lines in order. The pins of the I2C buses are free in such a puppet. */
static const uint8_t selects[] = {10, 11, 12, 13, 14, 15, 20, 21, 22, 2, 3, 17, 4, 5, 6, 7, 8, 9, 28, 27, 26};

void spi_start(void)
{
    for (uint8_t i = 0; i < sizeof selects; i++) {
        REGISTER(PIN_HIGH) = 1u << selects[i];
        REGISTER(PIN_OUTPUT_ON) = 1u << selects[i];
        REGISTER(PIN_CONTROL(selects[i])) = PIN_BY_HAND;
    }
    CLEAR(RESETS) = RESET_SPI0 | RESET_ADC;
    while ((REGISTER(RESETS_DONE) & RESET_SPI0) == 0) {
    }
    REGISTER(PIN_CONTROL(DATA_OUT)) = PIN_SPI;
    REGISTER(PIN_CONTROL(DATA_IN)) = PIN_SPI;
    REGISTER(PAD(DATA_IN)) = PAD_INPUT | PAD_SCHMITT | PAD_PULL_UP;
    REGISTER(PIN_CONTROL(CLOCK)) = PIN_SPI;
    REGISTER(SPI_PRESCALER) = 2;
    REGISTER(SPI_FORMAT) = 7u << 8 | 1 << 7 | 7; /* 125 MHz / 16, mode 1, 8 bits */
    REGISTER(SPI_CONTROL) = 1 << 1;
    REGISTER(ADC_CONTROL) = 1;
}

void spi_select(uint8_t line, int on)
{
    REGISTER(on ? PIN_LOW : PIN_HIGH) = 1u << selects[line];
}

uint8_t spi_exchange(uint8_t out)
{
    enum { RECEIVED = 1 << 2 };
    REGISTER(SPI_DATA) = out;
    while ((REGISTER(SPI_STATUS) & RECEIVED) == 0) {
    }
    return (uint8_t)REGISTER(SPI_DATA);
}

uint16_t analogue_read(uint8_t input)
{
    enum { ON = 1, ONCE = 1 << 2, READY = 1 << 8, CHOICE = 12 };
    uint32_t pin = 26u + input;
    REGISTER(PIN_OUTPUT_OFF) = 1u << pin;
    REGISTER(PIN_CONTROL(pin)) = 31; /* no digital function */
    REGISTER(PAD(pin)) = 0;
    REGISTER(ADC_CONTROL) = ON | ONCE | (uint32_t)input << CHOICE;
    while ((REGISTER(ADC_CONTROL) & READY) == 0) {
    }
    return (uint16_t)(REGISTER(ADC_RESULT) >> 2);
}
