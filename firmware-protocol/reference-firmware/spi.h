/* What tree_table.c needs from a board: an SPI port with select lines, and analogue inputs. */
#ifndef SPI_H
#define SPI_H

#include <stdint.h>

/* Sets both up: mode 1 (the clock idles low, bits are sampled as it falls), highest bit first, all selects high. The data
 * line from the sensors needs a pull-up, so that a missing sensor reads as ones. */
void spi_start(void);

/* Pulls a select line low or releases it. The guide says which pin is which line. */
void spi_select(uint8_t line, int on);

/* A byte out and one in. */
uint8_t spi_exchange(uint8_t out);

/* An analogue input: 0 to 1023, relative to the supply. */
uint16_t analogue_read(uint8_t input);

#endif
