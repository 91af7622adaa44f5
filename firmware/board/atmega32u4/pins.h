// Which pin does what: the table in firmware/README.md, as code. All are on the edge connector of
// the Pro Micro, Micro and Leonardo boards (names in parentheses).
#pragma once

// The sensor on the SPI: SCK PB1, MOSI PB2, MISO PB3. PB0 is the slave select, which must be an
// output lest the SPI leave master mode.
#define TORQUER_SENSOR_NCS_PORT PORTB
#define TORQUER_SENSOR_NCS_DDR DDRB
#define TORQUER_SENSOR_NCS_BIT 6  // PB6 (10)

// Buttons to ground, pulled up inside the chip.
#define TORQUER_BUTTON_PORT PORTD
#define TORQUER_BUTTON_PIN PIND
#define TORQUER_XRAY_BIT 1      // PD1 (2)
#define TORQUER_CONTRAST_BIT 0  // PD0 (3)
#define TORQUER_CLUTCH_BIT 4    // PD4 (4)

// Joystick wipers, as ADC channels.
#define TORQUER_JOYSTICK_X_CHANNEL 7  // PF7 (A0)
#define TORQUER_JOYSTICK_Y_CHANNEL 6  // PF6 (A1)
