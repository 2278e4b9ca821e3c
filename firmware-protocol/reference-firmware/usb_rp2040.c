/* The RP2040's USB device controller (data sheet 4.1) as a serial port of the communications class (CDC 1.2, ACM). Every
 * operating system has a driver for it. Everything except usb_send happens in the interrupt. */
#include "usb_rp2040.h"

#include "hardware.h"
#include "rp2040.h"

/* Memory that the controller shares: setup packet, controls and buffers of the endpoints. */
#define SHARED 0x50100000u
#define SETUP_PACKET ((volatile uint8_t *)SHARED)
#define ENDPOINT_CONTROL(endpoint, out) (SHARED + 8u * (endpoint) + 4u * (out))
#define BUFFER_CONTROL(endpoint, out) (SHARED + 0x80u + 8u * (endpoint) + 4u * (out))
#define BUFFER(offset) ((volatile uint8_t *)(SHARED + (offset)))
enum { BUFFER_0 = 0x100, BUFFER_NOTIFY = 0x180, BUFFER_OUT = 0x1C0, BUFFER_IN = 0x200 };
enum { FULL = 1 << 15, DATA1 = 1 << 13, STALL = 1 << 11, AVAILABLE = 1 << 10, LENGTH = 0x3FF };
#define ENDPOINT_ON (1u << 31 | 1u << 29)
enum { BULK = 2 << 26, INTERRUPT = 3 << 26 };

#define USB 0x50110000u
#define USB_ADDRESS (USB + 0x00u)
#define USB_MAIN (USB + 0x40u)
#define USB_SIE (USB + 0x4Cu)
#define USB_SIE_STATUS (USB + 0x50u)
#define USB_BUFFERS (USB + 0x58u)
#define USB_STALL_ARM (USB + 0x68u)
#define USB_MUXING (USB + 0x74u)
#define USB_POWER (USB + 0x78u)
#define USB_INTERRUPTS (USB + 0x90u)
#define USB_INTERRUPT (USB + 0x98u)
enum { HAS_BUFFERS = 1 << 4, HAS_RESET = 1 << 12, HAS_SETUP = 1 << 16 };
enum { SIE_RESET = 1 << 19, SIE_SETUP = 1 << 17 };

enum { NOTIFY = 1, DATA = 2, PACKET = 64 };
enum { OUT = 1, IN = 0 };

/* --- Descriptors --- */

/* pid.codes' numbers for testing: anyone selling boards needs their own. */
static const uint8_t device_descriptor[18] = {
    18, 1, 0x00, 0x02, 0xEF, 2, 1, PACKET, 0x09, 0x12, 0x01, 0x00, 0x00, 0x01, 1, 2, 3, 1,
};

static const uint8_t configuration_descriptor[75] = {
    9, 2, 75, 0, 2, 1, 0, 0x80, 250,                 /* two interfaces, up to 500 mA */
    8, 11, 0, 2, 2, 2, 0, 0,                         /* they belong together */
    9, 4, 0, 0, 1, 2, 2, 0, 4,                       /* communications: abstract control model */
    5, 0x24, 0, 0x10, 1, 5, 0x24, 1, 0, 1, 4, 0x24, 2, 2, 5, 0x24, 6, 0, 1,
    7, 5, 0x80 | NOTIFY, 3, 8, 0, 16,
    9, 4, 1, 0, 2, 10, 0, 0, 0,                      /* data */
    7, 5, DATA, 2, PACKET, 0, 0, 7, 5, 0x80 | DATA, 2, PACKET, 0, 0,
};

/* --- Control transfers --- */

static uint8_t answer_bytes[80]; /* of a control transfer */
static const uint8_t *answer_next;
static uint16_t answer_left;
static uint8_t answer_zero;    /* ends with an empty packet */
static uint8_t next_data1[3][2]; /* the data toggle of each endpoint's next packet: [endpoint][OUT or IN] */
static uint8_t new_address;
static uint8_t line_coding[7] = {0x40, 0x42, 0x0F, 0, 0, 0, 8}; /* 1,000,000 baud, 8N1: has no effect */
static volatile uint8_t configured, port_is_open, in_is_busy, out_is_held;
static uint8_t expecting_line_coding;

static void give(uint8_t endpoint, uint8_t out, uint16_t length)
{
    uint32_t control = length | (out ? 0u : FULL) | (next_data1[endpoint][out] ? DATA1 : 0u);
    next_data1[endpoint][out] ^= 1;
    REGISTER(BUFFER_CONTROL(endpoint, out)) = control;
    /* The controller runs on another clock: it must see the data before it sees that it owns the buffer. */
    for (uint8_t i = 0; i < 4; i++)
        __asm__ volatile("nop\n\tnop\n\tnop");
    REGISTER(BUFFER_CONTROL(endpoint, out)) = control | AVAILABLE;
}

