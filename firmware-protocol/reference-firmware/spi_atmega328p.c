/* SPI and analogue inputs of an Arduino Nano or Uno: D11 data out, D12 data in, D13 clock; select lines 0 to 7 are D3 to
 * D10; analogue inputs are A0 to A7. */
#include "spi.h"

#include <avr/io.h>

void spi_start(void)
{
    PORTD |= 0xF8; /* D3 to D7 */
    DDRD |= 0xF8;
    PORTB |= 0x17; /* D8, D9, D10, and the pull-up of D12 */
    DDRB |= 0x2F;  /* D8 to D11, D13 */
    SPSR = 0;
    SPCR = _BV(SPE) | _BV(MSTR) | _BV(CPHA); /* 16 MHz / 4 */
    ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0); /* 125 kHz: 104 us per conversion */
}

void spi_select(uint8_t line, int on)
{
    volatile uint8_t *port = line < 5 ? &PORTD : &PORTB;
    uint8_t bit = (uint8_t)(line < 5 ? 8u << line : 1u << (line - 5));
    if (on)
        *port &= (uint8_t)~bit;
    else
        *port |= bit;
}

uint8_t spi_exchange(uint8_t out)
{
    SPDR = out;
    while ((SPSR & _BV(SPIF)) == 0) {
    }
    return SPDR;
}

uint16_t analogue_read(uint8_t input)
{
    ADMUX = _BV(REFS0) | (input & 7);
    ADCSRA |= _BV(ADSC);
    while ((ADCSRA & _BV(ADSC)) != 0) {
    }
    return ADC;
}
