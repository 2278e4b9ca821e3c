/* Reads one frame of the Armature protocol, the counterpart of frame.c. Plain C99, no library.
 *
 * Collect bytes up to the next 0x00 and hand over what came before it:
 *
 *   int length = armature_unframe(piece, piece_length, plain);
 *   if (length > 0)  message type plain[0], payload plain[1] to plain[length - 1]
 *
 * `plain` needs piece_length bytes. Returns 0 for a piece that is not a frame. Include frame.c first. */

int armature_unframe(const uint8_t *piece, size_t length, uint8_t *plain)
{
    if (length < 11 || length > 1039)
        return 0;
    size_t stuffed = length - 9;
    const uint8_t bounds[2] = {(uint8_t)(0x80 | (stuffed & 0x7F)), (uint8_t)(0x80 | (stuffed >> 7))};
    const uint8_t *rear = piece + 2 + stuffed, *sum = rear + 2;
    if (piece[0] != bounds[0] || piece[1] != bounds[1] || rear[0] != bounds[0] || rear[1] != bounds[1])
        return 0;
    uint32_t crc = armature_crc32(piece, length - 5);
    for (int i = 0; i < 5; i++, crc >>= 7)
        if (sum[i] != (uint8_t)(0x80 | (crc & 0x7F)))
            return 0;

    size_t at = 2, end = 0;
    while (at < 2 + stuffed) {
        size_t run = piece[at++];
        if (run == 0 || at + run - 1 > 2 + stuffed)
            return 0;
        for (size_t i = 1; i < run; i++)
            plain[end++] = piece[at++];
        if (run != 255 && at < 2 + stuffed)
            plain[end++] = 0;
    }
    return (int)end;
}
