/* Writes one frame of the Armature protocol. Plain C99, no library, 64 bytes of table.
 *
 *   size_t length = armature_frame(wire, 0x86, payload, payload_length);
 *   uart_write(wire, length);
 *
 * `wire` needs payload_length + payload_length / 254 + 13 bytes. The payload is at most 1024 bytes. */
#include <stddef.h>
#include <stdint.h>

static uint32_t armature_crc32(const uint8_t *bytes, size_t length)
{
    static const uint32_t table[16] = {
        0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4, 0x4DB26158, 0x5005713C,
        0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C, 0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C,
    };
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < length; i++) {
        crc ^= bytes[i];
        crc = (crc >> 4) ^ table[crc & 15];
        crc = (crc >> 4) ^ table[crc & 15];
    }
    return ~crc;
}

size_t armature_frame(uint8_t *wire, uint8_t type, const uint8_t *payload, size_t payload_length)
{
    size_t code = 2, end = 3; /* where the open run's code byte goes; where the next byte goes */
    int after_full_run = 0;
    for (size_t i = 0; i <= payload_length; i++) {
        uint8_t byte = i == 0 ? type : payload[i - 1];
        if (byte != 0)
            wire[end++] = byte;
        if (byte == 0 || end - code == 255) { /* close the run, open the next */
            after_full_run = byte != 0;
            wire[code] = (uint8_t)(end - code);
            code = end++;
        }
    }
    if (after_full_run && end == code + 1)
        end = code; /* a full run was the last: no empty one behind it */
    else
        wire[code] = (uint8_t)(end - code);

    size_t stuffed = end - 2;
    wire[0] = wire[end] = (uint8_t)(0x80 | (stuffed & 0x7F));
    wire[1] = wire[end + 1] = (uint8_t)(0x80 | (stuffed >> 7));
    end += 2;
    uint32_t crc = armature_crc32(wire, end);
    for (int i = 0; i < 5; i++, crc >>= 7)
        wire[end++] = (uint8_t)(0x80 | (crc & 0x7F));
    wire[end++] = 0;
    return end;
}
