/* The second boot stage. The chip's own boot code copies the first 256 bytes of flash into RAM, checks the CRC-32 at their
 * end (uf2.py puts it there) and runs them. They make the flash readable at 0x10000000, with the read command 03h that
 * every flash chip supports, and jump to the program after them (data sheet 2.8.1, 4.10). */
#include "rp2040.h"

#define SSI 0x18000000u
#define SSI_CONTROL0 (SSI + 0x00u)
#define SSI_CONTROL1 (SSI + 0x04u)
#define SSI_ENABLE (SSI + 0x08u)
#define SSI_BAUD (SSI + 0x14u)
#define SSI_SPI_CONTROL (SSI + 0xF4u)
#define VECTORS 0x10000100u
#define VECTOR_TABLE_OFFSET 0xE000ED08u

__attribute__((section(".boot2"), used, noreturn)) void boot2(void)
{
    REGISTER(SSI_ENABLE) = 0;
    REGISTER(SSI_BAUD) = 4;
    REGISTER(SSI_CONTROL0) = 31u << 16 | 3u << 8; /* 32 bits per frame; send command and address, then read */
    REGISTER(SSI_CONTROL1) = 0;
    REGISTER(SSI_SPI_CONTROL) = 0x03u << 24 | 2u << 8 | 6u << 2; /* read; 8-bit command, 24-bit address */
    REGISTER(SSI_ENABLE) = 1;
    REGISTER(VECTOR_TABLE_OFFSET) = VECTORS;
    __asm__ volatile("ldr r1, [%0]\n\tmsr msp, r1\n\tldr r1, [%0, #4]\n\tbx r1" ::"l"(VECTORS) : "r1");
    __builtin_unreachable();
}
