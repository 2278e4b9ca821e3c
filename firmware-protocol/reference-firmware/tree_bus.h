/* How a part of the modular bus is wired and what its memory contains. The guide has a drawing.
 *
 * A plug carries eight lines: power, ground, SDA, SCL, RESET and the three level lines L0 L1 L2. Each part contains
 *
 *   a multiplexer TCA9548A   its address pins A0 A1 A2 on L0 L1 L2 of the inlet, its RESET on RESET
 *     channel 0              the memory (24AA02E64), the light (PCA9536), the first sensor
 *     channels 1 and 2       the second and third sensor of a three-axis joint
 *     channels 3 to 7        outlets 0 to 4
 *   one XOR gate             the outlet's level lines are L0' = L2, L1' = L0 ^ L2, L2' = L1
 *
  * All multiplexers between the controller and a part hear what is sent to that part, so along any path outwards their
 * addresses must differ, and yet each part must work wherever it is plugged in. The gate makes the level lines count:
 * from 1 at the controller they go 1 2 4 3 6 7 5, seven levels without a jumper, a switch or a controller in the part. */
#ifndef TREE_BUS_H
#define TREE_BUS_H

#include <stdint.h>

#define MULTIPLEXER_ADDRESS 0x70u /* plus the level lines */
#define LEVELS 7u
#define FIRST_OUTLET_CHANNEL 3u

/* The memory: a label of one page, and the number from the factory (EUI-64) at the end. */
#define MEMORY_ADDRESS 0x50u
#define MEMORY_LABEL 0x00u
#define MEMORY_NUMBER 0xF8u
#define LABEL_MARK 0x41u
#define LABEL_VERSION 1u
#define LABEL_LENGTH 8u
/* offset 0 LABEL_MARK, 1 LABEL_VERSION, 2 kind, 3 sensor count, 4 outlet count, 5 counts per turn minus one u16,
 * 7 CRC-8 (polynomial 0x07, start 0) over the seven bytes before it */

/* The light: bit 0 of a PCA9536, which lights up when it is low. */
#define LIGHT_ADDRESS 0x41u
#define LIGHT_OUTPUT 0x01u
#define LIGHT_DIRECTION 0x03u

/* A number in the protocol has twelve bytes: these four, which identify the source of the rest, and the EUI-64. */
#define NUMBER_PREFIX {'E', 'U', 'I', 0}

#endif
