#!/usr/bin/env python3
"""Makes the file to copy to a Raspberry Pi Pico from a program's flash image.

    uf2.py PROGRAM.bin PROGRAM.uf2

Puts the checksum after the second boot stage (RP2040 data sheet 2.8.1.3.1: CRC-32 with polynomial 0x04C11DB7, highest bit
first, start 0xFFFFFFFF, over 252 bytes) and cuts the bytes into UF2 blocks (https://github.com/microsoft/uf2).
"""

import struct
import sys

FLASH = 0x10000000
FAMILY_RP2040 = 0xE48BFF56
FAMILY_PRESENT = 0x2000
PAYLOAD = 256


def crc32_highest_first(data: bytes) -> int:
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ (0x04C11DB7 if crc & 0x80000000 else 0)) & 0xFFFFFFFF
    return crc


def with_boot_checksum(program: bytes) -> bytes:
    if len(program) < 256 or program[252:256] not in (bytes(4), b"\xff" * 4):
        sys.exit("the first 252 bytes are no second boot stage: four empty bytes belong behind it")
    return program[:252] + struct.pack("<I", crc32_highest_first(program[:252])) + program[256:]


def blocks(program: bytes) -> bytes:
    count = -(-len(program) // PAYLOAD)
    made = bytearray()
    for number in range(count):
        payload = program[number * PAYLOAD : (number + 1) * PAYLOAD].ljust(PAYLOAD, b"\0")
        head = struct.pack(
            "<8I", 0x0A324655, 0x9E5D5157, FAMILY_PRESENT, FLASH + number * PAYLOAD, PAYLOAD, number, count, FAMILY_RP2040
        )
        made += head + payload.ljust(476, b"\0") + struct.pack("<I", 0x0AB16F30)
    return bytes(made)


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[1], "rb") as file:
        program = with_boot_checksum(file.read())
    with open(sys.argv[2], "wb") as file:
        file.write(blocks(program))


if __name__ == "__main__":
    main()