static void copy_in(uint32_t buffer, const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++)
        BUFFER(buffer)[i] = bytes[i];
}

static void send_answer_on(void)
{
    uint16_t length = answer_left < PACKET ? answer_left : PACKET;
    copy_in(BUFFER_0, answer_next, length);
    answer_next += length;
    answer_left -= length;
    answer_zero = answer_zero && length == PACKET;
    give(0, IN, length);
}

static void answer_with(const uint8_t *bytes, uint16_t length, uint16_t wanted)
{
    answer_next = bytes;
    answer_left = length < wanted ? length : wanted;
    answer_zero = length < wanted;
    next_data1[0][IN] = 1;
    send_answer_on();
}

static void acknowledge(void)
{
    next_data1[0][IN] = 1;
    answer_left = answer_zero = 0;
    give(0, IN, 0);
}

static void stall(void)
{
    REGISTER(USB_STALL_ARM) = 3;
    REGISTER(BUFFER_CONTROL(0, IN)) = STALL;
    REGISTER(BUFFER_CONTROL(0, OUT)) = STALL;
}

/* Makes a string descriptor from text. */
static uint16_t make_string(const char *text)
{
    uint16_t length = 2;
    for (; *text != 0 && length + 2 <= (int)sizeof answer_bytes; text++) {
        answer_bytes[length++] = (uint8_t)*text;
        answer_bytes[length++] = 0;
    }
    answer_bytes[0] = (uint8_t)length;
    answer_bytes[1] = 3;
    return length;
}

/* The serial number is that of the part that contains the controller, so the host recognises it on any socket. */
static const char *number_in_hexadecimal(void)
{
    static char text[25];
    const uint8_t *number = hardware_number();
    for (uint8_t i = 0; i < 12; i++) {
        text[2 * i] = "0123456789abcdef"[number[i] >> 4];
        text[2 * i + 1] = "0123456789abcdef"[number[i] & 15];
    }
    return text;
}

static void describe(uint16_t what, uint16_t wanted)
{
    static const uint8_t languages[4] = {4, 3, 0x09, 0x04};
    static const char *const strings[] = {"", "Armature", hardware_name, "", "Armature puppet"};
    uint8_t kind = (uint8_t)(what >> 8), index = (uint8_t)what;
    if (kind == 1)
        answer_with(device_descriptor, sizeof device_descriptor, wanted);
    else if (kind == 2)
        answer_with(configuration_descriptor, sizeof configuration_descriptor, wanted);
    else if (kind == 3 && index == 0)
        answer_with(languages, sizeof languages, wanted);
    else if (kind == 3 && index < 5)
        answer_with(answer_bytes, make_string(index == 3 ? number_in_hexadecimal() : strings[index]), wanted);
    else
        stall();
}

static void configure(void)
{
    REGISTER(ENDPOINT_CONTROL(NOTIFY, IN)) = ENDPOINT_ON | INTERRUPT | BUFFER_NOTIFY;
    REGISTER(ENDPOINT_CONTROL(DATA, IN)) = ENDPOINT_ON | BULK | BUFFER_IN;
    REGISTER(ENDPOINT_CONTROL(DATA, OUT)) = ENDPOINT_ON | BULK | BUFFER_OUT;
    for (uint8_t endpoint = NOTIFY; endpoint <= DATA; endpoint++)
        next_data1[endpoint][IN] = next_data1[endpoint][OUT] = 0;
    configured = 1;
    in_is_busy = out_is_held = 0;
    give(DATA, OUT, PACKET);
}

static void answer_setup(void)
{
    enum { STANDARD_IN = 0x80, STANDARD_OUT = 0x00, INTERFACE_IN = 0x81, ENDPOINT_OUT = 0x02, ENDPOINT_IN = 0x82 };
    enum { CLASS_OUT = 0x21, CLASS_IN = 0xA1, CLASS_OUT_DEVICE = 0x20 };
    uint8_t type = SETUP_PACKET[0], request = SETUP_PACKET[1];
    uint16_t value = (uint16_t)(SETUP_PACKET[2] | SETUP_PACKET[3] << 8);
    uint16_t wanted = (uint16_t)(SETUP_PACKET[6] | SETUP_PACKET[7] << 8);
    static const uint8_t zeros[2];
    expecting_line_coding = 0;
    if (type == STANDARD_IN && request == 6) {
        describe(value, wanted);
    } else if (type == STANDARD_OUT && request == 5) {
        new_address = (uint8_t)value; /* the acknowledgement is still sent from the old one */
        acknowledge();
    } else if (type == STANDARD_OUT && request == 9) {
        if (value != 0)
            configure();
        else
            configured = 0;
        acknowledge();
    } else if (type == STANDARD_IN && request == 8) {
        answer_with((const uint8_t *)&configured, 1, wanted);
    } else if ((type == STANDARD_IN || type == INTERFACE_IN || type == ENDPOINT_IN) && request == 0) {
        answer_with(zeros, 2, wanted);
    } else if ((type == STANDARD_OUT || type == ENDPOINT_OUT) && (request == 1 || request == 3)) {
        acknowledge();
    } else if ((type == CLASS_OUT || type == CLASS_OUT_DEVICE) && request == 0x22) {
        port_is_open = value & 1; /* DTR */
        acknowledge();
    } else if (type == CLASS_OUT && request == 0x20 && wanted == sizeof line_coding) {
        expecting_line_coding = 1;
        next_data1[0][OUT] = 1;
        give(0, OUT, PACKET);
    } else if (type == CLASS_IN && request == 0x21) {
        answer_with(line_coding, sizeof line_coding, wanted);
    } else {
        stall();
    }
}

