// Functions of the pins: the table in firmware/README.md, as code. All are on the edge connector of
// the Pro Micro, Micro and Leonardo boards (names in parentheses).
#pragma once

// The sensor on the SPI: SCK PB1, MOSI PB2, MISO PB3. PB0 is the slave select. It must be an
// output: a low input would end the SPI's master mode. On these boards it also drives the RX LED,
// which shines while PB0 is low. It is set high.
#define TORQUER_SENSOR_NCS_PORT PORTB
#define TORQUER_SENSOR_NCS_DDR DDRB
#define TORQUER_SENSOR_NCS_BIT 6  // PB6 (10)
// The second sensor's, on boards that have two; on the others this pin is unused.
#define TORQUER_SECOND_NCS_BIT 5  // PB5 (9)

// Buttons to ground, pulled up inside the chip.
#define TORQUER_BUTTON_PORT PORTD
#define TORQUER_BUTTON_PIN PIND
#define TORQUER_XRAY_BIT 1      // PD1 (2)
#define TORQUER_CONTRAST_BIT 0  // PD0 (3)
#define TORQUER_CLUTCH_BIT 4    // PD4 (4)
#define TORQUER_STICK_BIT 7     // PD7 (6)

// The end switch, to ground, pulled up likewise; not every device has one.
#define TORQUER_REFERENCE_PORT PORTC
#define TORQUER_REFERENCE_PIN PINC
#define TORQUER_REFERENCE_BIT 6  // PC6 (5)

// Joystick wipers, as ADC channels.
#define TORQUER_JOYSTICK_X_CHANNEL 7  // PF7 (A0)
#define TORQUER_JOYSTICK_Y_CHANNEL 6  // PF6 (A1)

// Unused pins of the edge connectors are pulled up, because a floating pin draws current in
// suspend. PD5 is one of them; its pull-up keeps the TX LED off. PC7 is driven low, which keeps LED
// 13 off. PE2 has a resistor on the board.
#define TORQUER_UNUSED_B 0xb0  // PB4, PB5, PB7
#define TORQUER_UNUSED_D 0x6c  // PD2, PD3, PD5, PD6
#define TORQUER_UNUSED_E 0x40  // PE6
#define TORQUER_UNUSED_F 0x33  // PF0, PF1, PF4, PF5
