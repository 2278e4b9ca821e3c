/* The Pico's USB socket as a serial port (CDC-ACM), and what it needs from the board. */
#ifndef USB_RP2040_H
#define USB_RP2040_H

#include <stddef.h>
#include <stdint.h>

void usb_start(void);
void usb_interrupt(void);

/* Takes bytes for the host. Returns how many; while no program has the port open, all are taken and discarded. */
size_t usb_send(const uint8_t *bytes, size_t length);

/* There may be room again: lets the host continue sending. */
void usb_receive_on(void);

/* Provided by the board: whether this many bytes can be taken, and taking one of them. */
int usb_may_receive(size_t length);
void usb_received(uint8_t byte);

#endif