/* --- Completed buffers --- */

static void control_has_sent(void)
{
    if (new_address != 0) {
        REGISTER(USB_ADDRESS) = new_address;
        new_address = 0;
    }
    if (answer_left > 0 || answer_zero) {
        send_answer_on();
    } else if ((SETUP_PACKET[0] & 0x80) != 0) {
        next_data1[0][OUT] = 1; /* the host's empty packet, which ends its read */
        give(0, OUT, 0);
    }
}

static void control_has_received(void)
{
    if (!expecting_line_coding)
        return;
    expecting_line_coding = 0;
    for (uint8_t i = 0; i < sizeof line_coding; i++)
        line_coding[i] = BUFFER(BUFFER_0)[i];
    acknowledge();
}

/* Takes a packet if there is room for it; otherwise the host has to wait. */
static void take_packet(void)
{
    if (!usb_may_receive(PACKET)) {
        out_is_held = 1;
        return;
    }
    uint16_t length = REGISTER(BUFFER_CONTROL(DATA, OUT)) & LENGTH;
    for (uint16_t i = 0; i < length; i++)
        usb_received(BUFFER(BUFFER_OUT)[i]);
    out_is_held = 0;
    give(DATA, OUT, PACKET);
}

void usb_receive_on(void)
{
    if (!out_is_held)
        return;
    interrupts_off();
    if (configured)
        take_packet();
    interrupts_on();
}

size_t usb_send(const uint8_t *bytes, size_t length)
{
    if (!configured || !port_is_open)
        return length;
    if (in_is_busy)
        return 0;
    /* Never a full packet: after one of those a host waits for the next. */
    size_t taken = length < PACKET - 1 ? length : PACKET - 1;
    copy_in(BUFFER_IN, bytes, taken);
    interrupts_off();
    in_is_busy = 1;
    give(DATA, IN, (uint16_t)taken);
    interrupts_on();
    return taken;
}

void usb_interrupt(void)
{
    uint32_t what = REGISTER(USB_INTERRUPT);
    if (what & HAS_RESET) {
        REGISTER(USB_SIE_STATUS) = SIE_RESET;
        REGISTER(USB_ADDRESS) = 0;
        configured = port_is_open = new_address = 0;
    }
    if (what & HAS_SETUP) {
        REGISTER(USB_SIE_STATUS) = SIE_SETUP;
        answer_setup();
    }
    if (what & HAS_BUFFERS) {
        uint32_t buffers = REGISTER(USB_BUFFERS);
        REGISTER(USB_BUFFERS) = buffers;
        if (buffers & 1u << (2 * 0 + IN))
            control_has_sent();
        if (buffers & 1u << (2 * 0 + OUT))
            control_has_received();
        if (buffers & 1u << (2 * DATA + IN))
            in_is_busy = 0;
        if (buffers & 1u << (2 * DATA + OUT))
            take_packet();
    }
}

void usb_start(void)
{
    for (uint32_t at = 0; at < 4096; at += 4)
        REGISTER(SHARED + at) = 0;
    REGISTER(USB_MUXING) = 1 << 0 | 1 << 3; /* to the transceiver on the chip */
    REGISTER(USB_POWER) = 1 << 2 | 1 << 3;  /* bus-powered, so VBUS is present */
    REGISTER(USB_MAIN) = 1;
    REGISTER(USB_SIE) = 1 << 29; /* an interrupt after each buffer of endpoint 0 */
    REGISTER(USB_INTERRUPTS) = HAS_BUFFERS | HAS_RESET | HAS_SETUP;
    SET(USB_SIE) = 1 << 16; /* enable the pull-up: the device appears on the bus */
}
